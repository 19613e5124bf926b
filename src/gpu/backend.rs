//! The GPU as a [`Backend`]: several steps per submission, whose status is read afterwards. A step whose pairs do
//! not fit is not applied, nor is any later step of the submission; then the buffers grow and the steps are
//! repeated, with the same bits as if the buffers had been large enough from the start.

use super::device::{GpuDevice, Pipeline, UNIFORM_STRIDE};
use super::encode::{Dispatch, encode};
use super::kernels::{Buf, KernelId, NUM_GROUPS, RasterKernels};
use super::layout::{DispatchArgs, FLAG_ALL_MAPS, FLAG_PERSIST, Status, StepUniform};
use super::model_buffers::{self, splat_stride};
use super::pace::{BATCH, Pace};
use super::photos::PhotoPool;
use super::resources::{Resources, UniformOffsets};
use super::shader::{HALF_TILE_ROWS_PX, HALF_TILES, TILE_PX};
use super::submission::{PendingStep, check_camera, check_request};
use super::timing::Timer;
use super::uniform::{self, UniformInputs, needs_statistics};
use super::view_buffers::{Capacity, RequiredCapacity};
use super::{apply_plan, geometry, limits, sort};
use crate::backend::{
    Backend, DensityPlan, DeviceInfo, DeviceLimits, RenderOptions, RenderedImage, SceneShape, StepReport,
    StepRequest, WindowStatistics,
};
use crate::camera::{Camera, Similarity};
use crate::model::{AdamState, Model, SplatArrays, TexturePool};
use crate::{Error, Result};
use std::collections::BTreeMap;

/// Options of a [`GpuBackend`]. Only `hardware_kernels` changes results, in their last bits.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct GpuOptions {
    /// Steps per submission, at most 16; 1 reads the status after each. `None`: as many as the device completes in
    /// less than a second.
    pub batch_steps: Option<usize>,
    /// Whether to count pixel-splat pairs.
    pub count_pairs: bool,
    /// Whether to use the kernel variants for hardware: tiles of 16 x 16 pixels instead of 16 x 8, splats loaded
    /// through workgroup memory, and an atomic per tap for the texels of large windows. `None`: on hardware.
    pub hardware_kernels: Option<bool>,
    /// Whether to count the global atomics of the texel gradients, instead of faults. Ignored in steps with window
    /// statistics or terms on depths and normals.
    pub count_texel_atomics: bool,
    /// Whether to time every dispatch, if the device can: step reports then contain times by kernel.
    pub time_kernels: bool,
    /// Pairs to allocate buffers for at first; `None`: a guess from the number of splats.
    pub pair_capacity: Option<u64>,
}

/// Renders and trains through wgpu.
pub struct GpuBackend {
    pub(super) device: GpuDevice,
    pub(super) resources: Resources,
    pub(super) pipelines: BTreeMap<KernelId, Pipeline>,
    pub(super) options: GpuOptions,
    pub(super) raster: RasterKernels,
    pub(super) tile_rows_px: u32,
    /// The model without its parameters, which are on the device.
    pub(super) shape: Model,
    /// Step and learning rates of the optimiser; its moments are on the device.
    pub(super) clock: AdamState,
    pub(super) capacity: Capacity,
    pub(super) photos: PhotoPool,
    pub(super) window_views: u32,
    pub(super) timer: Option<Timer>,
    pub(super) pace: Pace,
    /// Submitted steps whose status has not been read.
    pub(super) in_flight: Vec<PendingStep>,
    /// Receives the status of a submission. One is enough: it is read before the next submission.
    pub(super) staging: wgpu::Buffer,
}

impl GpuBackend {
    /// Compiles the kernels on an open device.
    ///
    /// # Errors
    /// [`crate::Error::Device`] if the driver rejects a kernel or allocation fails.
    pub fn new(device: GpuDevice, options: GpuOptions) -> Result<Self> {
        let (raster, tile_rows_px) = variants(&device, &options);
        let pipelines = device.pipelines(&raster.without_geometry(), tile_flags(tile_rows_px))?;
        let passes = sort::sort_passes();
        let mut resources = Resources::new(
            device.uniforms("steps", BATCH as u64)?,
            device.uniforms("sort passes", passes.len() as u64)?,
        );
        for (i, pass) in passes.iter().enumerate() {
            let at = i as u64 * UNIFORM_STRIDE;
            device.queue.write_buffer(resources.sort_passes(), at, bytemuck::bytes_of(pass));
        }
        resources.set(Buf::Status, device.buffer("status", BATCH as u64, size_of::<Status>() as u64)?);
        let args_bytes = size_of::<DispatchArgs>() as u64;
        resources.set(Buf::Args, device.buffer("dispatches", u64::from(NUM_GROUPS), args_bytes)?);
        let shape = Model {
            splats: SplatArrays::zeros(0, 0),
            textures: TexturePool::default(),
            near: 0.01,
            capture_from_local: Similarity::IDENTITY,
        };
        let timer = if options.time_kernels { Timer::new(&device)? } else { None };
        Ok(Self {
            timer,
            pace: Pace::new(options.batch_steps),
            in_flight: Vec::new(),
            staging: device.staging("status", (BATCH * size_of::<Status>()) as u64)?,
            raster,
            tile_rows_px,
            device,
            resources,
            pipelines,
            options,
            clock: AdamState::zeros(&shape),
            shape,
            capacity: Capacity::default(),
            photos: PhotoPool::default(),
            window_views: 0,
        })
    }

