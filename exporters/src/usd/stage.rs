//! The stage of an asset: its prims and their properties.

use super::layer::{Layer, Prim, Property, VariantSet};
use super::names::*;
use super::numbers::{self, floats, ints};
use super::quad_mesh;
use super::shade::{material, texture};
use super::value::{Form, Numbers, Value};
use crate::METRES;
use crate::asset::hash::text_from_hash;
use crate::asset::meta::Meta;
use crate::atlas::{Atlas, TexelDecode};
use crate::fallback::quads::Quads;
use crate::files::sidecars::SidecarHashes;
use crate::math::yup;
use crate::{Error, Quality, Result, SplatAsset};

/// The images of a stage, by their asset paths.
pub(super) struct Images<'a> {
    pub(super) atlas: &'a Atlas,
    /// Asset paths of the atlas pages.
    pub(super) page_paths: &'a [String],
    /// How codes become texels; `None` if pages hold floats.
    pub(super) decode: Option<TexelDecode>,
    pub(super) quads: Option<&'a Quads>,
    /// Asset paths of the pages of rectangles.
    pub(super) quad_paths: &'a [String],
    /// Of images that are files of their own.
    pub(super) sidecars: SidecarHashes,
}

/// Makes the stage. `hash` is that of the asset that a reader gets.
pub(super) fn layer(asset: &SplatAsset, quality: Quality, hash: u64, images: &Images) -> Result<Layer> {
    let mut scene = Prim::def("Xform", SCENE);
    scene.properties = node(asset);
    let mut textured = variant("textured", vec![textured_splats(asset, images)]);
    textured.children.extend(atlas_material(images));
    let mut variants = vec![textured, variant("splat3d", vec![splat3d(asset)])];
    if let Some(quads) = images.quads {
        variants.push(variant("mesh", quad_mesh::meshes(asset, quads, images.quad_paths.len())));
        // Outside the variant: three.js does not find materials within one.
        scene.children = quad_mesh::materials(images.quad_paths);
    }
    // Whoever asks for a mesh has programs in mind that show nothing else.
    let selection = if images.quads.is_some() { "mesh" } else { "textured" }.to_owned();
    scene.variant_set = Some(VariantSet { name: REPRESENTATION.to_owned(), selection, variants });
    let metadata = vec![
        ("customLayerData".to_owned(), custom_data(asset, quality, hash, &images.sidecars)?),
        ("defaultPrim".to_owned(), Value::token(SCENE)),
        ("metersPerUnit".to_owned(), Value::double(1.0)),
        ("upAxis".to_owned(), Value::token("Y")),
    ];
    Ok(Layer { metadata, root_prims: vec![scene] })
}

fn variant(name: &str, children: Vec<Prim>) -> Prim {
    Prim { name: name.to_owned(), children, ..Prim::default() }
}

/// Our dictionary of facts, sorted by name as other programs sort them.
fn custom_data(asset: &SplatAsset, quality: Quality, hash: u64, sidecars: &SidecarHashes) -> Result<Value> {
    let failed = |e| invalid!("", "metadata: {e}");
    let meta = serde_json::to_string(&Meta::of(asset)).map_err(failed)?;
    let sidecars =
        (!sidecars.is_empty()).then(|| serde_json::to_string(sidecars)).transpose().map_err(failed)?;
    if meta.len() > crate::asset::meta::META_BYTES_MAX {
        let what =
            format!("metadata of {} bytes, at most {}", meta.len(), crate::asset::meta::META_BYTES_MAX);
        return Err(Error::too_large("", what));
    }
    let facts = &asset.provenance;
    let mut entries = vec![
        ("author", Value::string(&facts.author)),
        ("generator", Value::string(concat!("litetex-exporters ", env!("CARGO_PKG_VERSION")))),
        ("hash", Value::string(&text_from_hash(hash))),
        ("licence", Value::string(&facts.licence)),
        ("meta", Value::string(&meta)),
        ("metricScale", Value::Bool(facts.scale.starts_with(METRES))),
        ("programVersion", Value::string(&facts.program_version)),
        ("quality", Value::string(quality.name())),
        ("source", Value::string(&facts.source)),
        ("title", Value::string(&facts.title)),
        ("version", Value::int(VERSION)),
    ];
    let before = entries.partition_point(|(name, _)| *name < SIDECARS);
    entries.splice(before..before, sidecars.map(|text| (SIDECARS, Value::string(&text))));
    if let Some((name, _)) = entries.iter().find(|(_, v)| v.as_text().is_some_and(|t| t.contains('\0'))) {
        return Err(invalid!("", "{name}: a text with a zero character, which USD cannot hold"));
    }
    let entries = entries.into_iter().map(|(name, value)| (name.to_owned(), value)).collect();
    Ok(Value::Dictionary(vec![(LITETEX.to_owned(), Value::Dictionary(entries))]))
}

/// A value of doubles.
pub(super) fn doubles(form: Form, values: Vec<f64>) -> Value {
    Value::Doubles(Numbers::element(form, values))
}

