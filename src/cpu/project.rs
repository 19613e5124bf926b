//! Projects the splats to a view and computes their bounds and base colours (twin: `reference/project.rs`).

use super::bounds::{Bounds, bounds};
use super::math::{cross, dot};
use super::view::ViewF32;
use crate::constants::{
    ALPHA_MIN, BASE_RGB_MAX, EDGE_ON_MIN, FOOTPRINT_TEXELS_MAX, SH_0, SH_1, SH_2, SH_3, sh_coefficients,
};
use crate::model::{Model, TextureMap};
use rayon::prelude::*;

/// A splat projected to a view. Coordinates on the surfel are those in which the filtered falloff is round: the falloff is
/// exp(-(a^2 + b^2) / 2). Without a filter they are standard deviations along u and v.
#[derive(Clone, Copy, Debug)]
pub(super) struct ProjectedSplat {
    /// Index in the model.
    pub id: u32,
    pub centre_px: [f32; 2],
    /// Numerator of the first coordinate, per pixel.
    pub a: [f32; 2],
    /// Numerator of the second coordinate, per pixel.
    pub b: [f32; 2],
    /// Gradient of the denominator, per pixel.
    pub g: [f32; 2],
    pub depth: f32,
    /// After the filter.
    pub opacity: f32,
    pub stored_opacity: f32,
    pub spread: Spread,
    pub scales: [f32; 2],
    /// Base colour, clamped at zero; set by [`base_colours`].
    pub rgb: [f32; 3],
    /// Channels whose base colour was not clamped.
    pub rgb_positive: [bool; 3],
    pub bounds: Bounds,
    pub centre_in_camera: [f32; 3],
    pub axes_in_camera: [[f32; 3]; 3],
    pub map: MapView,
}

impl ProjectedSplat {
    /// 1 if the normal faces the camera, else -1.
    pub(super) fn facing(&self) -> f32 {
        if dot(self.axes_in_camera[2], self.centre_in_camera) > 0.0 { -1.0 } else { 1.0 }
    }
}

/// What the low-pass filter does to a splat (method 2.5): standard deviations along u and v are `[u_a a, v_a a + v_b b]` of
/// the filtered coordinates, by the Cholesky factor of the filtered falloff's covariance.
#[derive(Clone, Copy, Debug)]
pub(super) struct Spread {
    pub u_a: f32,
    pub v_a: f32,
    pub v_b: f32,
}

impl Spread {
    /// From the map from pixels to standard deviations at the centre, by rows, and its determinant, which would lose
    /// digits if computed from them where the splat is seen edge-on.
    fn new(a: [f32; 2], b: [f32; 2], determinant: f32, filter_px2: f32) -> Self {
        let along = |x: [f32; 2], y: [f32; 2]| filter_px2 * (x[0] * y[0] + x[1] * y[1]);
        let u_a = (1.0 + along(a, a)).sqrt();
        let area = filter_px2 * determinant;
        let squared = 1.0 + along(a, a) + along(b, b) + area * area;
        Self { u_a, v_a: along(a, b) / u_a, v_b: squared.sqrt() / u_a }
    }

    /// How much of the opacity is left: the filter thins what it widens.
    fn thinning(&self) -> f32 {
        1.0 / (self.u_a * self.v_b)
    }
}

/// A splat's texture map, in the form that the kernels sample.
#[derive(Clone, Copy, Debug)]
pub(super) struct MapView {
    pub rows: i32,
    pub cols: i32,
    /// First float of the map's activated texels in the view's pool, `[rows, cols, 3]`.
    pub first: u32,
    /// Texels along u and v per standard deviation, times the spread.
    pub texels_per_coordinate: Spread,
    /// Texture coordinate of the surfel's centre.
    pub origin: [f32; 2],
    pub footprint: Footprint,
}

/// The area of a texture map that a sample takes the mean over (method 2.5). Its size along an axis is the number of texels
/// per pixel for many, and one for less than one, which is bilinear interpolation.
#[derive(Clone, Copy, Debug)]
pub(super) struct Footprint {
    /// Whether it is larger than a texel.
    pub is_minified: bool,
    /// Distance along rows and columns at which a texel's weight ends, in texels.
    pub reach: [f32; 2],
    /// 1 over its area in texels.
    pub per_area: f32,
}

impl Footprint {
    const TEXEL: Self = Self { is_minified: false, reach: [1.0; 2], per_area: 1.0 };

    /// From the gradients of the texture coordinates in the image.
    fn new(texels_per_px: [[f32; 2]; 2]) -> Self {
        let [u, v] = texels_per_px
            .map(|[x, y]| (2.0 * (x * x + y * y) - 1.0).max(1.0).sqrt().min(FOOTPRINT_TEXELS_MAX as f32));
        Self {
            is_minified: u.max(v) > 1.0,
            reach: [0.5 * (u + 1.0), 0.5 * (v + 1.0)],
            per_area: 1.0 / (u * v),
        }
    }
}

