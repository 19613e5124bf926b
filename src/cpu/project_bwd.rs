//! Backward projection of a splat (twin: `reference/project_bwd.rs`): applies the chain rule from the sums over its
//! pixels to its stored parameters.

use super::math::{cross, dot};
use super::project::{ProjectedSplat, Spread, sh_basis, sh_basis_derivative, view_direction};
use super::screen_bwd::{ScreenSums, screen_bwd};
use super::sums::{HEADER_FLOATS, Sum};
use super::view::ViewF32;
use crate::constants::sh_coefficients;
use crate::model::Model;

/// Derivatives with respect to a splat's stored parameters, except its texels.
#[derive(Clone, Debug)]
pub(super) struct SplatGradient {
    pub position: [f32; 3],
    pub quaternion: [f32; 4],
    pub log_scale: [f32; 2],
    pub opacity: f32,
    /// Zero above the degree in use. `[16, 3]`
    pub sh: [f32; 48],
    /// Floats of `sh` up to the degree in use.
    pub sh_floats: usize,
}

/// Applies the chain rule to `sums`, the sums over all pairs of the splat.
pub(super) fn project_bwd(
    model: &Model,
    splat: &ProjectedSplat,
    sums: &[f32; HEADER_FLOATS],
    view: &ViewF32,
    sh_degree: u32,
) -> SplatGradient {
    let s = |sum: Sum| sums[sum as usize];
    let i = splat.id as usize;
    let sh_degree = sh_degree.min(model.splats.sh_degrees()[i].into());
    let by_pixels = screen_bwd(splat, sums, view);
    let screen = filter_bwd(splat, sums, &by_pixels, view);
    let (by_centre, by_axes) = map_bwd(splat, sums, &by_pixels, &screen, view);
    let mut out = SplatGradient {
        position: view.rotate_back(by_centre),
        quaternion: [0.0; 4],
        log_scale: screen.log_scale,
        opacity: s(Sum::Opacity) * splat.opacity * (1.0 - splat.stored_opacity),
        sh: [0.0; 48],
        sh_floats: 3 * sh_coefficients(sh_degree),
    };
    let stored = [0, 1, 2, 3].map(|k| model.splats.quaternions[4 * i + k]);
    out.quaternion = quaternion_bwd(stored, by_axes.map(|axis| view.rotate_back(axis)));

    let by_rgb = [Sum::Red, Sum::Green, Sum::Blue].map(s);
    let by_rgb = [0, 1, 2].map(|c| if splat.rgb_positive[c] { by_rgb[c] } else { 0.0 });
    let (direction, distance) = view_direction(model, i, view);
    let basis = sh_basis(sh_degree, direction);
    let slopes = sh_basis_derivative(sh_degree, direction);
    let held = model.splats.sh_of(i);
    let mut by_direction = [0.0; 3];
    for k in 0..sh_coefficients(sh_degree) {
        (0..3).for_each(|c| out.sh[3 * k + c] = basis[k] * by_rgb[c]);
        let sh = &held[3 * k..][..3];
        let along = dot([sh[0], sh[1], sh[2]], by_rgb);
        (0..3).for_each(|c| by_direction[c] += slopes[k][c] * along);
    }
    let radial = dot(direction, by_direction);
    (0..3).for_each(|c| out.position[c] += (by_direction[c] - direction[c] * radial) / distance);
    out
}

/// Derivatives with respect to the map from pixels to standard deviations at the centre, by rows, and to the log-scales.
struct ScreenGradient {
    a: [f32; 2],
    b: [f32; 2],
    log_scale: [f32; 2],
}

/// From the filtered coordinates back to standard deviations, with what passes through the filter itself: its covariance on
/// the surfel follows from the map, and the opacity is divided by the root of the spread's determinant.
fn filter_bwd(
    splat: &ProjectedSplat,
    sums: &[f32; HEADER_FLOATS],
    by_pixels: &ScreenSums,
    view: &ViewF32,
) -> ScreenGradient {
    let s = |sum: Sum| sums[sum as usize];
    let Spread { u_a, v_a, v_b } = splat.spread;
    let by_thinning = s(Sum::Opacity) * splat.opacity;
    // By the spread's covariance, times 2: L^-T (sums - by_thinning I) L^-1.
    let (aa, ab, bb) =
        (s(Sum::ExponentAA) - by_thinning, s(Sum::ExponentAB), s(Sum::ExponentBB) - by_thinning);
    let vv = bb / (v_b * v_b);
    let uv = (ab / v_b - v_a * vv) / u_a;
    let uu = (aa / u_a - v_a * (ab / (u_a * v_b) + uv)) / u_a;
    let f = view.filter_px2;
    // The map from pixels to standard deviations.
    let a = splat.a.map(|v| u_a * v);
    let b = [0, 1].map(|k| v_a * splat.a[k] + v_b * splat.b[k]);
    let (numerator_a, numerator_b) = (by_pixels.a, by_pixels.b);
    ScreenGradient {
        a: [0, 1].map(|k| (numerator_a[k] - numerator_b[k] * v_a / v_b) / u_a + f * (uu * a[k] + uv * b[k])),
        b: [0, 1].map(|k| numerator_b[k] / v_b + f * (uv * a[k] + vv * b[k])),
        log_scale: [uu + by_thinning, vv + by_thinning],
    }
}

