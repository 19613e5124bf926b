//! Quality figures of rendered images against photos.
//!
//! Definitions are those of the 3DGS family's evaluation unless a name says otherwise: PSNR over all
//! pixels and channels of one image, figures of a set are means of figures of images. Pixels whose
//! mask is 0 count in no figure; both images are black there before windows are applied, so that
//! what a mask hides has no influence.

mod error_map;
mod flip;
mod gradient;
mod psnr;
mod ssim;

pub use error_map::{ERROR_MAP_MAX, error_map};
pub use flip::mean_flip;
pub use gradient::gradient_psnr;
pub use psnr::{PSNR_CAP_DB, psnr, psnr_from_mse};
pub use ssim::{Ssim, ssim};

use crate::backend::TargetImage;
use serde::{Deserialize, Serialize};

/// Figures of one image. Images are rounded to 8 bits before they are compared, as when written.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ViewQuality {
    /// Original image name.
    pub name: String,
    /// PSNR over all pixels and channels, dB.
    pub psnr: f64,
    /// PSNR of the gradients of the channel mean, dB.
    pub grad_psnr: f64,
    /// SSIM with zero padding, as the 3DGS family computes it.
    pub ssim_3dgs: f64,
    /// SSIM over the region where the window fits.
    pub ssim_valid: f64,
    /// Mean FLIP error, 0 to 1.
    pub flip: f64,
}

/// Figures of a set of images: arithmetic means over the views.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Evaluation {
    /// dB
    pub psnr: f64,
    /// dB
    pub grad_psnr: f64,
    /// With zero padding.
    pub ssim_3dgs: f64,
    /// Valid region.
    pub ssim_valid: f64,
    /// Mean FLIP error.
    pub flip: f64,
    /// In the order of the views.
    pub per_view: Vec<ViewQuality>,
}

impl Evaluation {
    /// Means over the views; `None` without a view, for then there is no figure.
    pub fn from_views(per_view: Vec<ViewQuality>) -> Option<Self> {
        if per_view.is_empty() {
            return None;
        }
        let count = per_view.len() as f64;
        let mean = |figure: fn(&ViewQuality) -> f64| per_view.iter().map(figure).sum::<f64>() / count;
        Some(Self {
            psnr: mean(|v| v.psnr),
            grad_psnr: mean(|v| v.grad_psnr),
            ssim_3dgs: mean(|v| v.ssim_3dgs),
            ssim_valid: mean(|v| v.ssim_valid),
            flip: mean(|v| v.flip),
            per_view,
        })
    }
}

/// Two images of one size, in 8 bits, black where the mask excludes them: what the figures compare.
#[derive(Clone, Debug, PartialEq)]
pub struct ImagePair {
    /// Width.
    pub width_px: usize,
    /// Height.
    pub height_px: usize,
    /// The rendered image. `[height, width, 3]`
    pub rendered: Vec<u8>,
    /// The photo. `[height, width, 3]`
    pub target: Vec<u8>,
    /// Whether a pixel counts; `None`: all do. `[height, width]`
    pub counts: Option<Vec<bool>>,
}

impl ImagePair {
    /// Clamps a rendered image (display space, `[height, width, 3]`) to [0, 1], rounds it to 8 bits
    /// and pairs it with its photo. NaN becomes black.
    ///
    /// # Panics
    /// If an array's length does not match the photo's size.
    pub fn new(rendered_rgb: &[f32], target: &TargetImage) -> Self {
        let (width_px, height_px) = (target.width_px as usize, target.height_px as usize);
        let num_pixels = width_px * height_px;
        assert_eq!(rendered_rgb.len(), 3 * num_pixels, "size of the rendered image");
        assert_eq!(target.rgb.len(), 3 * num_pixels, "size of the photo");
        let mut pair = Self {
            width_px,
            height_px,
            rendered: quantised(rendered_rgb),
            target: target.rgb.clone(),
            counts: None,
        };
        if let Some(mask) = &target.mask {
            assert_eq!(mask.len(), num_pixels, "size of the mask");
            for (pixel, _) in mask.iter().enumerate().filter(|&(_, &m)| m == 0) {
                pair.rendered[3 * pixel..3 * pixel + 3].fill(0);
                pair.target[3 * pixel..3 * pixel + 3].fill(0);
            }
            pair.counts = Some(mask.iter().map(|&m| m != 0).collect());
        }
        pair
    }

    /// Whether the pixel in column `x` of row `y` counts.
    pub fn counts_at(&self, x: usize, y: usize) -> bool {
        self.counts.as_ref().is_none_or(|c| c[y * self.width_px + x])
    }
}

/// Clamps to [0, 1] and rounds to 8 bits, half up; NaN becomes 0.
pub fn quantised(display_rgb: &[f32]) -> Vec<u8> {
    display_rgb.iter().map(|v| (v.clamp(0.0, 1.0) * 255.0).round() as u8).collect()
}

/// All figures of one rendered image (display space, not clamped, `[height, width, 3]`).
///
/// # Panics
/// If the image and its photo differ in size.
pub fn quality_of(name: &str, rendered_rgb: &[f32], target: &TargetImage) -> ViewQuality {
    let pair = ImagePair::new(rendered_rgb, target);
    let ssim = ssim(&pair);
    ViewQuality {
        name: name.to_owned(),
        psnr: psnr(&pair),
        grad_psnr: gradient_psnr(&pair),
        ssim_3dgs: ssim.zero_padded,
        ssim_valid: ssim.valid,
        flip: mean_flip(&pair),
    }
}

#[cfg(test)]
mod tests;
