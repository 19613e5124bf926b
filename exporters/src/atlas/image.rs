//! Writes pages as images: 8-bit PNG and f32 EXR. They hold data, not colours: no gamma, no profile.

use crate::Result;
use std::io::Cursor;

/// An 8-bit RGB image as PNG, without any colour information.
///
/// # Errors
/// [`crate::Error::Invalid`] if the sizes do not fit each other.
pub fn encode_png([width, height]: [u16; 2], rgb: &[u8]) -> Result<Vec<u8>> {
    let failed = |e: png::EncodingError| invalid!("", "PNG page: {e}");
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, width.into(), height.into());
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_depth(png::BitDepth::Eight);
    encoder.set_compression(png::Compression::Balanced);
    let mut writer = encoder.write_header().map_err(failed)?;
    writer.write_image_data(rgb).map_err(failed)?;
    writer.finish().map_err(failed)?;
    Ok(bytes)
}

/// An RGB image of f32 as EXR: every bit is kept.
///
/// # Errors
/// [`crate::Error::Invalid`] if the sizes do not fit each other.
pub fn encode_exr([width, height]: [u16; 2], rgb: &[f32]) -> Result<Vec<u8>> {
    use exr::prelude::{Encoding, Image, SpecificChannels, WritableImage};
    let (w, h) = (usize::from(width), usize::from(height));
    if rgb.len() != 3 * w * h {
        return Err(invalid!("", "EXR page: {} numbers for {w} x {h} texels", rgb.len()));
    }
    let pixel = |at: exr::math::Vec2<usize>| {
        let i = 3 * (at.1 * w + at.0);
        (rgb[i], rgb[i + 1], rgb[i + 2])
    };
    let mut bytes = Cursor::new(Vec::new());
    let layer = exr::prelude::Layer::new(
        (w, h),
        exr::prelude::LayerAttributes::default(),
        Encoding::SMALL_LOSSLESS,
        SpecificChannels::rgb(pixel),
    );
    let written = Image::from_layer(layer).write().non_parallel().to_buffered(&mut bytes);
    written.map_err(|e| invalid!("", "EXR page: {e}"))?;
    Ok(bytes.into_inner())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pages_have_no_colour_profile_and_wrong_sizes_are_refused() {
        let png = encode_png([40, 17], &[7; 3 * 40 * 17]).unwrap();
        assert!(!png.windows(4).any(|w| w == b"gAMA" || w == b"sRGB"), "data, not colours");
        assert!(encode_png([40, 17], &[7; 3]).is_err());
        assert!(encode_exr([40, 17], &[0.0; 3]).is_err());
    }
}
