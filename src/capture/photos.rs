//! Sizes of photos and masks, checked against their cameras, and how their files are opened. `decode.rs` decodes the
//! pixels.

use super::jpeg_frame::Frame;
use super::lens::Lens;
use super::options::ExifTurn;
use super::{advice, exr_photo};
use crate::text::quoted;
use crate::{Error, Result, input_file};
use image::metadata::Orientation;
use image::{ColorType, ImageDecoder as _, ImageFormat, ImageReader};
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
    if let Some(advice) = advice::for_image(path) {
        return Error::unsupported(path, advice);
    }
    match error {
        image::ImageError::IoError(e) if e.kind() != std::io::ErrorKind::UnexpectedEof => Error::io(path, e),
        image::ImageError::Unsupported(e) => {
            unsupported!(path, "{e}; photos must be PNG, JPEG, TIFF, WebP or EXR: convert this one")
        }
        e => invalid!(
            path,
            "unreadable image: {e}; expected PNG, JPEG, TIFF, WebP or EXR: replace the file or remove it"
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

/// What the header of a photo says.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PhotoHeader {
    /// As stored.
    pub size: (u32, u32),
    /// The turn that its EXIF data ask for.
    pub turn: Orientation,
    /// Whether the file has an alpha channel.
    pub has_alpha: bool,
    /// Of the decoded pixels.
    color: ColorType,
    /// What the decoder holds next to the decoded pixels.
    decoder_bytes: u64,
}

impl PhotoHeader {
    /// Of a photo that cannot be read and is taken to have this size.
    pub fn assumed(size: (u32, u32)) -> Self {
        let (turn, color) = (Orientation::NoTransforms, ColorType::Rgb8);
        Self { size, turn, has_alpha: false, color, decoder_bytes: 0 }
    }

    /// Memory for decoding the pixels, turned if `turns`, and converting them to 8-bit `[r, g, b]` or `[r, g, b, a]`.
    pub fn colours_bytes(&self, turns: bool) -> u64 {
        self.pixels_bytes(if self.color.has_alpha() { ColorType::Rgba8 } else { ColorType::Rgb8 }, turns)
    }

    /// The same for a mask, which becomes 8-bit grey.
    pub fn mask_bytes(&self, turns: bool) -> u64 {
        self.pixels_bytes(ColorType::L8, turns)
    }

    fn pixels_bytes(&self, converted: ColorType, turns: bool) -> u64 {
        let bytes_of = |color: ColorType| {
            u64::from(self.size.0) * u64::from(self.size.1) * u64::from(color.bytes_per_pixel())
        };
        let decoded = bytes_of(self.color);
        let turned = if turns { decoded } else { 0 };
        let copy = if converted == self.color { 0 } else { bytes_of(converted) };
        decoded + self.decoder_bytes.max(turned).max(copy)
    }
}

/// The header of a photo or a mask.
pub(crate) fn photo_header(path: &Path) -> Result<PhotoHeader> {
    if kind(path)? == FileKind::Exr {
        let size = exr_photo::size(path)?;
        let decoder_bytes = exr_photo::decoder_bytes(size);
        return Ok(PhotoHeader {
            size,
            turn: Orientation::NoTransforms,
            has_alpha: exr_photo::has_alpha(path)?,
            color: ColorType::Rgba8,
            decoder_bytes,
        });
    }
    let reader = open(path)?;
    let format = reader.format();
    let mut decoder = reader.into_decoder().map_err(|e| image_error(path, e))?;
    let orientation = decoder.orientation().unwrap_or(Orientation::NoTransforms);
    let (width, height) = decoder.dimensions();
    if width == 0 || height == 0 {
        return Err(invalid!(path, "the photo is {width}x{height}"));
    }
    let decoder_bytes = match format {
        // All pixels are decoded before they are copied, those of CMYK with four channels.
        Some(ImageFormat::Tiff) => {
            let bits = u64::from(decoder.original_color_type().bits_per_pixel());
            (u64::from(width) * u64::from(height) * bits).div_ceil(8)
        }
        _ => jpeg_bytes(path),
    };
    Ok(PhotoHeader {
        size: (width, height),
        turn: orientation,
        has_alpha: decoder.color_type().has_alpha(),
        color: decoder.color_type(),
        decoder_bytes,
    })
}

/// What the decoder of a JPEG file holds: the file and, if it is progressive, the coefficients. 0 for other files, which
/// are decoded row by row.
fn jpeg_bytes(path: &Path) -> u64 {
    let file_bytes = || std::fs::metadata(path).map_or(0, |m| m.len());
    Frame::of_file(path).map_or(0, |frame| frame.coefficient_bytes() + file_bytes())
}

/// Whether a turn swaps the sides; such turns need a second copy of the pixels.
pub(crate) fn swaps_sides(turn: Orientation) -> bool {
    matches!(
        turn,
        Orientation::Rotate90
            | Orientation::Rotate270
            | Orientation::Rotate90FlipH
            | Orientation::Rotate270FlipH
    )
}

/// Stored size of a photo.
pub(crate) fn photo_size(path: &Path) -> Result<(u32, u32)> {
    photo_header(path).map(|header| header.size)
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

/// A size once turned.
fn turned((width, height): (u32, u32), turn: Orientation) -> (u32, u32) {
    if swaps_sides(turn) { (height, width) } else { (width, height) }
}

/// The photo's size as its camera has it, and the turn that leads there from its `header`.
pub(crate) fn fit(
    path: &Path,
    name: &str,
    lens: &Lens,
    header: &PhotoHeader,
    exif: ExifTurn,
) -> Result<((u32, u32), Orientation)> {
    let as_stored = (header.size, Orientation::NoTransforms);
    let as_asked = (turned(header.size, header.turn), header.turn);
    let candidates = match exif {
        // The pose solver saw the pixels as stored, unless their sides say otherwise.
        ExifTurn::Auto => [as_stored, as_asked],
        ExifTurn::Ignore => [as_stored; 2],
        ExifTurn::Apply => [as_asked; 2],
    };
    if let Some(fitting) = candidates.into_iter().find(|(size, _)| same_shape(*size, lens)) {
        return Ok(fitting);
    }
    let (size, how) = match exif {
        ExifTurn::Apply if swaps_sides(header.turn) => (as_asked.0, " once turned as its EXIF data ask"),
        _ => (header.size, ""),
    };
    Err(invalid!(
        path,
        "size mismatch: photo {} has {}x{} pixels{how}, its camera expects {}x{} or a scaled copy of \
         that; give the folder of the photos that the poses were computed from with --images",
        quoted(name),
        size.0,
        size.1,
        lens.pinhole.width_px,
        lens.pinhole.height_px
    ))
}

/// Whether the EXIF data of a photo ask for a turn, and its sides fit its camera with it and without.
pub(crate) fn turn_is_open(lens: &Lens, header: &PhotoHeader) -> bool {
    header.turn != Orientation::NoTransforms
        && same_shape(header.size, lens)
        && same_shape(turned(header.size, header.turn), lens)
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
    use crate::capture::lens::Distortion;

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
    fn decoding_counts_what_is_converted_turned_and_held_by_the_decoder() {
        let header = |color, decoder_bytes| PhotoHeader {
            size: (10, 6),
            turn: Orientation::NoTransforms,
            has_alpha: false,
            color,
            decoder_bytes,
        };
        for (color, bytes_per_pixel) in [
            (ColorType::Rgb8, 3),
            (ColorType::Rgba8, 4),
            (ColorType::L8, 1 + 3),
            (ColorType::Rgb16, 6 + 3),
            (ColorType::Rgba16, 8 + 4),
        ] {
            assert_eq!(header(color, 0).colours_bytes(false), 60 * bytes_per_pixel, "{color:?}");
        }
        assert_eq!(header(ColorType::L8, 0).mask_bytes(false), 60);
        assert_eq!(header(ColorType::La16, 0).mask_bytes(false), 60 * (4 + 1));
        assert_eq!(header(ColorType::Rgb8, 0).colours_bytes(true), 60 * (3 + 3));
        assert_eq!(header(ColorType::Rgb8, 500).colours_bytes(true), 60 * 3 + 500);
    }

    #[test]
    fn tiff_files_take_their_pixels_twice() {
        let folder = tempfile::tempdir().unwrap();
        let needed = |name: &str| {
            let path = folder.path().join(name);
            image::RgbImage::new(10, 6).save(&path).unwrap();
            photo_header(&path).unwrap().colours_bytes(false)
        };
        assert_eq!((needed("a.tif"), needed("a.png")), (60 * (3 + 3), 60 * 3));
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
