//! Submissions: the dispatches of steps and images, the buffer capacity that they need, and the evaluation of
//! their status. `backend` decides what to submit, and repeats what did not fit.

use super::encode::Dispatch;
use super::kernels::{Buf, KernelId};
use super::layout::{FLAG_COUNT_ATOMICS, FLAG_UNSEEN, MAX_SIDE_PX, Status, StepUniform};
use super::limits;
use super::pace::BATCH;
use super::resources::UniformOffsets;
use super::sort;
use super::state::{GpuBackend, PendingStep};
use super::uniform::{self, UniformInputs};
use super::view_buffers::{MOST_ROUNDS, RequiredCapacity};
use crate::backend::{ColourSums, LossValues, RasterCounters, StepReport, StepRequest};
use crate::camera::Camera;
use crate::{Error, Result};
use std::time::{Duration, Instant};

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
        rounds: &[UniformOffsets],
        request: &StepRequest<'_>,
    ) -> Vec<Dispatch> {
        let offsets = rounds[0];
        let geometry = request.loss.needs_geometry();
        let (statistics, exposure) = (request.accumulate_statistics, request.exposure.is_some());
        match task {
            Task::Train => self.step_dispatches(rounds, &request.camera, geometry, statistics, exposure),
            Task::Probe => {
                let mut out = self.step_dispatches(rounds, &request.camera, false, false, exposure);
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
    /// `exposure` corrects the image by that of the photo. `rounds` are the uniforms of [`Self::rounds`].
    pub(super) fn step_dispatches(
        &self,
        rounds: &[UniformOffsets],
        camera: &Camera,
        geometry: bool,
        statistics: bool,
        exposure: bool,
    ) -> Vec<Dispatch> {
        use KernelId as K;
        let offsets = rounds[0];
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
        out.extend(rounds.iter().flat_map(|&round| [bwd, K::SumPairs].map(|id| Dispatch::new(id, round))));
        let last = [project_bwd, K::AdamTexel, K::FinishBlocks, finish];
        out.extend(last.map(|id| Dispatch::new(id, offsets)));
        out
    }

    /// Uniforms of the rounds in which a step sums the derivatives by its pairs: one, unless the partial sums of all pairs
    /// exceed a buffer. The bits do not depend on their number.
    pub(super) fn rounds(&self, slot: usize, uniform: &StepUniform) -> Vec<UniformOffsets> {
        let pairs = self.capacity.partial_pairs(uniform.partial_stride);
        let count = self.capacity.training_pairs.div_ceil(pairs.max(1)).max(1) as usize;
        assert!(count <= MOST_ROUNDS, "{count} rounds for {} pairs", self.capacity.training_pairs);
        let round = |k: usize| StepUniform {
            partial_first: (k as u64 * pairs) as u32,
            partial_capacity: pairs as u32,
            ..*uniform
        };
        (0..count).map(|k| self.set_uniform(k * BATCH + slot, &round(k))).collect()
    }

    /// The dispatch after the last of these steps, in which splats that it did not see take it. Within a submission the next
    /// step does this, by the same kernel: the bits do not depend on how many steps are submitted at a time.
    fn end_dispatch(&self, inputs: &UniformInputs, requests: &[StepRequest<'_>]) -> Dispatch {
        let offsets = self.set_uniform(MOST_ROUNDS * BATCH, &uniform::end(inputs));
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
            return Err(self.device.full(&format!(
                "a step needs {needed} tile-splat pairs, at most {most} fit: use fewer splats, smaller images, or the \
                 device \"cpu\""
            )));
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

    /// Runs requests as submissions, which grow the buffers where pairs do not fit. Returns a report for each.
    pub(super) fn run(&mut self, task: Task, requests: &[StepRequest<'_>]) -> Result<Vec<StepReport>> {
        self.check()?;
        requests.iter().try_for_each(check_request)?;
        if requests.iter().any(|r| r.loss.needs_geometry()) {
            self.compile_geometry(true)?;
        }
        let mut reports = Vec::new();
        while reports.len() < requests.len() {
            match self.run_some(task, &requests[reports.len()..]) {
                Ok(some) => reports.extend(some),
                // Training steps before it count.
                Err(Error::DeviceFull(_)) if task == Task::Train && !reports.is_empty() => break,
                Err(error) => return Err(error),
            }
        }
        Ok(reports)
    }

    /// Runs the first of these requests as one submission, and grows the buffers if pairs do not fit. Returns a report for each
    /// that was carried out.
    fn run_some(&mut self, task: Task, requests: &[StepRequest<'_>]) -> Result<Vec<StepReport>> {
        let some = &requests[..requests.len().min(self.pace.steps())];
        let photos: Vec<_> = some.iter().map(|r| (r.photo, r.target)).collect();
        let fitting = self.photos.prepare(&self.device, &mut self.resources, &photos)?;
        let batch = &some[..fitting];
        let statistics = batch.iter().any(|r| r.accumulate_statistics);
        let needs = RequiredCapacity {
            geometry: batch.iter().any(|r| r.loss.needs_geometry()),
            ..self.needs(batch.iter().map(|r| r.camera), true, statistics)
        };
        self.capacity.ensure(&self.device, &mut self.resources, &needs)?;
        let mut reports = Vec::new();
        for (request, (status, stages)) in batch.iter().zip(self.submit_steps(task, batch)?) {
            if status.done == 1 {
                reports.push(self.report(request, &status, stages));
            } else {
                match self.grow_pairs(&status, &needs) {
                    // The next call meets it again.
                    Err(Error::DeviceFull(_)) if !reports.is_empty() => {}
                    grown => grown?,
                }
            }
        }
        Ok(reports)
    }

    /// Runs steps as one submission. Returns the status and times of the applied steps, and of the first that was
    /// not applied.
    ///
    /// The host encodes a batch only after reading the status of the one before: the trait passes one batch at a
    /// time and expects its reports. To overlap encoding and execution, requests would have to arrive before the
    /// reports of earlier ones are returned.
    fn submit_steps(
        &mut self,
        task: Task,
        requests: &[StepRequest<'_>],
    ) -> Result<Vec<(Status, KernelTimes)>> {
        let start = Instant::now();
        let photos: Vec<_> = requests.iter().map(|r| (r.photo, r.target)).collect();
        let photos_px = self.photos.place(&self.device, &self.resources, &photos)?;
        self.arm();
        let mut dispatches = Vec::new();
        let mut ends = Vec::new();
        let mut inputs = self.uniform_inputs();
        inputs.pair_capacity = self.capacity.training_pairs as u32;
        for (slot, (request, photo_px)) in requests.iter().zip(photos_px).enumerate() {
            let mut uniform = uniform::step(&inputs, request, photo_px, slot as u32);
            match task {
                Task::Train => {
                    uniform.flags |= if slot > 0 { FLAG_UNSEEN } else { 0 };
                    uniform.flags |= if self.counts_atomics(request) { FLAG_COUNT_ATOMICS } else { 0 };
                }
                // As an image: parameters are flushed, but not stored.
                Task::Compare => (uniform.step, uniform.flags, uniform.segment_pairs) = (0, 0, 0),
                // The first moments of splats that it does not see are 0: they stand still.
                Task::Probe => {}
            }
            dispatches.extend(self.task_dispatches(task, &self.rounds(slot, &uniform), request));
            ends.push(dispatches.len());
            if task != Task::Compare {
                (inputs.flushed_step, inputs.flushed_rates) = (request.step, request.rates);
            }
        }
        if task == Task::Train {
            dispatches.push(self.end_dispatch(&inputs, requests));
        }
        let pending = |r: &StepRequest<'_>| PendingStep {
            step: r.step,
            rates: r.rates,
            counts_in_window: r.accumulate_statistics,
        };
        self.in_flight = requests.iter().filter(|_| task != Task::Compare).map(pending).collect();
        let statuses = self.submit_for_status(&dispatches, requests.len())?;
        let applied = self.count_applied(&statuses);
        let times = match &self.timer {
            Some(timer) => timer.read(&self.device, dispatches.len())?,
            None => Vec::new(),
        };
        let stages = (0..requests.len()).map(|k| {
            let range = ends[..k].last().copied().unwrap_or(0)..ends[k];
            times_by_kernel(&dispatches[range.clone()], times.get(range).unwrap_or_default())
        });
        // The time of a batch that was cut short does not predict that of a whole one.
        if task == Task::Train && applied == requests.len() {
            self.pace.learn(applied, start.elapsed().as_secs_f64());
        }
        Ok(statuses.into_iter().zip(stages).take(applied + 1).collect())
    }

    /// Updates the clock to the steps of the last submission that were applied, and returns their number.
    pub(super) fn count_applied(&mut self, statuses: &[Status]) -> usize {
        let applied = statuses.iter().take_while(|s| s.done == 1).count();
        let pending = std::mem::take(&mut self.in_flight);
        let steps = &pending[..applied.min(pending.len())];
        if let Some(last) = steps.last() {
            (self.clock.step, self.clock.rates) = (last.step, last.rates);
        }
        self.window_views += steps.iter().filter(|p| p.counts_in_window).count() as u32;
        applied
    }

    /// Submits dispatches and a copy of the first `count` statuses, and waits for them.
    pub(super) fn submit_for_status(&mut self, dispatches: &[Dispatch], count: usize) -> Result<Vec<Status>> {
        let mut encoder = self.encoded(dispatches);
        let bytes = (count * size_of::<Status>()) as u64;
        encoder.copy_buffer_to_buffer(self.resources.buffer(Buf::Status), 0, &self.staging, 0, bytes);
        self.device.submit(encoder);
        self.device.read_staged(&self.staging, count)
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

/// Time by kernel, in the order of their first dispatch.
pub(super) type KernelTimes = Vec<(&'static str, Duration)>;

fn times_by_kernel(dispatches: &[Dispatch], times: &[Duration]) -> KernelTimes {
    let mut out: KernelTimes = Vec::new();
    for (dispatch, time) in dispatches.iter().zip(times) {
        let name = dispatch.kernel.kernel().name;
        match out.iter_mut().find(|(n, _)| *n == name) {
            Some((_, sum)) => *sum += *time,
            None => out.push((name, *time)),
        }
    }
    out
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
