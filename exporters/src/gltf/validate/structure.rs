//! Rules about the JSON.

use super::Issues;
use crate::Severity;
use crate::gltf::document::{Accessor, MODE_POINTS, Primitive};
use crate::gltf::loaded::Loaded;
use crate::gltf::scene::Found;
use crate::gltf::{EXTENSION, KHR, node, sh_attribute, splats};
use serde_json::Value;
use std::collections::BTreeSet;

/// Every extension in the file is listed, and the other way round.
pub fn check_extensions(json: &Value, issues: &mut Issues) {
    let list = |name: &str| -> BTreeSet<String> {
        let names = json.get(name).and_then(Value::as_array).into_iter().flatten();
        names.filter_map(Value::as_str).map(str::to_owned).collect()
    };
    let (listed, required) = (list("extensionsUsed"), list("extensionsRequired"));
    let mut used = BTreeSet::new();
    collect_extensions(json, &mut used);
    for name in used.difference(&listed) {
        issues.error("LT1002", "/extensionsUsed", format!("{name:?} is used, but not listed"));
    }
    for name in required.difference(&listed) {
        issues.error("LT1002", "/extensionsUsed", format!("{name:?} is required, but not listed as used"));
    }
    if listed.contains(EXTENSION) && !used.contains(EXTENSION) {
        let what = format!("{EXTENSION} is listed, but not used: a tool has dropped the textures");
        issues.push("LT1002", Severity::Warning, "/extensionsUsed", what);
    }
    if required.contains(EXTENSION) {
        let what =
            format!("{EXTENSION} is required: viewers that do not know it refuse the file for no need");
        issues.push("LT1003", Severity::Warning, "/extensionsRequired", what);
    }
}

/// Names of all extension objects at any depth; `extras` may hold anything.
fn collect_extensions(value: &Value, used: &mut BTreeSet<String>) {
    match value {
        Value::Object(members) => {
            for (name, member) in members.iter().filter(|(name, _)| *name != "extras") {
                if let (true, Value::Object(extensions)) = (name == "extensions", member) {
                    used.extend(extensions.keys().cloned());
                }
                // The parser bounds the depth.
                collect_extensions(member, used);
            }
        }
        Value::Array(values) => values.iter().for_each(|v| collect_extensions(v, used)),
        _ => {}
    }
}

/// The primitive, its node, and the accessors of its attributes.
pub fn check_primitive(loaded: &Loaded<'_>, found: &Found<'_>, issues: &mut Issues) {
    if found.primitive.mode != Some(MODE_POINTS) {
        let what = format!("mode {:?}, expected 0 (POINTS)", found.primitive.mode);
        issues.error("LT1005", &format!("{}/mode", found.pointer), what);
    }
    check_khr(found, issues);
    if let Err(e) = node::world_from_mesh(&loaded.document, found.mesh, loaded.path) {
        issues.error("LT1017", "/nodes", super::text_of(e));
    }
    let place = format!("{}/attributes", found.pointer);
    if !found.primitive.attributes.contains_key("COLOR_0") {
        let what = "no COLOR_0: viewers that know no splats show points without colours";
        issues.push("LT1016", Severity::Warning, &place, what.to_owned());
    }
    let highest = splats::sh_degree(found.primitive);
    for l in 0..=highest {
        let missing: Vec<String> = (0..=2 * l)
            .map(|n| sh_attribute(l, n))
            .filter(|name| !found.primitive.attributes.contains_key(name))
            .collect();
        if !missing.is_empty() {
            issues.error(
                "LT1009",
                &place,
                format!("{} missing, degree {highest} is there", missing.join(", ")),
            );
        }
    }
    for (name, &index) in &found.primitive.attributes {
        if let Some(accessor) = loaded.document.accessors.get(index as usize) {
            check_alignment(loaded, accessor, &format!("{place}/{name}"), issues);
        }
    }
}