    /// Simulates the loss of the device, as when a driver hangs or is updated; for tests.
    pub fn lose_device(&self) {
        self.device.lose();
    }

    /// Changes the options from the next step on and compiles missing kernels. The model stays on the device.
    ///
    /// # Errors
    /// [`crate::Error::Device`] if the driver rejects a kernel or allocation fails.
    pub fn set_options(&mut self, options: GpuOptions) -> Result<()> {
        if options.batch_steps != self.options.batch_steps {
            self.pace = Pace::new(options.batch_steps);
        }
        self.options = options;
        let (raster, tile_rows_px) = variants(&self.device, &options);
        // The height of tiles is compiled into most kernels: if it changes, none can be kept.
        let keeps = tile_rows_px == self.tile_rows_px;
        let mut missing = raster.without_geometry();
        missing.retain(|id| !keeps || !self.pipelines.contains_key(id));
        let compiled = self.device.pipelines(&missing, tile_flags(tile_rows_px))?;
        if !keeps {
            self.pipelines.clear();
            self.resources.forget_groups();
        }
        self.pipelines.extend(compiled);
        (self.raster, self.tile_rows_px) = (raster, tile_rows_px);
        self.timer = if options.time_kernels { Timer::new(&self.device)? } else { None };
        Ok(())
    }

    /// The device that the backend runs on.
    pub fn gpu(&self) -> &GpuDevice {
        &self.device
    }

    pub(super) fn uniform_inputs(&self) -> UniformInputs {
        UniformInputs {
            num_splats: self.shape.num_splats() as u32,
            splat_stride: splat_stride(self.shape.splats.sh_degree) as u32,
            near: self.shape.near,
            pair_capacity: self.capacity.pairs as u32,
            tile_rows_px: self.tile_rows_px,
            flushed_step: self.clock.step,
            flushed_rates: self.clock.rates,
        }
    }

    /// Prepares a submission: writes the host's part of the dispatch table and clears the status ring.
    pub(super) fn arm(&self) {
        let n = self.shape.num_splats() as u32;
        let args = sort::first_args(n);
        self.device.queue.write_buffer(self.resources.buffer(Buf::Args), 0, bytemuck::cast_slice(&args));
        let status = [Status::default(); BATCH];
        self.device.queue.write_buffer(self.resources.buffer(Buf::Status), 0, bytemuck::cast_slice(&status));
    }

    /// Writes an entry of the uniform ring.
    pub(super) fn set_uniform(&self, slot: usize, values: &StepUniform) -> UniformOffsets {
        let at = slot as u64 * UNIFORM_STRIDE;
        self.device.queue.write_buffer(self.resources.steps(), at, bytemuck::bytes_of(values));
        UniformOffsets { step: at as u32, sort_pass: 0 }
    }

    /// Encodes dispatches, without submitting them.
    pub(super) fn encoded(&mut self, dispatches: &[Dispatch]) -> wgpu::CommandEncoder {
        let mut encoder =
            self.device.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        let timer = self.timer.as_ref().filter(|_| dispatches.len() <= Timer::MAX_DISPATCHES);
        encode(&self.device, &mut encoder, &mut self.resources, &self.pipelines, dispatches, timer);
        encoder
    }

    pub(super) fn submit(&mut self, dispatches: &[Dispatch]) {
        let encoder = self.encoded(dispatches);
        self.device.submit(encoder);
    }

    /// Flushes all lazily updated parameters, as of the last step.
    pub(super) fn flush_all(&mut self) {
        self.arm();
        let uniform = uniform::without_view(&self.uniform_inputs(), FLAG_PERSIST | FLAG_ALL_MAPS);
        let offsets = self.set_uniform(0, &uniform);
        let kernels = [KernelId::FlushSplat, KernelId::FlushTexel];
        self.submit(&kernels.map(|id| Dispatch::new(id, offsets)));
    }

