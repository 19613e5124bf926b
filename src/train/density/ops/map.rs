//! Sizes of texture maps: crop and pad them to their support, coarsen those that do not need their texels, refine
//! those of high-error splats (method 6.4, 6.5 and 6.7). Texels keep their place on the surfel throughout.

use super::coarse::{coarsened, coarsening_error, detail, residual};
use super::regrid::{centred, cropped, merged_moments, surplus};
use crate::backend::{Grid, MapChange};
use crate::model::{Coarsening, TextureMap};
use crate::train::density::geometry::{even_texels, first_texel_size};
use crate::train::density::plan::PlannedSplat;
use crate::train::density::situation::{DensityCounts, Situation};
use crate::train::density::sizes::MapRule;

/// Maps of `fixed:R` whose texel size is off by less than this factor are kept, since resampling blurs.
const TOLERATED: f64 = 1.1;

/// Edges of a map's texels after a change of its grids.
fn texel_sizes_on(map: &TextureMap, grids: [Grid; 2]) -> [f64; 2] {
    [0, 1].map(|axis| f64::from(map.texel_sizes[axis]) * f64::from(grids[axis].texel_ratio()))
}

/// What happens to the moments of a refined map (method 6.7).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Moments {
    /// Scaled as the gradients are: for quarters of a texel, first moments by 1/4, second by 1/16.
    Scaled,
    /// Kept unscaled (paper).
    Kept,
    /// Set to zero: an accidental warm restart (authors' code).
    Zero,
}

impl Moments {
    /// Factors of the first and second moments of texels that are halved along this many axes.
    fn scale(self, axes: usize) -> [f32; 2] {
        let area = 0.5_f32.powi(axes as i32);
        match self {
            Self::Scaled => [area, area * area],
            Self::Kept => [1.0, 1.0],
            Self::Zero => [0.0, 0.0],
        }
    }
}

fn set(planned: &mut PlannedSplat, change: MapChange, [rows, cols]: [u32; 2]) {
    planned.change = change;
    planned.texels = (rows * cols) as usize;
}

/// Fits a map to its support, and coarsens it if `may_coarsen` and its image hardly changes. A map that is idle, or whose support
/// is below the finest texel, is dropped where that `may_drop` it. Where maps may not be padded, they keep no more than what they
/// hold.
pub fn fit(
    s: &Situation<'_>,
    may_coarsen: bool,
    may_drop: bool,
    planned: &mut PlannedSplat,
    counts: &mut DensityCounts,
) {
    let map = &s.model.textures.maps[planned.source as usize];
    planned.texels = map.num_texels();
    match s.map_rule {
        MapRule::None => return,
        MapRule::Fixed(resolution) => return refit_fixed(map, resolution, planned),
        // A splat without support keeps its map, for the support may come back.
        MapRule::Adaptive if !planned.sizes.has_support() || map.rows == 0 => return,
        MapRule::Adaptive => {}
    }
    let (sizes, coarsens) = (planned.sizes, s.components.coarsening);
    let extent = 2.0 * sizes.extents[0].max(sizes.extents[1]);
    let is_idle = || {
        s.timing.texels_trained
            && coarsens
            && map.rows.max(map.cols) == 2
            && residual(s.model, planned.source as usize) < s.settings.coarsen_below
    };
    if may_drop && may_coarsen && (extent < sizes.finest || is_idle()) {
        set(planned, centred(map, [Grid::Same; 2], [0, 0], [1.0; 2]), [0, 0]);
        counts.coarsened += 1;
        return;
    }
    let needed = sizes.texels(map.texel_sizes.map(f64::from));
    if s.timing.may_pad && !sizes.fits(needed, planned.history.ceiling) {
        counts.coarsened += 1;
        stretch(map, planned);
        return;
    }
    let grids =
        if may_coarsen && coarsens { coarser_grids(s, planned.source as usize) } else { [Grid::Same; 2] };
    let is_coarser = grids.map(|grid| grid == Grid::Coarser);
    counts.coarsened += usize::from(is_coarser.contains(&true));
    if s.timing.may_pad {
        let needed = sizes.texels(texel_sizes_on(map, grids));
        set(planned, centred(map, grids, needed, merged_moments(grids)), needed);
        return;
    }
    planned.change = match Coarsening::new(map, is_coarser) {
        Some(coarser) if is_coarser.contains(&true) => coarsened(map, &coarser),
        _ => cropped(map, surplus(map, needed)),
    };
    planned.texels = planned.change.applied_to(map).num_texels();
}

/// The axes along which a map loses little by half as many texels.
fn coarser_grids(s: &Situation<'_>, splat: usize) -> [Grid; 2] {
    let map = &s.model.textures.maps[splat];
    let both = [Grid::Coarser; 2];
    let one_axis = [[Grid::Coarser, Grid::Same], [Grid::Same, Grid::Coarser]];
    let choices = if s.settings.grow_by_axis > 0.0 { [both, one_axis[0], one_axis[1]] } else { [both; 3] };
    let may = |grids: &[Grid; 2]| {
        let longer = |(grid, texels): (&Grid, u16)| *grid == Grid::Same || texels > 2;
        // A map of 2 x 2 is dropped or kept as it is.
        map.rows.min(map.cols) > 1
            && map.rows.max(map.cols) > 2
            && (*grids == both || grids.iter().zip([map.rows, map.cols]).all(longer))
            && coarsening_error(s.model, splat, grids.map(|grid| grid == Grid::Coarser))
                < s.settings.coarsen_below
    };
    choices.into_iter().find(may).unwrap_or([Grid::Same; 2])
}

