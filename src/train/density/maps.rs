//! Sizes of texture maps: crop and pad them to their support, coarsen those that do not need their texels, refine
//! those of high-error splats (method 6.4, 6.5 and 6.7). Texels keep their place on the surfel throughout.

use super::coarse::{coarsening_error, residual};
use super::geometry::first_texel_size;
use super::planned_splat::{PlannedSplat, size_of, with, without};
use super::score::Scores;
use super::settings::{Budget, Components, DensityConfig};
use super::situation::{DensityCounts, Situation};
use super::sizes::MapRule;
use crate::backend::{Grid, MapChange};
use crate::model::TextureMap;

/// Maps of `fixed:R` whose texel size is off by less than this factor are kept, since resampling blurs.
const TOLERATED: f64 = 1.1;

/// Factors of the moments where four texels become one, whose gradient is the sum of theirs.
const MERGED_MOMENTS: [f32; 2] = [4.0, 16.0];

/// The change to a map of `rows` x `cols` texels of `grid` about the same centre.
pub fn centred(map: &TextureMap, grid: Grid, [rows, cols]: [u32; 2], moment_scale: [f32; 2]) -> MapChange {
    let first = |old: u16, new: u32| (i32::from(grid.texels(old)) - new as i32) / 2;
    if grid == Grid::Same && (u32::from(map.rows), u32::from(map.cols)) == (rows, cols) {
        return MapChange::Keep;
    }
    MapChange::Regrid {
        grid,
        rows: rows as u16,
        cols: cols as u16,
        first_row: first(map.rows, rows),
        first_col: first(map.cols, cols),
        moment_scale,
    }
}

fn set(planned: &mut PlannedSplat, change: MapChange, [rows, cols]: [u32; 2]) {
    planned.change = change;
    planned.texels = (rows * cols) as usize;
}

/// Fits a map to its support, and coarsens or drops it if `may_coarsen` and its image hardly changes.
pub fn fit(
    s: &Situation<'_>,
    config: &DensityConfig,
    components: &Components,
    may_coarsen: bool,
    planned: &mut PlannedSplat,
    counts: &mut DensityCounts,
) {
    let map = &s.model.textures.maps[planned.source as usize];
    planned.texels = map.num_texels();
    match s.rule {
        MapRule::None => {}
        MapRule::Fixed(resolution) => refit_fixed(map, resolution, planned),
        // A splat without support keeps its map, for the support may come back.
        MapRule::Adaptive if !planned.sizes.has_support() || map.rows == 0 => {}
        MapRule::Adaptive => {
            let sizes = planned.sizes;
            let extent = 2.0 * sizes.extents[0].max(sizes.extents[1]);
            let is_idle = || {
                s.texels_trained
                    && components.coarsening
                    && map.rows.max(map.cols) == 2
                    && residual(s.model, planned.source as usize) < config.coarsen_below
            };
            if config.untextured && may_coarsen && s.use_statistics && (extent < sizes.finest || is_idle()) {
                set(planned, centred(map, Grid::Same, [0, 0], [1.0; 2]), [0, 0]);
                counts.coarsened += 1;
                return;
            }
            let texel_size = f64::from(map.texel_size);
            let needed = sizes.texels(texel_size);
            if !sizes.fits(needed, planned.history.ceiling) {
                counts.coarsened += 1;
                stretch(planned);
            } else if may_coarsen
                && s.use_statistics
                && components.coarsening
                && map.rows.min(map.cols) > 1
                && map.rows.max(map.cols) > 2
                && coarsening_error(s.model, planned.source as usize) < config.coarsen_below
            {
                counts.coarsened += 1;
                coarsen(map, planned);
            } else {
                set(planned, centred(map, Grid::Same, needed, [1.0; 2]), needed);
            }
        }
    }
}

/// Halves the side of a map.
fn coarsen(map: &TextureMap, planned: &mut PlannedSplat) {
    let needed = planned.sizes.texels(2.0 * f64::from(map.texel_size));
    set(planned, centred(map, Grid::Coarser, needed, MERGED_MOMENTS), needed);
}

