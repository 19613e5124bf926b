//! What writing an asset leaves.

use std::path::{Path, PathBuf};

/// The files that an asset was written to.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Written {
    /// All files; first the one requested.
    pub files: Vec<PathBuf>,
    /// Their sizes in bytes, in the same order.
    pub sizes: Vec<u64>,
    /// What users should know about the result.
    pub notes: Vec<String>,
}

impl Written {
    /// Each file with its size in bytes.
    pub fn each(&self) -> impl Iterator<Item = (&Path, u64)> {
        self.files.iter().map(PathBuf::as_path).zip(self.sizes.iter().copied())
    }

    /// Bytes of the files that the scene is read from: of all but a mesh of quads beside them.
    pub fn scene_bytes(&self) -> u64 {
        let mesh = self.files.first().map(|root| mesh_path(root));
        self.each().filter(|(file, _)| Some(*file) != mesh.as_deref()).map(|(_, bytes)| bytes).sum()
    }
}

/// The sidecar file with the mesh of quads.
pub(crate) fn mesh_path(path: &Path) -> PathBuf {
    path.with_extension("mesh.glb")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_mesh_is_not_counted_as_part_of_the_scene() {
        let files = ["a/b.gltf", "a/b.bin", "a/b.mesh.glb"].map(PathBuf::from).to_vec();
        let written = Written { files, sizes: vec![1, 20, 300], notes: Vec::new() };
        assert_eq!(written.scene_bytes(), 21);
        assert_eq!(written.each().last(), Some((Path::new("a/b.mesh.glb"), 300)));
        // Negative control: a mesh that was asked for by its own name is the scene.
        let other = Written { files: vec!["a/b.mesh.glb".into()], sizes: vec![300], notes: Vec::new() };
        assert_eq!(other.scene_bytes(), 300);
    }
}
