//! Structures shared with the shaders: members have the order, types and offsets of the WGSL structs of the same
//! names (a test compares every member).

use bytemuck::{Pod, Zeroable};

/// Largest side of an image: pixel coordinates of boxes are packed into 16 bits each.
pub const MAX_SIDE_PX: u32 = 65_535;

/// Inputs of one training step or one image: `Step` of `shaders/common/step.wgsl`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct StepUniform {
    /// First row of camera_from_local, translation last.
    pub camera_row0: [f32; 4],
    /// Second row of camera_from_local, translation last.
    pub camera_row1: [f32; 4],
    /// Third row of camera_from_local, translation last.
    pub camera_row2: [f32; 4],
    /// First row of the photo's exposure.
    pub exposure_row0: [f32; 4],
    /// Second row of the photo's exposure.
    pub exposure_row1: [f32; 4],
    /// Third row of the photo's exposure.
    pub exposure_row2: [f32; 4],
    /// Centre of the camera, local frame.
    pub camera_in_local: [f32; 3],
    /// Near plane, local units.
    pub near: f32,
    /// Focal lengths along x and y.
    pub focal_px: [f32; 2],
    /// Principal point, x and y.
    pub principal_px: [f32; 2],
    /// Width and height of the image.
    pub size_px: [u32; 2],
    /// Columns and rows of tiles.
    pub grid: [u32; 2],
    /// Display-space colour behind all splats.
    pub background: [f32; 3],
    /// Number of splats of the model.
    pub num_splats: u32,
    /// SH degree to evaluate.
    pub sh_degree: u32,
    /// Counts from 1; 0 for images.
    pub step: u32,
    /// Last completed step, up to which lazily updated parameters are flushed.
    pub flushed_step: u32,
    /// Any of `FLAG_*`.
    pub flags: u32,
    /// Entry of the status ring that belongs to this step.
    pub status_slot: u32,
    /// Number of pairs that the buffers can hold.
    pub pair_capacity: u32,
    /// Floats per pair in the partial sums.
    pub partial_stride: u32,
    /// Weight of the L1 term.
    pub loss_l1: f32,
    /// Weight of the SSIM term, 1 - SSIM.
    pub loss_dssim: f32,
    /// Weight of the mean squared difference.
    pub loss_mse: f32,
    /// Weight of the opacity term divided by the number of splats.
    pub opacity_weight: f32,
    /// Weight of the texture term.
    pub texture_weight: f32,
    /// Fixed-point units per unit of texel gradient, for a splat of one pixel.
    pub texel_units: f32,
    /// First pixel of the view's photo in the pool of photos.
    pub photo_offset_px: u32,
    /// Learning rate of centres.
    pub rate_position: f32,
    /// Learning rate of quaternions.
    pub rate_quaternion: f32,
    /// Learning rate of log-scales.
    pub rate_log_scale: f32,
    /// Learning rate of opacity logits.
    pub rate_opacity: f32,
    /// Learning rate of SH degree 0.
    pub rate_sh_dc: f32,
    /// Learning rate of higher SH degrees.
    pub rate_sh_rest: f32,
    /// Learning rate of texels.
    pub rate_texel: f32,
    /// Bias correction of the first moment, 1 / (1 - beta1^step).
    pub m_correction: f32,
    /// `rate_sh_dc` of the last completed step, for flushing.
    pub last_rate_sh_dc: f32,
    /// `rate_sh_rest` of the last completed step, for flushing.
    pub last_rate_sh_rest: f32,
    /// `rate_texel` of the last completed step, for flushing.
    pub last_rate_texel: f32,
    /// Bias correction of the second moment's root, 1 / sqrt(1 - beta2^step).
    pub v_correction_sqrt: f32,
    /// Weight of the distortion term.
    pub loss_distortion: f32,
    /// Weight of the normal term.
    pub loss_normal: f32,
    /// Exponent by which the texels' learning rate grows with the size of the map.
    pub rate_texel_growth: f32,
    /// Largest factor of that growth.
    pub rate_texel_growth_limit: f32,
    /// `rate_texel_growth` of the last completed step, for flushing.
    pub last_rate_texel_growth: f32,
    /// `rate_texel_growth_limit` of the last completed step, for flushing.
    pub last_rate_texel_growth_limit: f32,
    /// Variance of the low-pass filter; 0: none.
    pub filter_px2: f32,
    /// What the first moments of a probe are multiplied by.
    pub probe_scale: f32,
    /// Learning rate of centres in the last completed step, for splats that it did not see.
    pub last_rate_position: f32,
    /// As `last_rate_position`, of quaternions.
    pub last_rate_quaternion: f32,
    /// As `last_rate_position`, of log-scales.
    pub last_rate_log_scale: f32,
    /// As `last_rate_position`, of opacity logits.
    pub last_rate_opacity: f32,
    /// `m_correction` of the last completed step.
    pub last_m_correction: f32,
    /// `v_correction_sqrt` of the last completed step.
    pub last_v_correction_sqrt: f32,
    /// First pair, in the order of tiles, whose partial sums the buffer holds.
    pub partial_first: u32,
    /// Number of pairs whose partial sums it can hold.
    pub partial_capacity: u32,
    /// Pairs of a segment (`shaders/common/segments.wgsl`); 0: tiles are whole.
    pub segment_pairs: u32,
    /// Pads to a multiple of 16 bytes.
    pub pad: u32,
}

