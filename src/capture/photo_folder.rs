//! Finds the photos and masks that the poses name in a folder.

use super::extensions::{self, READ};
use super::paths::{confine, is_of_macos, is_there, with_slashes, without_extension};
use super::photos_near;
use crate::Result;
use std::collections::HashMap;
use std::ffi::OsString;
use std::ops::Deref;
use std::path::{Component, Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

/// Names at the end of a path on another computer that may lead to a photo here.
const ENDS_MAX: usize = 8;

/// The photos of a folder, by stem in lower case.
type Listing = HashMap<String, Vec<OsString>>;

/// The photos of a folder and those in it, by stem in lower case.
type DeepListing = HashMap<String, Vec<PathBuf>>;

/// Folders that were listed, so that a thousand names of another extension do not list them a thousand times.
#[derive(Clone, Debug, Default)]
pub(super) struct Listings {
    flat: Arc<Mutex<HashMap<PathBuf, Arc<Listing>>>>,
    deep: Arc<Mutex<HashMap<PathBuf, Arc<DeepListing>>>>,
}

impl Listings {
    fn of(&self, folder: &Path) -> Arc<Listing> {
        let mut known = self.flat.lock().unwrap_or_else(PoisonError::into_inner);
        let listing = known.entry(folder.to_owned()).or_insert_with(|| Arc::new(list(folder)));
        Arc::clone(listing)
    }

    fn deep(&self, folder: &Path) -> Arc<DeepListing> {
        let mut known = self.deep.lock().unwrap_or_else(PoisonError::into_inner);
        let listing = known.entry(folder.to_owned()).or_insert_with(|| {
            let mut listing = DeepListing::new();
            for folder in photos_near::folders(folder, &|_| true) {
                for (stem, names) in list(&folder) {
                    listing.entry(stem).or_default().extend(names.iter().map(|name| folder.join(name)));
                }
            }
            Arc::new(listing)
        });
        Arc::clone(listing)
    }
}

fn list(folder: &Path) -> Listing {
    let mut listing = Listing::new();
    for entry in std::fs::read_dir(folder).into_iter().flatten().flatten() {
        let (name, path) = (entry.file_name(), entry.path());
        if extensions::is_read(&path) && !is_of_macos(&name) {
            let stem = path.file_stem().unwrap_or_default().to_string_lossy().to_lowercase();
            listing.entry(stem).or_default().push(name);
        }
    }
    listing
}

/// A file that was found for a name.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Match {
    pub path: PathBuf,
    /// The name that was looked for.
    pub asked: String,
    pub misfit: Misfit,
}

impl Deref for Match {
    type Target = Path;

    fn deref(&self) -> &Path {
        &self.path
    }
}

/// How the name of a file differs from the one that was looked for. Less is better; none is exact.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Misfit {
    /// Leading folders of the name that are not there, or 1 of a photo in a folder inside.
    pub folders: usize,
    /// The name has another extension, or none.
    extension: bool,
    /// Upper and lower case differ.
    pub case: bool,
}

/// A folder in which photos are looked up by the names that pose files give them.
#[derive(Clone, Debug)]
pub(crate) struct PhotoFolder {
    pub(super) path: PathBuf,
    /// Nothing outside this folder is opened.
    pub(super) confined_to: Option<PathBuf>,
    /// Whether names without folders may be those of photos in the folders inside. In the folder of the capture there are
    /// also images that are no photos of it.
    pub(super) is_deep: bool,
    pub(super) listings: Listings,
}

impl PhotoFolder {
    /// Where it is.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// The photo of a name with or without extension. The file may have another extension, as scaled copies have; its name
    /// may differ in case, as on disks that ignore it; of a path on another computer, or from another folder, the longest
    /// end that is there counts; and in the folder that a name leads to, the only photo of that name in the folders inside.
    ///
    /// # Errors
    /// [`crate::Error::InvalidInput`] if the name leads out of an archive.
    pub fn find(&self, name: &str) -> Result<Option<Match>> {
        if let Some(found) = self.find_whole(name)? {
            return Ok(Some(found));
        }
        if let Some(turned) = with_slashes(name) {
            return self.find(&turned);
        }
        let end = ends(name).find_map(|(folders, end)| Some((folders, self.at(end)?)));
        let end = end.map(|(folders, found)| Match {
            asked: name.to_owned(),
            misfit: Misfit { folders, ..found.misfit },
            ..found
        });
        Ok(end.or_else(|| match &self.fitting_inside(name)[..] {
            [only] => Some(inside(only, name)),
            _ => None,
        }))
    }

    /// The photos in the folders inside that a name may mean, where they are several.
    pub fn several(&self, name: &str) -> Vec<PathBuf> {
        let fitting = self.fitting_inside(&name.replace('\\', "/"));
        if fitting.len() > 1 { fitting } else { Vec::new() }
    }

