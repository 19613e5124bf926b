//! What `litetex bench-kernels` measures: counts made by the code that does the work, times by the device's
//! clock and the wall's, bytes by the table of [`traffic`](Traffic).

mod sort;
mod traffic;

pub use sort::{SortThroughput, sort_throughput};
pub use traffic::{Traffic, TrafficCounts, TrafficItem, TrafficShare};

use super::backend::{GpuBackend, GpuOptions};
use super::device::{DeviceWork, GpuDevice};
use super::kernels::KernelId;
use super::resources::Offsets;
use super::shader::TILE_PX;
use super::sort::{DEPTH_PASSES, num_tile_passes};
use super::uniform;
use crate::Result;
use crate::backend::{Backend as _, RasterCounters, StepReport, StepRequest};
use crate::camera::Camera;
use crate::clock::process_cpu_secs;
use crate::model::{AdamState, Model, SplatGroup};
use serde::Serialize;
use std::collections::BTreeMap;
use std::time::Instant;

/// Steps over which pairs are counted, and each variant is timed.
const FEW_STEPS: u32 = 4;
/// Steps that are done twice.
const REPEATED_STEPS: u32 = 8;

/// A device and what it allows.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct DeviceFigures {
    /// What `--device` takes for it.
    pub name: String,
    /// Adapter, driver and API.
    pub description: String,
    /// Whether it is hardware.
    pub hardware: bool,
    /// Whether dispatches can be timed.
    pub timestamps: bool,
    /// Largest binding, bytes.
    pub max_storage_buffer_binding_size: u64,
    /// Largest buffer, bytes.
    pub max_buffer_size: u64,
    /// Storage buffers of a kernel.
    pub max_storage_buffers_per_shader_stage: u32,
    /// Workgroup memory, bytes.
    pub max_compute_workgroup_storage_size: u32,
    /// Invocations of a workgroup.
    pub max_compute_invocations_per_workgroup: u32,
    /// Subgroup sizes, which the kernels do not depend on.
    pub subgroup_sizes: [u32; 2],
}

impl DeviceFigures {
    /// Of an open device.
    pub fn of(device: &GpuDevice) -> Self {
        let (limits, info) = (&device.limits, device.choice.adapter.get_info());
        Self {
            name: device.choice.name.clone(),
            description: device.choice.description.clone(),
            hardware: device.choice.hardware,
            timestamps: device.device.features().contains(wgpu::Features::TIMESTAMP_QUERY),
            max_storage_buffer_binding_size: limits.max_storage_buffer_binding_size,
            max_buffer_size: limits.max_buffer_size,
            max_storage_buffers_per_shader_stage: limits.max_storage_buffers_per_shader_stage,
            max_compute_workgroup_storage_size: limits.max_compute_workgroup_storage_size,
            max_compute_invocations_per_workgroup: limits.max_compute_invocations_per_workgroup,
            subgroup_sizes: [info.subgroup_min_size, info.subgroup_max_size],
        }
    }
}

/// Work asked of the device, per step.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct WorkPerStep {
    /// Dispatches.
    pub dispatches: f64,
    /// Submissions, those that copy the status included.
    pub submissions: f64,
    /// Times that the host waited.
    pub host_waits: f64,
}

/// Pairs of pixels and splats, per pixel; means over a few views.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct PairFigures {
    /// Tile-splat pairs of a step, K.
    pub tile_pairs: f64,
    /// Pixels of whole tiles, 256 K / P on hardware, 128 K / P on software, whose tiles are half as high.
    pub visited: f64,
    /// Pixels in the splat's box.
    pub evaluated: f64,
    /// ... with alpha of at least 1/255.
    pub inside: f64,
    /// ... blended.
    pub blended: f64,
    /// Pairs in vain.
    pub evaluated_per_blended: f64,
    /// Cost of the tiles' edges.
    pub visited_per_evaluated: f64,
}

/// Global atomics of texel gradients, counted by a variant of the kernel.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct AtomicFigures {
    /// Of a step.
    pub per_step: f64,
    /// Per pair of pixel and splat that is blended.
    pub per_blended_pair: f64,
}

/// Times of the rasterisation in one of its two forms; `null` without a device clock.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct VariantTimes {
    /// Whether it is the form for hardware.
    pub hardware_kernels: bool,
    /// Median, forward.
    pub raster_fwd_secs: Option<f64>,
    /// Median, backward.
    pub raster_bwd_secs: Option<f64>,
}

