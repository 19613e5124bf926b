//! Updates the splats once per step: sums the pairs of each splat, applies the chain rule back to its
//! parameters, adds regularisers, zeroes non-finite gradients, and takes an Adam step. Splats are processed in
//! parallel chunks, each with exclusive slices of every array.

use super::adam::{AdamSkip, AdamStep};
use super::project::ProjectedSplat;
use super::project_bwd::{SplatGradient, project_bwd};
use super::simd::dispatch;
use super::sums::{HEADER_FLOATS, Sum};
use super::tiles::{Pair, Tiles};
use super::view::ViewF32;
use crate::backend::{LearningRates, WindowStatistics};
use crate::constants::LOG_SCALE_RANGE;
use crate::model::{AdamState, Model, SplatArrays, SplatGroup, TextureMap, texel_value_slope};
use fearless_simd::{Level, Simd};
use rayon::prelude::*;
use std::ops::Range;

/// Splats per chunk.
const CHUNK: usize = 256;

/// Parameters, first and second moments.
type WithMoments<'a> = [&'a mut [f32]; 3];

/// A chunk of splats with exclusive access to its part of model, moments and statistics.
struct SplatChunk<'a> {
    first: usize,
    groups: [WithMoments<'a>; 5],
    texels: WithMoments<'a>,
    last_step: &'a mut [u32],
    statistics: Option<[&'a mut [f32]; 3]>,
    seen: Option<&'a mut [u32]>,
}

/// Splits everything into chunks of splats.
fn split_chunks<'a>(
    groups: [[&'a mut Vec<f32>; 3]; 5],
    texels: [&'a mut Vec<f32>; 3],
    last_step: &'a mut Vec<u32>,
    statistics: Option<&'a mut WindowStatistics>,
    maps: &[TextureMap],
    sh_offsets: &[u32],
) -> Vec<SplatChunk<'a>> {
    let n = last_step.len();
    let mut groups = groups.map(|g| g.map(|v| v.as_mut_slice()));
    let mut texels = texels.map(|v| v.as_mut_slice());
    let mut last_step = last_step.as_mut_slice();
    let (mut sums, mut seen) = match statistics {
        Some(s) => {
            let arrays = [&mut s.area, &mut s.contribution, &mut s.error].map(|v| v.as_mut_slice());
            (Some(arrays), Some(s.seen.as_mut_slice()))
        }
        None => (None, None),
    };
    let mut out = Vec::new();
    for first in (0..n).step_by(CHUNK) {
        let len = CHUNK.min(n - first);
        let texel_floats: usize = maps[first..first + len].iter().map(|m| 3 * m.num_texels()).sum();
        let mut taken = Vec::new();
        for (group, arrays) in SplatGroup::ALL.into_iter().zip(&mut groups) {
            let floats = match group {
                SplatGroup::Sh => (sh_offsets[first + len] - sh_offsets[first]) as usize,
                _ => len * group.width(0),
            };
            taken.push(take(arrays, floats));
        }
        let Ok(taken) = taken.try_into() else { unreachable!("five groups") };
        let (head, tail) = std::mem::take(&mut last_step).split_at_mut(len);
        last_step = tail;
        out.push(SplatChunk {
            first,
            groups: taken,
            texels: take(&mut texels, texel_floats),
            last_step: head,
            statistics: sums.as_mut().map(|s| take(s, len)),
            seen: seen.as_mut().map(|s| {
                let (head, tail) = std::mem::take(s).split_at_mut(len);
                *s = tail;
                head
            }),
        });
    }
    out
}

/// Splits off the first `len` elements of three slices.
fn take<'a>(slices: &mut [&'a mut [f32]; 3], len: usize) -> [&'a mut [f32]; 3] {
    let [a, b, c] = slices;
    [a, b, c].map(|slice| {
        let (head, tail) = std::mem::take(slice).split_at_mut(len);
        *slice = tail;
        head
    })
}