    /// Adopts a model whose parameters are already on the device, and activates its texels.
    pub(super) fn adopt(&mut self, shape: Model, clock: AdamState) {
        self.shape = shape;
        self.clock = clock;
        self.window_views = 0;
        self.in_flight.clear();
        self.arm();
        let uniform = uniform::without_view(&self.uniform_inputs(), FLAG_ALL_MAPS);
        // At step 0 there is nothing to flush: this only activates.
        let offsets = self.set_uniform(0, &StepUniform { flushed_step: 0, ..uniform });
        self.submit(&[Dispatch::new(KernelId::FlushTexel, offsets)]);
    }

    /// Requires a model, and a device without errors.
    fn check(&self) -> Result<()> {
        self.check_model()?;
        self.device.check()
    }

    fn check_model(&self) -> Result<()> {
        if self.resources.has(Buf::SplatP) {
            return Ok(());
        }
        Err(Error::Usage(format!("{}: no model has been uploaded", self.device.choice.name)))
    }
}

/// Kernel variants of the rasterisation, and the height of its tiles.
fn variants(device: &GpuDevice, options: &GpuOptions) -> (RasterKernels, u32) {
    let hardware = options.hardware_kernels.unwrap_or(device.choice.hardware);
    let raster = RasterKernels::choose(hardware, options.count_pairs, options.count_texel_atomics);
    (raster, if hardware { TILE_PX } else { HALF_TILE_ROWS_PX })
}

/// Preprocessor flags of all kernels for tiles of a given height.
pub(super) fn tile_flags(tile_rows_px: u32) -> &'static [&'static str] {
    if tile_rows_px == HALF_TILE_ROWS_PX { &[HALF_TILES] } else { &[] }
}

impl Backend for GpuBackend {
    fn device(&self) -> DeviceInfo {
        let choice = &self.device.choice;
        DeviceInfo { name: choice.name.clone(), description: choice.description.clone() }
    }

    fn limits(&self, shape: SceneShape) -> DeviceLimits {
        limits::limits(self.device.most_buffer_bytes(), shape)
    }

    fn upload(&mut self, model: &Model, adam: &AdamState) -> Result<()> {
        model_buffers::upload(&self.device, &mut self.resources, model, adam)?;
        // Photo numbers may now mean other photos, and a smaller model may need smaller buffers.
        self.photos.release(&mut self.resources);
        self.capacity.release(&mut self.resources);
        self.adopt(model.clone(), adam.clone());
        self.device.check()
    }

    fn render(&mut self, camera: &Camera, options: &RenderOptions) -> Result<RenderedImage> {
        self.check()?;
        check_camera(camera)?;
        if options.geometry {
            self.compile_geometry(false)?;
        }
        let needs = RequiredCapacity {
            geometry: options.geometry,
            ..self.needs(std::iter::once(*camera), false, false)
        };
        self.capacity.ensure(&self.device, &mut self.resources, &needs)?;
        loop {
            self.arm();
            let degree = options.sh_degree.min(self.shape.splats.sh_degree);
            let offsets = self
                .set_uniform(0, &uniform::image(&self.uniform_inputs(), camera, options.background, degree));
            let dispatches = self.forward(offsets, camera, options.geometry);
            let status = self.submit_for_status(&dispatches, 1)?;
            if u64::from(status[0].needed_pairs) <= self.capacity.pairs {
                break;
            }
            self.grow_pairs(&status[0], &needs)?;
        }
        let num_pixels = camera.pinhole.num_pixels();
        let pixels: Vec<[f32; 4]> = self.device.read(self.resources.buffer(Buf::Pixels), num_pixels)?;
        let mut image = RenderedImage {
            width_px: camera.pinhole.width_px,
            height_px: camera.pinhole.height_px,
            rgb: pixels.iter().flat_map(|p| [p[0], p[1], p[2]]).collect(),
            alpha: pixels.iter().map(|p| 1.0 - p[3]).collect(),
            depth: Vec::new(),
            normal: Vec::new(),
        };
        if options.geometry {
            let sums = self.device.read(self.resources.buffer(Buf::Geometry), num_pixels)?;
            geometry::fill_in(&mut image, &sums);
        }
        Ok(image)
    }

    fn step(&mut self, request: &StepRequest<'_>) -> Result<StepReport> {
        let mut reports = self.steps(std::slice::from_ref(request))?;
        reports.pop().ok_or_else(|| self.device.error("a step returned no report"))
    }

