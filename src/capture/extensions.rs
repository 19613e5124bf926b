//! The extensions of photos: those that are read, those of photos that have to be converted, and those that only tell a
//! name with an extension from one without.

use std::path::Path;

/// Of photos that are read, in lower case. Of several files for one name, the extension that comes first is taken. `jpe`,
/// `jif`, `jfif` and `mpo` are JPEG files; of the two photos of the last, the first is read.
pub(crate) const READ: [&str; 11] =
    ["png", "jpg", "jpeg", "jpe", "jif", "jfif", "mpo", "exr", "webp", "tif", "tiff"];

/// Of photos that have to be converted.
pub(crate) const CONVERTED: [&str; 4] = ["heic", "heif", "hif", "avif"];

/// Of videos, in lower case.
pub(crate) const VIDEOS: [&str; 12] =
    ["mp4", "mov", "m4v", "mkv", "avi", "webm", "mts", "m2ts", "3gp", "mpg", "mpeg", "wmv"];

/// Levels of folders in which photos are looked for.
pub(crate) const DEPTH_MAX: usize = 3;

/// Of other images that poses may name.
const OTHER: [&str; 10] = ["jp2", "jxl", "bmp", "gif", "tga", "hdr", "ppm", "pgm", "pnm", "insp"];

/// Of the raw files of cameras, which begin like TIFF files.
const RAW: [&str; 11] = ["dng", "cr2", "cr3", "nef", "arw", "raf", "orf", "rw2", "pef", "srw", "raw"];

/// Whether a file has one of these extensions, in any case.
pub(crate) fn is_of(path: &Path, extensions: &[&str]) -> bool {
    path.extension().is_some_and(|e| extensions.iter().any(|known| e.eq_ignore_ascii_case(known)))
}

/// Whether a file is a photo that is read.
pub fn is_read(path: &Path) -> bool {
    is_of(path, &READ)
}

/// Whether a file is a photo, which may have to be converted.
pub(crate) fn is_photo(path: &Path) -> bool {
    is_read(path) || is_of(path, &CONVERTED)
}

/// Whether a file that begins with these bytes is an image, which may be read whatever its name; raw files are not.
pub(crate) fn is_image(path: &Path, head: &[u8]) -> bool {
    image::guess_format(head).is_ok() && !is_of(path, &RAW)
}

/// Whether a name ends in the extension of an image, so that it is whole: `a.jpg.png` is no photo of `a.jpg`, but the
/// mask of that photo as COLMAP names it.
pub(crate) fn is_whole(name: &str) -> bool {
    is_photo(Path::new(name)) || is_of(Path::new(name), &OTHER) || is_of(Path::new(name), &RAW)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::capture::fixtures::Scene;
    use crate::capture::{Capture, LoadOptions};
    use crate::views::ViewSource as _;
    use image::ImageFormat;
    use std::io::Write as _;

    /// A capture whose photos have one extension on disk and another in the poses.
    fn written(root: &Path, format: ImageFormat, on_disk: &str, in_poses: &str) {
        let mut scene = Scene::ring(3);
        std::fs::create_dir_all(root.join("images")).unwrap();
        for image in &mut scene.images {
            let stem = image.name.strip_suffix(".png").unwrap().to_owned();
            let photo = image::RgbImage::from_pixel(12, 8, image::Rgb([9, 90, 200]));
            photo.save_with_format(root.join(format!("images/{stem}{on_disk}")), format).unwrap();
            image.name = format!("{stem}{in_poses}");
        }
        scene.write_binary(&root.join("sparse/0"));
    }

    fn zipped(root: &Path, archive: &Path) {
        let mut zip = zip::ZipWriter::new(std::fs::File::create(archive).unwrap());
        for folder in ["images", "sparse/0"] {
            for file in std::fs::read_dir(root.join(folder)).unwrap().map(|entry| entry.unwrap()) {
                let name = format!("{folder}/{}", file.file_name().to_str().unwrap());
                zip.start_file(name, zip::write::SimpleFileOptions::default()).unwrap();
                zip.write_all(&std::fs::read(file.path()).unwrap()).unwrap();
            }
        }
        zip.finish().unwrap();
    }

    #[test]
    fn photos_of_every_extension_are_found_by_stem_in_folders_and_archives() {
        use ImageFormat::{Jpeg, Png, Tiff, WebP};
        for (format, on_disk, in_poses) in [
            (Tiff, ".tif", ".tif"),
            (Tiff, ".TIFF", ".jpg"),
            (Tiff, ".tiff", ""),
            (Jpeg, ".jfif", ".jfif"),
            (Jpeg, ".JFIF", ".jpg"),
            (Jpeg, ".jpe", ""),
            (Jpeg, ".MPO", ".JPG"),
            (WebP, ".webp", ".jpg"),
            (Png, ".png", ".tif"),
            // No extension that anybody knows: by the whole name.
            (Jpeg, ".jpg_large", ".jpg_large"),
            (Png, "", ""),
        ] {
            let folder = tempfile::tempdir().unwrap();
            let (root, archive) = (folder.path().join("capture"), folder.path().join("capture.zip"));
            written(&root, format, on_disk, in_poses);
            zipped(&root, &archive);
            for path in [&root, &archive] {
                let capture = Capture::load(path, &LoadOptions::default())
                    .unwrap_or_else(|e| panic!("{on_disk} for {in_poses}: {e}"));
                let blue = capture.target(0).unwrap().rgb[2];
                assert!(capture.views.len() == 3 && blue.abs_diff(200) < 8, "{on_disk} for {in_poses}");
            }
        }
        // Negative control: of no image, neither by name nor by content.
        let folder = tempfile::tempdir().unwrap();
        written(folder.path(), Png, ".txt", ".jpg");
        let error = Capture::load(folder.path(), &LoadOptions::default()).err().unwrap();
        assert!(error.exit_code() == 3 && error.to_string().contains("photos of 3 of 3 views are missing"));
    }

    #[test]
    fn images_are_told_by_their_first_bytes_and_raw_files_by_their_names() {
        assert!(is_image(Path::new("a"), b"\xff\xd8\xff\xe0") && is_image(Path::new("a.x"), b"II*\0"));
        assert!(!is_image(Path::new("a.NEF"), b"II*\0") && !is_image(Path::new("a"), b"solid"));
    }
}