/// The transformation to the world frame with y up.
fn node(asset: &SplatAsset) -> Vec<Property> {
    let node = yup::node(&asset.world_from_local());
    let operations = ["xformOp:translate", "xformOp:orient", "xformOp:scale"];
    vec![
        Property::new("double3", operations[0], doubles(Form::Vec3, node.translation.to_vec())),
        Property::new("quatd", operations[1], doubles(Form::Quaternion, node.rotation.to_vec())),
        Property::new("double3", operations[2], doubles(Form::Vec3, vec![node.scale; 3])),
        Property::uniform("token[]", "xformOpOrder", Value::Tokens(operations.map(str::to_owned).to_vec())),
    ]
}

/// Properties that both particle fields have.
fn particles(asset: &SplatAsset, is_3d: bool) -> Vec<Property> {
    vec![
        Property::new("float3[]", EXTENT, numbers::extent(asset)),
        Property::new("point3f[]", POSITIONS, numbers::positions(asset)),
        Property::new("quatf[]", ORIENTATIONS, numbers::orientations(asset)),
        Property::new("float3[]", SCALES, numbers::scales(asset, is_3d)),
        Property::new("float[]", OPACITIES, numbers::opacities(asset)),
        Property::uniform("int", SH_DEGREE, Value::int(asset.sh_degree as i32)),
        Property::new("float3[]", SH_COEFFICIENTS, numbers::mean_baked_sh(asset)),
    ]
}

fn textured_splats(asset: &SplatAsset, images: &Images) -> Prim {
    let mut prim = Prim::def(FIELD_TYPE, SPLATS);
    let has_pages = !images.page_paths.is_empty();
    prim.apply(&FIELD_SCHEMAS[..if has_pages { FIELD_SCHEMAS.len() } else { FIELD_SCHEMAS.len() - 1 }]);
    prim.properties = particles(asset, false);
    let placed = asset.maps.iter().zip(&images.atlas.placements);
    let rects = placed.flat_map(|(map, at)| [at.x, at.y, map.cols, map.rows].map(i32::from)).collect();
    let pages = images.atlas.placements.iter().map(|at| at.page.into()).collect();
    let texel_sizes = asset.maps.iter().flat_map(|m| m.texel_sizes).collect();
    prim.properties.extend([
        Property::new("int", LITETEX_VERSION, Value::int(VERSION)).interpolated("constant"),
        Property::new("int4[]", RECT, ints(Form::Vec4, rects)).interpolated("vertex"),
        Property::new("int[]", PAGE, ints(Form::One, pages)).interpolated("vertex"),
        Property::new("float2[]", TEXEL_SIZE, floats(Form::Vec2, texel_sizes)).interpolated("vertex"),
        Property::new("float3[]", SH0, numbers::exact_sh0(asset)).interpolated("vertex"),
    ]);
    if asset.sh_degrees.iter().any(|&degree| u32::from(degree) != asset.sh_degree) {
        let degrees = asset.sh_degrees.iter().map(|&degree| degree.into()).collect();
        prim.properties
            .push(Property::new("int[]", OWN_SH_DEGREE, ints(Form::One, degrees)).interpolated("vertex"));
    }
    if asset.maps.iter().any(|m| m.shift != [0; 2]) {
        let shifts = asset.maps.iter().flat_map(|m| m.shift.map(i32::from)).collect();
        prim.properties.push(Property::new("int2[]", SHIFT, ints(Form::Vec2, shifts)).interpolated("vertex"));
    }
    if let Some(decode) = images.decode {
        for (name, value) in [(DECODE_SCALE, decode.scale), (DECODE_BIAS, decode.bias)] {
            prim.properties
                .push(Property::new("double", name, Value::double(value)).interpolated("constant"));
        }
    }
    let sizes = images.atlas.pages.iter().flat_map(|p| p.map(i32::from)).collect();
    prim.properties.push(Property::uniform("int2[]", PAGE_SIZES, ints(Form::Vec2, sizes)).custom());
    if has_pages {
        prim.properties.push(Property::relationship(BINDING, format!("/{SCENE}/{ATLAS}")));
    }
    prim
}

/// A material with the pages as shaders, so that packaging and copying include them.
fn atlas_material(images: &Images) -> Option<Prim> {
    if images.page_paths.is_empty() {
        return None;
    }
    let mut material = material(ATLAS);
    for (i, path) in images.page_paths.iter().enumerate() {
        let mut page = texture(&format!("Page{i}"), path, "raw");
        if let Some(decode) = images.decode {
            // Shaders see codes divided by 255.
            let four = |value: f64| Value::Floats(Numbers::element(Form::Vec4, vec![value as f32; 4]));
            page.properties.extend([
                Property::new("float4", "inputs:scale", four(255.0 * decode.scale)),
                Property::new("float4", "inputs:bias", four(decode.bias)),
            ]);
        }
        page.properties.push(Property::declaration("float3", "outputs:rgb"));
        material.children.push(page);
    }
    Some(material)
}

fn splat3d(asset: &SplatAsset) -> Prim {
    let mut prim = Prim::def(SPLAT3D_TYPE, SPLATS);
    prim.properties = particles(asset, true);
    prim.properties.push(Property::uniform("token", "sortingModeHint", Value::token("zDepth")));
    prim
}