/// The arrays of each group, and the offsets of SH.
fn triples<'a>(
    p: &'a mut SplatArrays,
    m: &'a mut SplatArrays,
    v: &'a mut SplatArrays,
) -> ([[&'a mut Vec<f32>; 3]; 5], &'a [u32]) {
    let (p, offsets) = p.groups_mut();
    let ((m, _), (v, _)) = (m.groups_mut(), v.groups_mut());
    let [p0, p1, p2, p3, p4] = p;
    let [m0, m1, m2, m3, m4] = m;
    let [v0, v1, v2, v3, v4] = v;
    ([[p0, m0, v0], [p1, m1, v1], [p2, m2, v2], [p3, m3, v3], [p4, m4, v4]], offsets)
}

/// Where the floats of splat `i` of a chunk are in its part of an array with these offsets.
fn within(offsets: &[u32], first: usize, i: usize) -> Range<usize> {
    let [base, start, end] = [first, first + i, first + i + 1].map(|splat| offsets[splat] as usize);
    start - base..end - base
}

/// Flushes SH and texels of the given splats (ascending ids), or of all splats, up to step `now`.
pub(super) fn flush(model: &mut Model, adam: &mut AdamState, only: Option<&[u32]>, now: u32) {
    let rates = adam.rates;
    let Model { splats, textures, .. } = model;
    let (groups, sh_offsets) = triples(splats, &mut adam.splats_m, &mut adam.splats_v);
    let texels = [&mut textures.texels, &mut adam.texels_m, &mut adam.texels_v];
    let chunks = split_chunks(groups, texels, &mut adam.last_step, None, &textures.maps, sh_offsets);
    let maps = &textures.maps;
    chunks.into_par_iter().for_each(|mut chunk| {
        let base = 3 * maps[chunk.first].offset_texels as usize;
        let len = chunk.last_step.len();
        let mut flush_one = |i: usize| {
            if let Some(skip) = AdamSkip::new(chunk.last_step[i], now) {
                let [p, m, v] = &mut chunk.groups[4];
                let sh = within(sh_offsets, chunk.first, i);
                let (dc, rest) = (sh.start..sh.start + 3, sh.start + 3..sh.end);
                skip.update(&mut p[dc.clone()], &mut m[dc.clone()], &mut v[dc], rates.sh_dc);
                skip.update(&mut p[rest.clone()], &mut m[rest.clone()], &mut v[rest], rates.sh_rest);
                let map = &maps[chunk.first + i];
                let range = map.floats().start - base..map.floats().end - base;
                let [p, m, v] = &mut chunk.texels;
                let rate = rates.of_map(map.num_texels());
                skip.update(&mut p[range.clone()], &mut m[range.clone()], &mut v[range], rate);
            }
            if chunk.last_step[i] != 0 {
                chunk.last_step[i] = chunk.last_step[i].max(now);
            }
        };
        match only {
            Some(ids) => {
                ids_within(ids, chunk.first, len).for_each(|id| flush_one(id as usize - chunk.first))
            }
            None => (0..len).for_each(flush_one),
        }
    });
}

fn ids_within(ids: &[u32], first: usize, len: usize) -> impl Iterator<Item = u32> + '_ {
    let start = ids.partition_point(|&id| (id as usize) < first);
    ids[start..].iter().copied().take_while(move |&id| (id as usize) < first + len)
}

/// Input of the update.
pub(super) struct UpdateInput<'a> {
    pub level: Level,
    pub splats: &'a [ProjectedSplat],
    pub tiles: &'a Tiles,
    pub partials: &'a [f32],
    /// Activated texels of the view.
    pub texel_values: &'a [f32],
    pub view: ViewF32,
    pub sh_degree: u32,
    pub step: u32,
    pub rates: LearningRates,
    /// Weight of the opacity term divided by the number of splats.
    pub opacity_weight: f32,
    pub texture_weight: f32,
    pub num_pixels: f32,
}

/// Pairs of a projected splat to which any pixel contributed, with their partial sums, in the order of tiles.
#[inline(always)]
fn touched_records<'a>(
    input: &'a UpdateInput<'_>,
    index: usize,
) -> impl Iterator<Item = (&'a Pair, &'a [f32])> {
    let slots = input.tiles.slot_start[index] as usize..input.tiles.slot_start[index + 1] as usize;
    input.tiles.slot_pair[slots].iter().filter_map(move |&pair| {
        let pair = &input.tiles.pairs[pair as usize];
        let record = &input.partials[pair.partial..];
        (record[Sum::Touched as usize] != 0.0).then_some((pair, record))
    })
}

