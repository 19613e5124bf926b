//! The arrays of an asset as a stage holds them, with y up.

use super::value::{Form, Numbers, Value};
use crate::math::{quaternion, yup};
use crate::{SplatAsset, num_sh_coefficients};

/// Standard deviations that extents cover: those at which a splat of opacity 1 fades out, `sqrt(2 ln 255)`.
const REACH_MAX: f64 = 3.33;

pub(super) fn floats(form: Form, values: Vec<f32>) -> Value {
    Value::Floats(Numbers::array(form, values))
}

pub(super) fn ints(form: Form, values: Vec<i32>) -> Value {
    Value::Ints(Numbers::array(form, values))
}

pub(super) fn positions(asset: &SplatAsset) -> Value {
    floats(Form::Vec3, asset.positions.iter().flat_map(|&p| yup::position(p)).collect())
}

pub(super) fn orientations(asset: &SplatAsset) -> Value {
    floats(Form::Quaternion, asset.rotations.iter().flat_map(|&q| yup::rotation(q)).collect())
}

pub(super) fn opacities(asset: &SplatAsset) -> Value {
    floats(Form::One, asset.opacities.clone())
}

/// Scales with a third that is zero for surflets and thin for 3D Gaussians.
pub(super) fn scales(asset: &SplatAsset, is_3d: bool) -> Value {
    let third = |u: f32, v: f32| if is_3d { yup::thickness(u, v) } else { 0.0 };
    floats(Form::Vec3, asset.scales.iter().flat_map(|&[u, v]| [u, v, third(u, v)]).collect())
}

/// All SH coefficients, the first with the mean of the map, for programs without texture support.
pub(super) fn mean_baked_sh(asset: &SplatAsset) -> Value {
    let mut out = Vec::with_capacity(asset.sh.len());
    for splat in 0..asset.num_splats() {
        let first = out.len();
        out.extend(yup::sh(asset.own_sh_of(splat)));
        // Without the signs of zeros above the splat's degree.
        out.resize(first + asset.sh_of(splat).len(), 0.0);
        out[first..first + 3].copy_from_slice(&asset.untextured_dc(splat));
    }
    floats(Form::Vec3, out)
}

/// SH coefficients of degree 0 without the means of maps.
pub(super) fn exact_sh0(asset: &SplatAsset) -> Value {
    let width = 3 * num_sh_coefficients(asset.sh_degree);
    floats(Form::Vec3, asset.sh.chunks_exact(width).flat_map(|sh| [sh[0], sh[1], sh[2]]).collect())
}

/// Minimum and maximum of a box around all splats, rounded outwards.
pub(super) fn extent(asset: &SplatAsset) -> Value {
    let mut limits = [[f64::INFINITY; 3], [f64::NEG_INFINITY; 3]];
    for splat in 0..asset.num_splats() {
        let centre = yup::position(asset.positions[splat]).map(f64::from);
        let q = yup::rotation(asset.rotations[splat]).map(f64::from);
        let half = half_sides(q, asset.scales[splat].map(f64::from), REACH_MAX);
        for i in 0..3 {
            limits[0][i] = limits[0][i].min(centre[i] - half[i]);
            limits[1][i] = limits[1][i].max(centre[i] + half[i]);
        }
    }
    if asset.num_splats() == 0 {
        limits = [[0.0; 3]; 2];
    }
    // Beyond f32 the largest number must do: an extent is finite.
    let rounded = |v: f64, outwards: fn(f32) -> f32| outwards(v as f32).clamp(f32::MIN, f32::MAX);
    let [low, high] = limits;
    let values =
        low.iter().map(|&v| rounded(v, f32::next_down)).chain(high.iter().map(|&v| rounded(v, f32::next_up)));
    floats(Form::Vec3, values.collect())
}

/// Half sides of the box around a disc that reaches `reach` standard deviations.
pub(super) fn half_sides(q: [f64; 4], [scale_u, scale_v]: [f64; 2], reach: f64) -> [f64; 3] {
    let u = quaternion::turned(q, [reach * scale_u, 0.0, 0.0]);
    let v = quaternion::turned(q, [0.0, reach * scale_v, 0.0]);
    std::array::from_fn(|i| u[i].hypot(v[i]))
}
