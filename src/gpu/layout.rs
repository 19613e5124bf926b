//! Structures as the shaders see them. Scalars only, in the order and at the offsets of the WGSL structs of
//! the same names (a test compares every member).

use bytemuck::{Pod, Zeroable};

/// One iteration or one image (`shaders/common/step.wgsl`).
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct StepUniform {
    /// camera_from_local, rows; translation in the last column.
    pub camera_row0: [f32; 4],
    /// Second row.
    pub camera_row1: [f32; 4],
    /// Third row.
    pub camera_row2: [f32; 4],
    /// Camera's centre.
    pub camera_in_local: [f32; 3],
    /// Near plane, local units.
    pub near: f32,
    /// Focal lengths.
    pub focal_px: [f32; 2],
    /// Principal point.
    pub principal_px: [f32; 2],
    /// Width and height.
    pub size_px: [u32; 2],
    /// Columns and rows of tiles.
    pub grid: [u32; 2],
    /// Display-space colour behind everything.
    pub background: [f32; 3],
    /// Splats of the model.
    pub num_splats: u32,
    /// SH degree to evaluate.
    pub sh_degree: u32,
    /// Floats per splat in the parameter arrays.
    pub splat_stride: u32,
    /// From 1; in images 0.
    pub step: u32,
    /// Steps that are done.
    pub flushed_step: u32,
    /// `FLAG_*`
    pub flags: u32,
    /// Which entry of the status ring is this step's.
    pub status_slot: u32,
    /// Pairs that the buffers hold.
    pub pair_capacity: u32,
    /// Floats of a pair's partial sums.
    pub partial_stride: u32,
    /// Weight of L1.
    pub loss_l1: f32,
    /// Weight of 1 - SSIM.
    pub loss_dssim: f32,
    /// Weight of the squared difference.
    pub loss_mse: f32,
    /// Weight of the opacity term over the number of splats.
    pub opacity_weight: f32,
    /// Weight of the texture term.
    pub texture_weight: f32,
    /// Weight of the texture term on hidden maps.
    pub texture_hidden_weight: f32,
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
    /// 1 / (1 - beta1^step)
    pub m_correction: f32,
    /// The same rates of the step before.
    pub last_rate_sh_dc: f32,
    /// The same rates of the step before.
    pub last_rate_sh_rest: f32,
    /// The same rates of the step before.
    pub last_rate_texel: f32,
    /// 1 / sqrt(1 - beta2^step)
    pub v_correction_sqrt: f32,
    /// Weight of the distortion term.
    pub loss_distortion: f32,
    /// Weight of the normal term.
    pub loss_normal: f32,
    /// Growth of the texels' rates with the size of a map.
    pub rate_texel_growth: f32,
    /// Its limit.
    pub rate_texel_growth_limit: f32,
    /// The same of the step before.
    pub last_rate_texel_growth: f32,
    /// The same of the step before.
    pub last_rate_texel_growth_limit: f32,
    /// To a multiple of 16 bytes.
    pub pad0: u32,
    /// To a multiple of 16 bytes.
    pub pad1: u32,
}

/// Lagging parameters are stored when they are brought up to date.
pub const FLAG_PERSIST: u32 = 1;
/// Window statistics are summed up.
pub const FLAG_STATISTICS: u32 = 2;
/// Every map is activated, seen or not.
pub const FLAG_ALL_MAPS: u32 = 4;
/// Outside of a map is its nearest texel, not nothing.
pub const FLAG_NEAREST_OUTSIDE: u32 = 8;
/// What comes in the place of faults are atomics: of the variant that counts them.
pub const FLAG_COUNT_ATOMICS: u32 = 16;

/// One pass of the radix sort (`shaders/common/sort.wgsl`).
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct SortPass {
    /// Bits below the digit.
    pub shift: u32,
    /// 1: as many keys as the status says there are pairs, 0: as many as splats.
    pub counts_pairs: u32,
    /// 1: values are the indices of their keys and are not read.
    pub identity_values: u32,
    /// To a multiple of 16 bytes.
    pub pad: u32,
}

/// Place and size of a map (`shaders/common/splat.wgsl`).
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct SplatInfo {
    /// First texel of the map in the pool.
    pub map_offset_texels: u32,
    /// rows | cols << 16
    pub map_size: u32,
    /// Edge of a texel, local units.
    pub texel_size: f32,
    /// Step up to which SH and texels have been brought.
    pub last_step: u32,
}

/// What a density-control plan makes of a map (`shaders/common/map_change.wgsl`).
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct MapChange {
    /// Splat that the new one comes from.
    pub source: u32,
    /// `CHANGE_*`
    pub kind: u32,
    /// Row of the grid that becomes row 0; not of resampled maps.
    pub first_row: i32,
    /// Column of the grid that becomes column 0.
    pub first_col: i32,
}

/// A window of the map's own texels, ...
pub const CHANGE_SAME: u32 = 0;
/// ... of a grid of texels of half the edge, ...
pub const CHANGE_FINER: u32 = 1;
/// ... of twice the edge.
pub const CHANGE_COARSER: u32 = 2;
/// Bilinear resampling to another size.
pub const CHANGE_RESAMPLE: u32 = 3;

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
    /// To a multiple of 16 bytes.
    pub pad: u32,
}

/// Bytes of a projected splat (`shaders/common/projected.wgsl`), which the host never reads.
pub const PROJECTED_BYTES: u64 = 80;
/// Bytes of a splat's bounds (`shaders/common/bounds.wgsl`), which the host never reads.
pub const BOUNDS_BYTES: u64 = 64;
/// Bytes of the sums over a block of splats (`shaders/common/splat_sums.wgsl`), which the host never reads.
pub const SPLAT_SUMS_BYTES: u64 = 16;

/// What a step tells the host (`shaders/common/status.wgsl`).
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Status {
    /// 1 once the step has been applied.
    pub done: u32,
    /// Pairs that the view needs.
    pub needed_pairs: u32,
    /// Splats that touch a tile.
    pub visible: u32,
    /// Gradient entries that were not finite or did not fit fixed point.
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
    /// Pixel-splat pairs for which the falloff was computed, where counted.
    pub evaluated: u32,
    /// ... with alpha >= 1/255.
    pub inside: u32,
    /// ... blended.
    pub blended: u32,
    /// Global atomics of the texel gradients, where counted.
    pub texel_atomics: u32,
    /// Distortion term, weighted.
    pub distortion: f32,
    /// Normal term, weighted.
    pub normal: f32,
    /// To a multiple of 16 bytes.
    pub pad: u32,
}

/// Groups of an indirect dispatch.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct DispatchArgs {
    /// Groups along x.
    pub x: u32,
    /// Groups along y.
    pub y: u32,
    /// Groups along z.
    pub z: u32,
}
