//! Hashes of sidecar files. The file that refers to them holds them, so that readers notice when files of two exports are
//! mixed: sidecar files keep their names from one export to the next, and a process can be killed between two of them.

use crate::asset::hash::text_from_hash;
use crate::{Error, Result, quoted, text};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::Path;
use twox_hash::XxHash3_64;

/// xxh3-64 of each sidecar file, 16 hexadecimal digits, by the reference that the file holds.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(transparent)]
pub(crate) struct SidecarHashes(BTreeMap<String, String>);

impl SidecarHashes {
    pub(crate) fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// Adds the file that is referred to like this.
    pub(crate) fn add(&mut self, reference: &str, bytes: &[u8]) {
        self.0.insert(reference.to_owned(), hash_of(bytes));
    }

    /// Checks a sidecar file of the asset at `root`. One without a hash passes: other programs state none.
    ///
    /// # Errors
    /// [`Error::Invalid`] if it is not the one that was written with the asset.
    pub(crate) fn check(&self, reference: &str, bytes: &[u8], root: &Path) -> Result<()> {
        let found = hash_of(bytes);
        let Some(stated) = self.0.get(reference).filter(|stated| !stated.eq_ignore_ascii_case(&found)) else {
            return Ok(());
        };
        let what = format!(
            "the file {} beside it is not the one that was written with {} (hash {found}, expected {}): it was changed, or an \
             export was killed and left files of two; export the scene again",
            quoted(reference),
            root.file_name().map_or_else(String::new, |name| text::path(Path::new(name))),
            quoted(stated),
        );
        Err(Error::invalid(root, what))
    }
}

fn hash_of(bytes: &[u8]) -> String {
    text_from_hash(XxHash3_64::oneshot(bytes))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_stated_files_are_checked_and_others_named() {
        let mut hashes = SidecarHashes::default();
        hashes.add("a.bin", b"new");
        let root = Path::new("folder/a.gltf");
        assert!(hashes.check("a.bin", b"new", root).is_ok() && hashes.check("b.bin", b"old", root).is_ok());
        let error = hashes.check("a.bin", b"old", root).unwrap_err();
        let message = error.to_string();
        assert!(matches!(error, Error::Invalid { .. }), "{message}");
        assert!(
            ["folder/a.gltf", "\"a.bin\"", "export the scene again"].iter().all(|w| message.contains(w)),
            "{message}"
        );
        let text = serde_json::to_string(&hashes).unwrap().to_uppercase().replace("A.BIN", "a.bin");
        assert!(serde_json::from_str::<SidecarHashes>(&text).unwrap().check("a.bin", b"new", root).is_ok());
    }
}
