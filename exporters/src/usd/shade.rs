//! Materials and their shaders.

use super::layer::{Prim, Property};
use super::names::SCENE;
use super::value::{Form, Numbers, Value};

/// A material with a black surface.
pub(super) fn material(name: &str) -> Prim {
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

pub(super) fn shader(name: &str, id: &str) -> Prim {
    let mut shader = Prim::def("Shader", name);
    shader.properties.push(Property::uniform("token", "info:id", Value::token(id)));
    shader
}

pub(super) fn texture(name: &str, path: &str, colour_space: &str) -> Prim {
    let mut shader = shader(name, "UsdUVTexture");
    shader.properties.extend([
        Property::new("asset", "inputs:file", Value::Asset(path.to_owned())),
        Property::new("token", "inputs:sourceColorSpace", Value::token(colour_space)),
        Property::new("token", "inputs:wrapS", Value::token("clamp")),
        Property::new("token", "inputs:wrapT", Value::token("clamp")),
    ]);
    shader
}
