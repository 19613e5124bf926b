//! Quality figures of rendered images against photos.
//!
//! Definitions are those of the 3DGS family's evaluation unless a name says otherwise: PSNR over all
//! pixels and channels of one image, figures of a set are means of figures of images. Pixels whose
//! mask is 0 count in no figure; both images are black there before windows are applied, so that
//! what a mask hides has no influence.

mod error_map;
mod flip;
mod gradient;
mod pair;
mod psnr;
mod ssim;

pub use error_map::{ERROR_MAP_MAX, error_map};
pub use flip::mean_flip;
pub use gradient::gradient_psnr;
pub use pair::{ImagePair, quantised};
pub use psnr::{PSNR_CAP_DB, psnr, psnr_from_mse};
pub use ssim::{Ssim, ssim};

use crate::image::TargetImage;
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
