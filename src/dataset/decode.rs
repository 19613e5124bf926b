//! From image files to the photo that is trained on: composited, undistorted, reduced and masked.
//! Which files and sizes belongs to `images.rs`, keeping the results to `store.rs`.

use super::exr_photo;
use super::lens::Lens;
use super::photos::{image_error, open};
use super::warp::Warp;
use crate::image::TargetImage;
use crate::image::resample::{by_area, to_byte};
use crate::{Error, Result};
use image::DynamicImage;
use image::metadata::Orientation;
use std::path::{Path, PathBuf};

/// All that is needed to make one photo.
#[derive(Clone, Debug)]
pub(crate) struct Recipe {
    pub image: PathBuf,
    /// Size after the turn.
    pub image_size: (u32, u32),
    pub turn: Orientation,
    pub mask: Option<PathBuf>,
    pub mask_invert: bool,
    /// The lens at the size that its file states; scaled here.
    pub lens: Lens,
    /// Size of the result.
    pub size: (u32, u32),
    /// Display space, 0 to 1.
    pub background: [f32; 3],
}

impl Recipe {
    /// Upper bound of the result's memory.
    pub fn num_bytes(&self) -> u64 {
        let masked = self.mask.is_some() || self.lens.is_distorted();
        let channels = if masked { 4 } else { 3 };
        u64::from(self.size.0) * u64::from(self.size.1) * channels
    }

    /// Makes the photo.
    pub fn decode(&self) -> Result<TargetImage> {
        let (rgb, valid) = self.colours()?;
        let mut mask = valid;
        if let Some(path) = &self.mask {
            let kept = self.kept(path)?;
            match &mut mask {
                Some(mask) => mask.iter_mut().zip(kept).for_each(|(m, k)| *m = (*m).min(k)),
                None => mask = Some(kept),
            }
        }
        Ok(TargetImage {
            width_px: self.size.0,
            height_px: self.size.1,
            rgb,
            mask: mask.filter(|m| m.contains(&0)),
        })
    }

    fn read(&self, path: &Path) -> Result<DynamicImage> {
        let mut image = read_pixels(path)?;
        image.apply_orientation(self.turn);
        Ok(image)
    }

    /// The warp for an image of a given size, if the lens needs one.
    fn warp(&self, (width, height): (u32, u32)) -> Option<Warp> {
        self.lens
            .is_distorted()
            .then(|| Warp::new(Lens { pinhole: self.lens.pinhole.resized(width, height), ..self.lens }))
    }

    fn colours(&self) -> Result<(Vec<u8>, Option<Vec<u8>>)> {
        let image = self.read(&self.image)?;
        let size = (image.width(), image.height());
        if size != self.image_size {
            return Err(Error::invalid(
                &self.image,
                format!(
                    "the image has {}x{} pixels now, it had {}x{} when the capture was loaded",
                    size.0, size.1, self.image_size.0, self.image_size.1
                ),
            ));
        }
        Ok(if image.color().has_alpha() {
            let pixels = image.into_rgba8().into_raw();
            let background = self.background.map(|b| 255.0 * b);
            self.reduce(size, |i| {
                let [r, g, b, a] = [0, 1, 2, 3].map(|c| f32::from(pixels[4 * i + c]));
                let share = a / 255.0;
                let over = |colour: f32, behind: f32| behind + share * (colour - behind);
                [over(r, background[0]), over(g, background[1]), over(b, background[2])]
            })
        } else {
            let pixels = image.into_rgb8().into_raw();
            if size == self.size && !self.lens.is_distorted() {
                return Ok((pixels, None));
            }
            self.reduce(size, |i| [0, 1, 2].map(|c| f32::from(pixels[3 * i + c])))
        })
    }

    /// Undistorts and reduces an image given by pixel index; colours, and where they are valid.
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
            // Means over the valid part only, so that borders do not darken.
            colours.extend(p[..N].iter().map(|v| to_byte(if share > 0.0 { v / share } else { 0.0 })));
            // The model will be rendered over the whole pixel: partly imaged ones do not count.
            valid.push(if share > 0.999 { 255 } else { 0 });
        }
        (colours, Some(valid))
    }

    /// The mask at the size of the result, 255 where the image counts.
    fn kept(&self, path: &Path) -> Result<Vec<u8>> {
        let mut mask = read_pixels(path)?;
        let stored = (mask.width(), mask.height());
        if self.turn != Orientation::NoTransforms && is_landscape(stored) != is_landscape(self.image_size) {
            mask.apply_orientation(self.turn);
        }
        let size = (mask.width(), mask.height());
        let expected = f64::from(self.image_size.0) / f64::from(self.image_size.1);
        let found = f64::from(size.0) / f64::from(size.1);
        // Rounded sides of small masks; another shape is another image's mask.
        if (found / expected - 1.0).abs() > 0.02 {
            return Err(Error::invalid(
                path,
                format!(
                    "size mismatch: the mask has {}x{} pixels, its image {}x{}; expected the same shape",
                    stored.0, stored.1, self.image_size.0, self.image_size.1
                ),
            ));
        }
        let pixels = mask.into_luma8().into_raw();
        let (means, _) = self.reduce(size, |i| [f32::from(pixels[i])]);
        Ok(means.into_iter().map(|mean| if (mean >= 128) != self.mask_invert { 255 } else { 0 }).collect())
    }
}

/// The pixels as stored, display space.
fn read_pixels(path: &Path) -> Result<DynamicImage> {
    if exr_photo::is_exr(path) {
        return exr_photo::read(path);
    }
    open(path)?.decode().map_err(|e| image_error(path, e))
}

/// An image as it is in its file: width, height and display-space values `[height, width, 3]`; alpha is left out.
///
/// # Errors
/// [`Error::InvalidInput`] or [`Error::Unsupported`] if it is no image that can be read.
pub fn read_image(path: &Path) -> Result<(u32, u32, Vec<f32>)> {
    let image = read_pixels(path)?;
    let (width, height) = (image.width(), image.height());
    Ok((width, height, image.into_rgb8().into_raw().into_iter().map(|v| f32::from(v) / 255.0).collect()))
}

fn is_landscape((width, height): (u32, u32)) -> bool {
    width > height
}
