//! Where images and masks lie, how large they are, and whether that fits their cameras. Nothing is
//! decoded here.

use super::exr_photo;
use super::lens::Lens;
use crate::{Error, Result};
use image::metadata::Orientation;
use image::{ImageDecoder as _, ImageReader};
use std::fs::File;
use std::io::BufReader;
use std::path::{Path, PathBuf};

/// Extensions of the images that can be read.
const EXTENSIONS: [&str; 8] = ["png", "jpg", "jpeg", "exr", "PNG", "JPG", "JPEG", "EXR"];

/// A folder in which images are looked up by the names that pose files give them.
#[derive(Clone, Debug)]
pub(crate) struct ImageFolder {
    path: PathBuf,
}

impl ImageFolder {
    pub fn at(path: &Path) -> Self {
        Self { path: path.to_owned() }
    }

    pub fn path(&self) -> &Path {
        &self.path
    }

    /// A folder given by the user: absolute, relative to the capture or to the working directory.
    pub fn given(root: &Path, folder: &Path, option: &str) -> Result<Self> {
        for path in [root.join(folder), folder.to_owned()] {
            if path.is_dir() {
                return Ok(Self { path });
            }
        }
        Err(Error::invalid(
            root.join(folder),
            format!("no such folder; {option} takes a folder inside the capture or an absolute path"),
        ))
    }

    /// The image of a name with or without extension; scaled copies may have another extension.
    pub fn find(&self, name: &str) -> Option<PathBuf> {
        let exact = self.path.join(name);
        if exact.is_file() {
            return Some(exact);
        }
        let replaced = Path::new(name).with_extension("");
        let replaced = replaced.to_string_lossy();
        [name, &replaced]
            .into_iter()
            .flat_map(|stem| EXTENSIONS.map(|e| self.path.join(format!("{stem}.{e}"))))
            .find(|p| p.is_file())
    }

    /// The mask of an image: `name.png`, `name.ext.png` or the image's own path.
    pub fn find_mask(&self, name: &str) -> Option<PathBuf> {
        let double = self.path.join(format!("{name}.png"));
        if double.is_file() {
            return Some(double);
        }
        self.find(name)
    }

    /// Number of images in the folder and its subfolders.
    pub fn count(&self) -> usize {
        let mut folders = vec![self.path.clone()];
        let mut count = 0;
        while let Some(folder) = folders.pop() {
            for entry in std::fs::read_dir(folder).into_iter().flatten().flatten() {
                // `file_type` does not follow links: no endless walks.
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

/// A reader that goes by the file's content, not by its extension.
pub(crate) fn open(path: &Path) -> Result<ImageReader<BufReader<File>>> {
    let reader = ImageReader::open(path).map_err(|e| Error::io(path, e))?;
    reader.with_guessed_format().map_err(|e| Error::io(path, e))
}

/// Our error for what the image library says.
pub(crate) fn image_error(path: &Path, error: image::ImageError) -> Error {
    match error {
        image::ImageError::IoError(e) if e.kind() != std::io::ErrorKind::UnexpectedEof => Error::io(path, e),
        image::ImageError::Unsupported(e) => {
            Error::unsupported(path, format!("{e}; images must be PNG, JPEG or EXR: convert this one"))
        }
        e => Error::invalid(
            path,
            format!("unreadable image: {e}; expected PNG, JPEG or EXR: replace the file or remove it"),
        ),
    }
}

/// Stored size of an image and the turn that its EXIF data ask for.
pub(crate) fn image_header(path: &Path) -> Result<((u32, u32), Orientation)> {
    if exr_photo::is_exr(path) {
        return Ok((exr_photo::size(path)?, Orientation::NoTransforms));
    }
    let mut decoder = open(path)?.into_decoder().map_err(|e| image_error(path, e))?;
    let orientation = decoder.orientation().unwrap_or(Orientation::NoTransforms);
    let (width, height) = decoder.dimensions();
    if width == 0 || height == 0 {
        return Err(Error::invalid(path, format!("the image is {width}x{height}")));
    }
    Ok(((width, height), orientation))
}

/// Stored size of an image.
pub(crate) fn image_size(path: &Path) -> Result<(u32, u32)> {
    image_header(path).map(|(size, _)| size)
}

/// Whether an image is the camera's image or a scaled copy: sizes that were rounded either way fit.
fn same_shape((width, height): (u32, u32), lens: &Lens) -> bool {
    let camera = (f64::from(lens.pinhole.width_px), f64::from(lens.pinhole.height_px));
    let (width, height) = (f64::from(width), f64::from(height));
    // Scaled by the longer side, whose rounding matters least.
    if camera.0 >= camera.1 {
        (height - camera.1 * width / camera.0).abs() <= 1.0
    } else {
        (width - camera.0 * height / camera.1).abs() <= 1.0
    }
}

/// An image's size as its camera means it, and whether it must be turned for that.
pub(crate) fn fit(path: &Path, name: &str, lens: &Lens) -> Result<((u32, u32), Orientation)> {
    let (stored, orientation) = image_header(path)?;
    if same_shape(stored, lens) {
        // The solver saw the pixels as stored.
        return Ok((stored, Orientation::NoTransforms));
    }
    let turns = matches!(
        orientation,
        Orientation::Rotate90
            | Orientation::Rotate270
            | Orientation::Rotate90FlipH
            | Orientation::Rotate270FlipH
    );
    let turned = (stored.1, stored.0);
    if turns && same_shape(turned, lens) {
        return Ok((turned, orientation));
    }
    Err(Error::invalid(
        path,
        format!(
            "size mismatch: image {name:?} has {}x{} pixels, its camera expects {}x{} or a scaled copy of \
             that; give the folder of the images that the poses were computed from with --images",
            stored.0, stored.1, lens.pinhole.width_px, lens.pinhole.height_px
        ),
    ))
}

/// Size with the longer side bounded.
pub(crate) fn bounded((width, height): (u32, u32), max_resolution: u32) -> (u32, u32) {
    let longer = width.max(height);
    if longer <= max_resolution {
        return (width, height);
    }
    let scale = f64::from(max_resolution) / f64::from(longer);
    let side = |v: u32| ((f64::from(v) * scale).round() as u32).max(1);
    (side(width), side(height))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::Pinhole;
    use crate::dataset::lens::Distortion;

    fn lens(width_px: u32, height_px: u32) -> Lens {
        Lens {
            pinhole: Pinhole { width_px, height_px, fx_px: 1.0, fy_px: 1.0, cx_px: 0.0, cy_px: 0.0 },
            distortion: Distortion::None,
        }
    }

    #[test]
    fn the_longer_side_is_bounded_and_small_images_stay() {
        assert_eq!(bounded((1067, 1899), 480), (270, 480));
        assert_eq!(bounded((1067, 1899), 960), (539, 960));
        assert_eq!(bounded((400, 300), 400), (400, 300));
        assert_eq!(bounded((4000, 1), 40), (40, 1));
    }

    #[test]
    fn scaled_copies_fit_and_other_shapes_do_not() {
        let camera = lens(4946, 3286);
        for fits in [(4946, 3286), (1237, 822), (1236, 821), (618, 411)] {
            assert!(same_shape(fits, &camera), "{fits:?}");
        }
        for other in [(3286, 4946), (1237, 900), (4946, 3200)] {
            assert!(!same_shape(other, &camera), "{other:?}");
        }
    }
}
