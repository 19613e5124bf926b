//! The largest scene and images that an open device can hold: their buffers must stay within its limits, and 32-bit
//! integers must be able to index their elements.

use super::device::GpuDevice;
use super::layout::MAX_SIDE_PX;
use super::layout::{BOUNDS_BYTES, PAIR_SUMS_GEOMETRY, PROJECTED_BYTES};
use super::model_buffers::MOST_SPLAT_FLOATS;
use super::shape::splat_floats;
use crate::backend::{DeviceLimits, SceneShape};

/// Bytes and floats per texel of the largest texel buffer, the activated texels.
const TEXEL_BYTES: u64 = 16;
const TEXEL_FLOATS: u64 = 4;
/// Bytes and floats per pixel of the largest pixel buffer, the SSIM maps.
const PIXEL_BYTES: u64 = 36;
const PIXEL_FLOATS: u64 = 9;
/// Bytes per pixel of the records that the distortion and normal terms need.
const GEOMETRY_PIXEL_BYTES: u64 = 48;

/// Numbers of a pair in the largest array that a kernel indexes by pair.
const MOST_PAIR_FLOATS: u64 = PAIR_SUMS_GEOMETRY as u64;

/// Largest number of pairs that fit into buffers of `buffer_bytes`, with `pair_bytes` each. Their partial sums need not fit at once.
pub(super) fn max_pairs(buffer_bytes: u64, pair_bytes: u64) -> u64 {
    (buffer_bytes / 16 * 16 / pair_bytes).min(u64::from(u32::MAX) / MOST_PAIR_FLOATS)
}

/// Limits of a device whose storage buffers may have `buffer_bytes`, and hold `max_pairs` pairs.
pub(super) fn limits(buffer_bytes: u64, max_pairs: u64, shape: SceneShape) -> DeviceLimits {
    // Buffer sizes are multiples of 16 bytes.
    let buffer_bytes = buffer_bytes / 16 * 16;
    let most = |bytes: u64, floats: u64| (buffer_bytes / bytes).min(u64::from(u32::MAX) / floats);
    let parameters = splat_floats(shape.sh_degree) as u64;
    let sums_bytes = 4 * u64::from(PAIR_SUMS_GEOMETRY);
    let splat_bytes = (4 * parameters).max(PROJECTED_BYTES).max(BOUNDS_BYTES).max(sums_bytes);
    let pixel_bytes = if shape.geometry { GEOMETRY_PIXEL_BYTES } else { PIXEL_BYTES };
    DeviceLimits {
        max_side_px: MAX_SIDE_PX,
        max_pixels: most(pixel_bytes, PIXEL_FLOATS),
        max_splats: most(splat_bytes, parameters).min(MOST_SPLAT_FLOATS / parameters),
        max_texels: most(TEXEL_BYTES, TEXEL_FLOATS),
        max_pairs,
    }
}

impl GpuDevice {
    /// Largest size of a buffer that a kernel can bind.
    pub(super) fn most_buffer_bytes(&self) -> u64 {
        self.limits.max_storage_buffer_binding_size.min(self.limits.max_buffer_size)
    }
}
