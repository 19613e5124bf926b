//! Captures in a ZIP archive: unpacked into a temporary folder that exists as long as the capture does.

use super::extensions;
use super::formats::unread;
use super::paths::is_of_macos;
use crate::text::quoted;
use crate::{Error, Result};
use std::fs::File;
use std::io::{BufReader, Read as _};
use std::path::{Path, PathBuf};
use zip::ZipArchive;
use zip::result::ZipError;

/// Extensions of the files that a capture may need next to its photos; everything else stays packed.
const EXTENSIONS: [&str; 7] = ["bin", "txt", "json", "ply", "csv", "xml", "xmp"];

/// How much of a file tells whether it is an image.
const HEAD_BYTES: u64 = 32;

/// The file of Record3D's archives (.r3d) that has no extension.
const RECORD3D: &str = "metadata";

/// Largest ratio of unpacked to packed size: text models shrink to a quarter, ZIP bombs to a thousandth.
const MAX_RATIO: u64 = 100;

/// What small archives may hold whatever the ratio.
const ALWAYS_ALLOWED_BYTES: u64 = 64 << 20;

/// A temporary folder, removed with its content when dropped.
pub(crate) struct Unpacked {
    folder: PathBuf,
    archive: PathBuf,
}

impl Drop for Unpacked {
    fn drop(&mut self) {
        // Nothing could be done about a failure; the system clears its temporary folder.
        let _ = std::fs::remove_dir_all(&self.folder);
    }
}

impl Unpacked {
    fn new(archive: &Path) -> Result<Self> {
        let base = std::env::temp_dir();
        let process = std::process::id();
        for attempt in 0..10_000 {
            let folder = base.join(format!("litetex-{process}-{attempt}"));
            match std::fs::create_dir(&folder) {
                Ok(()) => return Ok(Self { folder, archive: archive.to_owned() }),
                Err(e) if e.kind() == std::io::ErrorKind::AlreadyExists => {}
                Err(e) => return Err(Error::io(folder, e)),
            }
        }
        Err(Error::invalid(base, "too many leftover litetex-* folders: remove them"))
    }

    /// A path in the temporary folder as one in the archive, which is the file that users know.
    pub fn in_archive(&self, path: &Path) -> PathBuf {
        match path.strip_prefix(&self.folder) {
            Ok(inside) if inside.as_os_str().is_empty() => self.archive.clone(),
            Ok(inside) => self.archive.join(inside),
            Err(_) => path.to_owned(),
        }
    }

    /// A message in which paths in the temporary folder are those in the archive.
    pub fn in_words(&self, text: &str) -> String {
        text.replace(&*self.folder.to_string_lossy(), &self.archive.to_string_lossy())
    }

    /// The same error about the archive.
    pub fn name_archive(&self, error: Error) -> Error {
        match error {
            Error::InvalidInput { path, what } => {
                Error::InvalidInput { path: self.in_archive(&path), what: self.in_words(&what) }
            }
            Error::Unsupported { path, what } => {
                Error::Unsupported { path: self.in_archive(&path), what: self.in_words(&what) }
            }
            Error::Io { path, cause } => Error::Io { path: self.in_archive(&path), cause },
            other => other,
        }
    }

    /// The capture's folder: inside a single top-level folder, where the archive has one.
    pub fn root(&self) -> PathBuf {
        let mut root = self.folder.clone();
        loop {
            let mut entries: Vec<_> = std::fs::read_dir(&root).into_iter().flatten().flatten().collect();
            // A note beside the folder is no part of the capture.
            entries.retain(|entry| !is_note(&entry.path()));
            match &entries[..] {
                [only] if only.path().is_dir() && only.file_name() != "sparse" => root = only.path(),
                _ => return root,
            }
        }
    }
}

/// Whether a file is a text that is no model of COLMAP.
fn is_note(path: &Path) -> bool {
    let is_text = path.extension().is_some_and(|e| e.eq_ignore_ascii_case("txt"));
    let of_model = ["cameras", "images", "points3D", "rigs", "frames"];
    is_text
        && path.is_file()
        && path.file_stem().is_some_and(|stem| of_model.iter().all(|name| stem != *name))
}

/// Whether a path names an archive.
pub(crate) fn is_archive(path: &Path) -> bool {
    let is_one = |extension| path.extension().is_some_and(|e| e.eq_ignore_ascii_case(extension));
    path.is_file() && (is_one("zip") || is_one("r3d"))
}

fn our_error(path: &Path, element: &str, error: ZipError) -> Error {
    match error {
        ZipError::Io(e) if e.kind() == std::io::ErrorKind::StorageFull => Error::io(path, e),
        ZipError::UnsupportedArchive(what) => {
            unsupported!(path, "{element}: {what}; supported: stored and deflated files: unpack it yourself")
        }
        e @ ZipError::CompressionMethodNotSupported(_) => {
            unsupported!(path, "{element}: {e}; supported: stored and deflated files: unpack it yourself")
        }
        e => invalid!(path, "{element}: {e}; copy the archive again"),
    }
}

