//! A mesh of textured quads for viewers without splat support: each quad shows colour and falloff of its splat, from an atlas
//! of 8-bit RGBA. A preview: colours do not depend on the view, viewers blend in linear light, and few sort.

use super::buffer::{Arrays, Use};
use super::document::{Buffer, Document, Image, MIME_PNG, Mesh, Primitive, Scene, TARGET_INDICES, Texture};
use super::{UNLIT, container, scene, write};
use crate::atlas::PAGE_SIDE;
use crate::fallback::depth_order::places_far_to_near;
use crate::fallback::quads::{self, QUADS_MAX, Quad, Quads};
use crate::{Error, Result, SplatAsset};
use std::collections::BTreeMap;

/// How to make a mesh of quads.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MeshOptions {
    /// Most quads of the mesh.
    pub quads_max: usize,
    /// Largest side of an atlas page, texels.
    pub page_side: u16,
}

impl Default for MeshOptions {
    fn default() -> Self {
        Self { quads_max: QUADS_MAX, page_side: PAGE_SIDE }
    }
}

/// Facts about a mesh that was made.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct MeshSummary {
    /// Size of the file.
    pub bytes: usize,
    /// Splats that became quads.
    pub quads: usize,
    /// Splats that were left out: too faint to be seen, or beyond the maximum.
    pub omitted: usize,
    /// Texels of the atlas that quads use.
    pub texels: usize,
}

/// Encodes a `.glb` with one unlit mesh of quads for the most visible splats, by opacity times area.
///
/// # Errors
/// [`Error::Invalid`] if the asset breaks a rule or has no visible splat, [`Error::TooLarge`].
pub fn encode_mesh(asset: &SplatAsset, options: &MeshOptions) -> Result<(Vec<u8>, MeshSummary)> {
    asset.validate()?;
    let baked = Quads::of(asset, options.quads_max, options.page_side)?;
    if baked.quads.is_empty() {
        return Err(Error::invalid("", "no visible splat: a glTF mesh cannot be empty"));
    }
    let mut arrays = Arrays::default();
    let mut document = Document::default();
    document.meshes.resize(1, Mesh::default());
    for (index, page) in baked.pages.iter().enumerate() {
        let on_page: Vec<&Quad> = baked.quads.iter().filter(|q| usize::from(q.page) == index).collect();
        document.meshes[0].primitives.push(push_quads(&mut arrays, asset, &on_page, index as u32));
        let png = quads::encode_page(page)?;
        push_material(&mut document, arrays.push_bytes(&png), index as u32);
    }
    finish(&mut document, asset, &arrays);
    let bytes = container::glb(write::json(&document)?, arrays.bytes)?;
    let (quads, texels) = (baked.quads.len(), baked.num_texels);
    let summary = MeshSummary { bytes: bytes.len(), quads, omitted: asset.num_splats() - quads, texels };
    Ok((bytes, summary))
}

/// Adds the quads of a page as a primitive. Viewers draw triangles in the order of the indices.
fn push_quads(arrays: &mut Arrays, asset: &SplatAsset, quads: &[&Quad], material: u32) -> Primitive {
    let points: Vec<[f32; 3]> = quads.iter().flat_map(|quad| quad.corners).collect();
    let places = places_far_to_near(asset, quads).into_iter();
    let indices = places.flat_map(|place| [0, 1, 2, 0, 2, 3].map(|k| [4 * place as u32 + k]));
    let mut attributes = BTreeMap::new();
    attributes.insert("POSITION".to_owned(), arrays.push_positions(points.iter().copied()));
    let coordinates = quads.iter().flat_map(|quad| quad.uvs);
    attributes.insert("TEXCOORD_0".to_owned(), arrays.push(coordinates, Use::Attribute));
    let indices = arrays.push(indices, Use::Other(Some(TARGET_INDICES)));
    let extras = Some(serde_json::json!({ "litetex": { "kind": scene::QUADS } }));
    Primitive { attributes, indices: Some(indices), material: Some(material), extras, ..Primitive::default() }
}

fn push_material(document: &mut Document, view: u32, page: u32) {
    document.images.push(Image {
        name: Some(format!("baked {page}")),
        buffer_view: Some(view),
        mime_type: Some(MIME_PNG.to_owned()),
        uri: None,
    });
    document.textures.push(Texture { sampler: Some(0), source: Some(page) });
    document.materials.push(serde_json::json!({
        "name": format!("page {page}"),
        "pbrMetallicRoughness": {
            "baseColorTexture": { "index": page },
            "metallicFactor": 0.0,
            "roughnessFactor": 1.0
        },
        "alphaMode": "BLEND",
        "doubleSided": true,
        "extensions": { UNLIT: {} }
    }));
}

fn finish(document: &mut Document, asset: &SplatAsset, arrays: &Arrays) {
    document.asset = write::asset_info(asset);
    document.extensions_used = vec![UNLIT.to_owned()];
    document.scene = Some(0);
    let title = Some(asset.provenance.title.clone()).filter(|title| !title.is_empty());
    document.meshes[0].name.clone_from(&title);
    document.scenes = vec![Scene { name: title, nodes: vec![0] }];
    document.nodes = vec![write::node(asset)];
    // Bilinear, without mipmaps, which would mix neighbours.
    document.samplers = vec![serde_json::json!({
        "magFilter": 9729, "minFilter": 9729, "wrapS": 33_071, "wrapT": 33_071
    })];
    document.accessors.clone_from(&arrays.accessors);
    document.buffer_views.clone_from(&arrays.views);
    document.buffers = vec![Buffer { byte_length: arrays.bytes.len() as u64, uri: None }];
}
