//! Structure decisions, made on the host from what was read back. With `fixed:R` there is one: a map
//! that no longer fits its splat's support is resampled to it (method section 6).

use super::config::TexturePolicy;
use crate::backend::{MapChange, StructurePlan};
use crate::model::{Model, support_half_extent};

/// Maps whose texel size is off by less than this factor are left alone: each resampling blurs.
const TOLERATED: f64 = 1.1;

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
            let sigma_max = f64::from(s.log_scales[2 * i].max(s.log_scales[2 * i + 1])).exp();
            let opacity = 1.0 / (1.0 + f64::from(-s.opacity_logits[i]).exp());
            let half = support_half_extent(sigma_max, opacity);
            let wanted = 2.0 * half / (f64::from(resolution) - 1.0);
            let ratio = wanted / f64::from(map.texel_size);
            // A splat without support keeps its map: it may come back.
            if half <= 0.0 || (1.0 / TOLERATED..=TOLERATED).contains(&ratio) {
                return MapChange::Keep;
            }
            MapChange::Resample {
                rows: resolution,
                cols: resolution,
                texel_size: wanted as f32,
                moment_scale: [1.0, 1.0],
            }
        })
        .collect();
    let changes = maps.iter().any(|m| *m != MapChange::Keep);
    changes.then(|| StructurePlan {
        sources: (0..maps.len() as u32).collect(),
        maps,
        ..StructurePlan::default()
    })
}
