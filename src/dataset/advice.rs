//! What to do about photos without poses, videos and formats that we do not read: commands of other programs.

use std::fs::File;
use std::io::Read as _;
use std::path::Path;

/// Extensions of photos, in lower case.
const PHOTOS: [&str; 9] = ["jpg", "jpeg", "png", "webp", "exr", "heic", "heif", "avif", "tif"];

/// Extensions of videos, in lower case.
const VIDEOS: [&str; 7] = ["mp4", "mov", "m4v", "mkv", "avi", "webm", "mts"];

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

/// How to make a capture of a folder of photos; `None` if it holds none.
pub(super) fn for_photos(folder: &Path) -> Option<String> {
    let inner = folder.join("images");
    let photos = if inner.is_dir() { inner } else { folder.to_owned() };
    let entries = std::fs::read_dir(&photos).ok()?.flatten();
    let count = entries.filter(|e| has_extension(&e.path(), &PHOTOS)).count();
    (count > 0).then(|| {
        let commands = colmap(folder, &photos);
        format!("the {count} photos in {} have no poses yet. {commands}", crate::text::path(&photos))
    })
}

/// How to make a capture of a video; `None` if the file is none.
pub(super) fn for_video(file: &Path) -> Option<String> {
    has_extension(file, &VIDEOS).then(|| {
        let capture = file.with_extension("");
        let photos = capture.join("images");
        format!(
            "a video. Extract photos, two for each second:\n  mkdir -p {}\n  ffmpeg -i {} -vf fps=2 -q:v 2 {}\n{}",
            shell_word(&photos),
            shell_word(file),
            shell_word(&photos.join("%04d.jpg")),
            colmap(&capture, &photos)
        )
    })
}

/// How to convert an image that we do not read; `None` if it is not HEIC or AVIF.
pub(super) fn for_image(file: &Path) -> Option<String> {
    let mut head = [0; 12];
    File::open(file).and_then(|mut f| f.read_exact(&mut head)).ok()?;
    let (_, format) = BRANDS.iter().find(|(brand, _)| head[4..8] == *b"ftyp" && head[8..] == brand[..])?;
    Some(format!(
        "{format} is not read; convert it with ImageMagick: magick {} {}",
        shell_word(file),
        shell_word(&file.with_extension("jpg"))
    ))
}

/// The commands that find the poses of photos, with options as COLMAP 3.6 to 3.13 and glomap 1 document them.
fn colmap(capture: &Path, photos: &Path) -> String {
    let database = shell_word(&capture.join("database.db"));
    let (photos, model) = (shell_word(photos), shell_word(&capture.join("sparse")));
    format!(
        "Find the poses with COLMAP (3.6 or newer; \"glomap mapper\" takes the same arguments and is faster):\n  \
         mkdir -p {model}\n  \
         colmap feature_extractor --database_path {database} --image_path {photos}\n  \
         colmap exhaustive_matcher --database_path {database}\n  \
         colmap mapper --database_path {database} --image_path {photos} --output_path {model}"
    )
}

fn has_extension(path: &Path, extensions: &[&str]) -> bool {
    let extension = path.extension().and_then(|e| e.to_str()).map(str::to_lowercase);
    extension.is_some_and(|e| extensions.contains(&e.as_str()))
}

/// A path as one word of a POSIX shell; a path that begins like an option gets a folder before it.
fn shell_word(path: &Path) -> String {
    let mut text = path.display().to_string();
    if text.starts_with('-') {
        text.insert_str(0, "./");
    }
    let is_plain = |c: char| c.is_ascii_alphanumeric() || "/._-+%:@".contains(c);
    if !text.is_empty() && text.chars().all(is_plain) {
        text
    } else {
        format!("'{}'", text.replace('\'', r"'\''"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn folders_of_photos_get_the_commands_that_find_poses() {
        let folder = tempfile::tempdir().unwrap();
        let root = folder.path().join("my photos");
        std::fs::create_dir_all(root.join("images")).unwrap();
        std::fs::write(root.join("images/notes.txt"), "").unwrap();
        assert_eq!(for_photos(&root), None, "negative control: no photos");
        for name in ["a.JPG", "b.heic"] {
            std::fs::write(root.join("images").join(name), "").unwrap();
        }
        let text = for_photos(&root).unwrap();
        let images = format!("--image_path '{}/images'", root.display());
        assert!(text.starts_with("the 2 photos in ") && text.matches(&images).count() == 2, "{text}");
        assert!(text.contains(&format!("mapper --database_path '{}/database.db'", root.display())), "{text}");
    }

    #[test]
    fn videos_get_the_command_that_extracts_photos() {
        let text = for_video(Path::new("it's.MOV")).unwrap();
        assert!(
            text.contains(r"ffmpeg -i 'it'\''s.MOV' -vf fps=2 -q:v 2 'it'\''s/images/%04d.jpg'"),
            "{text}"
        );
        assert_eq!(for_video(Path::new("a.zip")), None);
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

    #[test]
    fn paths_are_quoted_for_the_shell() {
        for (path, word) in [("a/b-1.jpg", "a/b-1.jpg"), ("-x", "./-x"), ("a b", "'a b'"), ("$(x)", "'$(x)'")]
        {
            assert_eq!(shell_word(Path::new(path)), word);
        }
    }
}
