//! Runs the passes over a view: projection, tiles, forward, loss, backward. Each pass is in its own file; this module
//! passes data between them and distributes the work over threads.

use super::exposure::{exposure_bwd, exposure_fwd};
use super::geometry::{Coefficients, PixelSums, geometry_loss};
use super::loss::{LossBuffers, image_loss};
use super::math::{LANES, texel_values};
use super::project::{ProjectedSplat, base_colours, project_all};
use super::raster_bwd::{ReplayBlock, TileGradient, raster_bwd};
use super::raster_fwd::{OutputBlock, TileGeometry, TileInput, TileOutput, raster_fwd};
use super::simd::dispatch;
use super::sums::HEADER_FLOATS;
use super::tile::{BLOCKS, CPU_TILE_PX, place_of};
use super::tiles::{Tiles, build_tiles};
use super::update::UpdateInput;
use super::view::ViewF32;
use crate::backend::{ColourSums, LossValues, RasterCounters, RenderedImage, StepRequest};
use crate::model::Model;
use fearless_simd::Level;
use rayon::prelude::*;

/// Intermediate results of the passes over one view.
#[derive(Default)]
pub(super) struct ViewPipeline {
    view: Option<ViewF32>,
    pub splats: Vec<ProjectedSplat>,
    pub tiles: Tiles,
    texels: Vec<f32>,
    outputs: Vec<TileOutput>,
    /// Depths and normals, if the loss needs them.
    geometry: Vec<TileGeometry>,
    /// Coefficients of the distortion and normal terms; empty if both are off. `[height, width]`
    coefficients: Vec<Coefficients>,
}

impl ViewPipeline {
    /// Projects the splats and lists those of each tile.
    pub(super) fn project(&mut self, level: Level, model: &Model, view: ViewF32) {
        self.view = Some(view);
        self.splats = project_all(model, &view);
        self.tiles = build_tiles(level, &self.splats, view.size_px, HEADER_FLOATS);
    }

    /// Model indices of the visible splats, ascending.
    pub(super) fn visible_ids(&self) -> Vec<u32> {
        let slots = self.tiles.slot_start.windows(2);
        slots.zip(&self.splats).filter(|(w, _)| w[0] < w[1]).map(|(_, s)| s.id).collect()
    }

