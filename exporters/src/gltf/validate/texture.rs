//! Rules about our extension: its properties, rectangles and pages.

use crate::atlas::Atlas;
use crate::format::contents::Issues;
use crate::gltf::accessor::Component;
use crate::gltf::extension::TextureExtension;
use crate::gltf::loaded::Loaded;
use crate::gltf::scene::Found;
use crate::gltf::{EXTENSION, KHR, VERSION, pages};
use crate::{AssetMap, Error, Quality, ltgs, quoted};
use serde_json::Value;

/// Checks everything but the hash, which is that of the whole content.
pub fn check(loaded: &Loaded<'_>, found: &Found<'_>, value: &Value, issues: &mut Issues) {
    let place = format!("{}/extensions/{KHR}/extensions/{EXTENSION}", found.pointer);
    let extension = match TextureExtension::parse(value, loaded.path) {
        Ok(extension) => extension,
        Err(e) => {
            let is_other_version = value.get("version").and_then(Value::as_u64) != Some(u64::from(VERSION));
            return issues.error(if is_other_version { "LT1020" } else { "LT1021" }, &place, e.text());
        }
    };
    let known = if extension.stream.is_some() { &Quality::ALL[..] } else { &Quality::ALL[..2] };
    if !Quality::from_name(&extension.quality).is_some_and(|quality| known.contains(&quality)) {
        let known: Vec<&str> = known.iter().map(|quality| quality.name()).collect();
        let what = format!("{}, known: {known:?}", quoted(&extension.quality));
        issues.warning("LT1021", &format!("{place}/quality"), what);
    }
    if extension.hash().is_none() {
        let what = format!("{}, expected 16 hexadecimal digits", quoted(&extension.hash));
        issues.error("LT1021", &format!("{place}/hash"), what);
    }
    if let Some(stream) = &extension.stream {
        match stream.bytes(loaded) {
            Ok(bytes) => issues.list.append(&mut ltgs::validate(bytes, loaded.path)),
            Err(e) => issues.error("LT1021", &format!("{place}/stream"), e.text()),
        }
        return;
    }
    let position = found.primitive.attributes.get("POSITION");
    let position = position.and_then(|&i| loaded.accessor(i, "POSITION").ok());
    if let (Some(index), Some(view)) = (extension.sh_degree, &position)
        && let Err(e) = pages::own_array(loaded, index, "shDegree", (1, &[Component::U8]), view.count)
    {
        issues.error("LT1021", &format!("{place}/shDegree"), e.text());
    }
    // Otherwise an error of the attribute.
    if let Some(view) = position {
        check_atlas(loaded, &extension, view.count, &place, issues);
    }
}

/// Checks rectangles and pages, each step only if the one before it found nothing.
fn check_atlas(
    loaded: &Loaded<'_>,
    extension: &TextureExtension,
    num_splats: usize,
    place: &str,
    issues: &mut Issues,
) {
    let [rects, pages] = ["rects", "atlas"].map(|name| format!("{place}/{name}"));
    let (maps, placements) = match pages::maps(loaded, extension, num_splats) {
        Ok(Some(maps)) => maps,
        Ok(None) => return,
        Err(e) => return issues.error("LT1021", place, e.text()),
    };
    check_sizes(&maps, &format!("{place}/texelSize"), issues);
    let atlas = match pages::page_sizes(loaded, extension) {
        Ok(pages) => Atlas { placements, pages, border: extension.border.unwrap_or(0) },
        Err(e) => return issues.error("LT1024", &pages, e.text()),
    };
    match atlas.check(&maps) {
        Ok(()) => {}
        Err(e @ Error::TooLarge { .. }) => return issues.error("LT1024", &pages, e.text()),
        Err(e) => return issues.error("LT1022", &rects, e.text()),
    }
    if let Some(splat) = atlas.first_overlap(&maps) {
        issues.error("LT1023", &rects, format!("the rectangle of splat {splat} overlaps another"));
    }
    match pages::texels(loaded, extension, &atlas, &maps) {
        Ok(texels) if !texels.iter().all(|t| (-1.0..=1.0).contains(t)) => {
            issues.error("LT1024", &pages, "texels that are not in [-1, 1]");
        }
        Ok(_) => check_border(loaded, extension, (&atlas, &maps), &format!("{place}/border"), issues),
        Err(e) => issues.error("LT1024", &pages, e.text()),
    }
}

/// Texels around maps must be zero as far as the border reaches.
fn check_border(
    loaded: &Loaded<'_>,
    extension: &TextureExtension,
    (atlas, maps): (&Atlas, &[AssetMap]),
    place: &str,
    issues: &mut Issues,
) {
    let Some((strips, strip_maps)) = atlas.borders(maps) else {
        return issues.error("LT1035", place, "a map is nearer than that to the edge of its page");
    };
    match pages::texels(loaded, extension, &strips, &strip_maps) {
        Ok(texels) if texels.iter().any(|t| *t != 0.0) => {
            issues.error("LT1035", place, "texels around maps that are not zero");
        }
        Ok(_) => {}
        Err(e) => issues.error("LT1035", place, e.text()),
    }
}

/// Texel sizes, shifts and rectangles must agree on which splats have a map.
fn check_sizes(maps: &[AssetMap], place: &str, issues: &mut Issues) {
    let offends = |map: &AssetMap| match map.num_texels() {
        0 => *map != AssetMap { offset_texels: map.offset_texels, ..AssetMap::default() },
        _ => !map.texel_sizes.iter().all(|&k| k > 0.0 && k.is_finite()),
    };
    let offences = maps.iter().enumerate().filter(|(_, map)| offends(map));
    let text = |(i, map): (usize, &AssetMap)| {
        let AssetMap { rows, cols, texel_sizes, shift, .. } = map;
        format!("splat {i}: texels of {texel_sizes:?} and shift {shift:?} in a map of {rows} x {cols}")
    };
    issues.many("LT1021", place, offences.map(text));
}
