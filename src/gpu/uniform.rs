//! Fills in the uniforms of training steps and images.

use super::layout::{
    FLAG_INVISIBLE, FLAG_NO_VIEW, FLAG_PERSIST, FLAG_STATISTICS, PAIR_SUMS, PAIR_SUMS_GEOMETRY,
    PAIR_SUMS_STATISTICS, StepUniform,
};
use super::shader::{FIXED_MAX, TILE_PX};
use crate::backend::{ColourMap, LossWeights, StepRequest, probe_scale};
use crate::camera::Camera;
use crate::constants::{ADAM_BETA1, ADAM_BETA2};
use crate::model::LearningRates;

/// State of a backend that every uniform contains.
#[derive(Clone, Copy, Debug)]
pub(super) struct UniformInputs {
    pub num_splats: u32,
    pub near: f32,
    /// Variance of the low-pass filter.
    pub filter_px2: f32,
    pub pair_capacity: u32,
    /// Height of the rasterisation's tiles.
    pub tile_rows_px: u32,
    /// Pairs of a segment; 0: tiles are whole.
    pub segment_pairs: u32,
    /// Last completed step.
    pub flushed_step: u32,
    /// Learning rates of that step.
    pub flushed_rates: LearningRates,
}

/// Columns and rows of tiles.
pub(super) fn grid(camera: &Camera, tile_rows_px: u32) -> [u32; 2] {
    [camera.pinhole.width_px.div_ceil(TILE_PX), camera.pinhole.height_px.div_ceil(tile_rows_px)]
}

/// Uniform of dispatches that use no view.
pub(super) fn without_view(inputs: &UniformInputs, flags: u32) -> StepUniform {
    let [last_m_correction, last_v_correction_sqrt] = bias_corrections(inputs.flushed_step.max(1));
    StepUniform {
        near: inputs.near,
        filter_px2: inputs.filter_px2,
        num_splats: inputs.num_splats,
        flushed_step: inputs.flushed_step,
        pair_capacity: inputs.pair_capacity,
        partial_stride: PAIR_SUMS,
        last_rate_sh_dc: inputs.flushed_rates.sh_dc,
        last_rate_sh_rest: inputs.flushed_rates.sh_rest,
        last_rate_position: inputs.flushed_rates.position,
        last_rate_quaternion: inputs.flushed_rates.quaternion,
        last_rate_log_scale: inputs.flushed_rates.log_scale,
        last_rate_opacity: inputs.flushed_rates.opacity,
        last_m_correction,
        last_v_correction_sqrt,
        last_rate_texel: inputs.flushed_rates.texel,
        last_rate_texel_growth: inputs.flushed_rates.texel_growth,
        last_rate_texel_growth_limit: inputs.flushed_rates.texel_growth_limit,
        flags,
        ..StepUniform::default()
    }
}

/// Uniform of `project` after the last step of a submission: splats that it did not see take it.
pub(super) fn end(inputs: &UniformInputs) -> StepUniform {
    without_view(inputs, FLAG_INVISIBLE | FLAG_NO_VIEW)
}

/// Bias corrections of both moments, 1 / (1 - beta1^t) and 1 / sqrt(1 - beta2^t).
fn bias_corrections(step: u32) -> [f32; 2] {
    let t = f64::from(step);
    [(1.0 / (1.0 - ADAM_BETA1.powf(t))) as f32, (1.0 / (1.0 - ADAM_BETA2.powf(t)).sqrt()) as f32]
}

/// Uniform of an image.
pub(super) fn image(
    inputs: &UniformInputs,
    camera: &Camera,
    background: [f32; 3],
    sh_degree: u32,
) -> StepUniform {
    let rotation = camera.camera_from_local.rotation;
    let translation = camera.camera_from_local.translation;
    let row = |r: usize| {
        [0, 1, 2, 3].map(|c| if c < 3 { rotation.col(c)[r] as f32 } else { translation[r] as f32 })
    };
    let pinhole = &camera.pinhole;
    StepUniform {
        camera_row0: row(0),
        camera_row1: row(1),
        camera_row2: row(2),
        camera_in_local: camera.centre_in_local().as_vec3().to_array(),
        focal_px: [pinhole.fx_px as f32, pinhole.fy_px as f32],
        principal_px: [pinhole.cx_px as f32, pinhole.cy_px as f32],
        size_px: [pinhole.width_px, pinhole.height_px],
        grid: grid(camera, inputs.tile_rows_px),
        background,
        sh_degree,
        ..without_view(inputs, 0)
    }
}

/// Floats per pair in the partial sums of a step.
pub(super) fn partial_stride(geometry: bool, statistics: bool) -> u32 {
    match (geometry, statistics) {
        (true, _) => PAIR_SUMS_GEOMETRY,
        (false, true) => PAIR_SUMS_STATISTICS,
        (false, false) => PAIR_SUMS,
    }
}

/// Uniform of a training step.
pub(super) fn step(
    inputs: &UniformInputs,
    request: &StepRequest<'_>,
    photo_offset_px: u32,
    status_slot: u32,
) -> StepUniform {
    let (loss, rates) = (&request.loss, &request.rates);
    let [m_correction, v_correction_sqrt] = bias_corrections(request.step);
    let num_pixels = request.camera.pinhole.num_pixels() as f64;
    let statistics = if request.accumulate_statistics { FLAG_STATISTICS } else { 0 };
    let exposure = request.exposure.unwrap_or(ColourMap::IDENTITY);
    let [exposure_row0, exposure_row1, exposure_row2] = exposure.0;
    StepUniform {
        exposure_row0,
        exposure_row1,
        exposure_row2,
        step: request.step,
        flags: FLAG_PERSIST | statistics,
        status_slot,
        partial_stride: partial_stride(loss.needs_geometry(), request.accumulate_statistics),
        loss_l1: loss.l1,
        loss_dssim: loss.dssim,
        loss_mse: loss.mse,
        loss_distortion: loss.distortion,
        loss_normal: loss.normal,
        opacity_weight: loss.opacity / inputs.num_splats.max(1) as f32,
        texture_weight: loss.texture,
        texel_units: (3.0 * num_pixels * FIXED_MAX / gradient_bound(loss)) as f32,
        photo_offset_px,
        segment_pairs: if loss.needs_geometry() { 0 } else { inputs.segment_pairs },
        probe_scale: probe_scale(request.target.rgb.len(), &exposure),
        rate_position: rates.position,
        rate_quaternion: rates.quaternion,
        rate_log_scale: rates.log_scale,
        rate_opacity: rates.opacity,
        rate_sh_dc: rates.sh_dc,
        rate_sh_rest: rates.sh_rest,
        rate_texel: rates.texel,
        rate_texel_growth: rates.texel_growth,
        rate_texel_growth_limit: rates.texel_growth_limit,
        m_correction,
        v_correction_sqrt,
        ..image(inputs, &request.camera, request.background, request.sh_degree)
    }
}

/// Upper bound of the derivative of the loss w.r.t. a channel of a pixel, times the number of channels, rounded up to
/// a power of two: 1 for L1; 2 per unit of difference for MSE; 2 / sqrt(C2) for SSIM, reached where the photo is
/// flat under the window. Poisoned images may exceed it; their gradients are clamped and counted.
fn gradient_bound(loss: &LossWeights) -> f64 {
    let bound = f64::from(loss.l1) + 4.0 * f64::from(loss.mse) + 67.0 * f64::from(loss.dssim);
    bound.max(1e-6).log2().ceil().exp2()
}