    fn batch_steps(&self) -> usize {
        self.pace.steps()
    }

    fn steps(&mut self, requests: &[StepRequest<'_>]) -> Result<Vec<StepReport>> {
        self.check()?;
        requests.iter().try_for_each(check_request)?;
        if requests.iter().any(|r| r.loss.needs_geometry()) {
            self.compile_geometry(true)?;
        }
        let mut reports = Vec::new();
        while reports.len() < requests.len() {
            let rest = &requests[reports.len()..];
            let rest = &rest[..rest.len().min(self.pace.steps())];
            let photos: Vec<_> = rest.iter().map(|r| (r.photo, r.target)).collect();
            let fitting = self.photos.prepare(&self.device, &mut self.resources, &photos)?;
            let batch = &rest[..fitting];
            let statistics = batch.iter().any(needs_statistics);
            let needs = RequiredCapacity {
                geometry: batch.iter().any(|r| r.loss.needs_geometry()),
                ..self.needs(batch.iter().map(|r| r.camera), true, statistics)
            };
            self.capacity.ensure(&self.device, &mut self.resources, &needs)?;
            let statuses = self.submit_steps(batch)?;
            for (request, (status, stages)) in batch.iter().zip(statuses) {
                if status.done == 1 {
                    reports.push(self.report(request, &status, stages));
                } else {
                    self.grow_pairs(&status, &needs)?;
                }
            }
        }
        Ok(reports)
    }

    fn read_statistics(&mut self) -> Result<WindowStatistics> {
        // Readable after refused commands, like the model in `read_back`: both are part of a checkpoint.
        self.check_model()?;
        let n = self.shape.num_splats();
        let values: Vec<[f32; 4]> = self.device.rescue(self.resources.buffer(Buf::Statistics), n)?;
        let column = |k: usize| values.iter().map(|v| v[k]).collect::<Vec<f32>>();
        Ok(WindowStatistics {
            views: self.window_views,
            seen: values.iter().map(|v| v[0] as u32).collect(),
            area: column(1),
            contribution: column(2),
            error: column(3),
        })
    }

    fn set_statistics(&mut self, statistics: &WindowStatistics) -> Result<()> {
        self.check()?;
        statistics.check(self.shape.num_splats())?;
        let values: Vec<[f32; 4]> = (0..statistics.seen.len())
            .map(|i| {
                let s = statistics;
                [s.seen[i] as f32, s.area[i], s.contribution[i], s.error[i]]
            })
            .collect();
        let buffer = self.resources.buffer(Buf::Statistics);
        self.device.queue.write_buffer(buffer, 0, bytemuck::cast_slice(&values));
        self.window_views = statistics.views;
        Ok(())
    }

    fn apply_plan(&mut self, plan: &DensityPlan) -> Result<()> {
        self.check()?;
        plan.check(self.shape.num_splats())?;
        apply_plan::apply_plan(self, plan)
    }

    fn read_back(&mut self) -> Result<(Model, AdamState)> {
        // Works after refused commands too: the steps applied before are intact, and worth saving.
        self.check_model()?;
        if !self.in_flight.is_empty() {
            let statuses: Vec<Status> =
                self.device.rescue(self.resources.buffer(Buf::Status), self.in_flight.len())?;
            self.count_applied(&statuses);
        }
        let (mut model, mut adam) = (self.shape.clone(), self.clock.clone());
        model_buffers::read_back(&self.device, &self.resources, &mut model, &mut adam)?;
        Ok((model, adam))
    }

    fn read_flushed(&mut self) -> Result<Model> {
        self.check()?;
        // Flushes a copy: reading must not change what the next steps compute.
        let lazily_updated =
            [Buf::SplatP, Buf::SplatM, Buf::SplatV, Buf::TexelP, Buf::TexelM, Buf::TexelV, Buf::SplatInfo];
        let originals = lazily_updated.map(|name| (name, self.resources.buffer(name).clone()));
        let mut encoder =
            self.device.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        let mut copies = Vec::new();
        for (name, original) in &originals {
            let copy = self.device.buffer("flushed parameters", original.size() / 16, 16)?;
            encoder.copy_buffer_to_buffer(original, 0, &copy, 0, original.size());
            copies.push((*name, copy));
        }
        // No early return from here on: the originals are restored on every path.
        copies.into_iter().for_each(|(name, copy)| self.resources.set(name, copy));
        self.device.submit(encoder);
        self.flush_all();
        let flushed = self.read_back();
        for (name, original) in originals {
            self.resources.set(name, original);
        }
        // If a command was refused, the copy is not flushed.
        self.device.check()?;
        Ok(flushed?.0)
    }
}
