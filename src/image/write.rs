//! Writing images: 8-bit PNG for viewing and metrics, JPEG for reports, 32-bit float EXR for quantities. A file appears under
//! its name only once it is complete.

use crate::{Error, Result, atomic_file};
use exr::prelude::{
    AnyChannel, AnyChannels, Encoding, FlatSamples, Image, Layer, LayerAttributes, SmallVec, WritableImage,
};
use image::{ExtendedColorType, ImageEncoder, codecs::jpeg::JpegEncoder, codecs::png};
use std::io::Cursor;
use std::path::Path;

/// Channels of an image, interleaved.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Channels {
    /// One channel, such as brightness or depth.
    Grey,
    /// Red, green and blue.
    Rgb,
}

impl Channels {
    /// Values per pixel.
    pub const fn count(self) -> usize {
        match self {
            Self::Grey => 1,
            Self::Rgb => 3,
        }
    }

    fn names(self) -> &'static [&'static str] {
        match self {
            Self::Grey => &["Y"],
            Self::Rgb => &["R", "G", "B"],
        }
    }

    fn check(self, path: &Path, width_px: u32, height_px: u32, num_values: usize) -> Result<()> {
        let expected = width_px as usize * height_px as usize * self.count();
        if num_values == expected && expected > 0 {
            return Ok(());
        }
        Err(invalid!(
            path,
            "an image of {width_px} x {height_px} with {} channels has {expected} values, found {num_values}",
            self.count()
        ))
    }
}

/// Writes an 8-bit PNG. `values`: `[height, width, channels]`
///
/// # Errors
/// [`Error::InvalidInput`] if the number of values does not match or is zero, [`Error::Io`].
pub fn write_png(
    path: &Path,
    width_px: u32,
    height_px: u32,
    channels: Channels,
    values: &[u8],
) -> Result<()> {
    channels.check(path, width_px, height_px, values.len())?;
    let colour = match channels {
        Channels::Grey => ExtendedColorType::L8,
        Channels::Rgb => ExtendedColorType::Rgb8,
    };
    let mut bytes = Vec::new();
    png::PngEncoder::new_with_quality(&mut bytes, png::CompressionType::Default, png::FilterType::Adaptive)
        .write_image(values, width_px, height_px, colour)
        .map_err(|e| Error::io(path, std::io::Error::other(e)))?;
    Ok(atomic_file::write(path, &bytes)?)
}

/// Quality of JPEG files in reports: good enough to look at a render.
pub const JPEG_QUALITY: u8 = 85;

/// Writes a JPEG file. `rgb`: `[height, width, 3]`
///
/// # Errors
/// [`Error::InvalidInput`] if the number of values does not match or is zero, [`Error::Io`].
pub fn write_jpeg(path: &Path, width_px: u32, height_px: u32, rgb: &[u8], quality: u8) -> Result<()> {
    Channels::Rgb.check(path, width_px, height_px, rgb.len())?;
    Ok(atomic_file::write(
        path,
        &encode_jpeg(width_px, height_px, rgb, quality).map_err(|e| Error::io(path, e))?,
    )?)
}

/// An image as a JPEG file. `rgb`: `[height, width, 3]`
///
/// # Errors
/// If the number of values does not match or is zero.
pub fn encode_jpeg(width_px: u32, height_px: u32, rgb: &[u8], quality: u8) -> std::io::Result<Vec<u8>> {
    let expected = width_px as usize * height_px as usize * Channels::Rgb.count();
    if rgb.len() != expected || expected == 0 {
        return Err(std::io::Error::other(format!(
            "{} values for an image of {width_px} x {height_px}",
            rgb.len()
        )));
    }
    let mut bytes = Vec::new();
    JpegEncoder::new_with_quality(&mut bytes, quality)
        .write_image(rgb, width_px, height_px, ExtendedColorType::Rgb8)
        .map_err(std::io::Error::other)?;
    Ok(bytes)
}

