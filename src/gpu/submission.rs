//! What a submission is made of: the dispatches of steps and pictures, what they need room for, and what their
//! status tells. Who asks for them, and what happens when they did not fit, stands in `backend`.

use super::backend::{GpuBackend, tile_flags};
use super::encode::Dispatch;
use super::kernels::Buf;
use super::kernels::KernelId;
use super::layout::Status;
use super::resources::Offsets;
use super::sort;
use super::uniform::{self, needs_statistics};
use super::view_buffers::Needs;
use crate::backend::{LossValues, RasterCounters, StepReport, StepRequest};
use crate::camera::Camera;
use crate::{Error, Result};
use std::time::Duration;

/// Pairs that a fresh backend has room for, per splat.
const PAIRS_PER_SPLAT: u64 = 8;

impl GpuBackend {
    /// Projection to picture.
    pub(super) fn forward(&self, offsets: Offsets, camera: &Camera, geometry: bool) -> Vec<Dispatch> {
        let [cols, rows] = uniform::grid(camera, self.tile_rows_px);
        let (project, raster) = if geometry {
            (KernelId::ProjectGeometry, self.raster.fwd_geometry)
        } else {
            (KernelId::Project, self.raster.fwd)
        };
        let mut out = vec![Dispatch::new(project, offsets)];
        out.push(Dispatch::new(KernelId::SettleTexel, offsets));
        out.extend(sort::order_and_bin(offsets, cols * rows));
        out.push(Dispatch::new(raster, offsets));
        out
    }

    /// A whole step, with or without the terms on depths and normals, and the window statistics.
    pub(super) fn step_dispatches(
        &self,
        offsets: Offsets,
        camera: &Camera,
        geometry: bool,
        statistics: bool,
    ) -> Vec<Dispatch> {
        use KernelId as K;
        let mut out = self.forward(offsets, camera, geometry);
        let mut kernels = vec![K::LossFwd, K::LossBwd];
        if geometry {
            kernels.extend([K::GeometryLoss, self.raster.bwd_geometry, K::ProjectBwdGeometry]);
            kernels.extend([K::AdamTexel, K::FinishGeometry]);
        } else {
            let bwd = if statistics { self.raster.bwd_statistics } else { self.raster.bwd };
            kernels.extend([bwd, K::ProjectBwd, K::AdamTexel, K::Finish]);
        }
        out.extend(kernels.into_iter().map(|id| Dispatch::new(id, offsets)));
        out
    }

    /// Compiles what depths and normals need, the first time.
    pub(super) fn compile_geometry(&mut self, training: bool) -> Result<()> {
        let mut missing = self.raster.geometry(training);
        missing.retain(|id| !self.pipelines.contains_key(id));
        if !missing.is_empty() {
            let compiled = self.device.pipelines(&missing, tile_flags(self.tile_rows_px))?;
            self.pipelines.extend(compiled);
        }
        Ok(())
    }

    pub(super) fn needs(
        &self,
        cameras: impl Iterator<Item = Camera>,
        training: bool,
        statistics: bool,
    ) -> Needs {
        let n = self.shape.num_splats() as u64;
        let guess = self.options.pair_capacity.unwrap_or((PAIRS_PER_SPLAT * n).max(1 << 14));
        // A guess must not be what the device refuses.
        let guess = guess.min(self.most_pairs());
        let mut needs = Needs {
            splats: n,
            pairs: self.capacity.pairs.max(guess),
            training,
            statistics,
            ..Needs::default()
        };
        for camera in cameras {
            let [cols, rows] = uniform::grid(&camera, self.tile_rows_px);
            needs.pixels = needs.pixels.max(camera.pinhole.num_pixels() as u64);
            needs.tiles = needs.tiles.max(u64::from(cols) * u64::from(rows));
        }
        needs
    }

    /// Pairs whose partial sums fit a buffer.
    fn most_pairs(&self) -> u64 {
        let limits = &self.device.limits;
        let bytes = limits.max_storage_buffer_binding_size.min(limits.max_buffer_size);
        bytes / (4 * u64::from(uniform::PARTIAL_STRIDE_GEOMETRY))
    }

    /// Makes room for the pairs that a view needs.
    pub(super) fn grow_pairs(&mut self, status: &Status, needs: &Needs) -> Result<()> {
        if u64::from(status.needed_pairs) <= self.capacity.pairs {
            return Err(self
                .device
                .error("a submission was not carried out, and the driver does not say why"));
        }
        let needed = u64::from(status.needed_pairs);
        let pairs = (needed * 3 / 2).min(self.most_pairs()).max(needed);
        self.capacity.ensure(&self.device, &mut self.resources, &Needs { pairs, ..*needs })
    }