impl MapView {
    /// Whether the splat has a map; most have none.
    #[inline(always)]
    pub(super) fn has_texels(&self) -> bool {
        self.rows > 0
    }

    fn new(
        map: &TextureMap,
        scales: [f32; 2],
        spread: Spread,
        [a, b]: [[f32; 2]; 2],
        filtered: bool,
    ) -> Self {
        // An empty map may have a texel size of zero.
        let [u, v] = [0, 1].map(|k| if map.rows == 0 { 0.0 } else { scales[k] / map.texel_sizes[k] });
        let texels = Spread { u_a: u * spread.u_a, v_a: v * spread.v_a, v_b: v * spread.v_b };
        let along_u = [0, 1].map(|k| texels.u_a * a[k]);
        let along_v = [0, 1].map(|k| texels.v_a * a[k] + texels.v_b * b[k]);
        Self {
            rows: i32::from(map.rows),
            cols: i32::from(map.cols),
            first: 0,
            texels_per_coordinate: texels,
            origin: map.origin(),
            footprint: if filtered { Footprint::new([along_u, along_v]) } else { Footprint::TEXEL },
        }
    }
}

/// Projects all splats; the result keeps the order of their indices and omits culled ones.
pub(super) fn project_all(model: &Model, view: &ViewF32) -> Vec<ProjectedSplat> {
    (0..model.num_splats())
        .into_par_iter()
        .with_min_len(256)
        .filter_map(|i| project(model, i, view))
        .collect()
}

fn project(model: &Model, i: usize, view: &ViewF32) -> Option<ProjectedSplat> {
    let s = &model.splats;
    let position = [0, 1, 2].map(|k| s.positions[3 * i + k]);
    let rotated = view.rotate(position);
    let p = [0, 1, 2].map(|k| rotated[k] + view.translation[k]);
    let scales = [0, 1].map(|k| s.log_scales[2 * i + k].exp());
    let stored_opacity = 1.0 / (1.0 + (-s.opacity_logits[i]).exp());
    let columns = rotation_columns([0, 1, 2, 3].map(|k| s.quaternions[4 * i + k]));
    let axes = columns.map(|c| view.rotate(c));
    let [e_u, e_v, n] = axes;
    let p_n = dot(p, n);
    let finite = (p_n + p[0] + p[1] + p[2] + stored_opacity).is_finite()
        && scales.iter().all(|s| s.is_finite() && *s > f32::MIN_POSITIVE);
    if !finite || p[2] < view.near || stored_opacity < ALPHA_MIN as f32 {
        return None;
    }
    if p_n.abs() < EDGE_ON_MIN as f32 * dot(p, p).sqrt() {
        return None;
    }
    let [cross_a, cross_b] = [cross(e_v, p), cross(p, e_u)];
    let w0 = p_n / p[2];
    let per_px = [1.0 / (view.focal_px[0] * w0), 1.0 / (view.focal_px[1] * w0)];
    let centre_px = [0, 1].map(|k| view.focal_px[k] * p[k] / p[2] + view.principal_px[k]);
    let a = [0, 1].map(|k| cross_a[k] * per_px[k] / scales[0]);
    let b = [0, 1].map(|k| cross_b[k] * per_px[k] / scales[1]);
    let g = [0, 1].map(|k| n[k] * per_px[k]);
    if ![a, b, g, centre_px].iter().flatten().all(|v| v.is_finite()) {
        return None;
    }
    let determinant = per_px[0] / scales[0] * (p[2] / (view.focal_px[1] * scales[1])) * p[2];
    let spread = Spread::new(a, b, determinant, view.filter_px2);
    let opacity = stored_opacity * spread.thinning();
    // Also if it is not a number, which huge entries of the map make it.
    if opacity.is_nan() || opacity < ALPHA_MIN as f32 {
        return None;
    }
    let a = a.map(|v| v / spread.u_a);
    let b = [0, 1].map(|k| (b[k] - spread.v_a * a[k]) / spread.v_b);
    let half_u = [0, 1, 2].map(|k| spread.u_a * scales[0] * e_u[k] + spread.v_a * scales[1] * e_v[k]);
    let half_v = e_v.map(|v| spread.v_b * scales[1] * v);
    let bounds = bounds(p, [half_u, half_v], opacity, centre_px, view)?;
    Some(ProjectedSplat {
        id: i as u32,
        centre_px,
        a,
        b,
        g,
        depth: p[2],
        opacity,
        stored_opacity,
        spread,
        scales,
        rgb: [0.0; 3],
        rgb_positive: [false; 3],
        bounds,
        centre_in_camera: p,
        axes_in_camera: axes,
        map: MapView::new(&model.textures.maps[i], scales, spread, [a, b], view.filter_px2 > 0.0),
    })
}

