//! The folder of a capture: finds the photos that the poses name, and the files outside it. Folders may refer to files
//! outside, with a warning; archives may not. The user may name folders anywhere.

use crate::Result;
use crate::text::quoted;
use std::collections::HashMap;
use std::ffi::OsString;
use std::path::{Component, Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

/// Extensions of the photos that can be read, in lower case.
pub(crate) const EXTENSIONS: [&str; 5] = ["png", "jpg", "jpeg", "exr", "webp"];

/// Whether a name is of a file that macOS puts beside each file on foreign disks and in archives.
pub(crate) fn is_of_macos(name: &std::ffi::OsStr) -> bool {
    let name = name.to_string_lossy();
    name == "__MACOSX" || name.starts_with("._")
}

/// The photos of a folder, by stem in lower case.
type Listing = HashMap<String, Vec<OsString>>;

/// Folders that were listed, so that a thousand names of another extension do not list them a thousand times.
#[derive(Clone, Debug, Default)]
struct Listings(Arc<Mutex<HashMap<PathBuf, Arc<Listing>>>>);

impl Listings {
    fn of(&self, folder: &Path) -> Arc<Listing> {
        let mut known = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let listing = known.entry(folder.to_owned()).or_insert_with(|| Arc::new(list(folder)));
        Arc::clone(listing)
    }
}

fn list(folder: &Path) -> Listing {
    let mut listing = Listing::new();
    for entry in std::fs::read_dir(folder).into_iter().flatten().flatten() {
        let (name, path) = (entry.file_name(), entry.path());
        if has_photo_extension(&path) && !is_of_macos(&name) {
            let stem = path.file_stem().unwrap_or_default().to_string_lossy().to_lowercase();
            listing.entry(stem).or_default().push(name);
        }
    }
    listing
}

fn has_photo_extension(path: &Path) -> bool {
    path.extension().is_some_and(|e| EXTENSIONS.iter().any(|known| e.eq_ignore_ascii_case(known)))
}

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

/// A folder in which photos are looked up by the names that pose files give them.
#[derive(Clone, Debug)]
pub(crate) struct PhotoFolder {
    path: PathBuf,
    /// Nothing outside this folder is opened.
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
        self.photo_folder(self.root.join(inside))
    }

    fn photo_folder(&self, path: PathBuf) -> PhotoFolder {
        PhotoFolder { path, confined_to: self.confined_to.clone(), listings: self.listings.clone() }
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
            let listings = self.listings.clone();
            return Ok(PhotoFolder { path: folder.to_owned(), confined_to, listings });
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

/// A path with backslashes as one with slashes; `None` if it has none.
fn with_slashes(stored: &str) -> Option<String> {
    stored.contains('\\').then(|| stored.replace('\\', "/"))
}

/// A stored path without `./` and with forward slashes.
pub(crate) fn plain(stored: &str) -> String {
    let path = stored.replace('\\', "/");
    path.trim_start_matches("./").to_owned()
}

/// A name without the extension of its last part. Digits alone are none: `frame.0001` is a whole name.
pub(crate) fn without_extension(name: &str) -> &str {
    match name.rsplit_once('.') {
        Some((stem, extension))
            if !(stem.is_empty() || stem.ends_with('/') || extension.contains('/'))
                && extension.contains(|c: char| !c.is_ascii_digit()) =>
        {
            stem
        }
        _ => name,
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
pub(crate) fn is_there(path: &Path) -> bool {
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

    /// The photo of a name with or without extension. The file may have another extension, as scaled copies have, and
    /// its name may differ in case, as on disks that ignore it.
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
        // The name may lack its extension, or have another one.
        for stem in [name, without_extension(name)] {
            if let Some(found) = self.with_stem(stem) {
                return Ok(Some(found));
            }
        }
        with_slashes(name).map_or(Ok(None), |turned| self.find(&turned))
    }

    /// The photo of a name without extension: in the same case if there is one, and of the extension that comes first.
    fn with_stem(&self, stem: &str) -> Option<PathBuf> {
        // Of "." and "..", which a file's name may end in, the path would name another folder.
        Path::new(stem).file_name()?;
        let wanted = self.path.join(stem);
        let wanted_name = wanted.file_name()?.to_string_lossy().into_owned();
        let folder = wanted.parent()?;
        let listing = self.listings.of(folder);
        let rank = |name: &OsString| {
            let path = Path::new(name);
            let found = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
            let extension = path.extension().unwrap_or_default();
            let place = EXTENSIONS.iter().position(|e| extension.eq_ignore_ascii_case(e));
            (found != wanted_name, place, name.clone())
        };
        let photos = listing.get(&wanted_name.to_lowercase())?.iter();
        let mut photos: Vec<&OsString> = photos.filter(|name| is_there(&folder.join(name))).collect();
        photos.sort_by_cached_key(|name| rank(name));
        photos.first().map(|name| folder.join(name))
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
                    _ if is_of_macos(&entry.file_name()) => {}
                    Ok(kind) if kind.is_dir() => folders.push(entry.path()),
                    _ => count += usize::from(has_photo_extension(&entry.path())),
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
    fn photos_are_found_by_stem_in_any_case_and_extension() {
        let folder = tempfile::tempdir().unwrap();
        std::fs::create_dir(folder.path().join("day")).unwrap();
        for name in [
            "a.webp",
            "b.Jpeg",
            "c.PNG",
            "c.jpg",
            "f.0001.png",
            "._g.jpg",
            "D.jpg",
            "d.JPG",
            "day/e.exr",
            "h.txt",
        ] {
            std::fs::write(folder.path().join(name), b"").unwrap();
        }
        let photos = CaptureFolder::new(folder.path(), None, false).unwrap().photos("");
        for (name, expected) in [
            ("a.jpeg", Some("a.webp")),
            ("a", Some("a.webp")),
            ("b.jpeg", Some("b.Jpeg")),
            ("B.JPG", Some("b.Jpeg")),
            ("c.tif", Some("c.PNG")),
            ("c.jpg", Some("c.jpg")),
            ("d.png", Some("d.JPG")),
            ("D.png", Some("D.jpg")),
            ("day\\e.exr", Some("day/e.exr")),
            (".\\day\\e.jpg", Some("./day/e.exr")),
            ("f.0001", Some("f.0001.png")),
            ("f.0002", None),
            ("g.jpg", None),
            ("h.jpg", None),
        ] {
            let found = photos.find(name).unwrap();
            assert_eq!(found, expected.map(|expected| folder.path().join(expected)), "{name}");
        }
        assert_eq!(photos.count(), 8);
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
        let turned = CaptureFolder::new(&root, None, true).unwrap().photos("images").find("..\\..\\a.png");
        assert!(turned.unwrap_err().to_string().contains("\"../../a.png\""));
        let archive = CaptureFolder::new(&root, None, true).unwrap();
        assert!(archive.file("images/../b.ply").is_ok());
        assert!(archive.file("/dev/zero").is_err() && archive.photos("").find_mask("/etc/hosts").is_err());
    }
}