/// Writes a 32-bit float EXR (lossless ZIP). Grey becomes channel `Y`.
/// `values`: `[height, width, channels]`
///
/// # Errors
/// [`Error::InvalidInput`] if the number of values does not match or is zero, [`Error::Io`].
pub fn write_exr(
    path: &Path,
    width_px: u32,
    height_px: u32,
    channels: Channels,
    values: &[f32],
) -> Result<()> {
    channels.check(path, width_px, height_px, values.len())?;
    let planes: SmallVec<[AnyChannel<FlatSamples>; 4]> = channels
        .names()
        .iter()
        .enumerate()
        .map(|(c, &name)| {
            let plane = values[c..].iter().step_by(channels.count()).copied().collect();
            AnyChannel::new(name, FlatSamples::F32(plane))
        })
        .collect();
    let layer = Layer::new(
        (width_px as usize, height_px as usize),
        LayerAttributes::default(),
        Encoding::SMALL_LOSSLESS,
        AnyChannels::sort(planes),
    );
    let mut bytes = Cursor::new(Vec::new());
    Image::from_layer(layer)
        .write()
        .non_parallel()
        .to_buffered(&mut bytes)
        .map_err(|e| Error::io(path, std::io::Error::other(e.to_string())))?;
    Ok(atomic_file::write(path, bytes.get_ref())?)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn png_round_trip_is_exact() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("p.png");
        for channels in [Channels::Grey, Channels::Rgb] {
            let values: Vec<u8> = (0..7 * 5 * channels.count()).map(|i| (i * 37) as u8).collect();
            write_png(&path, 7, 5, channels, &values).unwrap();
            let read = image::open(&path).unwrap();
            assert_eq!((read.width(), read.height()), (7, 5));
            assert_eq!(read.into_bytes(), values);
        }
        // No temporary file is left.
        assert_eq!(std::fs::read_dir(&dir).unwrap().count(), 1);
    }

    #[test]
    fn exr_round_trip_keeps_every_bit() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("p.exr");
        for channels in [Channels::Grey, Channels::Rgb] {
            let n = 7 * 5 * channels.count();
            let mut values: Vec<f32> = (0..n).map(|i| (i as f32 * 0.37).sin() * 1e3).collect();
            values[0] = f32::MIN_POSITIVE / 4.0;
            values[1] = -0.0;
            values[2] = f32::INFINITY;
            write_exr(&path, 7, 5, channels, &values).unwrap();
            let read = exr::prelude::read_first_flat_layer_from_file(&path).unwrap();
            let planes = &read.layer_data.channel_data.list;
            assert_eq!(planes.len(), channels.count());
            for (c, &name) in channels.names().iter().enumerate() {
                let plane = planes.iter().find(|p| p.name.eq(name)).unwrap();
                let ours = values[c..].iter().step_by(channels.count());
                assert!(plane.sample_data.values_as_f32().map(f32::to_bits).eq(ours.map(|v| v.to_bits())));
            }
        }
    }

    #[test]
    fn wrong_sizes_and_unwritable_paths_are_errors() {
        let dir = tempfile::tempdir().unwrap();
        let bad = write_png(&dir.path().join("p.png"), 2, 2, Channels::Rgb, &[0; 11]);
        assert!(matches!(bad, Err(Error::InvalidInput { .. })), "{bad:?}");
        assert!(write_exr(&dir.path().join("p.exr"), 0, 2, Channels::Grey, &[]).is_err());
        let nowhere = write_png(&dir.path().join("none/p.png"), 1, 1, Channels::Grey, &[1]);
        assert!(matches!(nowhere, Err(Error::Io { .. })));
        // A folder is in the way: the temporary file is removed again.
        std::fs::create_dir(dir.path().join("taken")).unwrap();
        assert!(write_png(&dir.path().join("taken"), 1, 1, Channels::Grey, &[0]).is_err());
        assert_eq!(std::fs::read_dir(&dir).unwrap().count(), 1);
    }
}
