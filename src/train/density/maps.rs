//! Sizes of the maps: crop and pad with the support, refine the worst, coarsen what does not need its
//! texels (method section 7.3). Texels keep their place on the surfel throughout.

use super::coarse::{coarsening_error, residual};
use super::decide::{DensityCounts, Situation};
use super::draft::Draft;
use super::geometry::{even_texels, first_texel_size};
use super::score::Scores;
use super::settings::{Budget, Components, DensityConfig};
use crate::backend::{Grid, MapChange};
use crate::model::TextureMap;

/// Maps of `fixed:R` whose texel size is off by less than this factor are left alone: each resampling
/// blurs.
const TOLERATED: f64 = 1.1;

/// Factors of moments where four texels become one, whose gradient is the sum of theirs.
const MERGED_MOMENTS: [f32; 2] = [4.0, 16.0];

/// Who decides on the size of the maps.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MapRule {
    /// No maps.
    None,
    /// So many texels a side, always.
    Fixed(u16),
    /// Each its own.
    Adaptive,
}

/// What bounds a map.
#[derive(Clone, Copy, Debug, Default)]
pub struct Sizes {
    /// Half extents of the texture's domain, local units.
    pub extents: [f64; 2],
    /// Edge of the finest texel allowed, local units.
    pub finest: f64,
    /// Most texels a side, whatever the ceiling.
    pub cap: u16,
}

impl Sizes {
    /// Texels that the map needs with texels of an edge.
    pub fn texels(&self, texel_size: f64) -> [u32; 2] {
        self.extents.map(|h| even_texels(h, texel_size))
    }

    /// Whether a map of these texels is within a ceiling.
    fn fits(&self, texels: [u32; 2], ceiling: u16) -> bool {
        texels[0].max(texels[1]) <= u32::from(ceiling.min(self.cap))
    }

    fn has_support(&self) -> bool {
        self.extents[0] > 0.0 && self.extents[1] > 0.0
    }
}

/// The window of a grid that has the given size and the same centre.
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

/// Fits the map to the support: what every map gets, candidates for growth or not. `may_coarsen`: the
/// splat is not among the worst.
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
        // A splat without support keeps its map: it may come back.
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
            if config.untextured && may_coarsen && s.judge && (extent < sizes.finest || is_idle()) {
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
                && s.judge
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

/// Halves the map's texels a side.
fn coarsen(map: &TextureMap, draft: &mut Draft) {
    let needed = draft.sizes.texels(2.0 * f64::from(map.texel_size));
    set(draft, centred(map, Grid::Coarser, needed, MERGED_MOMENTS), needed);
}

/// Spreads as many texels as the ceiling allows over a support that has outgrown them. Resampled, not
/// halved: the support has rarely doubled.
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

/// A finer map for one of the worst splats, with its ceiling raised; `None` if its bounds forbid both.
pub fn grown(
    s: &Situation<'_>,
    config: &DensityConfig,
    components: &Components,
    draft: &Draft,
) -> Option<Draft> {
    if s.rule != MapRule::Adaptive || !draft.sizes.has_support() {
        return None;
    }
    let map = &s.model.textures.maps[draft.source as usize];
    let mut grown = *draft;
    let sizes = draft.sizes;
    if components.growth {
        grown.life.ceiling = draft.life.ceiling.saturating_mul(2).min(sizes.cap).max(draft.life.ceiling);
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
            set(&mut grown, change, [2, 2]);
        }
        return Some(grown);
    }
    let half = f64::from(map.texel_size) / 2.0;
    let needed = sizes.texels(half);
    if half >= sizes.finest && sizes.fits(needed, grown.life.ceiling) {
        let change = centred(map, Grid::Finer, needed, config.growth_moments.scale());
        set(&mut grown, change, needed);
    }
    Some(grown)
}

/// Coarsens maps, those of the least error first, until the model is within its budget.
pub fn shrink_to_budget(
    s: &Situation<'_>,
    budget: &Budget,
    scores: &Scores,
    drafts: &mut [Option<Draft>],
    counts: &mut DensityCounts,
) {
    let splats = drafts.iter().flatten().count();
    let mut texels: usize = drafts.iter().flatten().map(|d| d.texels).sum();
    if budget.allows(splats, texels) || s.rule != MapRule::Adaptive {
        return;
    }
    let mut order: Vec<usize> = (0..drafts.len()).filter(|&i| drafts[i].is_some()).collect();
    order.sort_by(|&a, &b| scores.error[a].total_cmp(&scores.error[b]).then(a.cmp(&b)));
    // Half the side, then a quarter, ...: padding may have added more than one halving takes away.
    for halvings in 1..u16::BITS {
        for &i in &order {
            if budget.allows(splats, texels) {
                return;
            }
            let Some(draft) = &mut drafts[i] else { continue };
            let map = &s.model.textures.maps[i];
            let before = draft.texels;
            if map.rows == 0 || !draft.sizes.has_support() {
                continue;
            }
            let mut smaller = *draft;
            smaller.life.ceiling = (map.rows.max(map.cols) >> halvings).max(2);
            stretch(&mut smaller);
            if smaller.texels < before {
                counts.coarsened += 1;
                texels = texels - before + smaller.texels;
                *draft = smaller;
            }
        }
    }
}

/// `fixed:R`: resamples a map that no longer fits its splat's support.
fn refit_fixed(map: &TextureMap, resolution: u16, draft: &mut Draft) {
    let half = draft.sizes.extents[0].max(draft.sizes.extents[1]);
    let wanted = 2.0 * half / (f64::from(resolution) - 1.0);
    let ratio = wanted / f64::from(map.texel_size);
    if half <= 0.0 || (1.0 / TOLERATED..=TOLERATED).contains(&ratio) {
        return;
    }
    let change = MapChange::Resample {
        rows: resolution,
        cols: resolution,
        texel_size: wanted as f32,
        shift_texels: [0.0; 2],
        moment_scale: [1.0, 1.0],
    };
    set(draft, change, [u32::from(resolution); 2]);
}
