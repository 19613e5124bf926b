//! The CPU backend: owns model, moments and working memory, and runs the passes in order.

use super::apply_plan;
use super::loss::LossBuffers;
use super::pipeline::{ViewPipeline, with_regularisers};
use super::simd::SimdLevel;
use super::tile::{CPU_TILE_PX, place_of};
use super::update::{flush, update};
use super::view::ViewF32;
use crate::backend::{
    Backend, Costs, DensityPlan, Derivatives, DeviceInfo, DeviceLimits, Probe, RenderOptions, RenderedImage,
    SavedState, SceneShape, StepReport, StepRequest, WindowStatistics, costs_of, probed,
};
use crate::camera::{Camera, Similarity};
use crate::constants::SH_DEGREE_MAX;
use crate::model::{AdamState, Filter, Model, SplatArrays, SplatGroup, TexturePool};
use crate::{Error, Result};
use fearless_simd::Level;
use rayon::prelude::*;
use std::time::{Duration, Instant};

/// Splats whose costs a thread sums at a time.
const SPLATS_PER_TASK: usize = 256;

/// Renders and trains on all cores, without a GPU or driver.
pub struct CpuBackend {
    level: Level,
    pool: rayon::ThreadPool,
    model: Model,
    adam: AdamState,
    /// The flushed model, until the next step.
    flushed: Option<Model>,
    statistics: WindowStatistics,
    count_pairs: bool,
    pipeline: ViewPipeline,
    loss: LossBuffers,
    partials: Vec<f32>,
}

/// The pixels on which a splat is evaluated.
pub struct PairCoverage {
    /// Index of the splat in the model.
    pub splat: usize,
    /// Whether each pixel is covered. `[height, width]`
    pub covered: Vec<bool>,
}

/// Times of consecutive passes.
struct PassTimes {
    since: Instant,
    stages: Vec<(&'static str, Duration)>,
}

impl PassTimes {
    fn start() -> Self {
        Self { since: Instant::now(), stages: Vec::new() }
    }

    fn end(&mut self, name: &'static str) {
        let now = Instant::now();
        self.stages.push((name, now - self.since));
        self.since = now;
    }
}

impl CpuBackend {
    /// A backend with `threads` threads (default: one per core).
    ///
    /// # Errors
    /// [`Error::Device`] if the threads cannot be started.
    pub fn new(threads: Option<usize>) -> Result<Self> {
        Self::with_simd(threads, SimdLevel::best())
    }

    /// A backend with a given instruction set.
    ///
    /// # Errors
    /// As [`CpuBackend::new`].
    pub fn with_simd(threads: Option<usize>, simd: SimdLevel) -> Result<Self> {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads.unwrap_or(0))
            .thread_name(|i| format!("cpu-backend-{i}"))
            .build()
            .map_err(|e| Error::Device(format!("cannot start threads: {e}")))?;
        let model = Model {
            splats: SplatArrays::zeros(0, 0),
            textures: TexturePool::default(),
            near: 0.01,
            filter: Filter::None,
            capture_from_local: Similarity::IDENTITY,
        };
        Ok(Self {
            level: simd.0,
            pool,
            adam: AdamState::zeros(&model),
            model,
            flushed: None,
            statistics: WindowStatistics::default(),
            count_pairs: false,
            pipeline: ViewPipeline::default(),
            loss: LossBuffers::default(),
            partials: Vec::new(),
        })
    }

    /// Turns the pair counters of the step reports on or off; steps with counters are a few per cent slower.
    pub fn count_pairs(&mut self, on: bool) {
        self.count_pairs = on;
    }

    /// The pixels on which each projected splat is evaluated, for tests of the bounds.
    pub fn coverage(&mut self, camera: &Camera) -> Vec<PairCoverage> {
        let view = ViewF32::new(camera, &self.model);
        self.pipeline.project(self.level, &self.model, view);
        let size = view.size_px.map(|s| s as usize);
        let mut out: Vec<PairCoverage> = self
            .pipeline
            .splats
            .iter()
            .map(|s| PairCoverage { splat: s.id as usize, covered: vec![false; size[0] * size[1]] })
            .collect();
        for tile in 0..self.pipeline.tiles.len() {
            let origin = self.pipeline.tiles.origin_px(tile);
            for pair in self.pipeline.tiles.pairs_of(tile) {
                for (y, x) in (0..CPU_TILE_PX).flat_map(|y| (0..CPU_TILE_PX).map(move |x| (y, x))) {
                    let (px, py) = (origin[0] as usize + x, origin[1] as usize + y);
                    if px < size[0] && py < size[1] && pair.blocks >> place_of(x, y).0 & 1 == 1 {
                        out[pair.splat as usize].covered[py * size[0] + px] = true;
                    }
                }
            }
        }
        out
    }

    /// Takes the flushed model, or makes one; callers put it back if it stays valid.
    fn take_flushed(&mut self) -> Model {
        self.flushed.take().unwrap_or_else(|| {
            let (mut model, mut adam) = (self.model.clone(), self.adam.clone());
            self.pool.install(|| flush(&mut model, &mut adam, None, self.adam.step));
            model
        })
    }
}

impl Backend for CpuBackend {
    fn device(&self) -> DeviceInfo {
        let simd = SimdLevel(self.level).name();
        DeviceInfo {
            name: "cpu".into(),
            description: format!("{simd}, {} threads", self.pool.current_num_threads()),
        }
    }