/// Everything measured on one scene.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct KernelFigures {
    /// Splats.
    pub splats: usize,
    /// Texels.
    pub texels: usize,
    /// Views, each seen once before anything is measured.
    pub views: u32,
    /// Largest width and height.
    pub size_px: [u32; 2],
    /// Steps measured.
    pub steps: u32,
    /// Steps of a submission.
    pub batch_steps: usize,
    /// Wall time.
    pub wall_secs_per_step: f64,
    /// CPU time of the process; a software device computes in it too.
    pub cpu_secs_per_step: f64,
    /// Over the wall time.
    pub steps_per_sec: f64,
    /// Counted where it is done.
    pub per_step: WorkPerStep,
    /// Median over the steps, by name of the shader, largest first; `null` without a device clock.
    pub kernel_secs: Option<Vec<(&'static str, f64)>>,
    /// Pairs per pixel.
    pub pairs: PairFigures,
    /// Global atomics.
    pub texel_atomics: AtomicFigures,
    /// What the traffic follows from.
    pub traffic_counts: TrafficCounts,
    /// Bytes.
    pub traffic: Traffic,
    /// Both forms of the rasterisation.
    pub variants: Vec<VariantTimes>,
    /// Whether the same steps gave the same bytes twice.
    pub repeatable: bool,
    /// FNV-1a of the state after them.
    pub state_hash: String,
}

/// Measures. `request` makes a step (from 1) that shows view `(step - 1) % views`.
///
/// # Errors
/// [`crate::Error::Device`] if memory or the device fails.
pub fn measure<'a>(
    backend: &mut GpuBackend,
    model: &Model,
    steps: u32,
    views: u32,
    request: &dyn Fn(u32) -> StepRequest<'a>,
) -> Result<KernelFigures> {
    let plain = GpuOptions::default();
    let timed = GpuOptions { time_kernels: true, ..plain };
    let mut bench = Bench { backend, next: 1, request };
    bench.restart(model, plain)?;
    bench.run(views)?;

    let (work, cpu, wall) = (bench.backend.gpu().work(), process_cpu_secs(), Instant::now());
    let batch_steps = bench.backend.batch_steps();
    bench.run(steps)?;
    let per = |total: f64| total / f64::from(steps);
    let wall_secs_per_step = per(wall.elapsed().as_secs_f64());
    let cpu_secs_per_step = per(process_cpu_secs() - cpu);
    let per_step = work_per_step(work, bench.backend.gpu().work(), steps);

    bench.backend.set_options(timed)?;
    let kernel_secs = medians(&bench.run(steps)?);
    let (pairs, texel_atomics, traffic_counts, traffic) = bench.count(model)?;
    let mut variants = Vec::new();
    for hardware_kernels in [false, true] {
        bench.backend.set_options(GpuOptions { hardware_kernels: Some(hardware_kernels), ..timed })?;
        // The first run of a kernel may compile it.
        bench.run(1)?;
        let times = medians(&bench.run(FEW_STEPS)?);
        let of =
            |name| times.as_ref().and_then(|t| t.iter().find(|(n, _)| *n == name)).map(|(_, secs)| *secs);
        let (raster_fwd_secs, raster_bwd_secs) = (of("raster_fwd"), of("raster_bwd"));
        variants.push(VariantTimes { hardware_kernels, raster_fwd_secs, raster_bwd_secs });
    }
    let mut hashes = Vec::new();
    for _ in 0..2 {
        bench.restart(model, plain)?;
        bench.run(REPEATED_STEPS)?;
        let (model, adam) = bench.backend.read_back()?;
        hashes.push(state_hash(&model, &adam));
    }
    let size_px = (1..=views)
        .map(|step| request(step).camera.pinhole)
        .fold([0, 0], |[w, h]: [u32; 2], p| [w.max(p.width_px), h.max(p.height_px)]);
    Ok(KernelFigures {
        splats: model.num_splats(),
        texels: model.num_texels(),
        views,
        size_px,
        steps,
        batch_steps,
        wall_secs_per_step,
        cpu_secs_per_step,
        steps_per_sec: 1.0 / wall_secs_per_step.max(1e-12),
        per_step,
        kernel_secs,
        pairs,
        texel_atomics,
        traffic_counts,
        traffic,
        variants,
        repeatable: hashes[0] == hashes[1],
        state_hash: format!("{:016x}", hashes[0]),
    })
}

/// A backend and where it stands.
struct Bench<'a, 'b> {
    backend: &'b mut GpuBackend,
    next: u32,
    request: &'b dyn Fn(u32) -> StepRequest<'a>,
}

impl Bench<'_, '_> {
    fn restart(&mut self, model: &Model, options: GpuOptions) -> Result<()> {
        self.backend.set_options(options)?;
        self.backend.upload(model, &AdamState::zeros(model))?;
        self.next = 1;
        Ok(())
    }

    fn run(&mut self, steps: u32) -> Result<Vec<StepReport>> {
        let requests: Vec<_> = (self.next..self.next + steps).map(self.request).collect();
        self.next += steps;
        self.backend.steps(&requests)
    }

