//! From photo files to target images: composited, undistorted, reduced and masked. `photos.rs` knows
//! which files and sizes, `store.rs` keeps the results.

use super::lens::Lens;
use super::options::PHOTO_MEMORY_BYTES;
use super::photos::{FileKind, image_error, open};
use super::warp::Warp;
use super::{exr_photo, photos};
use crate::Result;
use crate::image::resample::{by_area, to_byte};
use crate::image::{ALPHA_LEVELS, TargetImage};
use image::DynamicImage;
use image::metadata::Orientation;
use std::path::{Path, PathBuf};

/// The allocator keeps smaller blocks when they are freed and returns larger ones (glibc, `M_MMAP_THRESHOLD` on 64 bits).
const KEPT_BYTES_MAX: u64 = 32 << 20;

/// Everything needed to make one target image.
#[derive(Clone, Debug)]
pub(crate) struct Recipe {
    pub photo: PathBuf,
    /// Size once turned.
    pub photo_size: (u32, u32),
    pub turn: Orientation,
    /// Whether its file has an alpha channel.
    pub has_alpha: bool,
    /// Memory for decoding the photo.
    pub photo_bytes: u64,
    pub mask: Option<PathBuf>,
    /// The turn that lays the mask on the photo.
    pub mask_turn: Orientation,
    /// Memory for decoding the mask.
    pub mask_bytes: u64,
    pub mask_invert: bool,
    /// The lens at the size that the pose file states; scaled to the photo here.
    pub lens: Lens,
    /// Focal length of the target image's camera over that of the lens.
    pub focal_scale: f64,
    /// Most memory for decoding a file.
    pub memory_bytes: u64,
    /// Size of the target image.
    pub size: (u32, u32),
    /// Display space, 0 to 1.
    pub background: [f32; 3],
    /// Whether alpha is kept beside the colours, which are those over black then.
    pub keep_alpha: bool,
}

/// A target image, and what its mask leaves out.
pub(crate) struct Decoded {
    pub image: TargetImage,
    /// Share of the pixels that the photo shows; 0 without mask.
    pub masked_share: f64,
}

/// Colours of a target image, and where they are valid. `[height, width]`, colours three for each pixel
struct Colours {
    rgb: Vec<u8>,
    /// As [`TargetImage::alpha`].
    alpha: Option<Vec<u8>>,
    /// `None`: everywhere.
    valid: Option<Vec<u8>>,
}

impl Recipe {
    /// Upper bound of the target image's memory.
    pub fn num_bytes(&self) -> u64 {
        let masked = self.mask.is_some() || self.lens.is_distorted();
        let channels = 3 + u64::from(masked) + u64::from(self.keep_alpha && self.has_alpha);
        u64::from(self.size.0) * u64::from(self.size.1) * channels
    }

    /// Memory while it is made: for the pixels of photo and mask and, where they are reduced, undistorted or composited, for
    /// means in f32 and the result. Otherwise the pixels become the result.
    pub fn working_bytes(&self) -> u64 {
        let target = self.num_bytes();
        let resampled = if self.resamples() || self.has_alpha { 4 * target + target } else { 0 };
        resampled + in_turn(self.photo_bytes, target, self.mask_bytes)
    }

    fn resamples(&self) -> bool {
        self.size != self.photo_size || self.lens.is_distorted()
    }

    /// Whether the photo has a pixel that is not opaque; decodes it if its file has an alpha channel.
    pub fn is_translucent(&self) -> Result<bool> {
        Ok(self.has_alpha
            && read_pixels(&self.photo, self.memory_bytes)?.into_rgba8().pixels().any(|p| p.0[3] < u8::MAX))
    }

    /// Makes the target image.
    pub fn decode(&self) -> Result<Decoded> {
        let Colours { rgb, alpha, valid } = self.colours()?;
        let mut masked_share = 0.0;
        let mut mask = valid;
        if let Some(path) = &self.mask {
            let shown = mask.as_ref().map_or(rgb.len() / 3, |mask| count_kept(mask));
            let mut kept = self.kept(path)?;
            if let Some(valid) = mask {
                kept.iter_mut().zip(valid).for_each(|(kept, valid)| *kept = valid.min(*kept));
            }
            masked_share = 1.0 - count_kept(&kept) as f64 / shown.max(1) as f64;
            mask = Some(kept);
        }
        let image = TargetImage {
            width_px: self.size.0,
            height_px: self.size.1,
            rgb,
            mask: mask.filter(|m| m.contains(&0)),
            alpha,
        };
        Ok(Decoded { image, masked_share })
    }

