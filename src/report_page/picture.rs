//! Images in a page: JPEG files of bounded size.

use crate::image::{JPEG_QUALITY, encode_jpeg};
use base64::prelude::{BASE64_STANDARD, Engine as _};
use image::RgbImage;
use image::imageops::{FilterType, resize};
use std::io;

/// Longest side of an image in a report: three stand side by side.
pub const PICTURE_PX: u32 = 480;

/// A JPEG file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Picture {
    /// Width.
    pub width_px: u32,
    /// Height.
    pub height_px: u32,
    jpeg: Vec<u8>,
}

impl Picture {
    /// Encodes an image, made smaller if it exceeds [`PICTURE_PX`]. `rgb`: `[height, width, 3]`
    ///
    /// # Errors
    /// If the number of values does not match or is zero.
    pub fn new(width_px: u32, height_px: u32, rgb: Vec<u8>) -> io::Result<Self> {
        let longer = width_px.max(height_px);
        let image = RgbImage::from_raw(width_px, height_px, rgb).filter(|_| width_px > 0 && height_px > 0);
        let mut image = image.ok_or_else(|| io::Error::other("an image and its size do not match"))?;
        if longer > PICTURE_PX {
            let scaled = |px: u32| (u64::from(px) * u64::from(PICTURE_PX) / u64::from(longer)).max(1) as u32;
            image = resize(&image, scaled(width_px), scaled(height_px), FilterType::Triangle);
        }
        let (width_px, height_px) = image.dimensions();
        Ok(Self { width_px, height_px, jpeg: encode_jpeg(width_px, height_px, &image, JPEG_QUALITY)? })
    }

    /// The image as a URL that holds it.
    pub(super) fn url(&self) -> String {
        format!("data:image/jpeg;base64,{}", BASE64_STANDARD.encode(&self.jpeg))
    }
}
