//! The end of a training: what remains to be measured, and its summary.

use super::layers::LayersPerPixel;
use super::recorder::{Recorder, UNCOVERED_MIN_STEPS, reason_name};
use super::summary::{
    CaptureFigures, DiskBytes, Fps, GrowthFigures, Resumed, SCHEMA, Size, Summary, TestFigures, Times,
};
use super::trained::render_options;
use crate::backend::{Backend, RenderOptions};
use crate::bake::asset_cameras;
use crate::capture::Capture;
use crate::eval::uncovered_share;
use crate::memory::process_bytes;
use crate::model::{Model, TextureMap};
use crate::text::format_count;
use crate::train::{Schedule, StopReason, TrainConfig, TrainState};
use crate::verify::bake_checkpoint;
use crate::views::{Split, ViewSource};
use crate::{Error, Report, Result, Warning};
use litetex_exporters::ltgs::{LtgsOptions, encode};
use litetex_exporters::{Provenance, Quality as AssetQuality};
use std::time::Instant;

/// Training views that are looked at for uncovered pixels, at most.
const UNCOVERED_VIEWS_MAX: usize = 16;

impl Recorder<'_> {
    /// Ends a run: measures coverage where no test view did, the speed of rendering and the sizes of files, unless it was
    /// interrupted, and writes `summary.json`. `report` holds the warnings from before the training.
    ///
    /// # Errors
    /// What rendering and writing report.
    pub fn finish(
        &mut self,
        backend: &mut dyn Backend,
        capture: &Capture,
        (state, reason): (&TrainState, StopReason),
        resumed: Option<Resumed>,
        mut report: Report,
    ) -> Result<Summary> {
        let config = self.config;
        let is_trained = reason != StopReason::Consumer && state.step >= UNCOVERED_MIN_STEPS;
        if is_trained && capture.indices(Split::Test).is_empty() {
            let options = render_options(&state.model, config.train.background, false);
            match uncovered_of_training_views(backend, capture, &options) {
                // Only a hint.
                Err(Error::DeviceFull(_)) => {}
                share => {
                    self.warn_of_uncovered_pixels("training", share?, "more steps may close the gaps")?
                }
            }
        }
        let schedule = self.schedule(capture);
        let was_due = schedule.prune_rounds > 0 && schedule.is_pruned(state.step);
        if let Some(message) = over_budget(&config.train, state.model.num_params(), was_due) {
            self.warn(Warning { code: "budget-exceeded".to_owned(), message, count: 1 })?;
        }
        report.merge(std::mem::take(&mut self.report));
        let mut summary = self.summarise(backend, capture, (state, reason))?;
        (summary.resumed, summary.warnings) = (resumed, report.warnings);
        summary.time.total_wall_secs = (self.total_wall_secs)();
        summary.write(&self.folder.summary())?;
        Ok(summary)
    }

    /// The timetable with which the run ended.
    fn schedule(&self, capture: &Capture) -> Schedule {
        let first = Schedule::new(&self.config.train, capture.indices(Split::Train).len());
        self.train.plan.iter().fold(first, |now, &change| now.changed(change))
    }

    /// The summary without what only the end of the command knows.
    fn summarise(
        &self,
        backend: &mut dyn Backend,
        capture: &Capture,
        (state, reason): (&TrainState, StopReason),
    ) -> Result<Summary> {
        let config = self.config;
        let train = &config.train;
        let schedule = self.schedule(capture);
        let fps = match reason {
            StopReason::Consumer => None,
            _ => match measure_fps(backend, capture, state, train.background) {
                // As the evaluation said.
                Err(Error::DeviceFull(_)) => None,
                fps => fps?,
            },
        };
        let memory_peak_bytes = process_bytes().map(|(_, peak)| peak);
        let layers_per_pixel = match reason {
            StopReason::Consumer => None,
            _ => match backend.read_flushed() {
                Err(Error::DeviceFull(_)) => None,
                model => LayersPerPixel::of_stored(&model?, &asset_cameras(capture)),
            },
        };
        let disk = match reason {
            StopReason::Consumer => None,
            _ => disk_bytes(backend, state)?,
        };
        Ok(Summary {
            schema: SCHEMA.to_owned(),
            version: env!("CARGO_PKG_VERSION").to_owned(),
            scene: capture.name.clone(),
            capture: capture_figures(capture),
            resample: "area".to_owned(),
            background: train.background,
            device: backend.device(),
            seed: train.seed,
            steps: state.step,
            steps_planned: self.train.last_step(),
            profile: config.profile,
            policy: train.policy,
            components: train.active_components(),
            inactive: config.inactive(&schedule),
            outlying_views: self.outlying_views(),
            map_sides: map_sides(&state.model),
            stopped_by: reason_name(reason).to_owned(),
            quality: self.evaluation.as_ref().map(TestFigures::from),
            size: Size {
                splats: state.model.num_splats(),
                texels: state.model.num_texels(),
                maps: state.model.size().maps,
                sh_coefficients: state.model.size().sh_coefficients,
                params: state.model.num_params(),
                params_published: state.model.size().params_published(),
                disk,
            },
            layers_per_pixel,
            growth: GrowthFigures::new(&state.growth, &state.device, state.step, schedule.densify_until),
            pruned: state.history.pruned.clone(),
            fps,
            curve: state.history.curve.clone(),
            resumed: None,
            memory_peak_bytes,
            warnings: Vec::new(),
            time: Times {
                train_wall_secs: state.history.train_wall_secs,
                train_cpu_secs: state.history.train_cpu_secs,
                density_control_wall_secs: state.history.density_control_wall_secs,
                prune_wall_secs: state.history.prune_wall_secs,
                rounding_wall_secs: state.history.rounding_wall_secs,
                analysis_wall_secs: state.history.analysis_wall_secs,
                total_wall_secs: 0.0,
            },
        })
    }
}

