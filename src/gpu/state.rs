//! What a [`GpuBackend`] holds, and how it fills a submission.

use super::device::{GpuDevice, Pipeline, UNIFORM_STRIDE};
use super::encode::{Dispatch, encode};
use super::form::{Form, GpuOptions};
use super::in_flight::{InFlight, MOST_IN_FLIGHT};
use super::kernels::{Buf, Groups, KernelId, NUM_GROUPS, RasterKernels};
use super::layout::{DispatchArgs, FLAG_ALL_MAPS, FLAG_PERSIST, Status, StepUniform};
use super::pace::{BATCH, Pace};
use super::photos::PhotoPool;
use super::resources::{Resources, UniformOffsets};
use super::shape::{Clock, Shape};
use super::sort;
use super::timing::Timer;
use super::uniform::{self, UniformInputs};
use super::view_buffers::{Capacity, MOST_TURNS};
use crate::Result;
use std::collections::{BTreeMap, VecDeque};

/// Renders and trains through wgpu.
pub struct GpuBackend {
    pub(super) device: GpuDevice,
    pub(super) resources: Resources,
    pub(super) pipelines: BTreeMap<KernelId, Pipeline>,
    pub(super) options: GpuOptions,
    pub(super) raster: RasterKernels,
    pub(super) form: Form,
    pub(super) shape: Shape,
    pub(super) clock: Clock,
    pub(super) capacity: Capacity,
    pub(super) photos: PhotoPool,
    pub(super) window_views: u32,
    pub(super) timer: Option<Timer>,
    pub(super) pace: Pace,
    /// Submissions of steps whose statuses have not been read, the oldest first. They are empty between calls, unless reading
    /// failed.
    pub(super) in_flight: VecDeque<InFlight>,
    /// Receive the statuses of a submission, one for each part of the ring.
    pub(super) staging: [wgpu::Buffer; MOST_IN_FLIGHT],
}

impl GpuBackend {
    /// Compiles the kernels on an open device.
    ///
    /// # Errors
    /// [`crate::Error::Device`] if the driver rejects a kernel or allocation fails.
    pub fn new(device: GpuDevice, options: GpuOptions) -> Result<Self> {
        let (form, raster) = Form::choose(&device, &options)?;
        let pipelines = device.pipelines(&raster.without_geometry(), &form.flags(), form.checks_indices)?;
        let passes = sort::sort_passes();
        let mut resources = Resources::new(
            device.uniforms("steps", (MOST_TURNS * BATCH + 1) as u64)?,
            device.uniforms("sort passes", passes.len() as u64)?,
        );
        for (i, pass) in passes.iter().enumerate() {
            let at = i as u64 * UNIFORM_STRIDE;
            device.queue.write_buffer(resources.sort_passes(), at, bytemuck::bytes_of(pass));
        }
        let slots = (MOST_IN_FLIGHT * BATCH) as u64;
        resources.set(Buf::Status, device.buffer("status", slots, size_of::<Status>() as u64)?);
        let staging = || device.staging("status", (BATCH * size_of::<Status>()) as u64);
        let args_bytes = size_of::<DispatchArgs>() as u64;
        resources.set(Buf::Args, device.buffer("dispatches", u64::from(NUM_GROUPS), args_bytes)?);
        let timer = if options.time_kernels { Timer::new(&device)? } else { None };
        Ok(Self {
            timer,
            pace: Pace::new(options.batch_steps),
            in_flight: VecDeque::new(),
            staging: [staging()?, staging()?],
            raster,
            form,
            device,
            resources,
            pipelines,
            options,
            shape: Shape::empty(),
            clock: Clock::default(),
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
        let (form, raster) = Form::choose(&self.device, &options)?;
        // It is compiled into most kernels: if it changes, none is kept.
        let keeps = form == self.form;
        let mut missing = raster.without_geometry();
        missing.retain(|id| !keeps || !self.pipelines.contains_key(id));
        let compiled = self.device.pipelines(&missing, &form.flags(), form.checks_indices)?;
        self.options = options;
        if !keeps {
            self.pipelines.clear();
            self.resources.forget_groups();
        }
        self.pipelines.extend(compiled);
        (self.raster, self.form) = (raster, form);
        self.timer = if options.time_kernels { Timer::new(&self.device)? } else { None };
        Ok(())
    }

    /// Compiles those of these kernels that have not been.
    ///
    /// # Errors
    /// [`crate::Error::Device`] if the driver rejects a kernel.
    pub(super) fn compile(&mut self, mut kernels: Vec<KernelId>) -> Result<()> {
        kernels.retain(|id| !self.pipelines.contains_key(id));
        let compiled = self.device.pipelines(&kernels, &self.form.flags(), self.form.checks_indices)?;
        self.pipelines.extend(compiled);
        Ok(())
    }

    /// The device that the backend runs on.
    pub fn gpu(&self) -> &GpuDevice {
        &self.device
    }

    pub(super) fn uniform_inputs(&self) -> UniformInputs {
        UniformInputs {
            num_splats: self.shape.num_splats() as u32,
            near: self.shape.near,
            filter_px2: self.shape.filter.variance_px2() as f32,
            pair_capacity: self.capacity.pairs as u32,
            tile_rows_px: self.form.tile_rows_px,
            segment_pairs: self.form.segment_pairs,
            flushed_step: self.clock.step,
            flushed_rates: self.clock.rates,
        }
    }

    /// Prepares a submission that uses the first part of the status ring: writes the host's part of the dispatch table and
    /// clears the statuses.
    pub(super) fn arm(&self) {
        let n = self.shape.num_splats() as u32;
        let args = sort::first_args(n);
        self.device.queue.write_buffer(self.resources.buffer(Buf::Args), 0, bytemuck::cast_slice(&args));
        self.clear_statuses(0);
    }

    /// Clears a part of the status ring.
    pub(super) fn clear_statuses(&self, part: usize) {
        let statuses = [Status::default(); BATCH];
        let at = (part * size_of_val(&statuses)) as u64;
        let buffer = self.resources.buffer(Buf::Status);
        self.device.queue.write_buffer(buffer, at, bytemuck::cast_slice(&statuses));
    }

    /// Writes an entry of the uniform ring. The queue writes in the order of submissions: those under way have read what an
    /// entry held before.
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
        self.submit(&[KernelId::FlushSplat, KernelId::FlushTexel].map(|id| each_splat(id, offsets)));
    }

    /// Adopts a model whose parameters are already on the device, and activates its texels.
    pub(super) fn adopt(&mut self, shape: Shape, clock: Clock) {
        self.shape = shape;
        self.clock = clock;
        self.window_views = 0;
        self.in_flight.clear();
        self.arm();
        let uniform = uniform::without_view(&self.uniform_inputs(), FLAG_ALL_MAPS);
        // At step 0 there is nothing to flush: this only activates.
        let offsets = self.set_uniform(0, &StepUniform { flushed_step: 0, ..uniform });
        self.submit(&[each_splat(KernelId::FlushTexel, offsets)]);
    }

    /// Requires a model, and a device without errors.
    pub(super) fn check(&self) -> Result<()> {
        self.check_model()?;
        self.device.check()
    }

    pub(super) fn check_model(&self) -> Result<()> {
        if self.resources.has(Buf::SplatP) {
            return Ok(());
        }
        Err(usage!("{}: no model has been uploaded", self.device.choice.name))
    }
}

/// A dispatch for all splats, visible or not.
fn each_splat(kernel: KernelId, offsets: UniformOffsets) -> Dispatch {
    Dispatch { groups: Groups::EachSplat, ..Dispatch::new(kernel, offsets) }
}
