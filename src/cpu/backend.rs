//! The CPU backend: owns model, moments and work space, and runs the passes in order.

use super::loss::{LossBuffers, image_loss};
use super::math::{BLOCK_PX, texel_values};
use super::project::{ProjectedSplat, ViewF32, base_colours, project_all};
use super::raster_bwd::{HEADER_FLOATS, TileGradient, raster_bwd};
use super::raster_fwd::{TileGeometry, TileInput, TileOutput, raster_fwd};
use super::shape::element_of;
use super::structure;
use super::tiles::{TILE_PIXELS, TILE_PX, Tiles, build_tiles};
use super::update::{UpdateInput, collect_gradients, settle, update};
use crate::backend::{
    Backend, DeviceInfo, LossValues, RasterCounters, RenderOptions, RenderedImage, StepReport, StepRequest,
    StructurePlan, WindowStatistics,
};
use crate::camera::{Camera, Similarity};
use crate::model::{AdamState, Model, SplatArrays, TexturePool};
use crate::{Error, Result};
use fearless_simd::{Level, dispatch};
use rayon::prelude::*;
use std::time::{Duration, Instant};

/// Renders and optimises on all cores, without driver or GPU.
pub struct CpuBackend {
    level: Level,
    pool: rayon::ThreadPool,
    model: Model,
    adam: AdamState,
    /// The settled model, until the next step.
    settled: Option<Model>,
    statistics: WindowStatistics,
    count_pairs: bool,
    frame: Frame,
    loss: LossBuffers,
    partials: Vec<f32>,
}

/// Gradients of one view for comparisons.
pub struct ModelGradients {
    /// By the splats' parameters.
    pub splats: SplatArrays,
    /// By the texels. `[num_texels, 3]`
    pub texels: Vec<f32>,
    /// The rendered picture.
    pub image: RenderedImage,
    /// Loss terms.
    pub loss: LossValues,
    /// Splats that touch a tile.
    pub visible: Vec<bool>,
    /// Window statistics of this view alone.
    pub statistics: WindowStatistics,
}

/// Which pixels a splat's tiles and row spans cover.
pub struct PairCoverage {
    /// Model index of the splat.
    pub splat: usize,
    /// `[height, width]`
    pub covered: Vec<bool>,
}

/// What the forward pass of a view leaves behind.
#[derive(Default)]
struct Frame {
    view: Option<ViewF32>,
    splats: Vec<ProjectedSplat>,
    tiles: Tiles,
    texels: Vec<f32>,
    outputs: Vec<TileOutput>,
}

