//! What a submission consists of: the dispatches of steps and images, the buffer capacity that they need, and the reports made
//! of statuses. `queue` submits them, and repeats what did not fit.

use super::encode::Dispatch;
use super::in_flight::KernelTimes;
use super::kernels::KernelId;
use super::layout::{FLAG_COUNT_ATOMICS, FLAG_INVISIBLE, MAX_SIDE_PX, Status, StepUniform};
use super::limits;
use super::pace::BATCH;
use super::resources::UniformOffsets;
use super::sort;
use super::state::GpuBackend;
use super::uniform::{self, UniformInputs};
use super::view_buffers::{MOST_TURNS, RequiredCapacity};
use crate::backend::{ColourSums, LossValues, RasterCounters, StepReport, StepRequest};
use crate::camera::Camera;
use crate::{Error, Result};

/// Initial pair capacity per splat.
const PAIRS_PER_SPLAT: u64 = 8;

/// What the requests of a submission are for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Task {
    /// Training steps.
    Train,
    /// Probes.
    Probe,
    /// Comparisons of images and photos: nothing moves, and the clock stands still.
    Compare,
}

impl GpuBackend {
    fn task_dispatches(
        &self,
        task: Task,
        turns: &[UniformOffsets],
        request: &StepRequest<'_>,
    ) -> Vec<Dispatch> {
        let offsets = turns[0];
        let geometry = request.loss.needs_geometry();
        let (statistics, exposure) = (request.accumulate_statistics, request.exposure.is_some());
        match task {
            Task::Train => self.step_dispatches(turns, &request.camera, geometry, statistics, exposure),
            Task::Probe => {
                let mut out = self.step_dispatches(turns, &request.camera, false, false, exposure);
                // Before the step is marked as applied.
                out.insert(out.len() - 1, Dispatch::new(KernelId::ProbeCosts, offsets));
                out
            }
            Task::Compare => {
                let mut out = self.forward(offsets, &request.camera, false);
                out.extend(exposure.then_some(Dispatch::new(KernelId::ExposureFwd, offsets)));
                out.extend([KernelId::LossFwd, KernelId::Finish].map(|id| Dispatch::new(id, offsets)));
                out
            }
        }
    }

    /// Dispatches from the projection to the image.
    pub(super) fn forward(&self, offsets: UniformOffsets, camera: &Camera, geometry: bool) -> Vec<Dispatch> {
        let [cols, rows] = uniform::grid(camera, self.form.tile_rows_px);
        let (project, raster) = if geometry {
            (KernelId::ProjectGeometry, self.raster.fwd_geometry)
        } else {
            (KernelId::Project, self.raster.fwd)
        };
        let mut out = vec![Dispatch::new(project, offsets)];
        out.extend(sort::visible_list(offsets));
        out.push(Dispatch::new(KernelId::FlushTexel, offsets));
        out.extend(sort::order_and_bin(offsets, cols * rows));
        out.push(Dispatch::new(raster, offsets));
        out
    }

    /// Dispatches of a training step; `geometry` includes the distortion and normal terms, and window statistics;
    /// `exposure` corrects the image by that of the photo. `turns` are the uniforms of [`Self::turns`].
    pub(super) fn step_dispatches(
        &self,
        turns: &[UniformOffsets],
        camera: &Camera,
        geometry: bool,
        statistics: bool,
        exposure: bool,
    ) -> Vec<Dispatch> {
        use KernelId as K;
        let offsets = turns[0];
        let mut out = self.forward(offsets, camera, geometry);
        let mut loss = if exposure {
            vec![K::ExposureFwd, K::ExposureSums, K::LossFwd, K::LossBwd, K::ExposureBwd]
        } else {
            vec![K::LossFwd, K::LossBwd]
        };
        let (bwd, project_bwd, finish) = if geometry {
            loss.push(K::GeometryLoss);
            (self.raster.bwd_geometry, K::ProjectBwdGeometry, K::FinishGeometry)
        } else {
            let bwd = if statistics { self.raster.bwd_statistics } else { self.raster.bwd };
            (bwd, K::ProjectBwd, K::Finish)
        };
        out.extend(loss.into_iter().map(|id| Dispatch::new(id, offsets)));
        out.extend(turns.iter().flat_map(|&turn| [bwd, K::SumPairs].map(|id| Dispatch::new(id, turn))));
        let last = [project_bwd, K::AdamTexel, K::FinishBlocks, finish];
        out.extend(last.map(|id| Dispatch::new(id, offsets)));
        out
    }

