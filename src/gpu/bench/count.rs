//! Counts pairs, atomics and bytes of steps with either variant of the rasterisation, one step at a time.

use super::{AtomicFigures, BenchRun, CountFigures, Deadline, PairFigures, Traffic, TrafficCounts};
use crate::Result;
use crate::backend::{Backend as _, RasterCounters, StepRequest};
use crate::camera::Camera;
use crate::gpu::form::GpuOptions;
use crate::gpu::kernels::{Buf, KernelId};
use crate::gpu::resources::UniformOffsets;
use crate::gpu::segments::num_boundaries;
use crate::gpu::shader::TILE_PX;
use crate::gpu::sort::{DEPTH_PASSES, num_tile_passes};
use crate::gpu::state::GpuBackend;
use crate::gpu::uniform;
use crate::model::Model;

/// Counts pairs, atomics and bytes of `steps` steps with the variant of the rasterisation that the options choose.
///
/// # Errors
/// [`crate::Error::Device`] if allocation or the device fails.
pub fn count<'a>(
    backend: &mut GpuBackend,
    model: &Model,
    steps: u32,
    variant: GpuOptions,
    request: &dyn Fn(u32) -> StepRequest<'a>,
) -> Result<Option<CountFigures>> {
    let mut bench = BenchRun { backend, next: 1, request, deadline: Deadline::new(None), step_secs: 0.0 };
    bench.restart(model, counting(variant))?;
    bench.count(model, steps, variant, 1.0)
}

/// Options that count everything, one step per submission.
fn counting(variant: GpuOptions) -> GpuOptions {
    GpuOptions {
        count_pairs: true,
        count_texel_atomics: true,
        batch_steps: Some(1),
        time_kernels: false,
        ..variant
    }
}

impl BenchRun<'_, '_> {
    /// Counts at most `steps` steps, as far as a share of the time left allows.
    pub(super) fn count(
        &mut self,
        model: &Model,
        steps: u32,
        variant: GpuOptions,
        share: f64,
    ) -> Result<Option<CountFigures>> {
        let deadline = self.deadline.share(share);
        self.backend.set_options(counting(variant))?;
        let (mut sum, mut counts) = (RasterCounters::default(), TrafficCounts::default());
        let mut before = self.backend.read_back()?.1.last_step;
        let mut counted = 0;
        while counted < steps && deadline.allows(self.step_secs) {
            counted += 1;
            let (step, camera) = (self.next, (self.request)(self.next).camera);
            let report = self.run(1)?.pop().unwrap_or_default();
            let after = self.backend.read_back()?.1.last_step;
            let c = report.counters;
            sum.pixels += c.pixels;
            sum.tile_pairs += c.tile_pairs;
            sum.evaluated_pairs += c.evaluated_pairs;
            sum.inside_pairs += c.inside_pairs;
            sum.blended_pairs += c.blended_pairs;
            counts.texel_atomics += c.texel_atomics as f64;
            for (i, map) in model.textures.maps.iter().enumerate().filter(|(i, _)| after[*i] == step) {
                let (texels, lags) = (map.num_texels() as f64, before[i] + 1 < step);
                counts.visible += 1.0;
                counts.visible_texels += texels;
                counts.lagging += f64::from(u8::from(lags));
                counts.lagging_texels += if lags { texels } else { 0.0 };
            }
            let [cols, rows] = uniform::grid(&camera, self.backend.form.tile_rows_px);
            counts.tiles += f64::from(cols * rows);
            counts.states += self.backend.num_states((cols * rows) as usize)? as f64;
            counts.tile_passes += f64::from(num_tile_passes(cols * rows));
            before = after;
        }
        if counted == 0 {
            return Ok(None);
        }
        let mean = |total: f64| total / f64::from(counted);
        let counts = TrafficCounts {
            splats: model.num_splats() as f64,
            visible: mean(counts.visible),
            lagging: mean(counts.lagging),
            pairs: mean(sum.tile_pairs as f64),
            windows: if self.backend.form.sum_lanes > 0 { 0.0 } else { mean(sum.tile_pairs as f64) },
            states: mean(counts.states),
            pixels: mean(sum.pixels as f64),
            tiles: mean(counts.tiles),
            visible_texels: mean(counts.visible_texels),
            lagging_texels: mean(counts.lagging_texels),
            sh_floats: model.splats.sh.len() as f64 / model.num_splats().max(1) as f64,
            texel_atomics: mean(counts.texel_atomics),
            depth_passes: f64::from(DEPTH_PASSES),
            tile_passes: mean(counts.tile_passes),
        };
        let traffic = Traffic::of(&self.backend.kernels_of_step(&(self.request)(1).camera), &counts);
        let blended = (sum.blended_pairs as f64).max(1.0);
        let atomics = AtomicFigures {
            per_step: counts.texel_atomics,
            per_blended_pair: counts.texel_atomics / mean(blended),
        };
        let tile_pixels = u64::from(TILE_PX * self.backend.form.tile_rows_px);
        let pairs = pair_figures(&sum, counts.pairs, tile_pixels);
        Ok(Some(CountFigures { pairs, texel_atomics: atomics, traffic_counts: counts, traffic }))
    }
}

fn pair_figures(sum: &RasterCounters, tile_pairs: f64, tile_pixels: u64) -> PairFigures {
    let per_pixel = |n: u64| n as f64 / sum.pixels.max(1) as f64;
    let (visited, evaluated) = (tile_pixels * sum.tile_pairs, sum.evaluated_pairs);
    PairFigures {
        tile_pairs,
        visited: per_pixel(visited),
        evaluated: per_pixel(evaluated),
        inside: per_pixel(sum.inside_pairs),
        blended: per_pixel(sum.blended_pairs),
        evaluated_per_blended: evaluated as f64 / sum.blended_pairs.max(1) as f64,
        visited_per_evaluated: visited as f64 / evaluated.max(1) as f64,
    }
}

impl GpuBackend {
    /// Most states of pixels that the last step stored: all, unless pixels ended before.
    fn num_states(&self, num_tiles: usize) -> Result<u64> {
        let ranges: Vec<[u32; 2]> = self.device.read(self.resources.buffer(Buf::TileRanges), num_tiles)?;
        let pairs = ranges.iter().map(|[first, past]| past - first);
        Ok(num_boundaries(pairs, self.form.segment_pairs) * u64::from(TILE_PX * self.form.tile_rows_px))
    }

    /// Kernels of a step without window statistics, each listed once.
    fn kernels_of_step(&self, camera: &Camera) -> Vec<KernelId> {
        let dispatches = self.step_dispatches(&[UniformOffsets::default()], camera, false, false, false);
        let mut kernels: Vec<_> = dispatches.iter().map(|d| d.kernel).collect();
        kernels.sort_unstable();
        kernels.dedup();
        kernels
    }
}