    /// The photos of a name in the folders inside the one that it leads to. The extension tells them apart where it can.
    fn fitting_inside(&self, name: &str) -> Vec<PathBuf> {
        let (folder, file) = match name.rsplit_once('/') {
            Some((folder, file)) if is_plain(folder) && !folder.trim_matches(['.', '/']).is_empty() => {
                (self.path.join(folder), file)
            }
            None if self.is_deep => (self.path.clone(), name),
            _ => return Vec::new(),
        };
        if !folder.is_dir() {
            return Vec::new();
        }
        let extension = Path::new(file).extension().unwrap_or_default();
        let (same, other): (Vec<PathBuf>, Vec<PathBuf>) = self
            .stems_inside(&folder, without_extension(file))
            .into_iter()
            .partition(|path| path.extension().is_some_and(|e| e.eq_ignore_ascii_case(extension)));
        if same.is_empty() { other } else { same }
    }

    /// The photos of a stem in a folder and those in it.
    fn stems_inside(&self, folder: &Path, stem: &str) -> Vec<PathBuf> {
        let listing = self.listings.deep(folder);
        let found = listing.get(&stem.to_lowercase()).into_iter().flatten();
        found.filter(|path| is_there(path)).cloned().collect()
    }

    /// As [`Self::find`], of the whole path only.
    ///
    /// # Errors
    /// As [`Self::find`].
    pub fn find_whole(&self, name: &str) -> Result<Option<Match>> {
        self.check(name)?;
        Ok(self.at(name))
    }

    fn check(&self, name: &str) -> Result<()> {
        match &self.confined_to {
            Some(root) => confine(root, &self.path.join(name), name),
            None => Ok(()),
        }
    }

    fn at(&self, name: &str) -> Option<Match> {
        let bare = without_extension(name);
        let any = |_: &Path| false;
        self.exact(name, name)
            // A name that is whole has no further extension: `a.jpg.png` is the mask of `a.jpg`.
            .or_else(|| (!extensions::is_whole(name)).then(|| self.with_stem(name, name, &any)).flatten())
            .or_else(|| (bare != name).then(|| self.with_stem(bare, name, &any)).flatten())
    }

    fn exact(&self, file: &str, asked: &str) -> Option<Match> {
        let path = self.path.join(file);
        is_there(&path).then(|| Match { path, asked: asked.to_owned(), misfit: Misfit::default() })
    }

    /// The photo of a stem: the one whose name differs least from the one asked for, and of the extension that comes first.
    fn with_stem(&self, stem: &str, asked: &str, is_excluded: &dyn Fn(&Path) -> bool) -> Option<Match> {
        // Of "." and "..", which a file's name may end in, the path would name another folder.
        Path::new(stem).file_name()?;
        let wanted = self.path.join(stem);
        let wanted_name = wanted.file_name()?.to_string_lossy().into_owned();
        let folder = wanted.parent()?;
        let wanted_extension = asked.get(stem.len()..).unwrap_or_default().trim_start_matches('.');
        let misfit = |name: &OsString| {
            let path = Path::new(name);
            let found = path.file_stem().unwrap_or_default().to_string_lossy();
            let extension = path.extension().unwrap_or_default();
            let is_other = !extension.eq_ignore_ascii_case(wanted_extension);
            let case = found != wanted_name || (!is_other && extension != wanted_extension);
            let place = READ.iter().position(|e| extension.eq_ignore_ascii_case(e));
            (Misfit { folders: 0, extension: is_other, case }, place, name.clone())
        };
        let listing = self.listings.of(folder);
        let counts = |path: &Path| is_there(path) && !is_excluded(path);
        let photos = listing.get(&wanted_name.to_lowercase())?.iter();
        let (misfit, _, name) = photos.filter(|name| counts(&folder.join(name))).map(misfit).min()?;
        Some(Match { path: folder.join(name), asked: asked.to_owned(), misfit })
    }

    /// The mask of a photo: `name.ext.png`, the photo's own path, `name.png`, or Metashape's `name_mask.png`; of the name's
    /// folders, the longest end that is there counts, and of a name without folders, the only such mask in the folders
    /// inside. The photo itself and others (`is_photo`) are none.
    ///
    /// # Errors
    /// As [`Self::find`].
    pub fn find_mask(&self, name: &str, is_photo: &dyn Fn(&Path) -> bool) -> Result<Option<Match>> {
        if self.confined_to.is_some() {
            self.check(&format!("{name}.png"))?;
        }
        let whole = std::iter::once((0, name));
        let found = whole.chain(ends(name)).find_map(|(folders, end)| {
            let found = self.mask_at(end, is_photo)?;
            Some(Match {
                asked: name.to_owned(),
                misfit: Misfit { folders: found.misfit.folders + folders, ..found.misfit },
                ..found
            })
        });
        Ok(found.or_else(|| {
            let bare = without_extension(name);
            let stems = [name.to_owned(), bare.to_owned(), format!("{bare}_mask")];
            let mut fitting = stems.iter().filter(|_| self.is_deep && !name.contains('/')).map(|stem| {
                let found = self.stems_inside(&self.path, stem).into_iter();
                found.filter(|path| !is_photo(path)).collect::<Vec<_>>()
            });
            match &fitting.find(|found| !found.is_empty())?[..] {
                [only] => Some(inside(only, name)),
                _ => None,
            }
        }))
    }

