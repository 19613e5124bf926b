//! The GPU as a [`Backend`]: several steps per submission, whose statuses are read while the device does the next. A step
//! whose pairs do not fit is not applied, nor is any later step that was submitted; then the buffers grow and the steps
//! are repeated, with the same bits as if the buffers had been large enough from the start.

use super::kernels::Buf;
use super::layout::Status;
use super::model_buffers::{self, STATE};
use super::probing;
use super::saved::Saved;
use super::shape::Clock;
use super::state::GpuBackend;
use super::submission::{Task, check_camera};
use super::uniform;
use super::view_buffers::RequiredCapacity;
use super::{apply_plan, geometry, limits};
use crate::Result;
use crate::backend::{
    Backend, ComparedView, Costs, DensityPlan, DeviceInfo, DeviceLimits, LearningRates, LossWeights, Probe,
    RenderOptions, RenderedImage, SavedState, SceneShape, StepReport, StepRequest, WindowStatistics,
};
use crate::camera::Camera;
use crate::model::{AdamState, Model};

impl Backend for GpuBackend {
    fn device(&self) -> DeviceInfo {
        let choice = &self.device.choice;
        DeviceInfo { name: choice.name.clone(), description: choice.description.clone() }
    }

    fn limits(&self, shape: SceneShape) -> DeviceLimits {
        limits::limits(self.device.most_buffer_bytes(), self.most_pairs(), shape)
    }

    fn upload(&mut self, model: &Model, adam: &AdamState) -> Result<()> {
        let shape = model_buffers::upload(&self.device, &mut self.resources, &self.shape, model, adam)?;
        self.adopt(shape, Clock::of(adam));
        self.device.check()
    }

    fn forget_photos(&mut self) {
        self.photos.forget();
    }

    fn save(&mut self) -> Result<SavedState> {
        self.check()?;
        Ok(SavedState(Box::new(Saved::of(self)?)))
    }

    fn restore(&mut self, saved: &SavedState) -> Result<()> {
        match saved.0.downcast_ref::<Saved>() {
            Some(saved) => saved.restore(self),
            None => Err(usage!("{}: another backend saved this state", self.device.choice.name)),
        }
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
            let inputs = self.uniform_inputs();
            let uniform = uniform::image(&inputs, camera, options.background, options.sh_degree);
            let offsets = self.set_uniform(0, &uniform);
            let dispatches = self.forward(offsets, camera, options.geometry);
            let index = self.submit_for_statuses(&dispatches, 0, 1)?;
            let status: Vec<Status> = self.device.read_staged(&self.staging[0], 1, index)?;
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
        self.pace.call_steps()
    }

    fn most_batch_steps(&self) -> usize {
        self.pace.most_call_steps()
    }

    fn steps(&mut self, requests: &[StepRequest<'_>]) -> Result<Vec<StepReport>> {
        self.run(Task::Train, requests)
    }

    fn squared_errors(&mut self, views: &[ComparedView<'_>]) -> Result<Vec<f64>> {
        let requests: Vec<StepRequest<'_>> = views.iter().map(comparison).collect();
        let reports = self.run(Task::Compare, &requests)?;
        Ok(reports.iter().map(|report| report.loss.mse).collect())
    }

    fn probe(&mut self, probes: &mut dyn Iterator<Item = Result<Probe>>) -> Result<Vec<Costs>> {
        probing::probe(self, probes)
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
        self.window_views = statistics.views;
        let buffer = self.resources.buffer(Buf::Statistics);
        // An empty window takes no memory, so that beginning one cannot fail.
        if statistics.views == 0 {
            self.device.clear(buffer);
            return Ok(());
        }
        let values: Vec<[f32; 4]> = (0..statistics.seen.len())
            .map(|i| {
                let s = statistics;
                [s.seen[i] as f32, s.area[i], s.contribution[i], s.error[i]]
            })
            .collect();
        self.device.write(buffer, 0, bytemuck::cast_slice(&values))
    }

    fn apply_plan(&mut self, plan: &DensityPlan) -> Result<()> {
        self.check()?;
        plan.check(self.shape.num_splats())?;
        apply_plan::apply_plan(self, plan)
    }

    fn read_back(&mut self) -> Result<(Model, AdamState)> {
        // Works after refused commands too: the steps applied before are intact, and can be saved.
        self.check_model()?;
        self.count_unread()?;
        model_buffers::read_back(&self.device, &self.resources, &self.shape, self.clock)
    }

    fn read_flushed(&mut self) -> Result<Model> {
        self.check()?;
        // Flushes a copy: reading must not change what the next steps compute.
        let state = STATE.map(|name| (name, self.resources.buffer(name).clone())).to_vec();
        let copies = model_buffers::copies(&self.device, &state)?;
        // No early return from here on: the originals are restored on every path.
        copies.into_iter().for_each(|(name, copy)| self.resources.set(name, copy));
        self.flush_all();
        let flushed = model_buffers::read_model(&self.device, &self.resources, &self.shape);
        state.into_iter().for_each(|(name, original)| self.resources.set(name, original));
        // If a command was refused, the copy is not flushed.
        self.device.check()?;
        flushed
    }
}

/// The step whose mean squared difference compares a view with its photo.
fn comparison<'a>(view: &ComparedView<'a>) -> StepRequest<'a> {
    StepRequest {
        step: 1,
        camera: view.camera,
        photo: view.photo,
        target: view.target,
        background: view.background,
        sh_degree: view.sh_degree,
        loss: LossWeights { mse: 1.0, ..LossWeights::NONE },
        rates: LearningRates::default(),
        accumulate_statistics: false,
        exposure: view.exposure,
    }
}
