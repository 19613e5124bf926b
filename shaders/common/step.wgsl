// Inputs of one training step or one image. Mirrors `layout::StepUniform`.

struct Step {
    // camera_from_local, rows; translation in w.
    camera_row0: vec4f,
    camera_row1: vec4f,
    camera_row2: vec4f,
    // Rows of the exposure: factors of r, g, b and 1.
    exposure_row0: vec4f,
    exposure_row1: vec4f,
    exposure_row2: vec4f,
    camera_in_local: vec3f,
    near: f32,
    focal_px: vec2f,
    principal_px: vec2f,
    size_px: vec2u,
    // Columns and rows of tiles.
    grid: vec2u,
    background: vec3f,
    num_splats: u32,
    // SH degree to evaluate.
    sh_degree: u32,
    // Counts from 1; 0 for images.
    step: u32,
    // Last completed step, up to which lazily updated parameters are flushed.
    flushed_step: u32,
    // FLAG_*
    flags: u32,
    status_slot: u32,
    pair_capacity: u32,
    // Floats per pair in the partial sums.
    partial_stride: u32,
    loss_l1: f32,
    loss_dssim: f32,
    loss_mse: f32,
    // Weight of the opacity term divided by the number of splats.
    opacity_weight: f32,
    texture_weight: f32,
    // Fixed-point units per unit of texel gradient for a splat of one pixel.
    texel_units: f32,
    // First pixel of the view's photo in the pool of photos.
    photo_offset_px: u32,
    rate_position: f32,
    rate_quaternion: f32,
    rate_log_scale: f32,
    rate_opacity: f32,
    rate_sh_dc: f32,
    rate_sh_rest: f32,
    rate_texel: f32,
    // 1 / (1 - beta1^t)
    m_correction: f32,
    // Learning rates of the last completed step, for flushing.
    last_rate_sh_dc: f32,
    last_rate_sh_rest: f32,
    last_rate_texel: f32,
    // 1 / sqrt(1 - beta2^t)
    v_correction_sqrt: f32,
    loss_distortion: f32,
    loss_normal: f32,
    // Growth of the texels' learning rate with the size of the map, and its limit; the same for the last
    // completed step.
    rate_texel_growth: f32,
    rate_texel_growth_limit: f32,
    last_rate_texel_growth: f32,
    last_rate_texel_growth_limit: f32,
    // Variance of the low-pass filter; 0: none.
    filter_px2: f32,
    // What the first moments of a probe are multiplied by.
    probe_scale: f32,
    // Learning rates and bias corrections of the last completed step, for splats that were invisible in it.
    last_rate_position: f32,
    last_rate_quaternion: f32,
    last_rate_log_scale: f32,
    last_rate_opacity: f32,
    last_m_correction: f32,
    last_v_correction_sqrt: f32,
    // The pairs whose partial sums the buffer holds, in the order of tiles: first and number.
    partial_first: u32,
    partial_capacity: u32,
    // Pairs of a segment (common/segments); 0: tiles are whole.
    segment_pairs: u32,
    pad: u32,
}

// Flushed parameters are stored: a training step, not an image.
const FLAG_PERSIST = 1u;
// Window statistics are accumulated.
const FLAG_STATISTICS = 2u;
// All maps are flushed and activated, not only those of visible splats.
const FLAG_ALL_MAPS = 4u;
// The array is that of second moments: new texels get those of the nearest one, new coefficients those of DC.
const FLAG_SECOND_MOMENTS = 8u;
// The variant that counts global atomics reports them in place of faults.
const FLAG_COUNT_ATOMICS = 16u;
// Splats that were invisible in the submission's step before take that step.
const FLAG_INVISIBLE = 32u;
// Nothing else, as no step follows in the submission.
const FLAG_NO_VIEW = 64u;

@group(0) @binding(0) var<uniform> step: Step;

// Tiles of the rasterisation are half as high for software drivers, which compute every pixel of a tile,
// whether the splat reaches it or not.
#if HALF_TILES
const TILE_ROWS_PX = HALF_TILE_ROWS_PX;
#else
const TILE_ROWS_PX = TILE_PX;
#endif
const RASTER_GROUP = TILE_PX * TILE_ROWS_PX;

// The loss always uses square tiles, in the same columns as the rasterisation.
fn num_loss_tiles() -> u32 {
    return step.grid.x * ((step.size_px.y + TILE_PX - 1u) / TILE_PX);
}

fn has_flag(flag: u32) -> bool {
    return (step.flags & flag) != 0u;
}

// Rotates a direction from the local frame into camera axes.
fn in_camera(v: vec3f) -> vec3f {
    return vec3f(dot(step.camera_row0.xyz, v), dot(step.camera_row1.xyz, v), dot(step.camera_row2.xyz, v));
}

// Inverse of in_camera.
fn in_local(v: vec3f) -> vec3f {
    return step.camera_row0.xyz * v.x + step.camera_row1.xyz * v.y + step.camera_row2.xyz * v.z;
}

fn camera_translation() -> vec3f {
    return vec3f(step.camera_row0.w, step.camera_row1.w, step.camera_row2.w);
}