    fn mask_at(&self, name: &str, is_photo: &dyn Fn(&Path) -> bool) -> Option<Match> {
        let ways: [&dyn Fn() -> Option<Match>; 5] = [
            &|| self.exact(&format!("{name}.png"), name),
            &|| self.exact(name, name),
            &|| self.with_stem(name, name, is_photo),
            &|| self.with_stem(without_extension(name), name, is_photo),
            &|| self.with_stem(&format!("{}_mask", without_extension(name)), name, is_photo),
        ];
        ways.into_iter().find_map(|way| way().filter(|found| !is_photo(found)))
    }
}

/// A photo in a folder inside the one that the name leads to. It counts as of another extension, so that a file to which the
/// name itself leads fits better.
fn inside(path: &Path, asked: &str) -> Match {
    let misfit = Misfit { folders: 1, extension: true, case: false };
    Match { path: path.to_owned(), asked: asked.to_owned(), misfit }
}

/// The ends of a path with slashes, longest first, and how many folders each lacks.
pub(super) fn ends(name: &str) -> impl Iterator<Item = (usize, &str)> {
    let starts: Vec<usize> = name.match_indices('/').map(|(at, _)| at + 1).collect();
    let first = starts.len().saturating_sub(ENDS_MAX);
    let ends = starts.into_iter().enumerate().skip(first).map(|(i, at)| (i + 1, &name[at..]));
    ends.filter(|(_, end)| is_plain(end))
}

/// Whether a path leads into the folder that it is joined to.
fn is_plain(path: &str) -> bool {
    Path::new(path).components().all(|part| matches!(part, Component::Normal(_) | Component::CurDir))
}

#[cfg(test)]
mod tests {
    use crate::capture::folder::CaptureFolder;
    use std::path::Path;

    fn write(folder: &Path, names: &[&str]) {
        for name in names {
            std::fs::create_dir_all(folder.join(name).parent().unwrap()).unwrap();
            std::fs::write(folder.join(name), b"").unwrap();
        }
    }

    #[test]
    fn photos_are_found_by_stem_in_any_case_and_extension() {
        let folder = tempfile::tempdir().unwrap();
        write(
            folder.path(),
            &[
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
                "I.jpg",
                "i.webp",
                "left.cam.png",
            ],
        );
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
            ("i.jpg", Some("I.jpg")),
            ("i.png", Some("i.webp")),
            ("left.cam", Some("left.cam.png")),
            ("day\\e.exr", Some("day/e.exr")),
            (".\\day\\e.jpg", Some("./day/e.exr")),
            ("C:\\shots\\day\\e.jpg", Some("day/e.exr")),
            ("images/a.png", Some("a.webp")),
            ("../other/day/e.exr", Some("day/e.exr")),
            ("day/a.png", Some("a.webp")),
            ("f.0001", Some("f.0001.png")),
            ("f.0002", None),
            ("g.jpg", None),
            ("h.jpg", None),
            ("", None),
            ("/", None),
        ] {
            let found = photos.find(name).unwrap().map(|found| found.path);
            assert_eq!(found, expected.map(|expected| folder.path().join(expected)), "{name}");
        }
    }

    #[test]
    fn the_mask_of_a_photo_is_not_taken_for_it() {
        let folder = tempfile::tempdir().unwrap();
        write(
            folder.path(),
            &["a.jpg.png", "b.DNG.png", "c.0001.png", "d.jpg.png", "d.webp", "E.JPG.PNG", "k_mask.png"],
        );
        let photos = CaptureFolder::new(folder.path(), None, false).unwrap().photos("");
        for name in ["a.jpg", "a.JPG", "A.jpeg", "a", "b.DNG", "e.jpg", "e"] {
            assert_eq!(photos.find(name).unwrap(), None, "{name}");
        }
        for (name, file) in [("c.0001", "c.0001.png"), ("d.jpg", "d.webp"), ("a.jpg.png", "a.jpg.png")] {
            let found = photos.find(name).unwrap().unwrap();
            assert_eq!(found.path, folder.path().join(file), "negative control: {name}");
        }
        for (name, file) in
            [("a.jpg", "a.jpg.png"), ("d.jpg", "d.jpg.png"), ("E.JPG", "E.JPG.PNG"), ("k.jpg", "k_mask.png")]
        {
            assert_eq!(photos.find_mask(name, &|_| false).unwrap().unwrap().path, folder.path().join(file));
        }
    }

    #[test]
    fn files_that_differ_less_from_the_name_fit_better() {
        let folder = tempfile::tempdir().unwrap();
        write(folder.path(), &["a.jpg"]);
        let photos = CaptureFolder::new(folder.path(), None, false).unwrap().photos("");
        let names = ["a.jpg", "A.jpg", "a.png", "A.png", "x/a.jpg", "x/A.jpg", "x/y/a.jpg"];
        let misfits = names.map(|name| photos.find(name).unwrap().unwrap().misfit);
        assert!(misfits.is_sorted_by(|a, b| a < b), "{misfits:?}");
    }
}
