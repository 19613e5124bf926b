//! What to do about photos without poses, videos and formats that we do not read: commands of other programs.

use super::extensions::{self, DEPTH_MAX, VIDEOS};
use super::paths;
use crate::text::shell_word;
use std::collections::{BTreeMap, BTreeSet};
use std::fs::File;
use std::io::Read as _;
use std::path::{Path, PathBuf};

/// Brands of files in the ISO container (ISO/IEC 14496-12) that hold an image, and the name of their format.
const BRANDS: [(&[u8; 4], &str); 7] = [
    (b"avif", "AVIF"),
    (b"avis", "AVIF"),
    (b"heic", "HEIC"),
    (b"heix", "HEIC"),
    (b"hevc", "HEIC"),
    (b"mif1", "HEIC"),
    (b"msf1", "HEIC"),
];

/// How to make a capture of what the user named: a folder of photos or a video, or a file of these; `None` if there is
/// neither.
pub(super) fn for_path(path: &Path) -> Option<String> {
    if path.is_dir() {
        return for_photos(path).or_else(|| for_video(&first_video(path)?));
    }
    for_video(path).or_else(|| {
        let is_photo = extensions::is_photo(path);
        let folder = path.parent().map(|p| if p.as_os_str().is_empty() { Path::new(".") } else { p });
        let advice = for_photos(folder.filter(|_| is_photo)?)?;
        Some(format!("a single photo; a capture is a folder of photos with poses: {advice}"))
    })
}

/// How to make a capture of a folder of photos; `None` if it holds none.
fn for_photos(folder: &Path) -> Option<String> {
    let mut found = photos_in(folder);
    let images = folder.join("images");
    if !found.contains_key(folder) && found.keys().any(|inner| inner.starts_with(&images)) {
        found.retain(|inner, _| inner.starts_with(&images));
    }
    let photos = found.keys().cloned().reduce(common)?;
    let photos = if photos.starts_with(&images) { images.clone() } else { photos };
    let count: usize = found.values().map(BTreeSet::len).sum();
    let what = if count == 1 {
        format!("the photo in {} has no pose yet", crate::text::path(&photos))
    } else {
        format!("the {count} photos in {} have no poses yet", crate::text::path(&photos))
    };
    Some(format!("{what}. {}", capture(&photos)))
}

/// The commands that make a capture of photos or a video, and train it.
fn capture(source: &Path) -> String {
    // Beside the source, whose name may end in a dot or a slash.
    let name = source.file_stem().map_or_else(|| "new".into(), |name| name.to_string_lossy().into_owned());
    let out = shell_word(&source.with_file_name(format!("{name}-capture")));
    let source = shell_word(source);
    format!("Find the poses, and train:\n  litetex capture {source} -o {out}\n  litetex train {out} -o RUN")
}

/// The photos of a folder and of the folders in it.
fn photos_in(folder: &Path) -> BTreeMap<PathBuf, BTreeSet<PathBuf>> {
    let mut found = BTreeMap::<PathBuf, BTreeSet<PathBuf>>::new();
    let mut folders = vec![(folder.to_owned(), 1)];
    while let Some((folder, depth)) = folders.pop() {
        for path in std::fs::read_dir(&folder).into_iter().flatten().flatten().map(|entry| entry.path()) {
            if path.is_dir() {
                if depth < DEPTH_MAX && !is_of_macos(&path) {
                    folders.push((path, depth + 1));
                }
            } else if extensions::is_photo(&path) && !is_of_macos(&path) {
                found.entry(folder.clone()).or_default().insert(path);
            }
        }
    }
    found
}

fn is_of_macos(path: &Path) -> bool {
    path.file_name().is_some_and(paths::is_of_macos)
}

/// The folder that two paths share.
fn common(a: PathBuf, b: PathBuf) -> PathBuf {
    a.components().zip(b.components()).take_while(|(a, b)| a == b).map(|(a, _)| a).collect()
}

fn first_video(folder: &Path) -> Option<PathBuf> {
    let entries = std::fs::read_dir(folder).ok()?.flatten().map(|entry| entry.path());
    entries.filter(|path| extensions::is_of(path, &VIDEOS)).min()
}