/// Times of consecutive stages.
struct Stages {
    since: Instant,
    stages: Vec<(&'static str, Duration)>,
}

impl Stages {
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
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads.unwrap_or(0))
            .thread_name(|i| format!("cpu-backend-{i}"))
            .build()
            .map_err(|e| Error::Device(format!("cannot start threads: {e}")))?;
        let model = Model {
            splats: SplatArrays::zeros(0, 0),
            textures: TexturePool::default(),
            near: 0.01,
            capture_from_local: Similarity::IDENTITY,
        };
        Ok(Self {
            level: Level::new(),
            pool,
            adam: AdamState::zeros(&model),
            model,
            settled: None,
            statistics: WindowStatistics::default(),
            count_pairs: false,
            frame: Frame::default(),
            loss: LossBuffers::default(),
            partials: Vec::new(),
        })
    }

    /// Fills the pair counters of the reports (a few per cent slower).
    pub fn count_pairs(&mut self, on: bool) {
        self.count_pairs = on;
    }

    /// Gradients of one view without an update, for comparisons.
    ///
    /// # Errors
    /// As [`Backend::step`].
    pub fn gradients(&mut self, request: &StepRequest<'_>) -> Result<ModelGradients> {
        check_size(request)?;
        let mut stages = Stages::start();
        let Self { level, pool, model, frame, loss, partials, .. } = self;
        pool.install(|| {
            let view = ViewF32::new(&request.camera, model.near);
            frame.project(model, view);
            frame.colours(*level, model, request.sh_degree);
            frame.raster(*level, true, None);
            let image = frame.image(request.background, None);
            let terms = frame.loss(*level, loss, request);
            let values = with_regularisers(terms, model, frame, request);
            frame.backward(*level, loss, request, partials, true);
            let input = frame.update_input(model, request, partials, view);
            let sink = collect_gradients(model, &input);
            let n = model.num_splats();
            let mut visible = vec![false; n];
            frame.visible_ids().iter().for_each(|&id| visible[id as usize] = true);
            let mut statistics = empty_statistics(n);
            let (mut scratch_model, mut scratch_adam) = (model.clone(), AdamState::zeros(model));
            update(&mut scratch_model, &mut scratch_adam, Some(&mut statistics), &input);
            stages.end("all");
            Ok(ModelGradients {
                splats: sink.splats,
                texels: sink.texels,
                image,
                loss: values,
                visible,
                statistics,
            })
        })
    }

    /// The pixels that each visible splat is evaluated on, for the test of the bounds.
    pub fn coverage(&mut self, camera: &Camera) -> Vec<PairCoverage> {
        let view = ViewF32::new(camera, self.model.near);
        self.frame.project(&self.model, view);
        let size = view.size_px.map(|s| s as usize);
        let mut out: Vec<PairCoverage> = self
            .frame
            .splats
            .iter()
            .map(|s| PairCoverage { splat: s.id as usize, covered: vec![false; size[0] * size[1]] })
            .collect();
        for tile in 0..self.frame.tiles.len() {
            let origin = self.frame.tiles.origin_px(tile);
            for pair in self.frame.tiles.pairs_of(tile) {
                let splat = &self.frame.splats[pair.splat as usize];
                let (strip0, strip1) = super::shape::strips(splat, origin);
                for strip in strip0..strip1 {
                    let (col0, col1) = super::shape::strip_span(splat, origin, strip);
                    let rows = BLOCK_PX[1] * strip..BLOCK_PX[1] * (strip + 1);
                    let cols = BLOCK_PX[0] * col0..BLOCK_PX[0] * col1;
                    for (y, x) in rows.flat_map(|y| cols.clone().map(move |x| (y, x))) {
                        let (px, py) = (origin[0] as usize + x, origin[1] as usize + y);
                        if px < size[0] && py < size[1] {
                            out[pair.splat as usize].covered[py * size[0] + px] = true;
                        }
                    }
                }
            }
        }
        out
    }

    /// Takes the settled model; put it back where it is still valid.
    fn take_settled(&mut self) -> Model {
        self.settled.take().unwrap_or_else(|| {
            let (mut model, mut adam) = (self.model.clone(), self.adam.clone());
            self.pool.install(|| settle(&mut model, &mut adam, None, self.adam.step));
            model
        })
    }
}

fn check_size(request: &StepRequest<'_>) -> Result<()> {
    let (p, t) = (&request.camera.pinhole, request.target);
    if (p.width_px, p.height_px) == (t.width_px, t.height_px) && t.rgb.len() == 3 * p.num_pixels() {
        return Ok(());
    }
    Err(Error::Usage(format!(
        "camera is {}x{} px but its photo {}x{} px with {} values",
        p.width_px,
        p.height_px,
        t.width_px,
        t.height_px,
        t.rgb.len()
    )))
}

fn empty_statistics(n: usize) -> WindowStatistics {
    WindowStatistics {
        views: 0,
        seen: vec![0; n],
        area: vec![0.0; n],
        contribution: vec![0.0; n],
        error: vec![0.0; n],
    }
}

impl Frame {
    /// Geometry of the splats in sight, and their tiles.
    fn project(&mut self, model: &Model, view: ViewF32) {
        self.view = Some(view);
        self.splats = project_all(model, &view);
        self.tiles = build_tiles(&self.splats, view.size_px, HEADER_FLOATS);
    }

    /// Model indices of the splats that touch a tile, ascending.
    fn visible_ids(&self) -> Vec<u32> {
        let slots = self.tiles.slot_start.windows(2);
        slots.zip(&self.splats).filter(|(w, _)| w[0] < w[1]).map(|(_, s)| s.id).collect()
    }