    /// Computes base colours and activated texels of the visible splats.
    pub(super) fn colours(&mut self, level: Level, model: &Model, sh_degree: u32) {
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

    /// Takes the maps off the projected splats, where colours do not matter.
    pub(super) fn without_maps(&mut self) {
        self.splats.iter_mut().for_each(|splat| (splat.map.rows, splat.map.cols) = (0, 0));
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
    pub(super) fn raster(&mut self, level: Level, count: bool, geometry: Option<&mut Vec<TileGeometry>>) {
        let Some(view) = self.view else { return };
        let mut outputs = std::mem::take(&mut self.outputs);
        outputs.resize_with(self.tiles.len(), TileOutput::default);
        let pipeline = &*self;
        match geometry {
            Some(geometry) => {
                geometry.resize_with(pipeline.tiles.len(), TileGeometry::default);
                outputs.par_iter_mut().zip(geometry).enumerate().for_each(|(tile, (out, geometry))| {
                    let input = pipeline.tile_input(tile, &view);
                    dispatch!(level, simd => raster_fwd::<_, false>(simd, &input, out, Some(geometry)));
                });
            }
            None => outputs.par_iter_mut().enumerate().for_each(|(tile, out)| {
                let input = pipeline.tile_input(tile, &view);
                if count {
                    dispatch!(level, simd => raster_fwd::<_, true>(simd, &input, out, None));
                } else {
                    dispatch!(level, simd => raster_fwd::<_, false>(simd, &input, out, None));
                }
            }),
        }
        self.outputs = outputs;
    }

    /// Calls `f(output of the block, [tile, block, lane], x)` for each pixel of an image row.
    fn for_row(&self, y: usize, width: usize, mut f: impl FnMut(&OutputBlock, [usize; 3], usize)) {
        let row = y / CPU_TILE_PX * self.tiles.grid[0];
        for x in 0..width {
            let tile = row + x / CPU_TILE_PX;
            let (block, lane) = place_of(x % CPU_TILE_PX, y % CPU_TILE_PX);
            f(&self.outputs[tile].blocks[block], [tile, block, lane], x);
        }
    }

    /// The image over a background, with depths and normals if given.
    pub(super) fn image(&self, background: [f32; 3], geometry: Option<&[TileGeometry]>) -> RenderedImage {
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
            self.for_row(y, w, |out, [tile, block, lane], x| {
                let pixel = y * w + x;
                let t = out.transmittance(lane);
                (0..3).for_each(|c| image.rgb[3 * pixel + c] = out.rgb[c][lane] + t * background[c]);
                image.alpha[pixel] = 1.0 - t;
                if let Some(geometry) = geometry {
                    let g = &geometry[tile];
                    let normal = [0, 1, 2].map(|c| g.normal[c][block][lane]);
                    let length = super::math::dot(normal, normal).sqrt();
                    if t < 1.0 {
                        image.depth[pixel] = g.depth[block][lane] / (1.0 - t);
                    }
                    if length > 0.0 {
                        (0..3).for_each(|c| image.normal[3 * pixel + c] = normal[c] / length);
                    }
                }
            });
        }
        image
    }

    /// Loss terms l1, dssim and mse, and with an exposure the sums to estimate it; writes the gradient with respect to the
    /// image to `buffers`.
    pub(super) fn loss(
        &self,
        level: Level,
        buffers: &mut LossBuffers,
        request: &StepRequest<'_>,
    ) -> ([f64; 3], Option<ColourSums>) {
        let p = &request.camera.pinhole;
        let w = p.width_px as usize;
        buffers.resize(p.num_pixels());
        let [r, g, b] = &mut buffers.image;
        let rows = (r.par_chunks_mut(w), g.par_chunks_mut(w), b.par_chunks_mut(w)).into_par_iter();
        rows.enumerate().for_each(|(y, (r, g, b))| {
            self.for_row(y, w, |out, [_, _, lane], x| {
                let t = out.transmittance(lane);
                r[x] = out.rgb[0][lane] + t * request.background[0];
                g[x] = out.rgb[1][lane] + t * request.background[1];
                b[x] = out.rgb[2][lane] + t * request.background[2];
            });
        });
        let target = request.target;
        let sums =
            request.exposure.map(|map| exposure_fwd(&mut buffers.image, (target, request.background), &map));
        let terms = image_loss(level, buffers, (target, request.background), &request.loss);
        if let Some(map) = &request.exposure {
            exposure_bwd(&mut buffers.image, target.width_px, map);
        }
        (terms, sums)
    }

    /// Forward pass of a training step, with depths and normals if the loss needs them.
    pub(super) fn raster_for(&mut self, level: Level, count: bool, request: &StepRequest<'_>) {
        let mut geometry = std::mem::take(&mut self.geometry);
        geometry.clear();
        let needed = request.loss.needs_geometry();
        self.raster(level, count, needed.then_some(&mut geometry));
        self.geometry = geometry;
    }

    /// Distortion and normal terms; keeps their coefficients for the backward pass.
    pub(super) fn geometry_loss(&mut self, request: &StepRequest<'_>) -> (f64, f64) {
        if !request.loss.needs_geometry() {
            self.coefficients.clear();
            return (0.0, 0.0);
        }
        let image = self.image(request.background, Some(&self.geometry));
        let w = image.width_px as usize;
        let mut sums: Vec<PixelSums> = vec![[0.0; 5]; image.alpha.len()];
        for (y, row) in sums.chunks_mut(w).enumerate() {
            self.for_row(y, w, |_, [tile, block, lane], x| {
                let TileGeometry { moments: [m1, m2], normal: [n_x, n_y, n_z], .. } = &self.geometry[tile];
                row[x] = [m1, m2, n_x, n_y, n_z].map(|plane| plane[block][lane]);
            });
        }
        let pinhole = &request.camera.pinhole;
        let (distortion, normal, coefficients) =
            geometry_loss(&image, &sums, pinhole, request.target, &request.loss);
        self.coefficients = coefficients;
        (distortion, normal)
    }

    /// Backward pass over all tiles; writes the pairs' partial sums.
    pub(super) fn backward(
        &self,
        level: Level,
        buffers: &LossBuffers,
        request: &StepRequest<'_>,
        partials: &mut Vec<f32>,
    ) {
        let Some(view) = self.view else { return };
        partials.resize(self.tiles.partial_floats, 0.0);
        let mut rest = partials.as_mut_slice();
        let mut jobs = Vec::with_capacity(self.tiles.len());
        let mut base = 0;
        for tile in 0..self.tiles.len() {
            let next = self.tiles.tile_start[tile + 1] as usize;
            let end = self.tiles.pairs.get(next).map_or(self.tiles.partial_floats, |p| p.partial);
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
            let mut gradient = self.tile_gradient(tile, buffers);
            let (out, background) = (&self.outputs[tile], request.background);
            if request.accumulate_statistics {
                dispatch!(level, simd => raster_bwd::<_, true>(simd, &input, out, &mut gradient, background, base, partials, lanes));
            } else {
                dispatch!(level, simd => raster_bwd::<_, false>(simd, &input, out, &mut gradient, background, base, partials, lanes));
            }
        });
    }

