//! The measurements of `litetex-lab bench-kernels`: counts by the kernels themselves, times by the device's and the
//! wall clock, and bytes by the model of [`Traffic`].

pub mod count;
mod sort;
mod traffic;

pub use sort::{SortThroughput, sort_throughput};
pub use traffic::{Traffic, TrafficCounts, TrafficItem, TrafficShare};

use super::device::{DeviceWork, GpuDevice};
use super::form::GpuOptions;
use super::pace::Pace;
use super::state::GpuBackend;
use crate::Result;
use crate::backend::{Backend as _, StepReport, StepRequest};
use crate::clock::process_cpu_secs;
use crate::model::{AdamState, Model, SplatGroup};
use serde::Serialize;
use std::collections::BTreeMap;
use std::time::{Duration, Instant};

/// Steps for counting pairs, and for timing each variant.
const FEW_STEPS: u32 = 4;
/// Steps that are run twice and compared.
const REPEATED_STEPS: u32 = 8;
/// If steps take longer, the deadline is checked after each.
const SLOW_STEP_SECS: f64 = 0.1;
/// Largest share of the available time that the warm-up may take.
const WARM_UP_SHARE: f64 = 0.1;

/// End of the available time, if it is limited.
#[derive(Clone, Copy, Debug)]
pub struct Deadline(Option<Instant>);

impl Deadline {
    /// A deadline at `end`; `None` for unlimited time.
    pub fn new(end: Option<Instant>) -> Self {
        Self(end)
    }

    /// Time left; `None` if it is unlimited.
    pub fn left(self) -> Option<Duration> {
        self.0.map(|end| end.saturating_duration_since(Instant::now()))
    }

    /// Whether work of `secs` seconds ends before the deadline.
    pub fn allows(self, secs: f64) -> bool {
        self.left().is_none_or(|left| left.as_secs_f64() >= secs)
    }

    /// The end of a share of the time left.
    fn share(self, share: f64) -> Self {
        Self(self.left().map(|left| Instant::now() + left.mul_f64(share)))
    }
}

/// A device and its limits.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct DeviceFigures {
    /// Name that selects it with `--device`.
    pub name: String,
    /// Adapter, driver and API.
    pub description: String,
    /// Whether it is hardware.
    pub hardware: bool,
    /// Whether dispatches can be timed.
    pub timestamps: bool,
    /// Largest storage binding, bytes.
    pub max_storage_buffer_binding_size: u64,
    /// Largest buffer, bytes.
    pub max_buffer_size: u64,
    /// Most storage buffers per kernel.
    pub max_storage_buffers_per_shader_stage: u32,
    /// Most workgroup memory, bytes.
    pub max_compute_workgroup_storage_size: u32,
    /// Most invocations per workgroup.
    pub max_compute_invocations_per_workgroup: u32,
    /// Smallest and largest subgroup size.
    pub subgroup_sizes: [u32; 2],
}

impl DeviceFigures {
    /// The figures of an open device.
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

/// Work given to the device, per step.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct WorkPerStep {
    /// Dispatches per step.
    pub dispatches: f64,
    /// Submissions per step.
    pub submissions: f64,
    /// How often the host waited, per step.
    pub host_waits: f64,
    /// Photos sent, per step: 0 unless the views do not fit the device, or there was no time to send them before.
    pub photos: f64,
}

/// Pixel-splat pairs per pixel; means over a few steps.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct PairFigures {
    /// Tile-splat pairs of a step, K.
    pub tile_pairs: f64,
    /// Pairs in whole tiles: 256 K / P on hardware, 128 K / P on software, whose tiles are half as high.
    pub visited: f64,
    /// Pairs in the splats' boxes.
    pub evaluated: f64,
    /// Pairs with alpha of at least 1/255.
    pub inside: f64,
    /// Blended pairs.
    pub blended: f64,
    /// Pairs evaluated per blended pair.
    pub evaluated_per_blended: f64,
    /// Pairs visited per evaluated pair: the cost of tile edges.
    pub visited_per_evaluated: f64,
}

