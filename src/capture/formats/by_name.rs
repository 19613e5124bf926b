//! Frames by the names that lists give them.

use crate::capture::paths::{plain, without_extension};
use std::collections::HashMap;

/// Frames by all names that a list may call them: the stored path and its ends, with and without extension.
pub(super) struct ByName {
    frames: HashMap<String, Vec<usize>>,
}

impl ByName {
    pub(super) fn new(paths: &[&str]) -> Self {
        let mut frames = HashMap::<String, Vec<usize>>::new();
        for (index, path) in paths.iter().enumerate() {
            for key in keys(path) {
                let known = frames.entry(key).or_default();
                if known.last() != Some(&index) {
                    known.push(index);
                }
            }
        }
        Self { frames }
    }

    /// The frames that a listed name means: the longest end of it that a frame has too. The extension tells frames apart
    /// only where it must.
    pub(super) fn find(&self, listed: &str) -> &[usize] {
        keys(listed).iter().find_map(|key| self.frames.get(key)).map_or(&[], Vec::as_slice)
    }
}

/// A path and its ends (`a/b/c.png`, `b/c.png`, `c.png`), longest first, each followed by itself without extension.
fn keys(path: &str) -> Vec<String> {
    let path = plain(path);
    let starts = std::iter::once(0).chain(path.match_indices('/').map(|(at, _)| at + 1));
    starts
        .flat_map(|start| [path[start..].to_owned(), without_extension(&path[start..]).to_owned()])
        .filter(|key| !key.is_empty())
        .collect()
}
