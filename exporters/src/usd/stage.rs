//! The stage of an asset: its prims and their properties.

use super::layer::{Layer, Prim, Property, VariantSet};
use super::names::*;
use super::numbers::{self, floats, ints};
use super::value::{Form, Numbers, Value};
use crate::atlas::{Atlas, TexelDecode};
use crate::depth_order::places_far_to_near;
use crate::meta::Meta;
use crate::quads::{Quad, Quads};
use crate::{Error, Quality, Result, SplatAsset, yup};

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
}

/// Makes the stage. `hash` is that of the asset that a reader gets.
pub(super) fn layer(asset: &SplatAsset, quality: Quality, hash: u64, images: &Images) -> Result<Layer> {
    let mut scene = Prim::def("Xform", SCENE);
    scene.properties = node(asset);
    let mut textured = variant("textured", vec![textured_splats(asset, images)]);
    textured.children.extend(atlas_material(images));
    let mut variants = vec![textured, variant("splat3d", vec![splat3d(asset)])];
    if let Some(quads) = images.quads {
        variants.push(variant("mesh", meshes(asset, quads, images.quad_paths.len())));
        // Outside the variant: three.js does not find materials within one.
        let material = |(page, path): (usize, &String)| quad_material(&quad_page(page), path);
        scene.children = images.quad_paths.iter().enumerate().map(material).collect();
    }
    // Whoever asks for a mesh has programs in mind that show nothing else.
    let selection = if images.quads.is_some() { "mesh" } else { "textured" }.to_owned();
    scene.variant_set = Some(VariantSet { name: REPRESENTATION.to_owned(), selection, variants });
    let metadata = vec![
        ("customLayerData".to_owned(), custom_data(asset, quality, hash)?),
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
fn custom_data(asset: &SplatAsset, quality: Quality, hash: u64) -> Result<Value> {
    let meta = serde_json::to_string(&Meta::of(asset));
    let meta = meta.map_err(|e| Error::invalid("", format!("metadata: {e}")))?;
    if meta.len() > crate::meta::META_BYTES_MAX {
        let what = format!("metadata of {} bytes, at most {}", meta.len(), crate::meta::META_BYTES_MAX);
        return Err(Error::too_large("", what));
    }
    let facts = &asset.provenance;
    let entries = [
        ("author", Value::string(&facts.author)),
        ("generator", Value::string(concat!("litetex-exporters ", env!("CARGO_PKG_VERSION")))),
        ("hash", Value::string(&format!("{hash:016x}"))),
        ("licence", Value::string(&facts.licence)),
        ("meta", Value::string(&meta)),
        ("metricScale", Value::Bool(false)),
        ("programVersion", Value::string(&facts.program_version)),
        ("quality", Value::string(quality.name())),
        ("source", Value::string(&facts.source)),
        ("title", Value::string(&facts.title)),
        ("version", Value::int(VERSION)),
    ];
    if let Some((name, _)) = entries.iter().find(|(_, v)| v.as_text().is_some_and(|t| t.contains('\0'))) {
        return Err(Error::invalid(
            "",
            format!("{name}: a text with a zero character, which USD cannot hold"),
        ));
    }
    let entries = entries.map(|(name, value)| (name.to_owned(), value));
    Ok(Value::Dictionary(vec![(LITETEX.to_owned(), Value::Dictionary(entries.to_vec()))]))
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

/// A material with a black surface.
fn material(name: &str) -> Prim {
    let mut material = Prim::def("Material", name);
    let surface = format!("/{SCENE}/{name}/Surface.outputs:surface");
    material.properties.push(Property::connected("token", "outputs:surface", surface));
    let mut shader = shader("Surface", "UsdPreviewSurface");
    let black = || Value::Floats(Numbers::element(Form::Vec3, vec![0.0; 3]));
    shader.properties.extend([
        Property::new("color3f", "inputs:diffuseColor", black()),
        Property::new("color3f", "inputs:specularColor", black()),
        Property::new("int", "inputs:useSpecularWorkflow", Value::int(1)),
        Property::new("float", "inputs:roughness", Value::float(1.0)),
        Property::declaration("token", "outputs:surface"),
    ]);
    material.children.push(shader);
    material
}

fn shader(name: &str, id: &str) -> Prim {
    let mut shader = Prim::def("Shader", name);
    shader.properties.push(Property::uniform("token", "info:id", Value::token(id)));
    shader
}

fn texture(name: &str, path: &str, colour_space: &str) -> Prim {
    let mut shader = shader(name, "UsdUVTexture");
    shader.properties.extend([
        Property::new("asset", "inputs:file", Value::Asset(path.to_owned())),
        Property::new("token", "inputs:sourceColorSpace", Value::token(colour_space)),
        Property::new("token", "inputs:wrapS", Value::token("clamp")),
        Property::new("token", "inputs:wrapT", Value::token("clamp")),
    ]);
    shader
}

fn splat3d(asset: &SplatAsset) -> Prim {
    let mut prim = Prim::def(SPLAT3D_TYPE, SPLATS);
    prim.properties = particles(asset, true);
    prim.properties.push(Property::uniform("token", "sortingModeHint", Value::token("zDepth")));
    prim
}

/// Name of the material of a page of rectangles.
fn quad_page(page: usize) -> String {
    format!("QuadPage{page}")
}

/// A mesh for each page of rectangles.
fn meshes(asset: &SplatAsset, quads: &Quads, num_pages: usize) -> Vec<Prim> {
    let of_page = |page| {
        let on_page: Vec<&Quad> = quads.quads.iter().filter(|q| usize::from(q.page) == page).collect();
        mesh(asset, &format!("Quads{page}"), &on_page, &quad_page(page))
    };
    (0..num_pages).map(of_page).collect()
}

/// A mesh whose faces are listed from far to near, for programs that do not sort them.
fn mesh(asset: &SplatAsset, name: &str, quads: &[&Quad], material: &str) -> Prim {
    let mut mesh = Prim::def("Mesh", name);
    mesh.apply(&["MaterialBindingAPI"]);
    let points: Vec<[f32; 3]> = quads.iter().flat_map(|q| q.corners).collect();
    // Texture coordinates of USD begin at the lower left.
    let uvs = quads.iter().flat_map(|q| q.uvs).flat_map(|[u, v]| [u, 1.0 - v]).collect();
    let faces = places_far_to_near(asset, quads);
    let faces = faces.into_iter().flat_map(|place| [0, 1, 2, 3].map(|k| 4 * place as i32 + k)).collect();
    let limit = |pick: fn(f32, f32) -> f32| {
        let first = points.first().copied().unwrap_or_default();
        points.iter().fold(first, |a, b| std::array::from_fn(|i| pick(a[i], b[i])))
    };
    let extent = [limit(f32::min), limit(f32::max)].concat();
    mesh.properties = vec![
        Property::uniform("bool", "doubleSided", Value::Bool(true)),
        Property::new("float3[]", EXTENT, floats(Form::Vec3, extent)),
        Property::new("int[]", "faceVertexCounts", ints(Form::One, vec![4; quads.len()])),
        Property::new("int[]", "faceVertexIndices", ints(Form::One, faces)),
        Property::new("point3f[]", "points", floats(Form::Vec3, points.as_flattened().to_vec())),
        Property::new("texCoord2f[]", "primvars:st", floats(Form::Vec2, uvs)).interpolated("vertex"),
        Property::uniform("token", "subdivisionScheme", Value::token("none")),
        Property::relationship(BINDING, format!("/{SCENE}/{material}")),
    ];
    mesh
}

fn quad_material(name: &str, path: &str) -> Prim {
    let mut material = material(name);
    let output = |shader: &str, output: &str| format!("/{SCENE}/{name}/{shader}.outputs:{output}");
    for surface in &mut material.children {
        surface.properties.extend([
            Property::connected("color3f", "inputs:emissiveColor", output("Texture", "rgb")),
            Property::connected("float", "inputs:opacity", output("Texture", "a")),
        ]);
    }
    let mut texture = texture("Texture", path, "sRGB");
    texture.properties.extend([
        Property::connected("float2", "inputs:st", output("Reader", "result")),
        Property::declaration("float3", "outputs:rgb"),
        Property::declaration("float", "outputs:a"),
    ]);
    let mut reader = shader("Reader", "UsdPrimvarReader_float2");
    reader.properties.extend([
        Property::new("string", "inputs:varname", Value::string("st")),
        Property::declaration("float2", "outputs:result"),
    ]);
    material.children.extend([texture, reader]);
    material
}
