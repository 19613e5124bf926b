//! Frames by the names that lists give them.

use crate::capture::paths::{common_folder, plain, without_extension};
use std::collections::HashMap;

/// Folders of a long path that a list may name or leave out: all ends of one take memory of the square of its length.
const ENDS_MAX: usize = 8;

/// Frames by the names that lists may give them.
pub(super) struct ByName {
    /// By their stored paths and ends of these: lists may leave out folders.
    ends: Index,
    /// By their paths in the folder that all share: lists may name other folders above it, as those of another computer or
    /// of scaled photos.
    inner: Index,
    /// Stored paths of the frames.
    paths: Vec<String>,
}

/// Frames by paths, with and without extension.
#[derive(Default)]
struct Index {
    exact: HashMap<String, Vec<usize>>,
    /// By paths in lower case: photos are found in any case, so lists find their frames likewise.
    folded: HashMap<String, Vec<usize>>,
}

impl Index {
    fn insert(&mut self, path: &str, index: usize) {
        for key in [path, without_extension(path)] {
            let exact = self.exact.entry(key.to_owned()).or_default();
            for known in [exact, self.folded.entry(key.to_lowercase()).or_default()] {
                if known.last() != Some(&index) {
                    known.push(index);
                }
            }
        }
    }

    /// The extension tells frames apart only where it must, the case only where it can; without it, one frame must be left.
    fn find(&self, path: &str, paths: &[String]) -> Option<&[usize]> {
        let keys = [path, without_extension(path)];
        let is_one = |frames: &&Vec<usize>| frames.iter().all(|&frame| paths[frame] == paths[frames[0]]);
        let exact = keys.iter().find_map(|key| self.exact.get(*key));
        let in_any_case = || keys.iter().find_map(|key| self.folded.get(&key.to_lowercase()).filter(is_one));
        exact.or_else(in_any_case).map(Vec::as_slice)
    }
}

impl ByName {
    pub(super) fn new(paths: &[&str]) -> Self {
        let paths: Vec<String> = paths.iter().map(|path| plain(path)).collect();
        let shared = common_folder(paths.iter().map(String::as_str)).len();
        let (mut by_end, mut inner) = (Index::default(), Index::default());
        for (index, path) in paths.iter().enumerate() {
            ends(path).for_each(|end| by_end.insert(end, index));
            inner.insert(&path[shared..], index);
        }
        Self { ends: by_end, inner, paths }
    }

    /// The frames that a listed name means: those whose path ends with it, or else those with whose path, in the folder that
    /// all share, it ends. Several have one end where the list leaves out the folders that tell them apart.
    pub(super) fn find(&self, listed: &str) -> &[usize] {
        let listed = plain(listed);
        if listed.is_empty() {
            return &[];
        }
        let inner = || ends(&listed).find_map(|end| self.inner.find(end, &self.paths));
        self.ends.find(&listed, &self.paths).or_else(inner).unwrap_or_default()
    }
}

/// A path and its ends (`a/b/c.png`, `b/c.png`, `c.png`), longest first; of a long path, the whole and the shortest ends.
fn ends(path: &str) -> impl Iterator<Item = &str> {
    let mut ends: Vec<&str> =
        path.rmatch_indices('/').take(ENDS_MAX).map(|(at, _)| &path[at + 1..]).collect();
    ends.push(path);
    ends.into_iter().rev().filter(|end| !end.is_empty())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn found(frames: &[&str], listed: &str) -> Vec<usize> {
        ByName::new(frames).find(listed).to_vec()
    }

    #[test]
    fn folders_that_tell_frames_apart_must_agree() {
        let rig = ["images/left/1.png", "images/right/1.png", "images/left/2.png"];
        for (listed, frames) in [
            ("images/left/1.png", &[0][..]),
            ("right/1", &[1]),
            ("/home/me/photos_4/right/1.jpg", &[1]),
            ("1.png", &[0, 1]),
            ("2.png", &[2]),
            ("middle/1.png", &[]),
            ("images/middle/1.png", &[]),
            ("middle/2.png", &[]),
            ("", &[]),
            ("/", &[]),
        ] {
            assert_eq!(found(&rig, listed), frames, "{listed}");
        }
        assert_eq!(found(&["images/2.png", "images/3.png"], "images_4/2.png"), [0], "of one folder");
    }

    #[test]
    fn case_tells_frames_apart_only_where_it_can() {
        let rig = ["images/left/a.png", "images/right/a.png"];
        for (listed, frames) in [
            ("images/Left/a.png", &[0][..]),
            ("/home/me/IMAGES/RIGHT/A.PNG", &[1]),
            ("right/A", &[1]),
            ("A.png", &[]),
            ("images/middle/A.png", &[]),
        ] {
            assert_eq!(found(&rig, listed), frames, "{listed}");
        }
        let alike = ["images/a.png", "images/A.png", "images/b.png", "images/b.png"];
        for (listed, frames) in [("a", &[0][..]), ("A.png", &[1]), ("IMAGES/A.PNG", &[1]), ("B", &[2, 3])] {
            assert_eq!(found(&alike, listed), frames, "{listed}");
        }
        assert!(found(&["images/ab.png", "images/aB.png"], "AB").is_empty(), "either may be meant");
        // A folder in another case goes before a shorter end.
        assert_eq!(found(&["images/1.png", "images/left/1.png"], "images/Left/1.png"), [1]);
    }

    #[test]
    fn memory_grows_with_the_length_of_paths_and_not_with_its_square() {
        let long = "a/".repeat(20_000) + "x.png";
        assert_eq!(ends(&long).count(), ENDS_MAX + 1);
        let by_name = ByName::new(&[&long, "images/y.png"]);
        let bytes =
            |index: &Index| [&index.exact, &index.folded].map(|m| m.keys().map(String::len).sum::<usize>());
        let [exact, folded] = [0, 1].map(|i| bytes(&by_name.ends)[i] + bytes(&by_name.inner)[i]);
        assert!(exact.max(folded) < 5 * long.len(), "{exact} and {folded} bytes");
        assert_eq!((by_name.find(&long), by_name.find("x")), (&[0][..], &[0][..]));
        assert_eq!(by_name.find("a/a/x.png"), [0]);
        assert!(by_name.find(&long.replace('x', "z")).is_empty(), "negative control");
    }
}