/// Gradient, statistics and number of non-finite gradients of a visible splat; its texel gradients replace the
/// contents of `texels`.
#[inline(always)]
fn splat_gradient(
    model: &Model,
    input: &UpdateInput<'_>,
    index: usize,
    texels: &mut Vec<f32>,
) -> (SplatGradient, [f32; 3], u32) {
    let splat = &input.splats[index];
    let map = &splat.map;
    texels.clear();
    texels.resize(3 * (map.rows * map.cols) as usize, 0.0);
    let mut sums = [0.0; HEADER_FLOATS];
    for (pair, record) in touched_records(input, index) {
        for (sum, part) in sums.iter_mut().zip(record) {
            *sum += part;
        }
        let w = &pair.window;
        let width = 3 * w.cols as usize;
        if width == 0 {
            continue;
        }
        let window = &record[HEADER_FLOATS..HEADER_FLOATS + 3 * w.len()];
        for (row, part) in (w.row0..).zip(window.chunks_exact(width)) {
            let first = 3 * (row * map.cols + w.col0) as usize;
            texels[first..first + width].iter_mut().zip(part).for_each(|(t, p)| *t += p);
        }
    }
    let mut gradient = project_bwd(model, splat, &sums, &input.view, input.sh_degree);
    gradient.opacity += input.opacity_weight * splat.stored_opacity * (1.0 - splat.stored_opacity);
    let values = &input.texel_values[map.first as usize..][..texels.len()];
    for (g, v) in texels.iter_mut().zip(values) {
        let sign = if *v == 0.0 { 0.0 } else { v.signum() };
        *g = (*g + input.texture_weight * sign) * texel_value_slope(f64::from(*v)) as f32;
    }
    let non_finite = guard(&mut gradient, texels);
    let statistics = [Sum::Pixels, Sum::Weight, Sum::Error].map(|s| sums[s as usize] / input.num_pixels);
    (gradient, statistics, non_finite)
}

/// Sets non-finite gradients to zero and returns their number.
fn guard(gradient: &mut SplatGradient, texels: &mut [f32]) -> u32 {
    // Zero times any finite number is zero: a single sum shows whether all gradients are finite.
    let fixed = gradient.position.iter().chain(&gradient.quaternion).chain(&gradient.log_scale);
    let probe: f32 = fixed.chain(&gradient.sh).chain(texels.iter()).map(|g| g * 0.0).sum();
    if probe + gradient.opacity * 0.0 == 0.0 {
        return 0;
    }
    let mut count = 0;
    let SplatGradient { position, quaternion, log_scale, opacity, sh, .. } = gradient;
    let fixed = position.iter_mut().chain(quaternion).chain(log_scale).chain(sh);
    for g in fixed.chain(std::iter::once(opacity)).chain(texels) {
        if !g.is_finite() {
            *g = 0.0;
            count += 1;
        }
    }
    count
}

/// Takes one step of Adam on position, rotation, scales and opacity of all splats, and on SH and texels of
/// visible ones. Returns the number of non-finite gradients.
pub(super) fn update(
    model: &mut Model,
    adam: &mut AdamState,
    statistics: Option<&mut WindowStatistics>,
    input: &UpdateInput<'_>,
) -> u64 {
    let gradients = gather_gradients(model, input);
    (adam.step, adam.rates) = (input.step, input.rates);
    let Model { splats, textures, .. } = model;
    let (groups, sh_offsets) = triples(splats, &mut adam.splats_m, &mut adam.splats_v);
    let texels = [&mut textures.texels, &mut adam.texels_m, &mut adam.texels_v];
    let maps = &textures.maps;
    let chunks = split_chunks(groups, texels, &mut adam.last_step, statistics, maps, sh_offsets);
    chunks.into_par_iter().zip(&gradients).for_each(|(mut chunk, gradients)| {
        dispatch!(input.level, simd => update_chunk(simd, &mut chunk, gradients, (maps, sh_offsets), input));
    });
    gradients.iter().map(|c| c.non_finite).sum()
}

