//! glTF 2.0: one POINTS primitive with `KHR_gaussian_splatting`, which every viewer of splats can show, and nested in it our
//! extension [`EXTENSION`] with the texture maps. `schema/gltf.md` specifies what the extension holds and how to render it.
//!
//! A `.glb` is one file; a `.gltf` has its arrays in a `.bin` file and its atlas pages in image files next to it. Viewers
//! without splat support show coloured points (`COLOR_0`); [`encode_mesh`] makes a file of textured quads for them.

mod accessor;
mod attributes;
mod buffer;
mod cameras;
mod colour;
mod container;
mod document;
mod extension;
mod files;
mod loaded;
mod mesh;
mod node;
mod pages;
mod read;
mod scene;
mod splats;
mod stream;
mod validate;
mod write;

pub use extension::{EXTENSION, VERSION};
pub(crate) use files::{arrays_name, page_name, stem};
pub use mesh::{MeshOptions, MeshSummary, encode_mesh};
pub use read::{decode_glb, read_fallback, read_gltf};
pub(crate) use stream::embeds_file;
pub(crate) use validate::QUADS_CODE;
pub use validate::validate;
pub(crate) use write::encode_files;
pub use write::{GltfOptions, encode_glb, write_gltf};

/// Khronos' extension in which ours is nested.
const KHR: &str = "KHR_gaussian_splatting";

/// Extension of materials that are shown without lighting.
const UNLIT: &str = "KHR_materials_unlit";

/// Extension of attributes of 8 and 16 bits; read, but not written.
const QUANTIZATION: &str = "KHR_mesh_quantization";

/// Most bytes of JSON that readers accept: as many as metadata may have, and room for the rest.
const JSON_BYTES_MAX: usize = crate::asset::meta::META_BYTES_MAX + (1 << 20);

/// Name of the attribute with coefficient `n`, from 0, of an SH degree.
fn sh_attribute(degree: u32, n: u32) -> String {
    format!("{KHR}:SH_DEGREE_{degree}_COEF_{n}")
}

/// `(degree, n)` of all coefficients up to a degree, in the order of assets.
fn sh_indices(degree: u32) -> impl Iterator<Item = (u32, u32)> {
    (0..=degree).flat_map(|l| (0..=2 * l).map(move |n| (l, n)))
}

#[cfg(test)]
mod tests;