    /// A few steps, one by one, with everything counted.
    fn count(&mut self, model: &Model) -> Result<(PairFigures, AtomicFigures, TrafficCounts, Traffic)> {
        let counting = GpuOptions {
            count_pairs: true,
            count_texel_atomics: true,
            batch_steps: 1,
            ..GpuOptions::default()
        };
        self.backend.set_options(counting)?;
        let (mut sum, mut counts) = (RasterCounters::default(), TrafficCounts::default());
        let mut before = self.backend.read_back()?.1.last_step;
        for _ in 0..FEW_STEPS {
            let (step, camera) = (self.next, (self.request)(self.next).camera);
            let report = self.run(1)?.pop().unwrap_or_default();
            let after = self.backend.read_back()?.1.last_step;
            let c = report.counters;
            sum.pixels += c.pixels;
            sum.tile_pairs += c.tile_pairs;
            sum.evaluated_pairs += c.evaluated_pairs;
            sum.inside_pairs += c.inside_pairs;
            sum.blended_pairs += c.blended_pairs;
            counts.texel_atomics += report.non_finite_gradients as f64;
            for (i, map) in model.textures.maps.iter().enumerate().filter(|(i, _)| after[*i] == step) {
                let (texels, lags) = (map.num_texels() as f64, before[i] + 1 < step);
                counts.visible += 1.0;
                counts.visible_texels += texels;
                counts.lagging += f64::from(u8::from(lags));
                counts.lagging_texels += if lags { texels } else { 0.0 };
            }
            let [cols, rows] = uniform::grid(&camera, self.backend.tile_rows_px);
            counts.tiles += f64::from(cols * rows);
            counts.tile_passes += f64::from(num_tile_passes(cols * rows));
            before = after;
        }
        let mean = |total: f64| total / f64::from(FEW_STEPS);
        let counts = TrafficCounts {
            splats: model.num_splats() as f64,
            visible: mean(counts.visible),
            lagging: mean(counts.lagging),
            pairs: mean(sum.tile_pairs as f64),
            pixels: mean(sum.pixels as f64),
            tiles: mean(counts.tiles),
            visible_texels: mean(counts.visible_texels),
            lagging_texels: mean(counts.lagging_texels),
            sh_floats: SplatGroup::Sh.width(model.splats.sh_degree) as f64,
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
        let tile_pixels = u64::from(TILE_PX * self.backend.tile_rows_px);
        Ok((pair_figures(&sum, counts.pairs, tile_pixels), atomics, counts, traffic))
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

fn work_per_step(before: DeviceWork, after: DeviceWork, steps: u32) -> WorkPerStep {
    let per = |before: u64, after: u64| (after - before) as f64 / f64::from(steps);
    WorkPerStep {
        dispatches: per(before.dispatches, after.dispatches),
        submissions: per(before.submissions, after.submissions),
        host_waits: per(before.waits, after.waits),
    }
}

/// Median time by kernel, largest first; `None` without times.
fn medians(reports: &[StepReport]) -> Option<Vec<(&'static str, f64)>> {
    let mut times: BTreeMap<&'static str, Vec<f64>> = BTreeMap::new();
    for (name, time) in reports.iter().flat_map(|r| &r.stages) {
        times.entry(name).or_default().push(time.as_secs_f64());
    }
    let mut out: Vec<_> = times
        .into_iter()
        .map(|(name, mut times)| {
            times.sort_by(f64::total_cmp);
            (name, times[times.len() / 2])
        })
        .collect();
    out.sort_by(|a, b| b.1.total_cmp(&a.1));
    (!out.is_empty()).then_some(out)
}

/// FNV-1a over the bytes of the state.
fn state_hash(model: &Model, adam: &AdamState) -> u64 {
    let arrays = [&model.splats, &adam.splats_m, &adam.splats_v];
    let splats = arrays.into_iter().flat_map(|a| SplatGroup::ALL.map(|g| a.group(g)));
    let texels = [&model.textures.texels, &adam.texels_m, &adam.texels_v];
    let floats = splats.chain(texels).flat_map(|values| bytemuck::cast_slice::<f32, u8>(values));
    floats
        .chain(bytemuck::cast_slice(&adam.last_step))
        .fold(0xcbf2_9ce4_8422_2325, |hash, byte| (hash ^ u64::from(*byte)).wrapping_mul(0x0100_0000_01b3))
}

impl GpuBackend {
    /// Kernels of a step without window statistics, each once.
    fn kernels_of_step(&self, camera: &Camera) -> Vec<KernelId> {
        let dispatches = self.step_dispatches(Offsets::default(), camera, false, false);
        let mut kernels: Vec<_> = dispatches.iter().map(|d| d.kernel).collect();
        kernels.sort_unstable();
        kernels.dedup();
        kernels
    }
}
