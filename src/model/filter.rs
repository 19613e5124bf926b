//! The low-pass filter in the image.

use crate::constants::FILTER_VARIANCE_PX2;
use serde::{Deserialize, Serialize};

/// Low-pass filter in the image, which keeps splats narrower than a pixel from aliasing (method 2.5).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Filter {
    /// None: a splat is sampled at the centres of pixels.
    #[default]
    None,
    /// Elliptical weighted average: a Gaussian in the image, convolved with the splat's.
    Ewa,
}

impl Filter {
    /// Variance of the Gaussian in the image; 0 without a filter.
    pub fn variance_px2(self) -> f64 {
        match self {
            Self::None => 0.0,
            Self::Ewa => FILTER_VARIANCE_PX2,
        }
    }
}