/// Derivatives with respect to the centre and the three surfel axes, in camera axes.
fn map_bwd(
    splat: &ProjectedSplat,
    sums: &[f32; HEADER_FLOATS],
    by_pixels: &ScreenSums,
    screen: &ScreenGradient,
    view: &ViewF32,
) -> ([f32; 3], [[f32; 3]; 3]) {
    let s = |sum: Sum| sums[sum as usize];
    let p = splat.centre_in_camera;
    let [e_u, e_v, n] = splat.axes_in_camera;
    let [fx, fy] = view.focal_px;
    let w0 = dot(p, n) / p[2];
    let numerator = |x: f32, y: f32| [x / (fx * w0), y / (fy * w0), 0.0];
    // The map in standard deviations is the map in local units over sigma.
    let [by_cross_a, by_cross_b] = [(screen.a, splat.scales[0]), (screen.b, splat.scales[1])]
        .map(|(by, scale)| numerator(by[0] / scale, by[1] / scale));
    let Spread { u_a, v_a, v_b } = splat.spread;
    let along = screen.a[0] * u_a * splat.a[0]
        + screen.a[1] * u_a * splat.a[1]
        + screen.b[0] * (v_a * splat.a[0] + v_b * splat.b[0])
        + screen.b[1] * (v_a * splat.a[1] + v_b * splat.b[1])
        + by_pixels.g[0] * splat.g[0]
        + by_pixels.g[1] * splat.g[1];
    let by_w0 = -along / w0;
    let by_g = numerator(by_pixels.g[0], by_pixels.g[1]);
    let direct = [Sum::NormalX, Sum::NormalY, Sum::NormalZ].map(s);
    let by_n = [0, 1, 2].map(|k| by_g[k] + by_w0 * p[k] / p[2] + direct[k]);
    let centre_px = by_pixels.centre_px;
    let by_projection = [
        centre_px[0] * fx / p[2],
        centre_px[1] * fy / p[2],
        s(Sum::Depth) - (centre_px[0] * fx * p[0] + centre_px[1] * fy * p[1]) / (p[2] * p[2]),
    ];
    let (from_a, from_b) = (cross(by_cross_a, e_v), cross(e_u, by_cross_b));
    let by_plane = [n[0] / p[2], n[1] / p[2], n[2] / p[2] - w0 / p[2]];
    let by_centre = [0, 1, 2].map(|k| from_a[k] + from_b[k] + by_w0 * by_plane[k] + by_projection[k]);
    (by_centre, [cross(by_cross_b, p), cross(p, by_cross_a), by_n])
}

/// Derivative with respect to a stored quaternion (wxyz) from those by the columns of its rotation.
fn quaternion_bwd(stored: [f32; 4], columns: [[f32; 3]; 3]) -> [f32; 4] {
    let norm = stored.iter().map(|q| q * q).sum::<f32>().sqrt();
    let [w, x, y, z] = stored.map(|q| q / norm);
    let m = |row: usize, col: usize| columns[col][row];
    let by_unit = [
        2.0 * (z * (m(1, 0) - m(0, 1)) + y * (m(0, 2) - m(2, 0)) + x * (m(2, 1) - m(1, 2))),
        2.0 * (y * (m(0, 1) + m(1, 0)) + z * (m(0, 2) + m(2, 0)) + w * (m(2, 1) - m(1, 2))
            - 2.0 * x * (m(1, 1) + m(2, 2))),
        2.0 * (x * (m(0, 1) + m(1, 0)) + w * (m(0, 2) - m(2, 0)) + z * (m(1, 2) + m(2, 1))
            - 2.0 * y * (m(0, 0) + m(2, 2))),
        2.0 * (w * (m(1, 0) - m(0, 1)) + x * (m(0, 2) + m(2, 0)) + y * (m(1, 2) + m(2, 1))
            - 2.0 * z * (m(0, 0) + m(1, 1))),
    ];
    let unit = [w, x, y, z];
    let along: f32 = unit.iter().zip(&by_unit).map(|(q, d)| q * d).sum();
    [0, 1, 2, 3].map(|k| (by_unit[k] - unit[k] * along) / norm)
}
