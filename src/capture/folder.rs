//! The folder of a capture: finds the photos that the poses name, and the files outside it. Folders may refer to files
//! outside, with a warning; archives may not. The user may name folders anywhere.

use crate::Result;
use crate::text::quoted;
use std::path::{Component, Path, PathBuf};

/// Extensions of the photos that can be read.
const EXTENSIONS: [&str; 8] = ["png", "jpg", "jpeg", "exr", "PNG", "JPG", "JPEG", "EXR"];

/// A capture's folder and what the user said of it.
#[derive(Clone, Debug)]
pub(crate) struct CaptureFolder {
    /// Paths in pose files are relative to it.
    pub root: PathBuf,
    /// The photos, where `--images` names their folder.
    pub images: Option<PhotoFolder>,
    /// An unpacked archive: nothing outside it is opened.
    is_archive: bool,
}

/// A folder in which photos are looked up by the names that pose files give them.
#[derive(Clone, Debug)]
pub(crate) struct PhotoFolder {
    path: PathBuf,
    /// Nothing outside this folder is opened.
    confined_to: Option<PathBuf>,
}

impl CaptureFolder {
    /// The folder with `--images` as given.
    pub fn new(root: &Path, images: Option<&Path>, is_archive: bool) -> Result<Self> {
        let mut folder = Self { root: root.to_owned(), images: None, is_archive };
        folder.images = images.map(|images| folder.given(images, "--images")).transpose()?;
        Ok(folder)
    }

    /// The same for poses whose paths are relative to a folder inside, with photos in another.
    pub fn inside(&self, root: &str, images: PhotoFolder) -> Self {
        Self { root: self.root.join(root), images: Some(images), is_archive: self.is_archive }
    }

    /// A folder inside.
    pub fn photos(&self, inside: &str) -> PhotoFolder {
        self.photo_folder(self.root.join(inside))
    }

    fn photo_folder(&self, path: PathBuf) -> PhotoFolder {
        PhotoFolder { path, confined_to: self.is_archive.then(|| self.root.clone()) }
    }

    /// A folder given by the user: absolute, relative to the capture or to the working directory. The names of an
    /// archive lead nowhere out of it.
    pub fn given(&self, folder: &Path, option: &str) -> Result<PhotoFolder> {
        let joined = self.root.join(folder);
        // What lies next to an unpacked archive is none of the user's.
        let is_of_capture = !self.is_archive || is_inside(&self.root, &joined);
        if is_of_capture && joined.is_dir() {
            return Ok(self.photo_folder(joined));
        }
        if folder.is_dir() {
            let confined_to = self.is_archive.then(|| folder.to_owned());
            return Ok(PhotoFolder { path: folder.to_owned(), confined_to });
        }
        let shown = if folder.exists() { folder.to_owned() } else { joined };
        let what = not_a_folder(&shown);
        Err(invalid!(shown, "{what}; {option} takes a folder inside the capture or an absolute path"))
    }

    /// The file at a stored path.
    ///
    /// # Errors
    /// [`crate::Error::InvalidInput`] if it lies outside an archive.
    pub fn file(&self, stored: &str) -> Result<PathBuf> {
        let path = self.root.join(stored);
        if self.is_archive {
            confine(&self.root, &path, stored)?;
        }
        Ok(path)
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

/// Whether something lies at a path that is to be read as a photo. Devices and pipes count: whoever opens the photo
/// refuses them by name, where a view without photo would only be left out.
fn is_there(path: &Path) -> bool {
    path.metadata().is_ok_and(|found| !found.is_dir())
}

fn confine(root: &Path, path: &Path, stored: &str) -> Result<()> {
    if is_inside(root, path) {
        return Ok(());
    }
    Err(invalid!(
        root,
        "{} is outside the archive, which must be self-contained; unpack it if you trust it",
        quoted(stored)
    ))
}

/// Whether a path lies in a folder, by the text of both: links lead where their owner wants them to.
pub(crate) fn is_inside(folder: &Path, path: &Path) -> bool {
    let plain = |path: &Path| {
        let mut plain = PathBuf::new();
        for part in std::path::absolute(path).unwrap_or_else(|_| path.to_owned()).components() {
            match part {
                Component::ParentDir => drop(plain.pop()),
                part => plain.push(part),
            }
        }
        plain
    };
    plain(path).starts_with(plain(folder))
}

impl PhotoFolder {
    /// Where it is.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// The photo of a name with or without extension; scaled copies may have another extension.
    ///
    /// # Errors
    /// [`crate::Error::InvalidInput`] if the name leads out of an archive.
    pub fn find(&self, name: &str) -> Result<Option<PathBuf>> {
        let exact = self.path.join(name);
        if let Some(root) = &self.confined_to {
            confine(root, &exact, name)?;
        }
        if is_there(&exact) {
            return Ok(Some(exact));
        }
        let replaced = Path::new(name).with_extension("");
        let replaced = replaced.to_string_lossy();
        let found = [name, &replaced]
            .into_iter()
            .flat_map(|stem| EXTENSIONS.map(|e| self.path.join(format!("{stem}.{e}"))))
            .find(|p| is_there(p));
        Ok(found)
    }

    /// The mask of a photo: `name.png`, `name.ext.png` or the photo's own path.
    ///
    /// # Errors
    /// As [`Self::find`].
    pub fn find_mask(&self, name: &str) -> Result<Option<PathBuf>> {
        let double = self.path.join(format!("{name}.png"));
        if self.confined_to.is_none() && is_there(&double) {
            return Ok(Some(double));
        }
        let found = self.find(name)?;
        Ok(Some(double).filter(|p| is_there(p)).or(found))
    }

    /// Number of photos in the folder and its subfolders.
    pub fn count(&self) -> usize {
        let mut folders = vec![self.path.clone()];
        let mut count = 0;
        while let Some(folder) = folders.pop() {
            for entry in std::fs::read_dir(folder).into_iter().flatten().flatten() {
                // `file_type` does not follow links, so the walk ends.
                match entry.file_type() {
                    Ok(kind) if kind.is_dir() => folders.push(entry.path()),
                    _ => {
                        let path = entry.path();
                        let extension = path.extension().unwrap_or_default().to_ascii_lowercase();
                        count += usize::from(EXTENSIONS.iter().any(|e| extension == *e));
                    }
                }
            }
        }
        count
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn containment_is_decided_by_the_normalised_path() {
        let inside = |path: &str| is_inside(Path::new("/captures/garden"), Path::new(path));
        assert!(inside("/captures/garden/images/a.png"));
        assert!(inside("/captures/garden/images/../masks/a.png"));
        assert!(inside("/captures/garden/./a.png"));
        assert!(!inside("/captures/garden/images/../../a.png"));
        assert!(!inside("/captures/garden2/a.png"));
        assert!(!inside("/etc/passwd"));
        assert!(is_inside(Path::new("."), Path::new("./images/a.png")));
        assert!(!is_inside(Path::new("."), Path::new("../a.png")));
    }

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
        let archive = CaptureFolder::new(&root, None, true).unwrap();
        assert!(archive.file("images/../b.ply").is_ok());
        assert!(archive.file("/dev/zero").is_err() && archive.photos("").find_mask("/etc/hosts").is_err());
    }
}