    /// Base colours and activated texels.
    fn colours(&mut self, level: Level, model: &Model, sh_degree: u32) {
        let Some(view) = self.view else { return };
        base_colours(model, &view, sh_degree, &mut self.splats);
        let mut floats = 0;
        let slots = &self.tiles.slot_start;
        for (i, splat) in self.splats.iter_mut().enumerate() {
            splat.map.first = floats;
            if slots[i] < slots[i + 1] {
                floats += (3 * splat.map.rows * splat.map.cols) as u32;
            }
        }
        self.texels.resize(floats as usize, 0.0);
        let mut rest = self.texels.as_mut_slice();
        let mut jobs = Vec::new();
        for (first, splats) in self.splats.chunks(256).enumerate().map(|(c, s)| (c * 256, s)) {
            let len = splats
                .iter()
                .enumerate()
                .filter(|(i, _)| slots[first + i] < slots[first + i + 1])
                .map(|(_, s)| (3 * s.map.rows * s.map.cols) as usize)
                .sum();
            let (head, tail) = rest.split_at_mut(len);
            rest = tail;
            jobs.push((first, splats, head));
        }
        jobs.into_par_iter().for_each(|(first, splats, mut out)| {
            for (i, splat) in splats.iter().enumerate() {
                if slots[first + i] < slots[first + i + 1] {
                    let stored = &model.textures.texels[model.textures.maps[splat.id as usize].floats()];
                    let (head, tail) = out.split_at_mut(stored.len());
                    dispatch!(level, simd => texel_values(simd, stored, head));
                    out = tail;
                }
            }
        });
    }