/// Spreads as many texels as the ceiling allows over a support that has outgrown them along an axis. Resampled rather
/// than coarsened, because the support has rarely doubled.
fn stretch(map: &TextureMap, planned: &mut PlannedSplat) {
    let most = planned.history.ceiling.min(planned.sizes.cap).max(2);
    let texel_sizes = [0, 1].map(|axis| {
        let texel_size = f64::from(map.texel_sizes[axis]);
        let half = planned.sizes.extents[axis];
        if even_texels(half, texel_size) <= most.into() {
            return texel_size;
        }
        first_texel_size([half; 2]) / f64::from(most - 1)
    });
    let needed = planned.sizes.texels(texel_sizes);
    set(planned, resampled(needed, texel_sizes), needed);
}

/// Resampling about the same centre, with the same moments.
fn resampled([rows, cols]: [u32; 2], texel_sizes: [f64; 2]) -> MapChange {
    MapChange::Resample {
        rows: rows as u16,
        cols: cols as u16,
        texel_sizes: texel_sizes.map(|size| size as f32),
        shift_texels: [0.0; 2],
        moment_scale: [1.0; 2],
    }
}

/// A candidate with its ceiling raised and, if its bounds allow it, its map refined; `None` without adaptive maps
/// or support.
pub fn refined(s: &Situation<'_>, moments: Moments, planned: &PlannedSplat) -> Option<PlannedSplat> {
    if s.map_rule != MapRule::Adaptive || !planned.sizes.has_support() {
        return None;
    }
    let map = &s.model.textures.maps[planned.source as usize];
    let mut refined = *planned;
    let sizes = planned.sizes;
    if s.components.growth {
        refined.history.ceiling =
            planned.history.ceiling.saturating_mul(2).min(sizes.cap).max(planned.history.ceiling);
    }
    if map.rows == 0 {
        let extent = 2.0 * sizes.extents[0].max(sizes.extents[1]);
        if extent >= sizes.finest {
            set(&mut refined, resampled([2, 2], [first_texel_size(sizes.extents); 2]), [2, 2]);
        }
        return Some(refined);
    }
    let fits = |grids: &[Grid; 2]| {
        let texel_sizes = texel_sizes_on(map, *grids);
        let fine_enough = (0..2).all(|axis| grids[axis] == Grid::Same || texel_sizes[axis] >= sizes.finest);
        fine_enough && sizes.fits(sizes.texels(texel_sizes), refined.history.ceiling)
    };
    if let Some(grids) = finer_grids(s, planned.source as usize).into_iter().find(fits) {
        let needed = sizes.texels(texel_sizes_on(map, grids));
        let halved = grids.iter().filter(|&&grid| grid == Grid::Finer).count();
        set(&mut refined, centred(map, grids, needed, moments.scale(halved)), needed);
    }
    Some(refined)
}

/// How a map may be refined, the best first: along both axes, or only along the one on which it varies much more.
fn finer_grids(s: &Situation<'_>, splat: usize) -> Vec<[Grid; 2]> {
    let [along_u, along_v] = detail(s.model, splat);
    let dominates = |a: f64, b: f64| s.settings.grow_by_axis > 0.0 && a > s.settings.grow_by_axis * b;
    let (both, u, v) = ([Grid::Finer; 2], [Grid::Finer, Grid::Same], [Grid::Same, Grid::Finer]);
    if dominates(along_u, along_v) {
        vec![u]
    } else if dominates(along_v, along_u) {
        vec![v]
    } else if s.settings.grow_by_axis > 0.0 {
        // Where both do not fit, the axis that varies more.
        vec![both, if along_u > along_v { u } else { v }, if along_u > along_v { v } else { u }]
    } else {
        vec![both]
    }
}

/// A splat whose map is resampled to its side halved this many times; `None` if that saves no texels.
pub fn halved(s: &Situation<'_>, halvings: u32, planned: &PlannedSplat) -> Option<PlannedSplat> {
    let map = &s.model.textures.maps[planned.source as usize];
    if map.rows == 0 || !planned.sizes.has_support() {
        return None;
    }
    let mut smaller = *planned;
    smaller.history.ceiling = (map.rows.max(map.cols) >> halvings).max(2);
    stretch(map, &mut smaller);
    (smaller.texels < planned.texels).then_some(smaller)
}

/// Resamples a map of `fixed:R` that no longer fits its splat's support: its outermost texels lie at the ends, along each
/// axis.
fn refit_fixed(map: &TextureMap, side: u16, planned: &mut PlannedSplat) {
    let wanted = planned.sizes.extents.map(|half| 2.0 * half / (f64::from(side) - 1.0));
    let is_off = |axis: usize| {
        let ratio = wanted[axis] / f64::from(map.texel_sizes[axis]);
        !(1.0 / TOLERATED..=TOLERATED).contains(&ratio)
    };
    if planned.sizes.has_support() && (is_off(0) || is_off(1)) {
        let needed = [u32::from(side); 2];
        set(planned, resampled(needed, wanted), needed);
    }
}