/// Unpacks what a capture may need.
pub(crate) fn unpack(path: &Path) -> Result<Unpacked> {
    let file = File::open(path).map_err(|e| Error::io(path, e))?;
    let archive_bytes = file.metadata().map_err(|e| Error::io(path, e))?.len();
    let mut allowed_bytes = archive_bytes.saturating_mul(MAX_RATIO).max(ALWAYS_ALLOWED_BYTES);
    let mut archive =
        ZipArchive::new(BufReader::new(file)).map_err(|e| our_error(path, "not a ZIP archive", e))?;
    let unpacked = Unpacked::new(path)?;
    for index in 0..archive.len() {
        let element = format!("file {} of {}", index + 1, archive.len());
        let mut entry = archive.by_index(index).map_err(|e| our_error(path, &element, e))?;
        let Some(inside) = entry.enclosed_name() else {
            let name = String::from_utf8_lossy(entry.name_raw());
            return Err(invalid!(
                path,
                "{element} ({}) points outside the archive; do not trust it",
                quoted(&name)
            ));
        };
        // Links are skipped, or they would be written as files with the text of their target.
        let is_of_macos = inside.components().any(|part| is_of_macos(part.as_os_str()));
        if is_of_macos || entry.is_dir() || entry.is_symlink() {
            continue;
        }
        let broken = |e| {
            our_error(path, &format!("{element} ({})", quoted(&inside.to_string_lossy())), ZipError::Io(e))
        };
        let mut head = Vec::new();
        let begun = entry.by_ref().take(HEAD_BYTES).read_to_end(&mut head);
        // Photos that are not read are refused with the command that converts them.
        let is_needed = extensions::is_photo(&inside)
            || extensions::is_of(&inside, &EXTENSIONS)
            || extensions::is_of(&inside, &unread::EXTENSIONS)
            || inside.ends_with(RECORD3D)
            || extensions::is_image(&inside, &head);
        if !is_needed {
            continue;
        }
        begun.map_err(broken)?;
        let target = unpacked.folder.join(&inside);
        let folder = target.parent().unwrap_or(&unpacked.folder);
        std::fs::create_dir_all(folder).map_err(|e| Error::io(folder, e))?;
        let mut out = File::create(&target).map_err(|e| Error::io(&target, e))?;
        // A byte beyond the bound shows that there is more.
        let mut content = head.as_slice().chain(entry.by_ref()).take(allowed_bytes + 1);
        let copied = std::io::copy(&mut content, &mut out).map_err(broken)?;
        allowed_bytes = allowed_bytes.checked_sub(copied).ok_or_else(|| {
            invalid!(
                path,
                "holds more than {MAX_RATIO} times its own size; unpack it yourself if you trust it"
            )
        })?;
    }
    Ok(unpacked)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::capture::fixtures::Scene;
    use crate::capture::{Capture, LoadOptions};
    use crate::views::ViewSource as _;
    use std::io::Write as _;
    use tempfile::tempdir;
    use zip::write::SimpleFileOptions;

    fn zipped(path: &Path, files: &[(&str, Vec<u8>)]) {
        let mut archive = zip::ZipWriter::new(File::create(path).unwrap());
        for (name, bytes) in files {
            let options = SimpleFileOptions::default().compression_method(zip::CompressionMethod::Deflated);
            archive.start_file(*name, options).unwrap();
            archive.write_all(bytes).unwrap();
        }
        archive.finish().unwrap();
    }

    #[test]
    fn a_zipped_capture_loads_like_its_folder_and_cleans_up() {
        let folder = tempdir().unwrap();
        let scene = Scene::ring(3);
        let plain = folder.path().join("plain");
        scene.write(&plain);
        let mut files = vec![
            ("garden/sparse/0/cameras.bin", scene.cameras_bin()),
            ("garden/sparse/0/images.bin", scene.images_bin()),
            ("garden/sparse/0/points3D.bin", scene.points_bin()),
            ("garden/notes.md", b"not needed".to_vec()),
            // As macOS packs it: attributes of each file in a folder beside, or next to it.
            ("__MACOSX/garden/images/._p01.png", vec![0; 32]),
            ("__MACOSX/._garden.txt", vec![0; 32]),
            ("garden/._notes.csv", vec![0; 32]),
            ("README.txt", b"a note".to_vec()),
            ("garden/images/._p01.png", vec![0; 32]),
        ];
        let names: Vec<String> = scene.images.iter().map(|i| format!("garden/images/{}", i.name)).collect();
        for (name, image) in names.iter().zip(&scene.images) {
            files.push((name, std::fs::read(plain.join("images").join(&image.name)).unwrap()));
        }
        let archive = folder.path().join("garden.zip");
        zipped(&archive, &files);
        let options = LoadOptions::default();
        let (a, b) = (Capture::load(&plain, &options).unwrap(), Capture::load(&archive, &options).unwrap());
        assert_eq!(b.name, "garden");
        assert_eq!(b.report, a.report, "files of macOS are no photos without a pose");
        for view in 0..3 {
            assert_eq!(a.target(view).unwrap(), b.target(view).unwrap());
            assert_eq!(a.views[view].camera, b.views[view].camera);
        }
        assert_eq!(b.root, archive);
        assert_eq!(b.poses, archive.join("garden/sparse/0"));
        let unpacked = b.unpacked.as_ref().unwrap().root();
        assert!(unpacked.is_dir());
        drop(b);
        assert!(!unpacked.exists());
    }

    #[test]
    fn escaping_exploding_and_damaged_archives_are_errors() {
        let folder = tempdir().unwrap();
        let archive = folder.path().join("a.zip");
        zipped(&archive, &[("../escaped.txt", b"x".to_vec())]);
        let text = unpack(&archive).err().unwrap().to_string();
        assert!(text.contains("file 1 of 1 (\"../escaped.txt\") points outside the archive"), "{text}");
        zipped(&archive, &[("zeros.bin", vec![0; ALWAYS_ALLOWED_BYTES as usize + 1])]);
        assert!(unpack(&archive).err().unwrap().to_string().contains("times its own size"));
        zipped(&archive, &[("a.bin", (0..=255).collect())]);
        let whole = std::fs::read(&archive).unwrap();
        for length in 0..whole.len() {
            std::fs::write(&archive, &whole[..length]).unwrap();
            assert!(unpack(&archive).is_err(), "cut at {length}");
        }
    }
}