/// Global atomics of texel gradients, counted by a kernel variant.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct AtomicFigures {
    /// Atomics per step.
    pub per_step: f64,
    /// Atomics per blended pixel-splat pair.
    pub per_blended_pair: f64,
}

/// One of the variants of the rasterisation. Times are `null` without a device clock.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct VariantFigures {
    /// Whether it is the variant for hardware.
    pub hardware_kernels: bool,
    /// Lanes that the backward pass sums over by subgroups; 0: without.
    pub sum_lanes: u32,
    /// Median time of the forward pass.
    pub raster_fwd_secs: Option<f64>,
    /// Median time of the backward pass.
    pub raster_bwd_secs: Option<f64>,
    /// Pairs, atomics and bytes of steps with this variant.
    pub counts: Option<CountFigures>,
}

/// All measurements of a scene. Those that did not fit the available time are `null` or empty.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct KernelFigures {
    /// Number of splats.
    pub splats: usize,
    /// Number of texels.
    pub texels: usize,
    /// Number of views. If time allows, each is rendered once before anything is measured.
    pub views: u32,
    /// Largest width and height of the views.
    pub size_px: [u32; 2],
    /// Duration of the very first step, in which drivers may compile.
    pub first_step_secs: f64,
    /// Measurements of steps; `null` if a step takes longer than the available time.
    #[serde(flatten)]
    pub steps: Option<StepFigures>,
}

/// Measurements of steps.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct StepFigures {
    /// Number of steps measured.
    pub steps: u32,
    /// Steps per submission.
    pub batch_steps: usize,
    /// Wall time of a step whose photo is sent first.
    pub first_wall_secs_per_step: f64,
    /// Wall time of a step whose photo is on the device.
    pub wall_secs_per_step: f64,
    /// CPU time of the process per step; software drivers compute in the process.
    pub cpu_secs_per_step: f64,
    /// Steps per second of wall time.
    pub steps_per_sec: f64,
    /// Work given to the device.
    pub per_step: WorkPerStep,
    /// Kernel name and median time, largest first; `null` without a device clock.
    pub kernel_secs: Option<Vec<(&'static str, f64)>>,
    /// Pairs, atomics and bytes with the variant that the device gets.
    #[serde(flatten)]
    pub counts: Option<CountFigures>,
    /// Both variants of the rasterisation.
    pub variants: Vec<VariantFigures>,
    /// Whether running the same steps twice gave the same bytes.
    pub repeatable: Option<bool>,
    /// FNV-1a of the state after these steps.
    pub state_hash: Option<String>,
    /// Number of steps that were run twice.
    pub repeated_steps: u32,
}

/// Counts, as means per step.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct CountFigures {
    /// Pairs per pixel.
    pub pairs: PairFigures,
    /// Global atomics of texel gradients.
    pub texel_atomics: AtomicFigures,
    /// Input of the traffic model.
    pub traffic_counts: TrafficCounts,
    /// Bytes by kernel and by item.
    pub traffic: Traffic,
}

/// Measures as much as time allows, but at least one step. `request` returns a step (counted from 1) that shows view
/// `(step - 1) % views`.
///
/// # Errors
/// [`crate::Error::Device`] if allocation or the device fails.
pub fn measure<'a>(
    backend: &mut GpuBackend,
    model: &Model,
    steps: u32,
    views: u32,
    deadline: Deadline,
    request: &dyn Fn(u32) -> StepRequest<'a>,
) -> Result<KernelFigures> {
    let mut bench = BenchRun { backend, next: 1, request, deadline, step_secs: 0.0 };
    bench.restart(model, GpuOptions::default())?;
    let start = Instant::now();
    bench.run(1)?;
    let first_step_secs = start.elapsed().as_secs_f64();
    bench.step_secs = first_step_secs;
    // One step to warm up, and one to measure.
    let has_time = deadline.allows(2.0 * first_step_secs);
    let steps = if has_time { Some(bench.steps(model, steps, views)?) } else { None };
    let size_px = (1..=views)
        .map(|step| request(step).camera.pinhole)
        .fold([0, 0], |[w, h]: [u32; 2], p| [w.max(p.width_px), h.max(p.height_px)]);
    let (splats, texels) = (model.num_splats(), model.num_texels());
    Ok(KernelFigures { splats, texels, views, size_px, first_step_secs, steps })
}

