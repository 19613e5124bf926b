//! Structure decisions, made on the host from what was read back. With `fixed:R` there is one: a map
//! that no longer fits its splat's support is resampled to it (method section 6).

use super::config::TexturePolicy;
use crate::backend::{MapChange, StructurePlan};
use crate::constants::{ALPHA_MIN, MAP_SIGMA_MAX};
use crate::model::Model;

/// Maps whose texel size is off by less than this factor are left alone: each resampling blurs.
const TOLERATED: f64 = 1.1;

/// Half extent of a splat's map, local units: `max(sigma) * min(3, radius of alpha 1/255)`.
pub fn support_half_extent(log_scales: [f32; 2], opacity_logit: f32) -> f64 {
    let opacity = 1.0 / (1.0 + f64::from(-opacity_logit).exp());
    let radius = (2.0 * (opacity / ALPHA_MIN).ln()).max(0.0).sqrt();
    f64::from(log_scales[0].max(log_scales[1])).exp() * radius.min(MAP_SIGMA_MAX)
}

/// The plan of a revision; `None` if nothing changes.
pub(super) fn revise_maps(model: &Model, policy: TexturePolicy) -> Option<StructurePlan> {
    let TexturePolicy::Fixed(resolution) = policy else {
        return None;
    };
    let s = &model.splats;
    let maps: Vec<MapChange> = model
        .textures
        .maps
        .iter()
        .enumerate()
        .map(|(i, map)| {
            let half =
                support_half_extent([s.log_scales[2 * i], s.log_scales[2 * i + 1]], s.opacity_logits[i]);
            let wanted = 2.0 * half / (f64::from(resolution) - 1.0);
            let ratio = wanted / f64::from(map.texel_size);
            // A splat without support keeps its map: it may come back.
            if half <= 0.0 || (1.0 / TOLERATED..=TOLERATED).contains(&ratio) {
                return MapChange::Keep;
            }
            MapChange::Resample { rows: resolution, cols: resolution, texel_size: wanted as f32 }
        })
        .collect();
    let changes = maps.iter().any(|m| *m != MapChange::Keep);
    changes.then(|| StructurePlan { sources: (0..maps.len() as u32).collect(), maps })
}