    fn tile_input(&self, tile: usize, view: &ViewF32) -> TileInput<'_> {
        TileInput {
            splats: &self.splats,
            texels: &self.texels,
            pairs: self.tiles.pairs_of(tile),
            origin_px: self.tiles.origin_px(tile),
            size_px: view.size_px,
            near: view.near,
        }
    }

    /// Forward pass over all tiles.
    fn raster(&mut self, level: Level, count: bool, geometry: Option<&mut Vec<TileGeometry>>) {
        let Some(view) = self.view else { return };
        let mut outputs = std::mem::take(&mut self.outputs);
        outputs.resize_with(self.tiles.len(), TileOutput::default);
        let frame = &*self;
        match geometry {
            Some(geometry) => {
                geometry.resize_with(frame.tiles.len(), TileGeometry::default);
                outputs.par_iter_mut().zip(geometry).enumerate().for_each(|(tile, (out, geometry))| {
                    let input = frame.tile_input(tile, &view);
                    dispatch!(level, simd => raster_fwd::<_, false>(simd, &input, out, Some(geometry)));
                });
            }
            None => outputs.par_iter_mut().enumerate().for_each(|(tile, out)| {
                let input = frame.tile_input(tile, &view);
                if count {
                    dispatch!(level, simd => raster_fwd::<_, true>(simd, &input, out, None));
                } else {
                    dispatch!(level, simd => raster_fwd::<_, false>(simd, &input, out, None));
                }
            }),
        }
        self.outputs = outputs;
    }

    /// Calls `f(tile, element, pixel)` for the pixels of a picture row.
    fn for_row(&self, y: usize, width: usize, mut f: impl FnMut(&TileOutput, usize, usize, usize)) {
        let row = y / TILE_PX * self.tiles.grid[0];
        for x in 0..width {
            let tile = row + x / TILE_PX;
            f(&self.outputs[tile], tile, element_of(x % TILE_PX, y % TILE_PX), x);
        }
    }

    /// The picture over a background.
    fn image(&self, background: [f32; 3], geometry: Option<&[TileGeometry]>) -> RenderedImage {
        let [width, height] = self.view.map_or([0, 0], |v| v.size_px);
        let (w, n) = (width as usize, (width * height) as usize);
        let mut image = RenderedImage {
            width_px: width,
            height_px: height,
            rgb: vec![0.0; 3 * n],
            alpha: vec![0.0; n],
            depth: vec![0.0; if geometry.is_some() { n } else { 0 }],
            normal: vec![0.0; if geometry.is_some() { 3 * n } else { 0 }],
        };
        for y in 0..height as usize {
            self.for_row(y, w, |out, tile, at, x| {
                let pixel = y * w + x;
                let t = out.transmittance[at];
                (0..3).for_each(|c| image.rgb[3 * pixel + c] = out.rgb[c][at] + t * background[c]);
                image.alpha[pixel] = 1.0 - t;
                if let Some(geometry) = geometry {
                    let g = &geometry[tile];
                    let normal = [0, 1, 2].map(|c| g.normal[c][at]);
                    let length = super::math::dot(normal, normal).sqrt();
                    if t < 1.0 {
                        image.depth[pixel] = g.depth[at] / (1.0 - t);
                    }
                    if length > 0.0 {
                        (0..3).for_each(|c| image.normal[3 * pixel + c] = normal[c] / length);
                    }
                }
            });
        }
        image
    }

    /// Loss terms l1, dssim, mse; leaves the picture's gradient in the buffers.
    fn loss(&self, level: Level, buffers: &mut LossBuffers, request: &StepRequest<'_>) -> [f64; 3] {
        let p = &request.camera.pinhole;
        let w = p.width_px as usize;
        buffers.resize(p.num_pixels());
        let [r, g, b] = &mut buffers.picture;
        let rows = (r.par_chunks_mut(w), g.par_chunks_mut(w), b.par_chunks_mut(w)).into_par_iter();
        rows.enumerate().for_each(|(y, (r, g, b))| {
            self.for_row(y, w, |out, _, at, x| {
                let t = out.transmittance[at];
                r[x] = out.rgb[0][at] + t * request.background[0];
                g[x] = out.rgb[1][at] + t * request.background[1];
                b[x] = out.rgb[2][at] + t * request.background[2];
            });
        });
        image_loss(level, buffers, request.target, &request.loss)
    }

    /// Backward pass over all tiles into the partial sums.
    fn backward(
        &self,
        level: Level,
        buffers: &LossBuffers,
        request: &StepRequest<'_>,
        partials: &mut Vec<f32>,
        statistics: bool,
    ) {
        let Some(view) = self.view else { return };
        partials.resize(self.tiles.partial_floats, 0.0);
        let mut rest = partials.as_mut_slice();
        let mut jobs = Vec::with_capacity(self.tiles.len());
        let mut base = 0;
        for tile in 0..self.tiles.len() {
            let next = self.tiles.tile_start[tile + 1] as usize;
            let end = self.tiles.pairs.get(next).map_or(self.tiles.partial_floats, |p| p.partial as usize);
            let (head, tail) = rest.split_at_mut(end - base);
            jobs.push((tile, base, head));
            rest = tail;
            base = end;
        }
        jobs.into_par_iter().for_each_init(Vec::new, |lanes, (tile, base, partials)| {
            let input = self.tile_input(tile, &view);
            if input.pairs.is_empty() {
                return;
            }
            let gradient = self.tile_gradient(tile, buffers);
            let (out, background) = (&self.outputs[tile], request.background);
            if statistics {
                dispatch!(level, simd => raster_bwd::<_, true>(simd, &input, out, &gradient, background, base, partials, lanes));
            } else {
                dispatch!(level, simd => raster_bwd::<_, false>(simd, &input, out, &gradient, background, base, partials, lanes));
            }
        });
    }

    fn tile_gradient(&self, tile: usize, buffers: &LossBuffers) -> TileGradient {
        let [width, height] = self.view.map_or([0, 0], |v| v.size_px.map(|s| s as usize));
        let origin = self.tiles.origin_px(tile).map(|o| o as usize);
        let mut out = TileGradient { rgb: [[0.0; TILE_PIXELS]; 3], loss: [0.0; TILE_PIXELS] };
        for y in origin[1]..height.min(origin[1] + TILE_PX) {
            for x in origin[0]..width.min(origin[0] + TILE_PX) {
                let (at, pixel) = (element_of(x - origin[0], y - origin[1]), y * width + x);
                (0..3).for_each(|c| out.rgb[c][at] = buffers.picture[c][pixel]);
                out.loss[at] = buffers.map[pixel];
            }
        }
        out
    }

    fn update_input<'a>(
        &'a self,
        model: &Model,
        request: &StepRequest<'_>,
        partials: &'a [f32],
        view: ViewF32,
    ) -> UpdateInput<'a> {
        UpdateInput {
            splats: &self.splats,
            tiles: &self.tiles,
            partials,
            texel_values: &self.texels,
            view,
            sh_degree: request.sh_degree,
            step: request.step,
            rates: request.rates,
            opacity_weight: request.loss.opacity / model.num_splats().max(1) as f32,
            texture_weight: request.loss.texture,
            num_pixels: request.camera.pinhole.num_pixels() as f32,
        }
    }

    fn counters(&self) -> RasterCounters {
        let mut sum = RasterCounters {
            pixels: self.view.map_or(0, |v| u64::from(v.size_px[0]) * u64::from(v.size_px[1])),
            visible_splats: self.tiles.slot_start.windows(2).filter(|w| w[0] < w[1]).count() as u64,
            tile_pairs: self.tiles.pairs.len() as u64,
            ..RasterCounters::default()
        };
        for out in &self.outputs {
            sum.evaluated_pairs += out.counters.evaluated_pairs;
            sum.inside_pairs += out.counters.inside_pairs;
            sum.blended_pairs += out.counters.blended_pairs;
        }
        sum
    }
}