/// A backend, and the state of the measurement on it.
struct BenchRun<'a, 'b> {
    backend: &'b mut GpuBackend,
    /// Number of the next step.
    next: u32,
    request: &'b dyn Fn(u32) -> StepRequest<'a>,
    deadline: Deadline,
    /// Duration of the most recent steps, each.
    step_secs: f64,
}

impl BenchRun<'_, '_> {
    /// All measurements after the first step, by importance, each in a share of the time that is left for it and the others.
    fn steps(&mut self, model: &Model, steps: u32, views: u32) -> Result<StepFigures> {
        // At least one, even for a single view: the first step may have compiled kernels, and does not predict the time of
        // others.
        self.run_within(WARM_UP_SHARE, 1, views.max(2) - 1)?;
        // Fixed from here on, so that all parts, and repeated measurements, do the same work.
        let plain = GpuOptions { batch_steps: Some(Pace::at(self.step_secs)), ..GpuOptions::default() };
        self.backend.set_options(plain)?;

        // The buffers are large enough by now: this sends the photos and nothing else besides the steps.
        self.backend.forget_photos();
        self.next = 1;
        let sending = Instant::now();
        let sent = self.run_within(0.2, 1, views)?.len() as f64;
        let first_wall_secs_per_step = sending.elapsed().as_secs_f64() / sent;

        let (work, cpu, wall) = (self.backend.gpu().work(), process_cpu_secs(), Instant::now());
        let measured = self.run_within(0.25, 1, steps)?.len() as u32;
        let per = |total: f64| total / f64::from(measured);
        let wall_secs_per_step = per(wall.elapsed().as_secs_f64());
        let cpu_secs_per_step = per(process_cpu_secs() - cpu);
        let per_step = work_per_step(work, self.backend.gpu().work(), measured);

        let timed = GpuOptions { time_kernels: true, ..plain };
        self.backend.set_options(timed)?;
        let kernel_secs = medians(&self.run_within(0.25, 0, steps)?);
        let own = self.variant(model, timed, kernel_secs.as_ref(), 0.25)?;
        let repeated = self.repeated(model, plain)?;
        let mut variants = vec![own];
        let others = self.other_variants(timed);
        for (at, other) in others.iter().enumerate() {
            self.backend.set_options(*other)?;
            // The first run of a kernel may compile it.
            let secs = if self.run_within(0.25, 0, 1)?.is_empty() {
                None
            } else {
                medians(&self.run_within(0.5, 0, FEW_STEPS)?)
            };
            let share = 1.0 / (others.len() - at) as f64;
            variants.push(self.variant(model, *other, secs.as_ref(), share)?);
        }
        // Leaves the backend without counters and timestamps.
        self.backend.set_options(plain)?;
        let counts = variants[0].counts.clone();
        variants.sort_by_key(|variant| (variant.hardware_kernels, variant.sum_lanes));
        Ok(StepFigures {
            steps: measured,
            batch_steps: self.backend.batch_steps(),
            first_wall_secs_per_step,
            wall_secs_per_step,
            cpu_secs_per_step,
            steps_per_sec: 1.0 / wall_secs_per_step.max(1e-12),
            per_step,
            kernel_secs,
            counts,
            variants,
            repeatable: repeated.map(|(_, [first, second])| first == second),
            state_hash: repeated.map(|(_, [hash, _])| format!("{hash:016x}")),
            repeated_steps: repeated.map_or(0, |(steps, _)| steps),
        })
    }

