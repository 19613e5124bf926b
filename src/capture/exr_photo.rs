//! EXR photos: linear light, converted to display space and clipped. Only the first layer with channels
//! R, G and B is read.

use crate::{Error, Result};
use exr::error::Error as ExrError;
use exr::prelude::{MetaData, ReadChannels as _, ReadLayers as _};
use image::{DynamicImage, RgbImage, RgbaImage};
use std::path::Path;

/// First bytes of every EXR file.
const MAGIC: [u8; 4] = [0x76, 0x2f, 0x31, 0x01];

/// A larger size is taken for a damaged header, before memory is allocated.
const MAX_PIXELS: usize = 1 << 28;

/// Whether a file is an EXR image, by its first bytes.
pub(crate) fn is_exr(path: &Path) -> bool {
    let mut head = [0; 4];
    std::fs::File::open(path)
        .and_then(|mut f| std::io::Read::read_exact(&mut f, &mut head))
        .is_ok_and(|()| head == MAGIC)
}

fn our_error(path: &Path, error: ExrError) -> Error {
    match error {
        ExrError::NotSupported(what) => unsupported!(
            path,
            "{what}; expected a flat EXR image with channels R, G and B: convert it to PNG"
        ),
        ExrError::Io(e) if e.kind() != std::io::ErrorKind::UnexpectedEof => Error::io(path, e),
        e => invalid!(
            path,
            "unreadable image: {e}; expected an EXR image with channels R, G and B: replace the file"
        ),
    }
}

/// Width and height.
pub(crate) fn size(path: &Path) -> Result<(u32, u32)> {
    let meta = MetaData::read_from_file(path, false).map_err(|e| our_error(path, e))?;
    let size = meta.headers.first().map_or((0, 0), |h| (h.layer_size.width(), h.layer_size.height()));
    let pixels = size.0.checked_mul(size.1);
    if pixels.is_none_or(|p| p == 0 || p > MAX_PIXELS) {
        return Err(invalid!(path, "the photo is {}x{}", size.0, size.1));
    }
    Ok((size.0 as u32, size.1 as u32))
}

/// Whether the file has an alpha channel.
pub(crate) fn has_alpha(path: &Path) -> Result<bool> {
    let meta = MetaData::read_from_file(path, false).map_err(|e| our_error(path, e))?;
    let has = |header: &exr::meta::header::Header| header.channels.list.iter().any(|c| c.name.eq("A"));
    Ok(meta.headers.first().is_some_and(has))
}

/// What [`read`] holds next to the result: the pixels in f32.
pub(crate) fn decoder_bytes((width, height): (u32, u32)) -> u64 {
    size_of::<[f32; 4]>() as u64 * u64::from(width) * u64::from(height)
}

/// The photo in display space, with straight alpha if the file has alpha.
pub(crate) fn read(path: &Path) -> Result<DynamicImage> {
    let (width, height) = size(path)?;
    let row = width as usize;
    let photo = exr::prelude::read()
        .no_deep_data()
        .largest_resolution_level()
        .rgba_channels(
            |size, _| (size.width(), vec![[0.0_f32; 4]; size.width() * size.height()]),
            |(width, pixels), at, (r, g, b, a): (f32, f32, f32, f32)| {
                pixels[at.y() * *width + at.x()] = [r, g, b, a];
            },
        )
        .first_valid_layer()
        .all_attributes()
        .non_parallel()
        .from_file(path)
        .map_err(|e| our_error(path, e))?;
    let (read_width, pixels) = photo.layer_data.channel_data.pixels;
    if read_width != row || pixels.len() != row * height as usize {
        return Err(Error::unsupported(
            path,
            "the layer with R, G and B is not the first and differs in size; expected one layer: convert it to PNG",
        ));
    }
    let has_alpha = pixels.iter().any(|p| p[3] != 1.0);
    let bytes: Vec<u8> = if has_alpha {
        pixels.iter().flat_map(|&p| rgba(p)).collect()
    } else {
        pixels.iter().flat_map(|&[r, g, b, _]| [r, g, b].map(display_byte)).collect()
    };
    let image = if has_alpha {
        RgbaImage::from_raw(width, height, bytes).map(DynamicImage::from)
    } else {
        RgbImage::from_raw(width, height, bytes).map(DynamicImage::from)
    };
    image.ok_or_else(|| Error::invalid(path, "the photo has no pixels"))
}

/// EXR colours are premultiplied (OpenEXR, "Technical introduction"); ours are not.
fn rgba([r, g, b, a]: [f32; 4]) -> [u8; 4] {
    let share = if a.is_nan() { 0.0 } else { a.clamp(0.0, 1.0) };
    let [r, g, b] = [r, g, b].map(|v| display_byte(if share > 0.0 { v / share } else { 0.0 }));
    [r, g, b, (255.0 * share + 0.5) as u8]
}

/// IEC 61966-2-1, clipped; NaN is black.
fn display_byte(linear: f32) -> u8 {
    let clipped = if linear.is_nan() { 0.0 } else { linear.clamp(0.0, 1.0) };
    let display =
        if clipped <= 0.003_130_8 { 12.92 * clipped } else { 1.055 * clipped.powf(1.0 / 2.4) - 0.055 };
    (255.0 * display + 0.5) as u8
}

#[cfg(test)]
mod tests {
    use super::*;
    use tempfile::tempdir;

    #[test]
    fn linear_light_becomes_display_space_and_is_clipped() {
        let folder = tempdir().unwrap();
        let path = folder.path().join("a.exr");
        let values = [0.0, 0.001, 0.214_041_14, 1.0, 7.0, -1.0, f32::NAN];
        exr::prelude::write_rgb_file(&path, 7, 2, |x, y| {
            let v = values[x];
            if y == 0 { (v, v, v) } else { (1.0, v, 0.0) }
        })
        .unwrap();
        assert!(is_exr(&path) && size(&path).unwrap() == (7, 2));
        let photo = read(&path).unwrap().into_rgb8();
        let first: Vec<u8> = (0..7).map(|x| photo.get_pixel(x, 0).0[0]).collect();
        assert_eq!(first, [0, 3, 128, 255, 255, 0, 0]);
        assert_eq!(photo.get_pixel(2, 1).0, [255, 128, 0]);
    }

    #[test]
    fn alpha_is_divided_out_before_the_conversion() {
        let folder = tempdir().unwrap();
        let path = folder.path().join("a.exr");
        exr::prelude::write_rgba_file(&path, 1, 1, |_, _| (0.107_020_57_f32, 0.5_f32, 0.0_f32, 0.5_f32))
            .unwrap();
        assert_eq!(read(&path).unwrap().into_rgba8().into_raw(), [128, 255, 0, 128]);
    }

    #[test]
    fn damaged_files_are_errors() {
        let folder = tempdir().unwrap();
        let path = folder.path().join("a.exr");
        exr::prelude::write_rgb_file(&path, 5, 4, |x, y| (x as f32, y as f32, 0.0_f32)).unwrap();
        let whole = std::fs::read(&path).unwrap();
        for length in (0..whole.len()).step_by(3) {
            std::fs::write(&path, &whole[..length]).unwrap();
            assert!(read(&path).is_err(), "cut at {length}");
        }
    }
}
