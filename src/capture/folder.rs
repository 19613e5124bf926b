//! The folder of a capture, and the files outside it. Folders may refer to files outside, with a warning; archives may not.
//! The user may name folders anywhere.

use super::paths::{confine, is_inside, with_slashes};
use super::photo_folder::{Listings, PhotoFolder};
use crate::Result;
use std::path::{Path, PathBuf};

/// A capture's folder and what the user said of it.
#[derive(Clone, Debug)]
pub(crate) struct CaptureFolder {
    /// Paths in pose files are relative to it.
    pub root: PathBuf,
    /// The photos, where `--images` names their folder.
    pub images: Option<PhotoFolder>,
    /// Of an unpacked archive: nothing outside this folder is opened.
    confined_to: Option<PathBuf>,
    listings: Listings,
}

impl CaptureFolder {
    /// The folder with `--images` as given.
    pub fn new(root: &Path, images: Option<&Path>, is_archive: bool) -> Result<Self> {
        let confined_to = is_archive.then(|| root.to_owned());
        let mut folder =
            Self { root: root.to_owned(), images: None, confined_to, listings: Listings::default() };
        folder.images = images.map(|images| folder.given(images, "--images")).transpose()?;
        Ok(folder)
    }

    /// The same for paths that are relative to a folder inside, with photos in another. What an archive may open stays the
    /// same.
    pub fn inside(&self, root: &str, images: PhotoFolder) -> Self {
        Self { root: self.root.join(root), images: Some(images), ..self.clone() }
    }

    /// A folder inside.
    pub fn photos(&self, inside: &str) -> PhotoFolder {
        PhotoFolder { is_deep: !inside.is_empty(), ..self.photo_folder(self.root.join(inside)) }
    }

    fn photo_folder(&self, path: PathBuf) -> PhotoFolder {
        let (confined_to, listings) = (self.confined_to.clone(), self.listings.clone());
        PhotoFolder { path, confined_to, is_deep: true, listings }
    }

    /// A folder given by the user: absolute, relative to the capture or to the working directory. The names of an
    /// archive lead nowhere out of it.
    pub fn given(&self, folder: &Path, option: &str) -> Result<PhotoFolder> {
        let joined = self.root.join(folder);
        // What lies next to an unpacked archive is none of the user's.
        let is_of_capture = self.confined_to.as_ref().is_none_or(|root| is_inside(root, &joined));
        if is_of_capture && joined.is_dir() {
            return Ok(self.photo_folder(joined));
        }
        if folder.is_dir() {
            let confined_to = self.confined_to.as_ref().map(|_| folder.to_owned());
            return Ok(PhotoFolder { confined_to, ..self.photo_folder(folder.to_owned()) });
        }
        let shown = if folder.exists() { folder.to_owned() } else { joined };
        let what = not_a_folder(&shown);
        Err(invalid!(shown, "{what}; {option} takes a folder inside the capture or an absolute path"))
    }

    /// The file at a stored path, which may have been stored on Windows.
    ///
    /// # Errors
    /// [`crate::Error::InvalidInput`] if it lies outside an archive.
    pub fn file(&self, stored: &str) -> Result<PathBuf> {
        let path = self.root.join(stored);
        if let Some(root) = &self.confined_to {
            confine(root, &path, stored)?;
        }
        match with_slashes(stored) {
            Some(turned) if !path.exists() => self.file(&turned),
            _ => Ok(path),
        }
    }
}

/// Why a path is not the folder that was expected.
fn not_a_folder(path: &Path) -> &'static str {
    match path.metadata() {
        Ok(found) if found.is_file() => "is a file, expected a folder",
        Ok(found) if !found.is_dir() => "is a device or a pipe, expected a folder",
        _ => "no such folder",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn archives_open_no_files_outside() {
        let folder = tempfile::tempdir().unwrap();
        let root = folder.path().join("capture");
        std::fs::create_dir_all(root.join("images")).unwrap();
        std::fs::write(folder.path().join("a.png"), b"").unwrap();
        let find = |is_archive| {
            CaptureFolder::new(&root, None, is_archive).unwrap().photos("images").find("../../a.png")
        };
        assert!(find(false).unwrap().is_some());
        assert!(find(true).unwrap_err().to_string().contains("\"../../a.png\""));
        let turned = CaptureFolder::new(&root, None, true).unwrap().photos("images").find("..\\..\\a.png");
        assert!(turned.unwrap_err().to_string().contains("\"../../a.png\""));
        let archive = CaptureFolder::new(&root, None, true).unwrap();
        assert!(archive.file("images/../b.ply").is_ok());
        assert!(
            archive.file("/dev/zero").is_err()
                && archive.photos("").find_mask("/etc/hosts", &|_| false).is_err()
        );
    }
}
