//! What the user named: a video, or photos and folders of photos.

use crate::capture::extensions::{CONVERTED, DEPTH_MAX, READ, VIDEOS, is_of};
use crate::capture::paths::is_of_macos;
use crate::{Error, Result};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Fewer photos have no poses.
const PHOTOS_MIN: usize = 3;

/// A photo and its name in the capture, without extension.
#[derive(Clone, Debug, PartialEq)]
pub struct Named {
    pub file: PathBuf,
    pub stem: String,
}

/// What a capture is made of.
#[derive(Clone, Debug, PartialEq)]
pub enum Input {
    Video(PathBuf),
    /// In the order of their names, and the videos that lie beside them, which nobody named.
    Photos(Vec<Named>, Vec<PathBuf>),
}

impl Input {
    /// Looks at what the user named; what lies in `skipped`, the capture itself, does not count.
    ///
    /// # Errors
    /// [`Error::Usage`], [`Error::Io`], [`Error::InvalidInput`] for too few photos, [`Error::Unsupported`] for files that are
    /// neither.
    pub fn find(paths: &[PathBuf], skipped: &Path) -> Result<Self> {
        let (mut videos, mut photos, mut beside) = (Vec::new(), Vec::new(), Vec::new());
        for path in paths {
            let facts = std::fs::metadata(path).map_err(|e| Error::io(path, e))?;
            if facts.is_dir() {
                let (mut inner, mut clips) = (Vec::new(), Vec::new());
                files_in(path, 1, skipped, &mut inner, &mut clips)?;
                // Cameras and phones put short videos beside photos.
                if inner.is_empty() { &mut videos } else { &mut beside }.extend(clips);
                photos.extend(inner);
            } else if is_of(path, &VIDEOS) {
                videos.push(path.clone());
            } else if is_of(path, &READ) || is_of(path, &CONVERTED) {
                photos.push(path.clone());
            } else {
                return Err(unsupported!(
                    path,
                    "neither a photo ({}, {}) nor a video ({})",
                    READ.join(", "),
                    CONVERTED.join(", "),
                    VIDEOS.join(", ")
                ));
            }
        }
        match (&videos[..], photos.len()) {
            ([video], 0) => Ok(Self::Video(video.clone())),
            ([], 0) => Err(invalid!(&paths[0], "no photos and no video here")),
            ([], 1..PHOTOS_MIN) => Err(invalid!(
                &photos[0],
                "{} only; poses need at least {PHOTOS_MIN}, and 50 to 300 are best",
                crate::text::counted(photos.len(), "photo")
            )),
            ([], _) => Ok(Self::Photos(named(photos), beside)),
            ([_, other, ..], 0) => Err(usage!("{}: a second video; make a capture of each", other.display())),
            ([video, ..], _) => {
                Err(usage!("{}: found a video and photos, expected one of them", video.display()))
            }
        }
    }
}

fn entries(folder: &Path) -> Result<Vec<PathBuf>> {
    let io = |e| Error::io(folder, e);
    let mut all = Vec::new();
    for entry in std::fs::read_dir(folder).map_err(io)? {
        all.push(entry.map_err(io)?.path());
    }
    all.retain(|path| !path.file_name().is_some_and(is_of_macos));
    all.sort();
    Ok(all)
}

/// The photos and the videos in a folder and those inside it.
fn files_in(
    folder: &Path,
    depth: usize,
    skipped: &Path,
    photos: &mut Vec<PathBuf>,
    videos: &mut Vec<PathBuf>,
) -> Result<()> {
    for path in entries(folder)? {
        let is_skipped = || path.canonicalize().is_ok_and(|p| skipped.canonicalize().is_ok_and(|s| s == p));
        if path.is_dir() {
            if depth < DEPTH_MAX && !is_skipped() {
                files_in(&path, depth + 1, skipped, photos, videos)?;
            }
        } else if is_of(&path, &READ) || is_of(&path, &CONVERTED) {
            photos.push(path);
        } else if is_of(&path, &VIDEOS) {
            videos.push(path);
        }
    }
    Ok(())
}