    /// The warp at a given size, if the lens is distorted.
    pub(super) fn warp(&self, (width, height): (u32, u32)) -> Option<Warp> {
        self.lens
            .is_distorted()
            .then(|| Lens { pinhole: self.lens.pinhole.resized(width, height), ..self.lens })
            .map(|lens| Warp::new(lens, self.focal_scale))
    }

    fn colours(&self) -> Result<Colours> {
        let mut photo = read_pixels(&self.photo, self.memory_bytes)?;
        photo.apply_orientation(self.turn);
        let size = (photo.width(), photo.height());
        if size != self.photo_size {
            return Err(invalid!(
                &self.photo,
                "the photo has {}x{} pixels now, it had {}x{} when the capture was loaded",
                size.0,
                size.1,
                self.photo_size.0,
                self.photo_size.1
            ));
        }
        Ok(if photo.color().has_alpha() {
            let pixels = photo.into_rgba8().into_raw();
            let background = if self.keep_alpha { [0.0; 3] } else { self.background.map(|b| 255.0 * b) };
            let composited = |i: usize| {
                let [r, g, b, a] = [0, 1, 2, 3].map(|c| f32::from(pixels[4 * i + c]));
                let share = a / 255.0;
                let over = |colour: f32, behind: f32| behind + share * (colour - behind);
                [over(r, background[0]), over(g, background[1]), over(b, background[2]), a]
            };
            if self.keep_alpha {
                let (values, valid) = self.reduce(size, composited);
                let rgb = values.chunks_exact(4).flat_map(|p| [p[0], p[1], p[2]]).collect();
                let level = |a: u8| (f32::from(a) / 255.0 * f32::from(ALPHA_LEVELS)).round() as u8;
                let alpha = values.chunks_exact(4).map(|p| level(p[3])).collect();
                Colours { rgb, alpha: Some(alpha), valid }
            } else {
                let (rgb, valid) = self.reduce(size, |i| {
                    let [r, g, b, _] = composited(i);
                    [r, g, b]
                });
                Colours { rgb, alpha: None, valid }
            }
        } else {
            let pixels = photo.into_rgb8().into_raw();
            if !self.resamples() {
                return Ok(Colours { rgb: pixels, alpha: None, valid: None });
            }
            let (rgb, valid) = self.reduce(size, |i| [0, 1, 2].map(|c| f32::from(pixels[3 * i + c])));
            Colours { rgb, alpha: None, valid }
        })
    }

    /// Undistorts and reduces an image given by pixel index; returns colours, and where they are valid.
    fn reduce<const N: usize>(
        &self,
        size: (u32, u32),
        pixel: impl Fn(usize) -> [f32; N],
    ) -> (Vec<u8>, Option<Vec<u8>>) {
        let width = size.0 as usize;
        let Some(warp) = self.warp(size) else {
            let reduced = by_area(size, self.size, N, |y, row| {
                for (x, out) in row.chunks_exact_mut(N).enumerate() {
                    out.copy_from_slice(&pixel(y * width + x));
                }
            });
            return (reduced.into_iter().map(to_byte).collect(), None);
        };
        let reduced = by_area(size, self.size, N + 1, |y, row| {
            warp.fill_row(y, row, |x, y| pixel(y * width + x));
        });
        let mut colours = Vec::with_capacity(reduced.len() / (N + 1) * N);
        let mut valid = Vec::with_capacity(reduced.len() / (N + 1));
        for p in reduced.chunks_exact(N + 1) {
            let share = p[N];
            // Means over the valid part only, so that borders do not get darker.
            colours.extend(p[..N].iter().map(|v| to_byte(if share > 0.0 { v / share } else { 0.0 })));
            // The model is rendered over the whole pixel, so pixels that are valid only in part do not count.
            valid.push(if share > 0.999 { 255 } else { 0 });
        }
        (colours, Some(valid))
    }

