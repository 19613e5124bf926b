//! Finds the primitive of splats in a file.

use super::KHR;
use super::document::{Document, Primitive};
use super::extension::{Digest, Splatting};
use crate::{Error, Result};
use std::path::Path;

/// JSON pointer in the `extras` of a primitive to its kind, and the kind that marks these meshes. Most tools keep `extras`.
const KIND: &str = "/litetex/kind";
pub const QUADS: &str = "quads";

/// Whether a file is one of these meshes, and so not an asset.
pub fn is_quad_mesh(document: &Document) -> bool {
    let mut extras = document.meshes.iter().flat_map(|m| &m.primitives).filter_map(|p| p.extras.as_ref());
    extras.any(|extras| extras.pointer(KIND).is_some_and(|kind| kind == QUADS))
}

/// A primitive of splats.
pub struct Found<'a> {
    pub mesh: u32,
    pub primitive: &'a Primitive,
    pub splatting: &'a Splatting,
    /// JSON pointer to the primitive, for messages.
    pub pointer: String,
}

/// All primitives of splats.
pub fn splat_primitives(document: &Document) -> impl Iterator<Item = Found<'_>> {
    document.meshes.iter().enumerate().flat_map(|(i, mesh)| {
        mesh.primitives.iter().enumerate().filter_map(move |(j, primitive)| {
            let splatting = primitive.extensions.as_ref()?.splatting.as_ref()?;
            let pointer = format!("/meshes/{i}/primitives/{j}");
            Some(Found { mesh: i as u32, primitive, splatting, pointer })
        })
    })
}

/// Finds the only primitive of splats.
///
/// # Errors
/// [`Error::Unsupported`] if there is none or several, [`Error::Invalid`] if a tool has dropped the extensions.
pub fn find<'a>(document: &'a Document, path: &Path) -> Result<Found<'a>> {
    let mut all = splat_primitives(document);
    let Some(found) = all.next() else {
        let mut primitives = document.meshes.iter().flat_map(|m| &m.primitives);
        return Err(match primitives.find_map(|p| p.digest()) {
            Some(digest) => Error::invalid(path, lost(&digest)),
            None if is_quad_mesh(document) => Error::unsupported(path, QUADS_ONLY),
            None => unsupported!(path, "no primitive with {KHR}: not a file of splats"),
        });
    };
    let others = all.count();
    if others > 0 {
        let what = format!("{} primitives with {KHR}, supported: one; join them first", others + 1);
        return Err(Error::unsupported(path, what));
    }
    Ok(found)
}

/// Message about a mesh of quads.
pub const QUADS_ONLY: &str =
    "a mesh of quads made by litetex, a preview without splats; read the asset that it was made from";

/// Message about a file of ours that has lost its textures.
pub fn lost(digest: &Digest) -> String {
    format!(
        "the file was written with {} textured texels for {} splats, but a tool that processed it has dropped the \
         textures: go back to the original file, or use a tool that keeps unknown extensions",
        digest.texels, digest.splats
    )
}