/// Sizes of the scene's files; `None` for a scene that no file can hold, or where the device has no room to bake it.
fn disk_bytes(backend: &mut dyn Backend, state: &TrainState) -> Result<Option<DiskBytes>> {
    let model = (&state.model, &state.adam);
    let provenance = Provenance::default();
    let baked = bake_checkpoint(backend, model, Vec::new(), [0.0; 3], provenance, &mut Report::default());
    let asset = match baked {
        Err(Error::DeviceFull(_)) => return Ok(None),
        asset => asset?,
    };
    let bytes = |quality| {
        let file = encode(&asset, &LtgsOptions { quality, ..LtgsOptions::default() });
        file.ok().map(|file| file.len())
    };
    let both = bytes(AssetQuality::Balanced).zip(bytes(AssetQuality::Tiny));
    Ok(both.map(|(ltgs_balanced, ltgs_tiny)| DiskBytes { ltgs_balanced, ltgs_tiny }))
}

fn capture_figures(capture: &Capture) -> CaptureFigures {
    let sizes = (0..capture.num_views()).map(|v| capture.camera(v).pinhole);
    let (width_px, height_px) = sizes.fold((0, 0), |(w, h), p| (w.max(p.width_px), h.max(p.height_px)));
    CaptureFigures {
        path: capture.root.display().to_string(),
        format: capture.format.to_string(),
        train_views: capture.indices(Split::Train).len(),
        test_views: capture.indices(Split::Test).len(),
        width_px,
        height_px,
        points: capture.points.len(),
    }
}

/// Number of splats by the longer side of their map: none, 2, up to 4, 8, ... 256 texels.
fn map_sides(model: &Model) -> Vec<usize> {
    let mut counts = vec![0; TextureMap::SIDE_CLASSES + 1];
    model.textures.maps.iter().for_each(|map| counts[map.side_class()] += 1);
    counts
}

/// Times renders of the test views, 8 to 64, after one that does not count.
fn measure_fps(
    backend: &mut dyn Backend,
    capture: &Capture,
    state: &TrainState,
    background: [f32; 3],
) -> Result<Option<Fps>> {
    let test = capture.indices(Split::Test);
    let Some(&first) = test.first() else {
        return Ok(None);
    };
    let options = render_options(&state.model, background, false);
    backend.render(&capture.camera(first), &options)?;
    let renders = test.len().clamp(8, 64);
    let mut secs = Vec::new();
    for &view in test.iter().cycle().take(renders) {
        let camera = capture.camera(view);
        let start = Instant::now();
        backend.render(&camera, &options)?;
        secs.push(start.elapsed().as_secs_f64().max(1e-9));
    }
    secs.sort_by(f64::total_cmp);
    let figures = capture_figures(capture);
    Ok(Some(Fps {
        median: 1.0 / secs[renders / 2],
        p5: 1.0 / secs[(renders - 1) * 95 / 100],
        renders,
        width_px: figures.width_px,
        height_px: figures.height_px,
    }))
}

