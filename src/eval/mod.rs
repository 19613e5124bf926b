//! Quality figures of rendered pictures against photos.

use serde::{Deserialize, Serialize};

/// Figures of one picture. Pictures are rounded to 8 bits before they are compared, as when written.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ViewQuality {
    /// Original picture name.
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

/// Figures of a set of pictures: arithmetic means over the views.
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