    /// Uniforms of the turns in which a step sums the derivatives by its pairs: one, unless the partial sums of all pairs
    /// exceed a buffer. The bits do not depend on their number.
    pub(super) fn turns(&self, slot: usize, uniform: &StepUniform) -> Vec<UniformOffsets> {
        let pairs = self.capacity.partial_pairs(uniform.partial_stride);
        let count = self.capacity.training_pairs.div_ceil(pairs.max(1)).max(1) as usize;
        assert!(count <= MOST_TURNS, "{count} turns for {} pairs", self.capacity.training_pairs);
        let turn = |k: usize| StepUniform {
            partial_first: (k as u64 * pairs) as u32,
            partial_capacity: pairs as u32,
            ..*uniform
        };
        (0..count).map(|k| self.set_uniform(k * BATCH + slot, &turn(k))).collect()
    }

    /// The dispatch after the last of these steps, in which splats that were invisible in it take it. Within a submission the next
    /// step does this, by the same kernel: the bits do not depend on how many steps are submitted at a time.
    fn end_dispatch(&self, inputs: &UniformInputs, requests: &[StepRequest<'_>]) -> Dispatch {
        let offsets = self.set_uniform(MOST_TURNS * BATCH, &uniform::end(inputs));
        let geometry = requests.last().is_some_and(|r| r.loss.needs_geometry());
        Dispatch::new(if geometry { KernelId::ProjectGeometry } else { KernelId::Project }, offsets)
    }

    /// Compiles the kernels for depths and normals when they are first needed.
    pub(super) fn compile_geometry(&mut self, training: bool) -> Result<()> {
        self.compile(self.raster.geometry_only(training))
    }

    /// Capacity that renders or training steps with these cameras need.
    pub(super) fn needs(
        &self,
        cameras: impl Iterator<Item = Camera>,
        training: bool,
        statistics: bool,
    ) -> RequiredCapacity {
        let n = self.shape.num_splats() as u64;
        let guess = self.options.pair_capacity.unwrap_or((PAIRS_PER_SPLAT * n).max(1 << 14));
        // The guess must not exceed the device's limits.
        let guess = guess.min(self.most_pairs()).max(1);
        let mut needs = RequiredCapacity {
            // An empty model has buffers too.
            splats: n.max(1),
            pairs: self.capacity.pairs_of(training).max(guess),
            pair_bytes: self.form.pair_bytes(),
            training,
            statistics,
            ..RequiredCapacity::default()
        };
        for camera in cameras {
            let [cols, rows] = uniform::grid(&camera, self.form.tile_rows_px);
            needs.pixels = needs.pixels.max(camera.pinhole.num_pixels() as u64);
            needs.tiles = needs.tiles.max(u64::from(cols) * u64::from(rows));
        }
        needs
    }

    /// Largest number of pairs of a training step.
    pub(super) fn most_pairs(&self) -> u64 {
        let most = limits::max_pairs(self.device.most_buffer_bytes(), self.form.pair_bytes());
        self.options.most_pairs.map_or(most, |asked| most.min(asked))
    }

    /// Grows the buffers to the number of pairs that a view needs.
    ///
    /// # Errors
    /// [`crate::Error::DeviceFull`] if a device cannot hold as many, or memory fails.
    pub(super) fn grow_pairs(&mut self, status: &Status, needs: &RequiredCapacity) -> Result<()> {
        if u64::from(status.needed_pairs) <= self.capacity.pairs_of(needs.training) {
            return Err(self
                .device
                .error("a submission was not carried out, and the driver reports no reason"));
        }
        let needed = u64::from(status.needed_pairs);
        let most = self.most_pairs();
        if needs.training && needed > most {
            let needed = format!("a step needs {needed} tile-splat pairs, at most {most} fit");
            let remedy = "use fewer splats, smaller images, or the device \"cpu\"";
            return Err(self.device.full(&needed, Some(remedy)));
        }
        let grown = |pairs| RequiredCapacity { pairs, ..*needs };
        let ample = (needed * 3 / 2).min(most).max(needed);
        match self.capacity.ensure(&self.device, &mut self.resources, &grown(ample)) {
            Err(Error::DeviceFull(_)) if ample > needed => {
                self.capacity.ensure(&self.device, &mut self.resources, &grown(needed))
            }
            outcome => outcome,
        }
    }

    /// The dispatches of a submission, and where those of each request end. Writes their uniforms.
    pub(super) fn batch_dispatches(
        &self,
        task: Task,
        batch: &[StepRequest<'_>],
        photos_px: &[u32],
        part: usize,
        mut inputs: UniformInputs,
    ) -> (Vec<Dispatch>, Vec<usize>) {
        let (mut dispatches, mut ends) = (Vec::new(), Vec::new());
        for (slot, (request, &photo_px)) in batch.iter().zip(photos_px).enumerate() {
            let mut uniform = uniform::step(&inputs, request, photo_px, (part * BATCH + slot) as u32);
            match task {
                Task::Train => {
                    uniform.flags |= if slot > 0 { FLAG_INVISIBLE } else { 0 };
                    uniform.flags |= if self.counts_atomics(request) { FLAG_COUNT_ATOMICS } else { 0 };
                }
                // As an image: parameters are flushed, but not stored.
                Task::Compare => (uniform.step, uniform.flags, uniform.segment_pairs) = (0, 0, 0),
                // The first moments of invisible splats are 0: they stand still.
                Task::Probe => {}
            }
            dispatches.extend(self.task_dispatches(task, &self.turns(slot, &uniform), request));
            ends.push(dispatches.len());
            if task != Task::Compare {
                (inputs.flushed_step, inputs.flushed_rates) = (request.step, request.rates);
            }
        }
        if task == Task::Train {
            dispatches.push(self.end_dispatch(&inputs, batch));
        }
        (dispatches, ends)
    }

    /// Whether a step runs the kernel variant that counts atomics.
    fn counts_atomics(&self, request: &StepRequest<'_>) -> bool {
        self.options.count_texel_atomics && !request.loss.needs_geometry() && !request.accumulate_statistics
    }

    pub(super) fn report(
        &self,
        request: &StepRequest<'_>,
        status: &Status,
        stages: KernelTimes,
    ) -> StepReport {
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
            texel_atomics: s.texel_atomics.into(),
        };
        let sums = s.colour_sums.as_flattened();
        let colour_sums = request.exposure.map(|_| ColourSums(std::array::from_fn(|k| sums[k].into())));
        StepReport { loss, counters, non_finite_gradients: s.faults.into(), colour_sums, stages }
    }
}

pub(super) fn check_camera(camera: &Camera) -> Result<()> {
    let (w, h) = (camera.pinhole.width_px, camera.pinhole.height_px);
    if w.max(h) <= MAX_SIDE_PX && w.min(h) > 0 {
        return Ok(());
    }
    Err(usage!("image of {w}x{h} px: on GPUs, sides must be between 1 and {MAX_SIDE_PX} px"))
}

pub(super) fn check_request(request: &StepRequest<'_>) -> Result<()> {
    check_camera(&request.camera)?;
    request.check()
}