/// One step of Adam on the splats of a chunk.
#[inline(always)]
fn update_chunk<S: Simd>(
    _simd: S,
    chunk: &mut SplatChunk<'_>,
    gradients: &ChunkGradients,
    (maps, sh_offsets): (&[TextureMap], &[u32]),
    input: &UpdateInput<'_>,
) {
    let step = AdamStep::new(input.step);
    let rates = &input.rates;
    let base = 3 * maps[chunk.first].offset_texels as usize;
    let mut dense = vec![[0.0_f32; 10]; chunk.last_step.len()];
    for g in gradients.splats.iter() {
        let i = g.id as usize - chunk.first;
        dense[i][..3].copy_from_slice(&g.gradient.position);
        dense[i][3..7].copy_from_slice(&g.gradient.quaternion);
        dense[i][7..9].copy_from_slice(&g.gradient.log_scale);
        dense[i][9] = g.gradient.opacity;
        let [p, m, v] = &mut chunk.groups[4];
        let held = within(sh_offsets, chunk.first, i);
        // SH of degrees not in use take no step.
        let sh = &g.gradient.sh[..g.gradient.sh_floats];
        let (dc, rest) = (held.start..held.start + 3, held.start + 3..held.start + sh.len());
        step.update(&mut p[dc.clone()], &mut m[dc.clone()], &mut v[dc], &sh[..3], rates.sh_dc);
        step.update(&mut p[rest.clone()], &mut m[rest.clone()], &mut v[rest], &sh[3..], rates.sh_rest);
        let map = &maps[g.id as usize];
        let range = map.floats().start - base..map.floats().end - base;
        let [p, m, v] = &mut chunk.texels;
        let texels = &gradients.texels[g.first_texel..g.first_texel + range.len()];
        let rate = rates.of_map(map.num_texels());
        step.update(&mut p[range.clone()], &mut m[range.clone()], &mut v[range], texels, rate);
        chunk.last_step[i] = input.step;
        if let (Some(sums), Some(seen)) = (&mut chunk.statistics, &mut chunk.seen) {
            (0..3).for_each(|k| sums[k][i] += g.statistics[k]);
            seen[i] += 1;
        }
    }
    let widths =
        [(3, 0, rates.position), (4, 3, rates.quaternion), (2, 7, rates.log_scale), (1, 9, rates.opacity)];
    for ([p, m, v], (width, at, rate)) in chunk.groups.iter_mut().zip(widths) {
        for (i, g) in dense.iter().enumerate() {
            let range = i * width..(i + 1) * width;
            step.update(
                &mut p[range.clone()],
                &mut m[range.clone()],
                &mut v[range],
                &g[at..at + width],
                rate,
            );
        }
    }
    for s in chunk.groups[2][0].iter_mut() {
        *s = s.clamp(LOG_SCALE_RANGE.0 as f32, LOG_SCALE_RANGE.1 as f32);
    }
}

/// Gradients of the visible splats of a chunk.
struct ChunkGradients {
    splats: Vec<IndexedGradient>,
    texels: Vec<f32>,
    non_finite: u64,
}

struct IndexedGradient {
    id: u32,
    first_texel: usize,
    gradient: SplatGradient,
    statistics: [f32; 3],
}

fn gather_gradients(model: &Model, input: &UpdateInput<'_>) -> Vec<ChunkGradients> {
    let firsts: Vec<usize> = (0..model.num_splats()).step_by(CHUNK).collect();
    let chunk = |first: usize| dispatch!(input.level, simd => gather_chunk(simd, model, input, first));
    firsts.into_par_iter().map(chunk).collect()
}

#[inline(always)]
fn gather_chunk<S: Simd>(_simd: S, model: &Model, input: &UpdateInput<'_>, first: usize) -> ChunkGradients {
    let start = input.splats.partition_point(|s| (s.id as usize) < first);
    let past = input.splats.partition_point(|s| (s.id as usize) < first + CHUNK);
    let mut out = ChunkGradients { splats: Vec::new(), texels: Vec::new(), non_finite: 0 };
    let mut texels = Vec::new();
    for index in start..past {
        if input.tiles.slot_start[index] == input.tiles.slot_start[index + 1] {
            continue;
        }
        let (gradient, statistics, non_finite) = splat_gradient(model, input, index, &mut texels);
        out.non_finite += u64::from(non_finite);
        let id = input.splats[index].id;
        out.splats.push(IndexedGradient { id, first_texel: out.texels.len(), gradient, statistics });
        out.texels.extend_from_slice(&texels);
    }
    out
}