    fn tile_gradient(&self, tile: usize, buffers: &LossBuffers) -> TileGradient {
        let [width, height] = self.view.map_or([0, 0], |v| v.size_px.map(|s| s as usize));
        let origin = self.tiles.origin_px(tile).map(|o| o as usize);
        let mut out = TileGradient { blocks: [ReplayBlock::ZERO; BLOCKS], geometry: None };
        let mut planes = (!self.coefficients.is_empty()).then(|| Box::new([[[0.0; LANES]; BLOCKS]; 6]));
        for y in origin[1]..height.min(origin[1] + CPU_TILE_PX) {
            for x in origin[0]..width.min(origin[0] + CPU_TILE_PX) {
                let ((block, lane), pixel) = (place_of(x - origin[0], y - origin[1]), y * width + x);
                (0..3).for_each(|c| out.blocks[block].rgb[c][lane] = buffers.image[c][pixel]);
                out.blocks[block].loss[lane] = buffers.map[pixel];
                if let Some(planes) = &mut planes {
                    (0..6).for_each(|k| planes[k][block][lane] = self.coefficients[pixel][k]);
                }
            }
        }
        out.geometry = planes;
        out
    }

    pub(super) fn update_input<'a>(
        &'a self,
        level: Level,
        model: &Model,
        request: &StepRequest<'_>,
        partials: &'a [f32],
        view: ViewF32,
    ) -> UpdateInput<'a> {
        UpdateInput {
            level,
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

    pub(super) fn counters(&self) -> RasterCounters {
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
pub(super) fn with_regularisers(
    terms: [f64; 3],
    model: &Model,
    pipeline: &ViewPipeline,
    request: &StepRequest<'_>,
) -> LossValues {
    let visible = pipeline.tiles.slot_start.windows(2).zip(&pipeline.splats).filter(|(w, _)| w[0] < w[1]);
    let opacity: f64 = visible.map(|(_, s)| f64::from(s.stored_opacity)).sum();
    let residual: f64 = pipeline
        .texels
        .par_chunks(1 << 14)
        .map(|c| c.iter().map(|v| f64::from(v.abs())).sum::<f64>())
        .collect::<Vec<_>>()
        .iter()
        .sum();
    LossValues {
        total: 0.0,
        l1: terms[0],
        dssim: terms[1],
        mse: terms[2],
        opacity: f64::from(request.loss.opacity) * opacity / model.num_splats().max(1) as f64,
        texture: f64::from(request.loss.texture) * residual,
        distortion: 0.0,
        normal: 0.0,
    }
}
