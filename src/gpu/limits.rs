//! What an open device can hold: the largest scene and images whose buffers are within its limits and whose
//! elements are within the 32 bits that shaders count in.

use super::device::GpuDevice;
use super::layout::{BOUNDS_BYTES, PROJECTED_BYTES};
use super::model_buffers::splat_stride;
use super::submission::MAX_SIDE_PX;
use crate::backend::{DeviceLimits, SceneShape};

/// Bytes of a texel in the largest of the texels' buffers, and the numbers that it is indexed by.
const TEXEL_BYTES: u64 = 16;
const TEXEL_NUMBERS: u64 = 4;
/// The same of a pixel: maps of SSIM, and what the terms on depths and normals leave.
const PIXEL_BYTES: u64 = 36;
const PIXEL_NUMBERS: u64 = 9;
const GEOMETRY_PIXEL_BYTES: u64 = 48;

/// Of a device whose buffers may have so many bytes.
pub(super) fn limits(buffer_bytes: u64, shape: SceneShape) -> DeviceLimits {
    // Buffers are a multiple of 16 bytes long.
    let buffer_bytes = buffer_bytes / 16 * 16;
    let most = |bytes: u64, numbers: u64| (buffer_bytes / bytes).min(u64::from(u32::MAX) / numbers);
    let parameters = splat_stride(shape.sh_degree) as u64;
    let splat_bytes = (4 * parameters).max(PROJECTED_BYTES).max(BOUNDS_BYTES);
    let pixel_bytes = if shape.geometry { GEOMETRY_PIXEL_BYTES } else { PIXEL_BYTES };
    DeviceLimits {
        max_side_px: MAX_SIDE_PX,
        max_pixels: most(pixel_bytes, PIXEL_NUMBERS),
        max_splats: most(splat_bytes, parameters),
        max_texels: most(TEXEL_BYTES, TEXEL_NUMBERS),
    }
}

impl GpuDevice {
    /// Bytes of a buffer that a kernel binds, at most.
    pub(super) fn most_buffer_bytes(&self) -> u64 {
        self.limits.max_storage_buffer_binding_size.min(self.limits.max_buffer_size)
    }
}