/// Sums of a tile-splat pair.
pub const PAIR_SUMS: u32 = 17;
/// The same with window statistics.
pub const PAIR_SUMS_STATISTICS: u32 = 20;
/// The same with distortion and normal terms, which imply window statistics.
pub const PAIR_SUMS_GEOMETRY: u32 = 24;

/// Flushed parameters are stored: a training step, not an image.
pub const FLAG_PERSIST: u32 = 1;
/// Window statistics are accumulated.
pub const FLAG_STATISTICS: u32 = 2;
/// All maps are flushed and activated, not only those of visible splats.
pub const FLAG_ALL_MAPS: u32 = 4;
/// The array is that of second moments: new texels get those of the nearest one, new coefficients those of DC.
pub const FLAG_SECOND_MOMENTS: u32 = 8;
/// The variant that counts global atomics reports them in place of faults.
pub const FLAG_COUNT_ATOMICS: u32 = 16;
/// Splats that the step before in the submission did not see take that step.
pub const FLAG_INVISIBLE: u32 = 32;
/// Nothing else, as no step follows in the submission.
pub const FLAG_NO_VIEW: u32 = 64;

/// One pass of the radix sort (`shaders/common/sort.wgsl`).
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct SortPass {
    /// Number of key bits below the digit.
    pub shift: u32,
    /// 1: one key per pair, 0: one per visible splat, as counted in the status.
    pub counts_pairs: u32,
    /// 1: the values are the indices of the keys, and are not read.
    pub identity_values: u32,
    /// 1: another pass follows, whose digits are counted on the way.
    pub counts_next: u32,
}

/// What a splat has besides its parameters: position and size of its map, its SH degree (`shaders/common/splat.wgsl`).
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct SplatInfo {
    /// First texel of the map in the pool.
    pub map_offset_texels: u32,
    /// Size of the map: rows | cols << 16.
    pub map_size: u32,
    /// Edges of a texel along u and v, local units.
    pub texel_sizes: [f32; 2],
    /// Texture coordinates of the splat's centre.
    pub map_origin: [f32; 2],
    /// Step up to which SH and texels have been flushed.
    pub last_step: u32,
    /// First float of its parameters << 2 | SH degree.
    pub parameters: u32,
}

/// How a density-control plan changes a map (`shaders/common/map_change.wgsl`).
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct MapChange {
    /// Old splat that the new one is made from.
    pub source: u32,
    /// `CHANGE_*` along u | that along v << 8, or [`CHANGE_RESAMPLE`].
    pub kind: u32,
    /// Row where the window begins; for resampled maps the bits of the row of the old map, as a texture coordinate, at
    /// the new centre.
    pub first_row: i32,
    /// As `first_row`, along v.
    pub first_col: i32,
}

/// A window of the map's own texel grid.
pub const CHANGE_SAME: u32 = 0;
/// A window of the grid with half the edge.
pub const CHANGE_FINER: u32 = 1;
/// A window of the grid with twice the edge.
pub const CHANGE_COARSER: u32 = 2;
/// Bilinear resampling to another size.
pub const CHANGE_RESAMPLE: u32 = 1 << 16;

/// New parameters of a splat (`shaders/edit_splats.wgsl`).
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Edit {
    /// Centre, local frame.
    pub position: [f32; 3],
    /// Opacity before the sigmoid.
    pub opacity_logit: f32,
    /// Logarithms of the standard deviations.
    pub log_scales: [f32; 2],
    /// Index in the new model.
    pub splat: u32,
    /// Pads to a multiple of 16 bytes.
    pub pad: u32,
}

/// Bytes of a projected splat (`shaders/common/projected.wgsl`), which the host never reads back.
pub const PROJECTED_BYTES: u64 = 96;
/// Bytes of a splat's bounds (`shaders/common/bounds.wgsl`), which the host never reads back.
pub const BOUNDS_BYTES: u64 = 64;
/// Bytes of the sums over a block of splats (`shaders/common/splat_sums.wgsl`), which the host never reads back.
pub const SPLAT_SUMS_BYTES: u64 = 12;

/// Results of a step that the host reads (`shaders/common/status.wgsl`).
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Status {
    /// 1 once the step has been applied.
    pub done: u32,
    /// Pairs that the view needs; if they exceed the capacity, the step was not applied.
    pub needed_pairs: u32,
    /// Splats that touch a tile.
    pub visible: u32,
    /// Gradients that were not finite or did not fit fixed point.
    pub faults: u32,
    /// L1 term, weighted.
    pub l1: f32,
    /// SSIM term, weighted.
    pub dssim: f32,
    /// MSE term, weighted.
    pub mse: f32,
    /// Opacity term, weighted.
    pub opacity: f32,
    /// Texture terms, weighted.
    pub texture: f32,
    /// Pixel-splat pairs in the splats' boxes, if counted.
    pub evaluated: u32,
    /// Pixel-splat pairs with alpha >= 1/255, if counted.
    pub inside: u32,
    /// Pixel-splat pairs that were blended, if counted.
    pub blended: u32,
    /// Global atomics of the texel gradients, if counted.
    pub texel_atomics: u32,
    /// Distortion term, weighted.
    pub distortion: f32,
    /// Normal term, weighted.
    pub normal: f32,
    /// Pads to a multiple of 16 bytes.
    pub pad: u32,
    /// Sums from which the exposure is estimated, in the order of `ColourSums`; the last two are unused.
    pub colour_sums: [[f32; 4]; 6],
}

/// Number of workgroups of an indirect dispatch.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct DispatchArgs {
    /// Workgroups along x.
    pub x: u32,
    /// Workgroups along y.
    pub y: u32,
    /// Workgroups along z.
    pub z: u32,
}