/// A file of meshes only: their accessors, images and nodes are there.
pub fn check_mesh(loaded: &Loaded<'_>, issues: &mut Issues) {
    for (i, mesh) in loaded.document.meshes.iter().enumerate() {
        for (j, primitive) in mesh.primitives.iter().enumerate() {
            check_arrays(loaded, primitive, &format!("/meshes/{i}/primitives/{j}"), issues);
        }
        if let Err(e) = node::world_from_mesh(&loaded.document, i as u32, loaded.path) {
            issues.error("LT1017", "/nodes", super::text_of(e));
        }
    }
    for (i, image) in loaded.document.images.iter().enumerate() {
        let bytes = match (image.buffer_view, &image.uri) {
            (Some(view), _) => loaded.view(view, "image").map(drop),
            (None, Some(uri)) => loaded.side_file(uri).map(drop),
            (None, None) => continue,
        };
        if let Err(e) = bytes {
            issues.error("LT1024", &format!("/images/{i}"), super::text_of(e));
        }
    }
}

/// Attributes have equal counts, indices name vertices.
fn check_arrays(loaded: &Loaded<'_>, primitive: &Primitive, place: &str, issues: &mut Issues) {
    let mut view_of = |name: &str, accessor: u32| {
        let view = loaded.accessor(accessor, name);
        view.map_err(|e| issues.error("LT1007", &format!("{place}/{name}"), super::text_of(e))).ok()
    };
    let attributes = primitive.attributes.iter();
    let counts: Vec<usize> = attributes.filter_map(|(name, &a)| Some(view_of(name, a)?.count)).collect();
    let indices = primitive.indices.and_then(|a| view_of("indices", a));
    let Some(&count) = counts.first() else { return };
    if counts.iter().any(|c| *c != count) {
        issues.error("LT1008", place, format!("attributes of {counts:?} elements"));
    }
    // Below 2^24, and so exact.
    let largest = indices.and_then(|view| view.rows::<1>().map(|[v]| v as usize).max());
    if let Some(index) = largest.filter(|index| *index >= count) {
        issues.error("LT1007", &format!("{place}/indices"), format!("vertex {index} of {count}"));
    }
}

fn check_khr(found: &Found<'_>, issues: &mut Issues) {
    let place = format!("{}/extensions/{KHR}", found.pointer);
    let splatting = found.splatting;
    let mut check = |name: &str, value: Option<&str>, known: &[&str], severity: Severity| {
        if !value.is_some_and(|v| known.contains(&v)) {
            let what = format!("{value:?}, known: {known:?}");
            issues.push("LT1006", severity, &format!("{place}/{name}"), what);
        }
    };
    let (kernel, space) = (splatting.kernel.as_str(), splatting.color_space.as_str());
    let missing = if kernel.is_empty() { Severity::Error } else { Severity::Warning };
    check("kernel", Some(kernel), &["ellipse"], missing);
    let spaces = ["srgb_rec709_display", "lin_rec709_display"];
    check("colorSpace", Some(space), &spaces, Severity::Error);
    let projection = splatting.projection.as_deref().unwrap_or("perspective");
    check("projection", Some(projection), &["perspective"], Severity::Warning);
    let sorting = splatting.sorting_method.as_deref().unwrap_or("cameraDistance");
    check("sortingMethod", Some(sorting), &["cameraDistance"], Severity::Warning);
}

/// glTF asks that elements of attributes begin at multiples of four.
fn check_alignment(loaded: &Loaded<'_>, accessor: &Accessor, place: &str, issues: &mut Issues) {
    let views = &loaded.document.buffer_views;
    let Some(view) = accessor.buffer_view.and_then(|v| views.get(v as usize)) else {
        return;
    };
    let width = match accessor.shape.as_str() {
        "VEC2" => 2,
        "VEC3" => 3,
        "VEC4" => 4,
        _ => 1,
    };
    let size = match accessor.component_type {
        5120 | 5121 => width,
        5122 | 5123 => 2 * width,
        _ => 4 * width,
    };
    let stride = view.byte_stride.unwrap_or(size);
    let offsets = [accessor.byte_offset, view.byte_offset, stride];
    if offsets.iter().any(|v| v % 4 != 0) {
        let [first, view, stride] = offsets;
        let what =
            format!("byteOffset {first} in a view at {view} with a stride of {stride}: not multiples of 4");
        issues.error("LT1010", place, what);
    }
}
