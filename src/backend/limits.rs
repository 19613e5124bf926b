//! Upper bounds of what a device can hold, as far as they are known in advance.

use serde::{Deserialize, Serialize};

/// Properties of a run that the limits depend on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SceneShape {
    /// Highest SH degree that a splat may have.
    pub sh_degree: u32,
    /// Whether loss terms on depths and normals are used.
    pub geometry: bool,
}

/// The largest model and images that a device can hold, each taken separately: limits of its buffers and of our
/// indices. Memory may run out earlier, and the number of pairs of a view is not known before it is rendered.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct DeviceLimits {
    /// Longest side of an image, in pixels.
    pub max_side_px: u32,
    /// Largest number of pixels of an image.
    pub max_pixels: u64,
    /// Largest number of splats of a model.
    pub max_splats: u64,
    /// Largest number of texels over all maps of a model.
    pub max_texels: u64,
    /// Largest number of tile-splat pairs of a training step.
    pub max_pairs: u64,
}

impl DeviceLimits {
    /// Whether an image of this size fits.
    pub fn allows_image(&self, width_px: u32, height_px: u32) -> bool {
        width_px.max(height_px) <= self.max_side_px
            && u64::from(width_px) * u64::from(height_px) <= self.max_pixels
    }
}