/// Mean share of uncovered pixels over some training views of the scene in `backend`.
fn uncovered_of_training_views(
    backend: &mut dyn Backend,
    capture: &Capture,
    options: &RenderOptions,
) -> Result<f64> {
    let views = capture.indices(Split::Train);
    let views: Vec<usize> =
        views.iter().copied().step_by(views.len().div_ceil(UNCOVERED_VIEWS_MAX)).collect();
    let mut sum = 0.0;
    for &view in &views {
        let alpha = backend.render(&capture.camera(view), options)?.alpha;
        sum += uncovered_share(&alpha, &*capture.target(view)?, options.background);
    }
    Ok(sum / views.len() as f64)
}

/// A warning if a run ended before its model was brought down to the budget, though its last round of pruning `was_due`, or
/// before that.
fn over_budget(config: &TrainConfig, params: usize, was_due: bool) -> Option<String> {
    let most = config.budget.max_params.filter(|&most| params > most)?;
    let why = if was_due {
        "the device had no room for the last round of pruning; lower density.overshoot, or use another --device"
    } else {
        "the run ended before its last round of pruning; give it more time, or fewer --steps"
    };
    Some(format!(
        "the model has {} parameters, more than {}: {why}",
        format_count(params as u64),
        config.named_bound(most)
    ))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::backend::{
        Costs, DensityPlan, DeviceInfo, DeviceLimits, Probe, RenderedImage, SavedState, SceneShape,
        StepReport, StepRequest, WindowStatistics,
    };
    use crate::camera::Camera;
    use crate::cpu::CpuBackend;
    use crate::model::AdamState;
    use crate::selftest::{SceneOptions, random_scene};
    use crate::train::density::Budget;

    #[test]
    fn a_model_above_its_budget_is_told() {
        let of = |max_params| {
            let budget = Budget { max_params, ..Budget::default() };
            [false, true]
                .map(|was_due| over_budget(&TrainConfig { budget, ..TrainConfig::default() }, 5001, was_due))
        };
        let found = of(Some(5000)).map(Option::unwrap);
        for (text, remedy) in found.iter().zip(["fewer --steps", "another --device"]) {
            for part in ["5,001 parameters", "--budget-params 5,000", remedy] {
                assert!(text.contains(part), "{part}: {text}");
            }
        }
        assert_eq!([of(Some(5001)), of(None)], [[None, None], [None, None]]);
    }

    #[test]
    fn sizes_of_files_are_left_out_where_the_device_is_full() {
        let scene = random_scene(&SceneOptions { num_splats: 9, ..SceneOptions::default() });
        let mut state = TrainState::fresh(scene.model);
        state.adam = AdamState::zeros(&state.model);
        let mut backend = CpuBackend::new(Some(1)).unwrap();
        assert!(disk_bytes(&mut backend, &state).unwrap().is_some());
        assert!(disk_bytes(&mut Full(backend), &state).unwrap().is_none());
    }

    /// A backend without room for a model.
    struct Full(CpuBackend);

    impl Backend for Full {
        fn device(&self) -> DeviceInfo {
            self.0.device()
        }
        fn limits(&self, shape: SceneShape) -> DeviceLimits {
            self.0.limits(shape)
        }
        fn upload(&mut self, _: &Model, _: &AdamState) -> Result<()> {
            Err(Error::DeviceFull(String::from("full").into()))
        }
        fn save(&mut self) -> Result<SavedState> {
            self.0.save()
        }
        fn restore(&mut self, saved: &SavedState) -> Result<()> {
            self.0.restore(saved)
        }
        fn probe(&mut self, probes: &mut dyn Iterator<Item = Result<Probe>>) -> Result<Vec<Costs>> {
            self.0.probe(probes)
        }
        fn render(&mut self, camera: &Camera, options: &RenderOptions) -> Result<RenderedImage> {
            self.0.render(camera, options)
        }
        fn step(&mut self, request: &StepRequest<'_>) -> Result<StepReport> {
            self.0.step(request)
        }
        fn read_statistics(&mut self) -> Result<WindowStatistics> {
            self.0.read_statistics()
        }
        fn set_statistics(&mut self, statistics: &WindowStatistics) -> Result<()> {
            self.0.set_statistics(statistics)
        }
        fn apply_plan(&mut self, plan: &DensityPlan) -> Result<()> {
            self.0.apply_plan(plan)
        }
        fn read_back(&mut self) -> Result<(Model, AdamState)> {
            self.0.read_back()
        }
        fn read_flushed(&mut self) -> Result<Model> {
            self.0.read_flushed()
        }
    }
}