    /// The mask at the size of the target image, 255 where pixels count.
    fn kept(&self, path: &Path) -> Result<Vec<u8>> {
        let mut mask = read_pixels(path, self.memory_bytes)?;
        let stored = (mask.width(), mask.height());
        mask.apply_orientation(self.mask_turn);
        let size = (mask.width(), mask.height());
        let expected = f64::from(self.photo_size.0) / f64::from(self.photo_size.1);
        let found = f64::from(size.0) / f64::from(size.1);
        // Small masks have rounded sides. A mask of another shape belongs to another photo.
        if (found / expected - 1.0).abs() > 0.02 {
            return Err(invalid!(
                path,
                "size mismatch: the mask has {}x{} pixels, its photo {}x{}; expected the same aspect ratio",
                stored.0,
                stored.1,
                self.photo_size.0,
                self.photo_size.1
            ));
        }
        let pixels = alpha_as_mask(&mask).unwrap_or_else(|| mask.into_luma8().into_raw());
        let (means, _) = self.reduce(size, |i| [f32::from(pixels[i])]);
        Ok(means.into_iter().map(|mean| if (mean >= 128) != self.mask_invert { 255 } else { 0 }).collect())
    }
}

/// Memory for decoding a photo, then its mask next to the finished colours. What a small mask took stays with the
/// allocator while the next photo is decoded (measured: 200 MiB of 24-megapixel photos and grey masks on two threads,
/// 154 without the masks).
fn in_turn(photo_bytes: u64, colours_bytes: u64, mask_bytes: u64) -> u64 {
    if mask_bytes < KEPT_BYTES_MAX {
        photo_bytes + mask_bytes
    } else {
        photo_bytes.max(colours_bytes + mask_bytes)
    }
}

/// Pixels that a mask keeps.
fn count_kept(mask: &[u8]) -> usize {
    mask.iter().filter(|&&m| m != 0).count()
}

/// The alpha of a mask that holds it there: cut-outs, whose colours are the photo's. `None` if alpha says nothing.
/// `[height, width]`, 255 opaque
fn alpha_as_mask(mask: &DynamicImage) -> Option<Vec<u8>> {
    let alpha: Vec<u8> = match mask {
        DynamicImage::ImageLumaA8(mask) => mask.pixels().map(|p| p.0[1]).collect(),
        DynamicImage::ImageRgba8(mask) => mask.pixels().map(|p| p.0[3]).collect(),
        DynamicImage::ImageLumaA16(mask) => mask.pixels().map(|p| (p.0[1] >> 8) as u8).collect(),
        DynamicImage::ImageRgba16(mask) => mask.pixels().map(|p| (p.0[3] >> 8) as u8).collect(),
        _ => return None,
    };
    alpha.iter().any(|&a| a < u8::MAX).then_some(alpha)
}

/// The pixels as stored, in display space. Decoders may take as many bytes for them as given.
fn read_pixels(path: &Path, memory_bytes: u64) -> Result<DynamicImage> {
    if photos::kind(path)? == FileKind::Exr {
        return exr_photo::read(path);
    }
    let mut reader = open(path)?;
    let mut limits = image::Limits::default();
    limits.max_alloc = limits.max_alloc.max(Some(memory_bytes));
    reader.limits(limits);
    reader.decode().map_err(|e| image_error(path, e))
}

/// An image as its file has it: width, height and display-space values `[height, width, 3]`; alpha is dropped.
///
/// # Errors
/// [`crate::Error::InvalidInput`] or [`crate::Error::Unsupported`] if it cannot be decoded.
pub fn read_image(path: &Path) -> Result<(u32, u32, Vec<f32>)> {
    let photo = read_pixels(path, PHOTO_MEMORY_BYTES)?;
    let (width, height) = (photo.width(), photo.height());
    Ok((width, height, photo.into_rgb8().into_raw().into_iter().map(|v| f32::from(v) / 255.0).collect()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn small_masks_count_next_to_the_photo_and_large_ones_in_its_place() {
        let mib = |photo: u64, colours: u64, mask: u64| in_turn(photo << 20, colours << 20, mask << 20) >> 20;
        assert_eq!(mib(69, 3, 0), 69);
        assert_eq!(mib(69, 3, 23), 92);
        assert_eq!((mib(69, 3, 40), mib(69, 3, 115)), (69, 118));
    }
}