/// Columns of the rotation of a quaternion wxyz of any length; NaN for length zero.
pub(super) fn rotation_columns(q: [f32; 4]) -> [[f32; 3]; 3] {
    let norm = (q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]).sqrt();
    let [w, x, y, z] = q.map(|v| v / norm);
    [
        [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y + w * z), 2.0 * (x * z - w * y)],
        [2.0 * (x * y - w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z + w * x)],
        [2.0 * (x * z + w * y), 2.0 * (y * z - w * x), 1.0 - 2.0 * (x * x + y * y)],
    ]
}

/// Sets the base colours: SH in the direction from the camera, clamped at zero.
pub(super) fn base_colours(model: &Model, view: &ViewF32, degree: u32, splats: &mut [ProjectedSplat]) {
    splats.par_iter_mut().with_min_len(256).for_each(|splat| {
        let i = splat.id as usize;
        let (direction, _) = view_direction(model, i, view);
        let degree = degree.min(model.splats.sh_degrees()[i].into());
        let basis = sh_basis(degree, direction);
        let mut rgb = [0.5_f32; 3];
        let sh = model.splats.sh_of(i).as_chunks::<3>().0;
        for (y, sh) in basis[..sh_coefficients(degree)].iter().zip(sh) {
            (0..3).for_each(|c| rgb[c] += y * sh[c]);
        }
        splat.rgb_positive = rgb.map(|v| v > 0.0);
        // Keeps poisoned coefficients from spreading: NaN becomes 0, and squares in the loss stay finite.
        splat.rgb = rgb.map(|v| if v.is_nan() { 0.0 } else { v.clamp(0.0, BASE_RGB_MAX as f32) });
    });
}

/// Unit direction from the camera to a splat in the local frame, and the distance.
pub(super) fn view_direction(model: &Model, i: usize, view: &ViewF32) -> ([f32; 3], f32) {
    let offset = [0, 1, 2].map(|k| model.splats.positions[3 * i + k] - view.centre_in_local[k]);
    let length = dot(offset, offset).sqrt();
    (offset.map(|v| v / length), length)
}

/// The SH basis at a unit direction; functions above `degree` are 0.
pub(super) fn sh_basis(degree: u32, [x, y, z]: [f32; 3]) -> [f32; 16] {
    let mut out = [0.0; 16];
    out[0] = SH_0 as f32;
    if degree >= 1 {
        let k = SH_1 as f32;
        out[1..4].copy_from_slice(&[-k * y, k * z, -k * x]);
    }
    if degree >= 2 {
        let band = [x * y, y * z, 2.0 * z * z - x * x - y * y, x * z, x * x - y * y];
        (0..5).for_each(|k| out[4 + k] = SH_2[k] as f32 * band[k]);
    }
    if degree >= 3 {
        let (xx, yy, zz) = (x * x, y * y, z * z);
        let band = [
            y * (3.0 * xx - yy),
            x * y * z,
            y * (4.0 * zz - xx - yy),
            z * (2.0 * zz - 3.0 * xx - 3.0 * yy),
            x * (4.0 * zz - xx - yy),
            z * (xx - yy),
            x * (xx - 3.0 * yy),
        ];
        (0..7).for_each(|k| out[9 + k] = SH_3[k] as f32 * band[k]);
    }
    out
}

/// Derivatives of [`sh_basis`] with respect to the components of the direction, treated as independent.
pub(super) fn sh_basis_derivative(degree: u32, [x, y, z]: [f32; 3]) -> [[f32; 3]; 16] {
    let mut out = [[0.0; 3]; 16];
    if degree >= 1 {
        let k = SH_1 as f32;
        out[1] = [0.0, -k, 0.0];
        out[2] = [0.0, 0.0, k];
        out[3] = [-k, 0.0, 0.0];
    }
    if degree >= 2 {
        let band =
            [[y, x, 0.0], [0.0, z, y], [-2.0 * x, -2.0 * y, 4.0 * z], [z, 0.0, x], [2.0 * x, -2.0 * y, 0.0]];
        (0..5).for_each(|k| out[4 + k] = band[k].map(|v| v * SH_2[k] as f32));
    }
    if degree >= 3 {
        let (xx, yy, zz) = (x * x, y * y, z * z);
        let band = [
            [6.0 * x * y, 3.0 * xx - 3.0 * yy, 0.0],
            [y * z, x * z, x * y],
            [-2.0 * x * y, 4.0 * zz - xx - 3.0 * yy, 8.0 * y * z],
            [-6.0 * x * z, -6.0 * y * z, 6.0 * zz - 3.0 * xx - 3.0 * yy],
            [4.0 * zz - 3.0 * xx - yy, -2.0 * x * y, 8.0 * x * z],
            [2.0 * x * z, -2.0 * y * z, xx - yy],
            [3.0 * xx - 3.0 * yy, -6.0 * x * y, 0.0],
        ];
        (0..7).for_each(|k| out[9 + k] = band[k].map(|v| v * SH_3[k] as f32));
    }
    out
}
