//! Sizes of photos and masks, checked against their cameras, and how their files are opened. `decode.rs` decodes the
//! pixels.

use super::exr_photo;
use super::lens::Lens;
use crate::{Error, Result, input_file};
use image::metadata::Orientation;
use image::{ImageDecoder as _, ImageReader};
use std::fs::File;
use std::io::BufReader;
use std::path::Path;

/// Larger files are not photos; decoders would read them into memory.
pub(crate) const FILE_BYTES_MAX: u64 = 4 << 30;

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
            Error::unsupported(path, format!("{e}; photos must be PNG, JPEG or EXR: convert this one"))
        }
        e => Error::invalid(
            path,
            format!("unreadable image: {e}; expected PNG, JPEG or EXR: replace the file or remove it"),
        ),
    }
}

/// The kinds of file that a photo or a mask may be.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum FileKind {
    /// Read by `exr_photo`.
    Exr,
    /// Read by the image library.
    Other,
}

/// The kind of a file, which must be a regular one.
pub(crate) fn kind(path: &Path) -> Result<FileKind> {
    input_file::check(path, FILE_BYTES_MAX)?;
    Ok(if exr_photo::is_exr(path) { FileKind::Exr } else { FileKind::Other })
}

/// Stored size of a photo and the turn that its EXIF data ask for.
pub(crate) fn photo_header(path: &Path) -> Result<((u32, u32), Orientation)> {
    if kind(path)? == FileKind::Exr {
        return Ok((exr_photo::size(path)?, Orientation::NoTransforms));
    }
    let mut decoder = open(path)?.into_decoder().map_err(|e| image_error(path, e))?;
    let orientation = decoder.orientation().unwrap_or(Orientation::NoTransforms);
    let (width, height) = decoder.dimensions();
    if width == 0 || height == 0 {
        return Err(Error::invalid(path, format!("the photo is {width}x{height}")));
    }
    Ok(((width, height), orientation))
}

/// Stored size of a photo.
pub(crate) fn photo_size(path: &Path) -> Result<(u32, u32)> {
    photo_header(path).map(|(size, _)| size)
}

/// Whether a photo has the camera's size or is a scaled copy; sizes may have been rounded either way.
fn same_shape((width, height): (u32, u32), lens: &Lens) -> bool {
    let camera = (f64::from(lens.pinhole.width_px), f64::from(lens.pinhole.height_px));
    let (width, height) = (f64::from(width), f64::from(height));
    // Scaled by the longer side, where rounding matters least.
    if camera.0 >= camera.1 {
        (height - camera.1 * width / camera.0).abs() <= 1.0
    } else {
        (width - camera.0 * height / camera.1).abs() <= 1.0
    }
}

/// The photo's size as its camera has it, and the turn that leads there.
pub(crate) fn fit(path: &Path, name: &str, lens: &Lens) -> Result<((u32, u32), Orientation)> {
    let (stored, orientation) = photo_header(path)?;
    if same_shape(stored, lens) {
        // The pose solver saw the pixels as stored.
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
            "size mismatch: photo {name:?} has {}x{} pixels, its camera expects {}x{} or a scaled copy of \
             that; give the folder of the photos that the poses were computed from with --images",
            stored.0, stored.1, lens.pinhole.width_px, lens.pinhole.height_px
        ),
    ))
}

/// The size reduced, if need be, so that the longer side keeps a bound.
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
    fn longer_sides_are_bounded_and_small_photos_unchanged() {
        assert_eq!(bounded((1067, 1899), 480), (270, 480));
        assert_eq!(bounded((1067, 1899), 960), (539, 960));
        assert_eq!(bounded((400, 300), 400), (400, 300));
        assert_eq!(bounded((4000, 1), 40), (40, 1));
    }

    #[test]
    fn scaled_copies_are_accepted_and_other_aspect_ratios_refused() {
        let camera = lens(4946, 3286);
        for fits in [(4946, 3286), (1237, 822), (1236, 821), (618, 411)] {
            assert!(same_shape(fits, &camera), "{fits:?}");
        }
        for other in [(3286, 4946), (1237, 900), (4946, 3200)] {
            assert!(!same_shape(other, &camera), "{other:?}");
        }
    }
}
