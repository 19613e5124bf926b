//! The rules by which a density-control step revises a model, one file each; what they share is here.

pub mod litetex;
pub mod paper;
pub mod plain;

use super::geometry::{half_extents, opacity, sigmas};
use super::plan::PlannedSplat;
use super::situation::{DensityCounts, Situation};
use super::sizes::Sizes;
use super::stats::{Scores, prune_count_after};
use crate::backend::MapChange;

/// Largest share of the splats that one step splits with a budget (method 6.6; 3DGS-MCMC: 0.05).
pub const SPLIT_RATE: f64 = 0.16;

/// Full size over image size from which narrow splats can miss every pixel: such windows can only reset prune counts.
const UNRELIABLE_SCALE: f64 = 3.0;

/// The splats that are neither pruned nor faded (method 6.3), `None` for those that are; nothing if none is left, as nothing can be
/// added to an empty model. `pixels` are the widths of a pixel at the splats, local units.
fn survivors(
    s: &Situation<'_>,
    scores: &Scores,
    pixels: &[f64],
    fresh_opacity_floor: f64,
    counts: &mut DensityCounts,
) -> Option<Vec<Option<PlannedSplat>>> {
    let planned: Vec<Option<PlannedSplat>> = (0..s.model.num_splats())
        .map(|splat| {
            let mut planned = unchanged(s, splat, pixels[splat]);
            if !s.timing.use_statistics {
                return Some(planned);
            }
            let history = &mut planned.history;
            let low = scores.contribution[splat] < s.settings.prune_contribution
                || scores.area[splat] < s.settings.prune_area;
            let is_reliable = s.render_scale < UNRELIABLE_SCALE || !low;
            let is_counted = scores.seen[splat] && !history.is_fresh() && is_reliable;
            history.prune_count = prune_count_after(history.prune_count, is_counted.then_some(low));
            let floor = if history.is_fresh() { fresh_opacity_floor } else { s.timing.opacity_floor };
            history.checks = history.checks.saturating_add(1);
            if s.components.pruning && history.prune_count >= s.timing.patience {
                counts.pruned += 1;
                return None;
            }
            if opacity(s.model, splat) < floor {
                counts.faded += 1;
                return None;
            }
            Some(planned)
        })
        .collect();
    planned.iter().any(Option::is_some).then_some(planned)
}

/// A splat as it is, with the bounds of its map.
fn unchanged(s: &Situation<'_>, splat: usize, pixel: f64) -> PlannedSplat {
    let extents = half_extents(sigmas(s.model, splat), opacity(s.model, splat), s.settings.alpha_texture);
    PlannedSplat {
        source: splat as u32,
        change: MapChange::Keep,
        edit: None,
        history: s.histories[splat],
        sizes: Sizes {
            extents,
            finest: s.settings.min_texel_px * pixel * s.render_scale,
            cap: s.texture_cap,
        },
        texels: s.model.textures.maps[splat].num_texels(),
        sh_degree: s.model.splats.sh_degrees()[splat],
    }
}
