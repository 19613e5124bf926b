//! Settings of the reference renderer.

use crate::backend::ColourMap;

/// Treatment of the discontinuity of alpha at 1/255.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum AlphaCutoff {
    /// As in production: alpha is zero below 1/255, and a pixel stops at a transmittance of 1e-4.
    Hard,
    /// A C1 ramp between 0.5/255 and 1.5/255, and pixels never stop: differentiable, for central differences.
    Smooth,
}

/// Gradient through the clamp of a colour channel at zero.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ColourGradient {
    /// Passes only where the colour is positive: the exact derivative.
    Strict,
    /// Also passes where descent would raise the colour, so that dark texels recover (method 2.4).
    Projected,
}

/// Settings of the reference renderer.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// Treatment of alpha near 1/255.
    pub cutoff: AlphaCutoff,
    /// Gradient through the colour clamp.
    pub colour_gradient: ColourGradient,
    /// Near plane, local units.
    pub near: f64,
    /// Variance of the low-pass filter in the image; 0: none.
    pub filter_px2: f64,
    /// SH degree to evaluate.
    pub sh_degree: u32,
    /// Display-space colour behind all splats.
    pub background: [f64; 3],
    /// The exposure of the photo, by which the image is corrected before the comparison.
    pub exposure: ColourMap,
}
