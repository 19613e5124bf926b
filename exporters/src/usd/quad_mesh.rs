//! The variant `mesh`: textured rectangles for programs that know no particle fields.

use super::layer::{Prim, Property};
use super::names::*;
use super::numbers::{floats, ints};
use super::shade::{material, shader, texture};
use super::value::{Form, Numbers, Value};
use crate::SplatAsset;
use crate::fallback::depth_order::{faces_cameras, places_far_to_near};
use crate::fallback::quads::{Quad, Quads};

/// Name of the material of a page of rectangles.
fn quad_page(page: usize) -> String {
    format!("QuadPage{page}")
}

/// A mesh for each page of rectangles.
pub(super) fn meshes(asset: &SplatAsset, quads: &Quads, num_pages: usize) -> Vec<Prim> {
    let of_page = |page| {
        let on_page: Vec<&Quad> = quads.quads.iter().filter(|q| usize::from(q.page) == page).collect();
        mesh(asset, &format!("Quads{page}"), &on_page, &quad_page(page))
    };
    (0..num_pages).map(of_page).collect()
}

/// A mesh whose faces are listed from far to near, for programs that do not sort them, and turned to most training cameras, for
/// those that show only one side.
fn mesh(asset: &SplatAsset, name: &str, quads: &[&Quad], material: &str) -> Prim {
    let mut mesh = Prim::def("Mesh", name);
    mesh.apply(&["MaterialBindingAPI"]);
    let points: Vec<[f32; 3]> = quads.iter().flat_map(|q| q.corners).collect();
    // Texture coordinates of USD begin at the lower left.
    let uvs = quads.iter().flat_map(|q| q.uvs).flat_map(|[u, v]| [u, 1.0 - v]).collect();
    let face = |place: usize| {
        let corners = if faces_cameras(asset, quads[place]) { [0, 1, 2, 3] } else { [0, 3, 2, 1] };
        corners.map(|k| 4 * place as i32 + k)
    };
    let faces = places_far_to_near(asset, quads).into_iter().flat_map(face).collect();
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

/// The materials of the pages, by their asset paths.
pub(super) fn materials(paths: &[String]) -> Vec<Prim> {
    paths.iter().enumerate().map(|(page, path)| quad_material(&quad_page(page), path)).collect()
}

/// A surface that only emits. Its diffuse colour is that of the page times zero: three.js takes the opacity from the texture of
/// the diffuse colour, whatever the opacity is connected to.
fn quad_material(name: &str, path: &str) -> Prim {
    let mut material = material(name);
    let output = |shader: &str, output: &str| format!("/{SCENE}/{name}/{shader}.outputs:{output}");
    for surface in &mut material.children {
        surface.properties.retain(|property| property.name != "inputs:diffuseColor");
        surface.properties.extend([
            Property::connected("color3f", "inputs:diffuseColor", output("Black", "rgb")),
            Property::connected("color3f", "inputs:emissiveColor", output("Texture", "rgb")),
            Property::connected("float", "inputs:opacity", output("Texture", "a")),
        ]);
    }
    let read = |name: &str| {
        let mut texture = texture(name, path, "sRGB");
        texture.properties.extend([
            Property::connected("float2", "inputs:st", output("Reader", "result")),
            Property::declaration("float3", "outputs:rgb"),
            Property::declaration("float", "outputs:a"),
        ]);
        texture
    };
    let mut black = read("Black");
    let scale = Value::Floats(Numbers::element(Form::Vec4, vec![0.0, 0.0, 0.0, 1.0]));
    black.properties.push(Property::new("float4", "inputs:scale", scale));
    let mut reader = shader("Reader", "UsdPrimvarReader_float2");
    reader.properties.extend([
        Property::new("string", "inputs:varname", Value::string("st")),
        Property::declaration("float2", "outputs:result"),
    ]);
    material.children.extend([read("Texture"), black, reader]);
    material
}