/// Adds the opacity and texture terms of the visible splats (method section 3).
fn with_regularisers(terms: [f64; 3], model: &Model, frame: &Frame, request: &StepRequest<'_>) -> LossValues {
    let visible = frame.tiles.slot_start.windows(2).zip(&frame.splats).filter(|(w, _)| w[0] < w[1]);
    let opacity: f64 = visible.map(|(_, s)| f64::from(s.opacity)).sum();
    let residual: f64 = frame
        .texels
        .par_chunks(1 << 14)
        .map(|c| c.iter().map(|v| f64::from(v.abs())).sum::<f64>())
        .collect::<Vec<_>>()
        .iter()
        .sum();
    let mut values = LossValues {
        total: 0.0,
        l1: terms[0],
        dssim: terms[1],
        mse: terms[2],
        opacity: f64::from(request.loss.opacity) * opacity / model.num_splats().max(1) as f64,
        texture: f64::from(request.loss.texture) * residual,
    };
    values.total = values.l1 + values.dssim + values.mse + values.opacity + values.texture;
    values
}

impl Backend for CpuBackend {
    fn device(&self) -> DeviceInfo {
        let level = format!("{:?}", self.level);
        let level = level.split('(').next().unwrap_or_default().to_lowercase();
        DeviceInfo {
            name: "cpu".into(),
            description: format!("{level}, {} threads", self.pool.current_num_threads()),
        }
    }

    fn upload(&mut self, model: &Model, adam: &AdamState) -> Result<()> {
        self.model = model.clone();
        self.adam = adam.clone();
        self.settled = None;
        self.statistics = empty_statistics(model.num_splats());
        Ok(())
    }

    fn render(&mut self, camera: &Camera, options: &RenderOptions) -> Result<RenderedImage> {
        let model = self.take_settled();
        let Self { level, pool, frame, .. } = self;
        let image = pool.install(|| {
            frame.project(&model, ViewF32::new(camera, model.near));
            frame.colours(*level, &model, options.sh_degree.min(model.splats.sh_degree));
            let mut geometry = options.geometry.then(Vec::new);
            frame.raster(*level, false, geometry.as_mut());
            frame.image(options.background, geometry.as_deref())
        });
        self.settled = Some(model);
        Ok(image)
    }

    fn step(&mut self, request: &StepRequest<'_>) -> Result<StepReport> {
        check_size(request)?;
        self.settled = None;
        let Self { level, pool, model, adam, frame, loss, partials, statistics, count_pairs, .. } = self;
        let level = *level;
        pool.install(|| {
            let mut stages = Stages::start();
            let view = ViewF32::new(&request.camera, model.near);
            frame.project(model, view);
            stages.end("project+bin");
            adam.rates = request.rates;
            settle(model, adam, Some(&frame.visible_ids()), request.step - 1);
            frame.colours(level, model, request.sh_degree);
            stages.end("settle+colours");
            frame.raster(level, *count_pairs, None);
            stages.end("forward");
            let terms = frame.loss(level, loss, request);
            let values = with_regularisers(terms, model, frame, request);
            stages.end("loss");
            frame.backward(level, loss, request, partials, request.accumulate_statistics);
            stages.end("backward");
            let input = frame.update_input(model, request, partials, view);
            let window = request.accumulate_statistics.then(|| {
                statistics.views += 1;
                &mut *statistics
            });
            let non_finite_gradients = update(model, adam, window, &input);
            stages.end("reduce+update");
            Ok(StepReport {
                loss: values,
                counters: frame.counters(),
                non_finite_gradients,
                stages: stages.stages,
            })
        })
    }

    fn read_statistics(&mut self) -> Result<WindowStatistics> {
        let empty = empty_statistics(self.model.num_splats());
        Ok(std::mem::replace(&mut self.statistics, empty))
    }

    fn apply_plan(&mut self, plan: &StructurePlan) -> Result<()> {
        plan.check(self.model.num_splats())?;
        (self.model, self.adam) = self.pool.install(|| structure::apply_plan(&self.model, &self.adam, plan));
        self.settled = None;
        self.statistics = empty_statistics(self.model.num_splats());
        Ok(())
    }

    fn read_back(&mut self) -> Result<(Model, AdamState)> {
        Ok((self.model.clone(), self.adam.clone()))
    }

    fn read_settled(&mut self) -> Result<Model> {
        let model = self.take_settled();
        self.settled = Some(model.clone());
        Ok(model)
    }
}