/// How to make a capture of a video; `None` if the file is none.
fn for_video(file: &Path) -> Option<String> {
    extensions::is_of(file, &VIDEOS)
        .then(|| format!("{} is a video. {}", crate::text::path(file), capture(file)))
}

/// How to convert an image that we do not read; `None` if it is not HEIC or AVIF.
pub(super) fn for_image(file: &Path) -> Option<String> {
    let mut head = [0; 12];
    File::open(file).and_then(|mut f| f.read_exact(&mut head)).ok()?;
    let (_, format) = BRANDS.iter().find(|(brand, _)| head[4..8] == *b"ftyp" && head[8..] == brand[..])?;
    Some(format!(
        "{format} is not read; convert it with ImageMagick (\"convert\" in place of \"magick\" in version 6, as Debian 12 has it): \
         magick {} {}",
        shell_word(file),
        shell_word(&file.with_extension("jpg"))
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The advice about a folder with empty files of these names, with the folder written as F.
    fn advice(names: &[&str]) -> Option<String> {
        let folder = tempfile::tempdir().unwrap();
        for name in names {
            let file = folder.path().join(name);
            std::fs::create_dir_all(file.parent().unwrap()).unwrap();
            std::fs::write(file, "").unwrap();
        }
        for_path(folder.path()).map(|text| text.replace(&folder.path().display().to_string(), "F"))
    }

    #[test]
    fn folders_of_photos_get_the_commands_that_make_a_capture() {
        assert_eq!(advice(&["images/notes.txt", "clip.txt"]), None, "negative control: no photos");
        for (names, photos, made) in [
            (&["a.JPG", "b.png"][..], "F", "F-capture"),
            (&["images/a.jpg", "images/b.jpg", "thumbnails/a.jpg"], "F/images", "F/images-capture"),
            (&["images/a/1.jpg", "images/b/1.jpg"], "F/images", "F/images-capture"),
            (&["my photos/1.jpg", "my photos/2.webp"], "'F/my photos'", "'F/my photos-capture'"),
            (&["day/1.HEIC", "night/1.jpg"], "F", "F-capture"),
            (&["p/1.jpg", "p/2.tif", "p/._1.jpg", "__MACOSX/p/._2.jpg"], "F/p", "F/p-capture"),
        ] {
            let text = advice(names).unwrap();
            assert!(text.starts_with("the 2 photos in "), "{text}");
            let commands = format!("litetex capture {photos} -o {made}\n  litetex train {made} -o RUN");
            assert!(text.contains(&commands), "{text}");
        }
    }

    #[test]
    fn a_single_photo_leads_to_its_folder() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("a.HEIC");
        std::fs::write(&file, "").unwrap();
        let text = for_path(&file).unwrap();
        assert!(text.starts_with("a single photo") && text.contains("litetex capture"), "{text}");
        assert_eq!(for_path(&file.with_extension("zip")), None);
    }

    #[test]
    fn videos_get_the_command_that_makes_a_capture() {
        let text = for_path(Path::new("it's.MOV")).unwrap();
        assert!(text.contains(r"litetex capture 'it'\''s.MOV' -o 'it'\''s-capture'"), "{text}");
        let text = advice(&["notes.txt", "b.3gp", "a.wmv"]).unwrap();
        assert!(text.contains("capture F/a.wmv -o F/a-capture"), "{text}");
        assert!(!advice(&["a.mp4", "b.jpg"]).unwrap().contains("a.mp4"), "photos come first");
    }

    #[test]
    fn images_in_the_iso_container_are_named_with_a_command() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("a.heic");
        for (brand, name) in [(b"heic", "HEIC"), (b"avif", "AVIF")] {
            std::fs::write(&file, [b"\0\0\0\x18ftyp", &brand[..], b"\0\0\0\0"].concat()).unwrap();
            let text = for_image(&file).unwrap();
            assert!(text.starts_with(name) && text.contains("magick") && text.ends_with("a.jpg"), "{text}");
        }
        std::fs::write(&file, b"\0\0\0\x18ftypisom\0\0\0\0").unwrap();
        assert_eq!(for_image(&file), None, "negative control: a video");
    }
}