    fn limits(&self, _shape: SceneShape) -> DeviceLimits {
        DeviceLimits {
            // Columns and rows of tiles are stored in 16 bits.
            max_side_px: CPU_TILE_PX as u32 * u32::from(u16::MAX),
            max_pixels: u32::MAX.into(),
            // Floats of SH are indexed by 32 bits.
            max_splats: u64::from(u32::MAX) / SplatGroup::Sh.width(SH_DEGREE_MAX) as u64,
            // The floats of visible texels are indexed by 32 bits.
            max_texels: u64::from(u32::MAX) / 3,
            // Pairs are indexed by 32 bits.
            max_pairs: u32::MAX.into(),
        }
    }

    fn upload(&mut self, model: &Model, adam: &AdamState) -> Result<()> {
        self.model = model.clone();
        self.adam = adam.clone();
        self.flushed = None;
        self.statistics = WindowStatistics::empty(model.num_splats());
        Ok(())
    }

    fn save(&mut self) -> Result<SavedState> {
        Ok(SavedState(Box::new((self.model.clone(), self.adam.clone()))))
    }

    fn restore(&mut self, saved: &SavedState) -> Result<()> {
        let Some((model, adam)) = saved.0.downcast_ref::<(Model, AdamState)>() else {
            return Err(usage!("cpu: another backend saved this state"));
        };
        self.upload(model, adam)
    }

    fn render(&mut self, camera: &Camera, options: &RenderOptions) -> Result<RenderedImage> {
        let model = self.take_flushed();
        let Self { level, pool, pipeline, .. } = self;
        let image = pool.install(|| {
            pipeline.project(*level, &model, ViewF32::new(camera, &model));
            pipeline.colours(*level, &model, options.sh_degree);
            let mut geometry = options.geometry.then(Vec::new);
            pipeline.raster(*level, false, geometry.as_mut());
            pipeline.image(options.background, geometry.as_deref())
        });
        self.flushed = Some(model);
        Ok(image)
    }

    fn probe(&mut self, probes: &mut dyn Iterator<Item = Result<Probe>>) -> Result<Vec<Costs>> {
        let model = probed(self.take_flushed());
        self.upload(&model, &AdamState::zeros(&model))?;
        let mut sums = vec![Costs::default(); model.num_splats()];
        for probe in probes {
            let probe = probe?;
            self.adam = AdamState::zeros(&model);
            self.step(&StepRequest::of_probe(&probe))?;
            let AdamState { splats_m, texels_m, .. } = &self.adam;
            let derivatives = Derivatives { splats: splats_m, texels: texels_m, scale: probe.scale() };
            let each = sums.par_iter_mut().with_min_len(SPLATS_PER_TASK).enumerate();
            self.pool.install(|| {
                each.for_each(|(splat, sums)| sums.add(&costs_of(&model, &derivatives, splat)));
            });
        }
        Ok(sums)
    }

    fn step(&mut self, request: &StepRequest<'_>) -> Result<StepReport> {
        request.check()?;
        self.flushed = None;
        let Self { level, pool, model, adam, pipeline, loss, partials, statistics, count_pairs, .. } = self;
        let level = *level;
        pool.install(|| {
            let mut stages = PassTimes::start();
            let view = ViewF32::new(&request.camera, model);
            pipeline.project(level, model, view);
            stages.end("project+bin");
            // With the learning rates of the last step, not of this one.
            flush(model, adam, Some(&pipeline.visible_ids()), request.step - 1);
            pipeline.colours(level, model, request.sh_degree);
            stages.end("flush+colours");
            pipeline.raster_for(level, *count_pairs, request);
            stages.end("forward");
            let (terms, colour_sums) = pipeline.loss(level, loss, request);
            let mut values = with_regularisers(terms, model, pipeline, request);
            (values.distortion, values.normal) = pipeline.geometry_loss(request);
            let v = values;
            values.total = v.l1 + v.dssim + v.mse + v.opacity + v.texture + v.distortion + v.normal;
            stages.end("loss");
            pipeline.backward(level, loss, request, partials);
            stages.end("backward");
            let input = pipeline.update_input(level, model, request, partials, view);
            let window = request.accumulate_statistics.then(|| {
                statistics.views += 1;
                &mut *statistics
            });
            let non_finite_gradients = update(model, adam, window, &input);
            stages.end("reduce+update");
            Ok(StepReport {
                loss: values,
                counters: pipeline.counters(),
                non_finite_gradients,
                colour_sums,
                stages: stages.stages,
            })
        })
    }

    fn read_statistics(&mut self) -> Result<WindowStatistics> {
        Ok(self.statistics.clone())
    }

    fn set_statistics(&mut self, statistics: &WindowStatistics) -> Result<()> {
        statistics.check(self.model.num_splats())?;
        self.statistics = statistics.clone();
        Ok(())
    }

    fn apply_plan(&mut self, plan: &DensityPlan) -> Result<()> {
        plan.check(self.model.num_splats())?;
        // Map changes do not commute with pending lazy updates.
        let (step, model, adam) = (self.adam.step, &mut self.model, &mut self.adam);
        self.pool.install(|| flush(model, adam, None, step));
        (self.model, self.adam) =
            self.pool.install(|| apply_plan::apply_plan(&self.model, &self.adam, plan))?;
        self.flushed = None;
        self.statistics = WindowStatistics::empty(self.model.num_splats());
        Ok(())
    }

    fn read_back(&mut self) -> Result<(Model, AdamState)> {
        Ok((self.model.clone(), self.adam.clone()))
    }

    fn read_flushed(&mut self) -> Result<Model> {
        let model = self.take_flushed();
        self.flushed = Some(model.clone());
        Ok(model)
    }
}
