//! Pages as images: 8-bit PNG and f32 EXR. They hold data, not colours: no gamma, no profile.

use crate::{Error, Result};
use std::io::Cursor;
use std::path::Path;

/// An RGB image of 8 bits as PNG, without any colour information.
///
/// # Errors
/// [`Error::Invalid`] if the sizes do not fit each other.
pub fn encode_png([width, height]: [u16; 2], rgb: &[u8]) -> Result<Vec<u8>> {
    let failed = |e: png::EncodingError| Error::invalid("", format!("PNG page: {e}"));
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

/// Reads an RGB image of 8 bits whose size must be the given one. `path` is only for messages.
///
/// # Errors
/// [`Error::Invalid`] if it is damaged or of another size or kind.
pub fn decode_png(bytes: &[u8], size: [u16; 2], path: &Path) -> Result<Vec<u8>> {
    let failed = |e: png::DecodingError| Error::invalid(path, format!("PNG page: {e}"));
    let mut decoder = png::Decoder::new(Cursor::new(bytes));
    decoder.set_transformations(png::Transformations::IDENTITY);
    let needed = 3 * usize::from(size[0]) * usize::from(size[1]);
    decoder.set_limits(png::Limits { bytes: needed + (1 << 20) });
    let mut reader = decoder.read_info().map_err(failed)?;
    let info = reader.info();
    let found = ([info.width, info.height], info.color_type, info.bit_depth);
    if found != (size.map(u32::from), png::ColorType::Rgb, png::BitDepth::Eight) {
        return Err(Error::invalid(path, format!("PNG page: {found:?}, expected {size:?} RGB of 8 bits")));
    }
    let mut rgb = vec![0; needed];
    reader.next_frame(&mut rgb).map_err(failed)?;
    Ok(rgb)
}

/// An RGB image of f32 as EXR: every bit is kept.
///
/// # Errors
/// [`Error::Invalid`] if the sizes do not fit each other.
pub fn encode_exr([width, height]: [u16; 2], rgb: &[f32]) -> Result<Vec<u8>> {
    use exr::prelude::{Encoding, Image, SpecificChannels, WritableImage};
    let (w, h) = (usize::from(width), usize::from(height));
    if rgb.len() != 3 * w * h {
        return Err(Error::invalid("", format!("EXR page: {} numbers for {w} x {h} texels", rgb.len())));
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
    written.map_err(|e| Error::invalid("", format!("EXR page: {e}")))?;
    Ok(bytes.into_inner())
}

/// Reads an RGB image of f32 whose size must be the given one. `path` is only for messages.
///
/// # Errors
/// [`Error::Invalid`] if it is damaged or of another size or kind.
pub fn decode_exr(bytes: &[u8], size: [u16; 2], path: &Path) -> Result<Vec<f32>> {
    use exr::prelude::{ReadChannels, ReadLayers};
    let failed = |e: exr::error::Error| Error::invalid(path, format!("EXR page: {e}"));
    let [width, height] = size.map(usize::from);
    // The header first: no image is allocated for a size that is wrong.
    let meta = exr::meta::MetaData::read_from_buffered(Cursor::new(bytes), false).map_err(failed)?;
    let sizes: Vec<_> = meta.headers.iter().map(|h| (h.layer_size.0, h.layer_size.1)).collect();
    if sizes != [(width, height)] {
        return Err(Error::invalid(path, format!("EXR page: {sizes:?}, expected one layer of {size:?}")));
    }
    let image = exr::prelude::read()
        .no_deep_data()
        .largest_resolution_level()
        .rgb_channels(
            move |_, _| vec![0.0_f32; 3 * width * height],
            move |rgb: &mut Vec<f32>, at, (r, g, b): (f32, f32, f32)| {
                let i = 3 * (at.1 * width + at.0);
                if let Some(texel) = rgb.get_mut(i..i + 3) {
                    texel.copy_from_slice(&[r, g, b]);
                }
            },
        )
        .first_valid_layer()
        .all_attributes()
        .non_parallel()
        .from_buffered(Cursor::new(bytes))
        .map_err(failed)?;
    Ok(image.layer_data.channel_data.pixels)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_bit_comes_back_and_damage_is_an_error() {
        let path = Path::new("page");
        let bytes: Vec<u8> = (0..3 * 40 * 17).map(|i| (i * 37 % 251) as u8).collect();
        let png = encode_png([40, 17], &bytes).unwrap();
        assert_eq!(decode_png(&png, [40, 17], path).unwrap(), bytes);
        assert!(!png.windows(4).any(|w| w == b"gAMA" || w == b"sRGB"), "data, not colours");
        let floats: Vec<f32> = bytes.iter().map(|&b| f32::from(b) / 127.0 - 1.0).collect();
        let mut floats = floats;
        (floats[0], floats[1], floats[2]) = (-0.0, f32::MIN_POSITIVE, 1e-42);
        let exr = encode_exr([40, 17], &floats).unwrap();
        let read = decode_exr(&exr, [40, 17], path).unwrap();
        assert!(read.iter().zip(&floats).all(|(a, b)| a.to_bits() == b.to_bits()));
        for (file, decode) in [
            (&png, (|b, s| decode_png(b, s, Path::new("p")).map(drop)) as fn(&[u8], [u16; 2]) -> Result<()>),
            (&exr, |b, s| decode_exr(b, s, Path::new("p")).map(drop)),
        ] {
            assert!(decode(file, [17, 40]).is_err(), "another size");
            for share in 0..50 {
                assert!(decode(&file[..file.len() * share / 50], [40, 17]).is_err(), "cut to {share} of 50");
            }
        }
        assert!(encode_exr([40, 17], &floats[3..]).is_err());
    }
}
