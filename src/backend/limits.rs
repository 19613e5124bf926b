//! What a device can hold at all, as far as that can be known beforehand.

use serde::{Deserialize, Serialize};

/// What of a scene the limits depend on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SceneShape {
    /// SH degree of the splats.
    pub sh_degree: u32,
    /// Whether it is trained with terms on depths and normals.
    pub geometry: bool,
}

/// The largest scene and images that a device takes, each by itself: limits of its buffers and of our indices.
/// Its memory may be less; and how many tile-splat pairs a view has is not known before it is rendered.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct DeviceLimits {
    /// Longest side of an image.
    pub max_side_px: u32,
    /// Pixels of an image.
    pub max_pixels: u64,
    /// Splats of a model.
    pub max_splats: u64,
    /// Texels over all maps of a model.
    pub max_texels: u64,
}

impl DeviceLimits {
    /// Whether an image fits.
    pub fn allows_image(&self, width_px: u32, height_px: u32) -> bool {
        width_px.max(height_px) <= self.max_side_px
            && u64::from(width_px) * u64::from(height_px) <= self.max_pixels
    }
}
