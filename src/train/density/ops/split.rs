//! Splitting of a splat along its longer axis (method 6.8).

use super::regrid::window;
use crate::backend::{Grid, MapChange};
use crate::constants::LOG_SCALE_RANGE;
use crate::train::density::geometry::{half_extents, opacity, sigmas};
use crate::train::density::plan::{Change, PlannedSplat};
use crate::train::density::situation::Situation;
use crate::train::density::sizes::{MapRule, Sizes};
use glam::{DQuat, DVec3};

/// Aspect above which a splat is not split if its smaller standard deviation is below a pixel: such a needle would
/// be split forever.
const NEEDLE_ASPECT: f64 = 50.0;

/// Halves whose shift is at least this many texels keep the parent's grid.
const GRID_SHIFT_MIN: f64 = 1.5;

/// Placement, width and opacity of the halves.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Profile {
    /// One standard deviation from the centre, half as wide, opacity times exp(-1/2) (CAT).
    Paper,
    /// 0.56 standard deviations from the centre, half as wide, opacity times 0.9: a third of the deviation from
    /// the parent's falloff.
    Tight,
}

impl Profile {
    /// Shift in standard deviations, factor of the standard deviation, factor of the opacity.
    pub fn factors(self) -> [f64; 3] {
        match self {
            Self::Paper => [1.0, 0.5, 0.606_530_659_712_633],
            Self::Tight => [0.56, 0.5, 0.9],
        }
    }
}

/// The two halves of a splat longer than this many finest texels, whatever the texels of its map; `None` if it is not, or a
/// needle. `pixel` is the width of a pixel at the splat, local units.
pub fn split_long(
    s: &Situation<'_>,
    profile: Profile,
    planned: &PlannedSplat,
    pixel: f64,
    longer_than_texels: f64,
) -> Option<[PlannedSplat; 2]> {
    let texels = planned.sizes.extents.map(|h| 2.0 * h / planned.sizes.finest);
    let axis = usize::from(texels[1] > texels[0]);
    let sigma = sigmas(s.model, planned.source as usize);
    let is_needle = sigma[axis] > NEEDLE_ASPECT * sigma[1 - axis] && sigma[1 - axis] < pixel * s.render_scale;
    // Three standard deviations of a half are at most the length from which splats are split.
    let widest = s.timing.split_texels.unwrap_or(longer_than_texels) * planned.sizes.finest / 3.0;
    (texels[axis] > longer_than_texels && !is_needle).then(|| halves(s, profile, planned, axis, widest))
}

/// The two halves of a splat along its longer axis, however short it is.
pub fn split_any(s: &Situation<'_>, profile: Profile, planned: &PlannedSplat) -> [PlannedSplat; 2] {
    let sigma = sigmas(s.model, planned.source as usize);
    halves(s, profile, planned, usize::from(sigma[1] > sigma[0]), f64::INFINITY)
}

/// The two halves of a splat along one of its axes; their standard deviation along it is at most `widest`.
fn halves(
    s: &Situation<'_>,
    profile: Profile,
    planned: &PlannedSplat,
    axis: usize,
    widest: f64,
) -> [PlannedSplat; 2] {
    let i = planned.source as usize;
    let sigma = sigmas(s.model, i);
    let [shift_sigmas, sigma_factor, opacity_factor] = profile.factors();
    let map = &s.model.textures.maps[i];
    let texel_size = f64::from(map.texel_sizes[axis]);
    let exact = shift_sigmas * sigma[axis];
    let on_grid = s.map_rule == MapRule::Adaptive && map.rows > 0 && exact / texel_size >= GRID_SHIFT_MIN;
    // A shift by whole texels spares resampling.
    let shift = if on_grid { (exact / texel_size).floor() * texel_size } else { exact };
    let mut half_sigma = sigma;
    half_sigma[axis] = (sigma[axis] * sigma_factor).min(widest);
    let half_opacity = opacity(s.model, i) * opacity_factor;
    let mut sizes = planned.sizes;
    sizes.extents = half_extents(half_sigma, half_opacity, s.settings.alpha_texture);
    let half = |direction: f64| {
        let (change, texels) = half_map(s, planned, &sizes, axis, direction * shift, on_grid);
        let edit = Change {
            position: shifted(s, i, axis, direction * shift),
            log_scales: half_sigma.map(|v| v.ln().clamp(LOG_SCALE_RANGE.0, LOG_SCALE_RANGE.1) as f32),
            opacity_logit: (half_opacity / (1.0 - half_opacity)).ln() as f32,
        };
        PlannedSplat { change, edit: Some(edit), history: planned.history.half(), sizes, texels, ..*planned }
    };
    [half(1.0), half(-1.0)]
}

/// The centre of a splat shifted along one of its axes, local units.
fn shifted(s: &Situation<'_>, splat: usize, axis: usize, by: f64) -> [f32; 3] {
    let q = &s.model.splats.quaternions[4 * splat..4 * splat + 4];
    let [w, x, y, z] = [q[0], q[1], q[2], q[3]].map(f64::from);
    let direction = DQuat::from_xyzw(x, y, z, w).normalize() * [DVec3::X, DVec3::Y][axis];
    let p = &s.model.splats.positions[3 * splat..3 * splat + 3];
    (DVec3::new(p[0].into(), p[1].into(), p[2].into()) + by * direction).as_vec3().to_array()
}

/// The part of the parent's map that lies under a half, and its number of texels.
fn half_map(
    s: &Situation<'_>,
    planned: &PlannedSplat,
    sizes: &Sizes,
    axis: usize,
    shift: f64,
    on_grid: bool,
) -> (MapChange, usize) {
    let map = &s.model.textures.maps[planned.source as usize];
    if map.rows == 0 {
        return (MapChange::Keep, 0);
    }
    // The map is dropped.
    if planned.texels == 0 {
        return (planned.change, 0);
    }
    // First moments start at zero, second ones are kept (method 6.8).
    let moment_scale = [0.0, 1.0];
    let texel_sizes = map.texel_sizes.map(f64::from);
    let mut shift_texels = [0.0; 2];
    shift_texels[axis] = shift / texel_sizes[axis];
    if on_grid {
        let texels = sizes.texels(texel_sizes);
        let moved = shift_texels.map(|by| by.round() as i32);
        let change = window(map, [Grid::Same; 2], texels, [0; 2], moved, moment_scale);
        return (change, (texels[0] * texels[1]) as usize);
    }
    let (texel_sizes, [rows, cols]) = match s.map_rule {
        MapRule::Fixed(resolution) => {
            let spanning = |axis: usize| {
                2.0 * sizes.extents[axis].max(1e-3 * texel_sizes[axis]) / (f64::from(resolution) - 1.0)
            };
            ([0, 1].map(spanning), [u32::from(resolution); 2])
        }
        _ => (texel_sizes, sizes.texels(texel_sizes)),
    };
    let change = MapChange::Resample {
        rows: rows as u16,
        cols: cols as u16,
        texel_sizes: texel_sizes.map(|size| size as f32),
        shift_texels: shift_texels.map(|t| t as f32),
        moment_scale,
    };
    (change, (rows * cols) as usize)
}