/// Spreads as many texels as the ceiling allows over a support that has outgrown them. Resampled rather than
/// coarsened, because the support has rarely doubled.
fn stretch(planned: &mut PlannedSplat) {
    let most = planned.history.ceiling.min(planned.sizes.cap).max(2);
    let texel_size = first_texel_size(planned.sizes.extents) / f64::from(most - 1);
    let needed = planned.sizes.texels(texel_size);
    let change = MapChange::Resample {
        rows: needed[0] as u16,
        cols: needed[1] as u16,
        texel_size: texel_size as f32,
        shift_texels: [0.0; 2],
        moment_scale: [1.0; 2],
    };
    set(planned, change, needed);
}

/// A candidate with its ceiling raised and, if its bounds allow it, its map refined; `None` without adaptive maps
/// or support.
pub fn refined(
    s: &Situation<'_>,
    config: &DensityConfig,
    components: &Components,
    planned: &PlannedSplat,
) -> Option<PlannedSplat> {
    if s.rule != MapRule::Adaptive || !planned.sizes.has_support() {
        return None;
    }
    let map = &s.model.textures.maps[planned.source as usize];
    let mut refined = *planned;
    let sizes = planned.sizes;
    if components.growth {
        refined.history.ceiling =
            planned.history.ceiling.saturating_mul(2).min(sizes.cap).max(planned.history.ceiling);
    }
    if map.rows == 0 {
        let extent = 2.0 * sizes.extents[0].max(sizes.extents[1]);
        let texel_size = first_texel_size(sizes.extents);
        if extent >= sizes.finest {
            let change = MapChange::Resample {
                rows: 2,
                cols: 2,
                texel_size: texel_size as f32,
                shift_texels: [0.0; 2],
                moment_scale: [1.0; 2],
            };
            set(&mut refined, change, [2, 2]);
        }
        return Some(refined);
    }
    let half = f64::from(map.texel_size) / 2.0;
    let needed = sizes.texels(half);
    if half >= sizes.finest && sizes.fits(needed, refined.history.ceiling) {
        let change = centred(map, Grid::Finer, needed, config.growth_moments.scale());
        set(&mut refined, change, needed);
    }
    Some(refined)
}

/// Makes maps smaller, those of the least error first, until the model is within its budget.
pub fn coarsen_to_budget(
    s: &Situation<'_>,
    budget: &Budget,
    scores: &Scores,
    planned_splats: &mut [Option<PlannedSplat>],
    counts: &mut DensityCounts,
) {
    let mut size = size_of(planned_splats.iter().flatten());
    if budget.allows(&size) || s.rule != MapRule::Adaptive {
        return;
    }
    let mut order: Vec<usize> = (0..planned_splats.len()).filter(|&i| planned_splats[i].is_some()).collect();
    order.sort_by(|&a, &b| scores.error[a].total_cmp(&scores.error[b]).then(a.cmp(&b)));
    // Half the side, then a quarter and so on: padding may have added more than one halving removes.
    for halvings in 1..u16::BITS {
        for &i in &order {
            if budget.allows(&size) {
                return;
            }
            let Some(planned) = &mut planned_splats[i] else { continue };
            let map = &s.model.textures.maps[i];
            if map.rows == 0 || !planned.sizes.has_support() {
                continue;
            }
            let mut smaller = *planned;
            smaller.history.ceiling = (map.rows.max(map.cols) >> halvings).max(2);
            stretch(&mut smaller);
            if smaller.texels < planned.texels {
                counts.coarsened += 1;
                size = with(without(size, planned), &smaller);
                *planned = smaller;
            }
        }
    }
}

/// Resamples a map of `fixed:R` that no longer fits its splat's support.
fn refit_fixed(map: &TextureMap, side: u16, planned: &mut PlannedSplat) {
    let half = planned.sizes.extents[0].max(planned.sizes.extents[1]);
    let wanted = 2.0 * half / (f64::from(side) - 1.0);
    let ratio = wanted / f64::from(map.texel_size);
    if half <= 0.0 || (1.0 / TOLERATED..=TOLERATED).contains(&ratio) {
        return;
    }
    let change = MapChange::Resample {
        rows: side,
        cols: side,
        texel_size: wanted as f32,
        shift_texels: [0.0; 2],
        moment_scale: [1.0, 1.0],
    };
    set(planned, change, [u32::from(side); 2]);
}
