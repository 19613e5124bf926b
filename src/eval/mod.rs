//! Quality figures of renders against photos.
//!
//! Definitions follow the evaluation scripts of the 3DGS family unless a name says otherwise: PSNR is
//! taken over all pixels and channels of one image, and the figures of a set are means over its images.
//! Pixels whose mask is 0 are left out. Both images are set to black there before windowed metrics run,
//! so masked content has no influence.

mod colour;
mod coverage;
mod error_map;
mod flip;
mod gradient;
mod pair;
mod psnr;
mod region;
mod sequence;
mod ssim;

pub use colour::corrected_psnr;
pub use coverage::{UNCOVERED_ALPHA, uncovered_pixels, uncovered_share};
pub use error_map::{ERROR_MAP_MAX, error_map};
pub use flip::mean_flip;
pub use gradient::gradient_psnr;
pub use pair::{ImagePair, quantised};
pub use psnr::{PSNR_CAP_DB, psnr, psnr_from_mse, psnr_from_squares, squared_error};
pub use region::{RegionError, texels_in_region};
pub use sequence::SequenceError;
pub use ssim::{Ssim, ssim};

use crate::image::TargetImage;
use serde::{Deserialize, Serialize};

/// Quality figures of one view. Renders are rounded to 8 bits first, as in written files.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ViewQuality {
    /// Name of the photo.
    pub name: String,
    /// PSNR over all pixels and channels, dB.
    pub psnr: f64,
    /// PSNR of the Sobel gradients of the channel mean, dB.
    pub grad_psnr: f64,
    /// SSIM with zero padding, as the 3DGS family computes it.
    pub ssim_3dgs: f64,
    /// SSIM over the pixels whose window lies inside the image.
    pub ssim_valid: f64,
    /// Mean FLIP error, 0 to 1.
    pub flip: f64,
    /// PSNR of the right half, the colours corrected by an affine map fitted on the left half, dB; `None` if a half is
    /// masked. Never mixed with `psnr`.
    pub psnr_corrected: Option<f64>,
    /// Share of the pixels with alpha below [`UNCOVERED_ALPHA`]; `None` for images without alpha.
    pub uncovered: Option<f64>,
}

/// Quality figures of a set of views: arithmetic means over the views.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Evaluation {
    /// Mean of [`ViewQuality::psnr`], dB.
    pub psnr: f64,
    /// Mean of [`ViewQuality::grad_psnr`], dB.
    pub grad_psnr: f64,
    /// Mean of [`ViewQuality::ssim_3dgs`].
    pub ssim_3dgs: f64,
    /// Mean of [`ViewQuality::ssim_valid`].
    pub ssim_valid: f64,
    /// Mean of [`ViewQuality::flip`].
    pub flip: f64,
    /// Mean of [`ViewQuality::psnr_corrected`] over the views that have one, dB.
    pub psnr_corrected: Option<f64>,
    /// Mean of [`ViewQuality::uncovered`].
    pub uncovered: Option<f64>,
    /// The figures of each view, in the order given.
    pub per_view: Vec<ViewQuality>,
}

impl Evaluation {
    /// Averages over the views; `None` if there are none.
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
            psnr_corrected: mean_of_known(&per_view, |v| v.psnr_corrected),
            uncovered: mean_of_known(&per_view, |v| v.uncovered),
            per_view,
        })
    }
}

fn mean_of_known(views: &[ViewQuality], figure: fn(&ViewQuality) -> Option<f64>) -> Option<f64> {
    let known: Vec<f64> = views.iter().filter_map(figure).collect();
    (!known.is_empty()).then(|| known.iter().sum::<f64>() / known.len() as f64)
}

/// All quality figures of one render (display space, not clamped, `[height, width, 3]`) but its coverage.
///
/// # Panics
/// If the render and its photo differ in size.
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
        psnr_corrected: corrected_psnr(&pair),
        uncovered: None,
    }
}

#[cfg(test)]
mod tests;
