//! Sizes of texture maps: crop and pad them to their support, coarsen those that do not need their texels, refine
//! those of high-error splats (method 6.4, 6.5 and 6.7). Texels keep their place on the surfel throughout.

use super::coarse::{coarsening_error, residual};
use super::draft::{Draft, size_of, with, without};
use super::geometry::first_texel_size;
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

fn set(draft: &mut Draft, change: MapChange, [rows, cols]: [u32; 2]) {
    draft.change = change;
    draft.texels = (rows * cols) as usize;
}

/// Fits a map to its support, and coarsens or drops it if `may_coarsen` and its image hardly changes.
pub fn fit(
    s: &Situation<'_>,
    config: &DensityConfig,
    components: &Components,
    may_coarsen: bool,
    draft: &mut Draft,
    counts: &mut DensityCounts,
) {
    let map = &s.model.textures.maps[draft.source as usize];
    draft.texels = map.num_texels();
    match s.rule {
        MapRule::None => {}
        MapRule::Fixed(resolution) => refit_fixed(map, resolution, draft),
        // A splat without support keeps its map, for the support may come back.
        MapRule::Adaptive if !draft.sizes.has_support() || map.rows == 0 => {}
        MapRule::Adaptive => {
            let sizes = draft.sizes;
            let extent = 2.0 * sizes.extents[0].max(sizes.extents[1]);
            let is_idle = || {
                s.texels_trained
                    && components.coarsening
                    && map.rows.max(map.cols) == 2
                    && residual(s.model, draft.source as usize) < config.coarsen_below
            };
            if config.untextured && may_coarsen && s.use_statistics && (extent < sizes.finest || is_idle()) {
                set(draft, centred(map, Grid::Same, [0, 0], [1.0; 2]), [0, 0]);
                counts.coarsened += 1;
                return;
            }
            let texel_size = f64::from(map.texel_size);
            let needed = sizes.texels(texel_size);
            if !sizes.fits(needed, draft.life.ceiling) {
                counts.coarsened += 1;
                stretch(draft);
            } else if may_coarsen
                && s.use_statistics
                && components.coarsening
                && map.rows.min(map.cols) > 1
                && map.rows.max(map.cols) > 2
                && coarsening_error(s.model, draft.source as usize) < config.coarsen_below
            {
                counts.coarsened += 1;
                coarsen(map, draft);
            } else {
                set(draft, centred(map, Grid::Same, needed, [1.0; 2]), needed);
            }
        }
    }
}

/// Halves the side of a map.
fn coarsen(map: &TextureMap, draft: &mut Draft) {
    let needed = draft.sizes.texels(2.0 * f64::from(map.texel_size));
    set(draft, centred(map, Grid::Coarser, needed, MERGED_MOMENTS), needed);
}

/// Spreads as many texels as the ceiling allows over a support that has outgrown them. Resampled rather than
/// coarsened, because the support has rarely doubled.
fn stretch(draft: &mut Draft) {
    let most = draft.life.ceiling.min(draft.sizes.cap).max(2);
    let texel_size = first_texel_size(draft.sizes.extents) / f64::from(most - 1);
    let needed = draft.sizes.texels(texel_size);
    let change = MapChange::Resample {
        rows: needed[0] as u16,
        cols: needed[1] as u16,
        texel_size: texel_size as f32,
        shift_texels: [0.0; 2],
        moment_scale: [1.0; 2],
    };
    set(draft, change, needed);
}

/// A candidate with its ceiling raised and, if its bounds allow it, its map refined; `None` without adaptive maps
/// or support.
pub fn refined(
    s: &Situation<'_>,
    config: &DensityConfig,
    components: &Components,
    draft: &Draft,
) -> Option<Draft> {
    if s.rule != MapRule::Adaptive || !draft.sizes.has_support() {
        return None;
    }
    let map = &s.model.textures.maps[draft.source as usize];
    let mut refined = *draft;
    let sizes = draft.sizes;
    if components.growth {
        refined.life.ceiling = draft.life.ceiling.saturating_mul(2).min(sizes.cap).max(draft.life.ceiling);
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
    if half >= sizes.finest && sizes.fits(needed, refined.life.ceiling) {
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
    drafts: &mut [Option<Draft>],
    counts: &mut DensityCounts,
) {
    let mut size = size_of(drafts.iter().flatten(), s.model.splats.sh_degree);
    if budget.allows(&size) || s.rule != MapRule::Adaptive {
        return;
    }
    let mut order: Vec<usize> = (0..drafts.len()).filter(|&i| drafts[i].is_some()).collect();
    order.sort_by(|&a, &b| scores.error[a].total_cmp(&scores.error[b]).then(a.cmp(&b)));
    // Half the side, then a quarter and so on: padding may have added more than one halving removes.
    for halvings in 1..u16::BITS {
        for &i in &order {
            if budget.allows(&size) {
                return;
            }
            let Some(draft) = &mut drafts[i] else { continue };
            let map = &s.model.textures.maps[i];
            if map.rows == 0 || !draft.sizes.has_support() {
                continue;
            }
            let mut smaller = *draft;
            smaller.life.ceiling = (map.rows.max(map.cols) >> halvings).max(2);
            stretch(&mut smaller);
            if smaller.texels < draft.texels {
                counts.coarsened += 1;
                size = with(without(size, draft), &smaller);
                *draft = smaller;
            }
        }
    }
}

/// Resamples a map of `fixed:R` that no longer fits its splat's support.
fn refit_fixed(map: &TextureMap, side: u16, draft: &mut Draft) {
    let half = draft.sizes.extents[0].max(draft.sizes.extents[1]);
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
    set(draft, change, [u32::from(side); 2]);
}