    /// Runs steps that fit one submission; returns what those that were applied tell.
    pub(super) fn submit_steps(&mut self, requests: &[StepRequest<'_>]) -> Result<Vec<(Status, Stages)>> {
        let kept: Vec<u32> = requests.iter().map(|r| r.photo).collect();
        self.arm();
        let mut dispatches = Vec::new();
        let mut ends = Vec::new();
        let mut scene = self.scene();
        for (slot, request) in requests.iter().enumerate() {
            let placed =
                self.photos.place(&self.device, &self.resources, request.photo, request.target, &kept);
            let photo_px =
                placed.ok_or_else(|| self.device.error("the photos of a batch do not fit its pool"))?;
            let offsets = self.set_uniform(slot, &uniform::step(&scene, request, photo_px, slot as u32));
            let geometry = request.loss.needs_geometry();
            let statistics = needs_statistics(request);
            dispatches.extend(self.step_dispatches(offsets, &request.camera, geometry, statistics));
            ends.push(dispatches.len());
            (scene.settled_step, scene.settled_rates) = (request.step, request.rates);
        }
        self.submit(&dispatches);
        let statuses: Vec<Status> = self.device.read(self.resources.buffer(Buf::Status), requests.len())?;
        let applied = statuses.iter().take_while(|s| s.done == 1).count();
        if let Some(last) = applied.checked_sub(1) {
            (self.clock.step, self.clock.rates) = (requests[last].step, requests[last].rates);
            let counted = requests[..applied].iter().filter(|r| r.accumulate_statistics).count();
            self.window_views += counted as u32;
        }
        let times = match &self.timer {
            Some(timer) => timer.read(&self.device, dispatches.len())?,
            None => Vec::new(),
        };
        let stages = (0..requests.len()).map(|k| {
            let range = ends[..k].last().copied().unwrap_or(0)..ends[k];
            stages(&dispatches[range.clone()], times.get(range).unwrap_or_default())
        });
        Ok(statuses.into_iter().zip(stages).take(applied + 1).collect())
    }

    pub(super) fn report(&self, request: &StepRequest<'_>, status: &Status, stages: Stages) -> StepReport {
        let s = status;
        let mut loss = LossValues {
            total: 0.0,
            l1: s.l1.into(),
            dssim: s.dssim.into(),
            mse: s.mse.into(),
            opacity: s.opacity.into(),
            texture: s.texture.into(),
            distortion: s.distortion.into(),
            normal: s.normal.into(),
        };
        loss.total =
            loss.l1 + loss.dssim + loss.mse + loss.opacity + loss.texture + loss.distortion + loss.normal;
        let counters = RasterCounters {
            pixels: request.camera.pinhole.num_pixels() as u64,
            visible_splats: s.visible.into(),
            tile_pairs: s.needed_pairs.into(),
            evaluated_pairs: s.evaluated.into(),
            inside_pairs: s.inside.into(),
            blended_pairs: s.blended.into(),
        };
        StepReport { loss, counters, non_finite_gradients: s.faults.into(), stages }
    }
}

/// Times by kernel, in the order in which they first run.
pub(super) type Stages = Vec<(&'static str, Duration)>;

fn stages(dispatches: &[Dispatch], times: &[Duration]) -> Stages {
    let mut out: Stages = Vec::new();
    for (dispatch, time) in dispatches.iter().zip(times) {
        let name = dispatch.kernel.kernel().name;
        match out.iter_mut().find(|(n, _)| *n == name) {
            Some((_, sum)) => *sum += *time,
            None => out.push((name, *time)),
        }
    }
    out
}

/// Largest side of a picture: pixels of a box are packed into 16 bits each.
const MAX_SIDE_PX: u32 = 65_535;

pub(super) fn check_camera(camera: &Camera) -> Result<()> {
    let (w, h) = (camera.pinhole.width_px, camera.pinhole.height_px);
    if w.max(h) <= MAX_SIDE_PX && w.min(h) > 0 {
        return Ok(());
    }
    Err(Error::Usage(format!("a picture of {w}x{h} px: GPUs take sides of 1 to {MAX_SIDE_PX} px here")))
}

pub(super) fn check_request(request: &StepRequest<'_>) -> Result<()> {
    check_camera(&request.camera)?;
    request.check()
}