/// Names of the photos in the capture: their paths below the folder that they share. COLMAP's lists have blanks between
/// names and comments behind `#`, so these characters are replaced.
fn named(mut photos: Vec<PathBuf>) -> Vec<Named> {
    photos.sort();
    photos.dedup();
    let folder = |path: &PathBuf| path.parent().map(Path::to_owned).unwrap_or_default();
    let shared = |a: PathBuf, b: PathBuf| -> PathBuf {
        a.components().zip(b.components()).take_while(|(a, b)| a == b).map(|(a, _)| a).collect()
    };
    let root = photos.iter().map(folder).reduce(shared).unwrap_or_default();
    let mut uses = BTreeMap::<String, usize>::new();
    let stem = |file: &PathBuf| {
        let inner = file.strip_prefix(&root).unwrap_or(file).with_extension("");
        let plain = |c: char| if c.is_alphanumeric() || "._-".contains(c) { c } else { '_' };
        let part = |p: std::path::Component<'_>| match p {
            std::path::Component::Normal(part) => {
                Some(part.to_string_lossy().chars().map(plain).collect::<String>())
            }
            _ => None,
        };
        inner.components().filter_map(part).collect::<Vec<_>>().join("/")
    };
    let mut name = |file: PathBuf| {
        let stem = stem(&file);
        // Names that differ in case only are one file on some systems.
        let count = uses.entry(stem.to_lowercase()).or_default();
        *count += 1;
        let stem = if *count == 1 { stem } else { format!("{stem}-{count}") };
        Named { file, stem }
    };
    photos.into_iter().map(&mut name).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn find(files: &[&str], named: &[&str]) -> Result<Input> {
        let folder = tempfile::tempdir().unwrap();
        for file in files {
            let path = folder.path().join(file);
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            std::fs::write(path, "").unwrap();
        }
        let paths: Vec<_> = named.iter().map(|name| folder.path().join(name)).collect();
        Input::find(&paths, &folder.path().join("capture"))
    }

    fn stems(found: Result<Input>) -> Vec<String> {
        match found.unwrap() {
            Input::Photos(photos, _) => photos.into_iter().map(|p| p.stem).collect(),
            Input::Video(video) => vec![video.file_name().unwrap().to_str().unwrap().to_owned()],
        }
    }

    #[test]
    fn photos_get_names_without_blanks_that_differ() {
        let files = ["p/b 1.jpg", "p/B_1.HEIC", "p/._b.jpg", "p/inner/#a.tif", "capture/images/x.jpg"];
        assert_eq!(stems(find(&files, &["."])), ["B_1", "b_1-2", "inner/_a"]);
        assert_eq!(
            stems(find(&["a.jpg", "b.PNG", "c.avif"], &["a.jpg", "b.PNG", "c.avif"])),
            ["a", "b", "c"]
        );
    }

    #[test]
    fn videos_beside_photos_are_told() {
        let beside = |files: &[&str]| match find(files, &["."]).unwrap() {
            Input::Photos(_, videos) => videos.len(),
            Input::Video(_) => panic!("a video"),
        };
        let photos = ["p/1.jpg", "p/2.jpg", "p/3.jpg"];
        assert_eq!(beside(&photos), 0);
        let videos = ["p/1.MOV", "clips/a.mp4", "capture/b.mp4", "p/._1.MOV", "p/notes.txt"];
        assert_eq!(beside(&[&photos[..], &videos].concat()), 2);
        assert_eq!(stems(find(&["clips/day/a.mp4"], &["clips"])), ["a.mp4"]);
    }

    #[test]
    fn a_video_is_found_and_mixtures_are_refused() {
        assert_eq!(stems(find(&["my clip.MOV"], &["my clip.MOV"])), ["my clip.MOV"]);
        assert_eq!(stems(find(&["clips/a.mp4", "clips/notes.txt"], &["clips"])), ["a.mp4"]);
        for (files, named, code, words) in [
            (&["a.mp4", "b.mov"][..], &["a.mp4", "b.mov"][..], 2, "a capture of each"),
            (&["a.mp4", "b.jpg", "c.jpg"], &["a.mp4", "b.jpg", "c.jpg"], 2, "a video and photos"),
            (&["a.jpg", "b.jpg"], &["."], 3, "2 photos only"),
            (&["a.txt"], &["."], 3, "no photos and no video"),
            (&["a.txt"], &["a.txt"], 4, "neither a photo"),
            (&[], &["none.mp4"], 3, "no such file"),
        ] {
            let error = find(files, named).unwrap_err();
            assert!(error.exit_code() == code && error.to_string().contains(words), "{error}");
        }
    }
}