    /// Runs the same steps twice from the start, as many as fit into a third of the time left. Returns their number and the hashes
    /// of both final states.
    fn repeated(&mut self, model: &Model, plain: GpuOptions) -> Result<Option<(u32, [u64; 2])>> {
        let fits = |steps: &u32| self.deadline.allows(6.0 * f64::from(*steps) * self.step_secs);
        let Some(steps) = (1..=REPEATED_STEPS).rev().find(fits) else { return Ok(None) };
        let mut hashes = [0; 2];
        for hash in &mut hashes {
            self.restart(model, plain)?;
            self.run(steps)?;
            let (model, adam) = self.backend.read_back()?;
            *hash = state_hash(&model, &adam);
        }
        Ok(Some((steps, hashes)))
    }

    /// The variants that the device does not get: that for software or for hardware, and if its kernels sum by subgroups, that
    /// without.
    fn other_variants(&self, timed: GpuOptions) -> Vec<GpuOptions> {
        let by_subgroups = self.backend.form.sum_lanes > 0;
        let without = by_subgroups.then_some(GpuOptions { sum_lanes: Some(0), ..timed });
        let hardware = self.backend.gpu().choice.hardware;
        let other = GpuOptions { hardware_kernels: Some(!hardware), ..timed };
        without.into_iter().chain([other]).collect()
    }

    /// Times of one of the variants of the rasterisation, and its counts in a share of the time left.
    fn variant(
        &mut self,
        model: &Model,
        options: GpuOptions,
        times: Option<&Vec<(&'static str, f64)>>,
        share: f64,
    ) -> Result<VariantFigures> {
        let of =
            |name| times.and_then(|t| t.iter().find(|(n, _)| n.starts_with(name))).map(|(_, secs)| *secs);
        let (raster_fwd_secs, raster_bwd_secs) = (of("raster_fwd"), of("raster_bwd"));
        let counts = self.count(model, FEW_STEPS, options, share)?;
        let hardware_kernels = options.hardware_kernels.unwrap_or(self.backend.gpu().choice.hardware);
        let sum_lanes = self.backend.form.sum_lanes;
        Ok(VariantFigures { hardware_kernels, sum_lanes, raster_fwd_secs, raster_bwd_secs, counts })
    }

    /// Runs at most `most` steps in a share of the time left, all at once if they are fast; at least `least`, be there time or not.
    fn run_within(&mut self, share: f64, least: u32, most: u32) -> Result<Vec<StepReport>> {
        let deadline = self.deadline.share(share);
        let (mut reports, mut done) = (Vec::new(), 0);
        while done < least || (done < most && deadline.allows(self.step_secs)) {
            let start = Instant::now();
            let fitting = deadline.left().map_or(f64::INFINITY, |left| left.as_secs_f64() / self.step_secs);
            let count = if self.step_secs < SLOW_STEP_SECS { (most - done).min(fitting as u32) } else { 1 };
            reports.extend(self.run(count.max(1))?);
            done += count.max(1);
            self.step_secs = start.elapsed().as_secs_f64() / f64::from(count.max(1));
        }
        Ok(reports)
    }

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
}

fn work_per_step(before: DeviceWork, after: DeviceWork, steps: u32) -> WorkPerStep {
    let per = |before: u64, after: u64| (after - before) as f64 / f64::from(steps);
    WorkPerStep {
        dispatches: per(before.dispatches, after.dispatches),
        submissions: per(before.submissions, after.submissions),
        host_waits: per(before.waits, after.waits),
        photos: per(before.photos, after.photos),
    }
}

/// Median time by kernel, largest first; `None` if the reports contain no times.
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

/// FNV-1a over the bytes of parameters, moments and last steps.
fn state_hash(model: &Model, adam: &AdamState) -> u64 {
    let arrays = [&model.splats, &adam.splats_m, &adam.splats_v];
    let splats = arrays.into_iter().flat_map(|a| SplatGroup::ALL.map(|g| a.group(g)));
    let texels = [&model.textures.texels, &adam.texels_m, &adam.texels_v];
    let floats = splats.chain(texels).flat_map(|values| bytemuck::cast_slice::<f32, u8>(values));
    floats
        .chain(bytemuck::cast_slice(&adam.last_step))
        .fold(0xcbf2_9ce4_8422_2325, |hash, byte| (hash ^ u64::from(*byte)).wrapping_mul(0x0100_0000_01b3))
}
