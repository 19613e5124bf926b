//! Rasterised fragments: the pixels whose centres lie in a splat's support, hidden or not (twin: `reference/fragments.rs`).
//!
//! Neither density control nor the commands that report them need a backend for it. A pixel's ray meets the surfel in the support if
//! `|A d|^2 <= r^2 D^2`, with d its offset from the projected centre, `D = 1 + g . d` (method 2.2), A the map to the
//! coordinates in which the falloff is round, and r the radius where alpha falls to 1/255. On a row of pixels that is a quadratic
//! inequality for one unknown, so that the fragments of a row are counted at once.

use crate::camera::Camera;
use crate::constants::{ALPHA_MIN, DENOMINATOR_MIN, EDGE_ON_MIN};
use crate::model::Model;
use glam::{DMat2, DMat3, DQuat, DVec2, DVec3};
use rayon::prelude::*;

/// Splats that a thread counts at a time.
const SPLATS_PER_TASK: usize = 256;

/// Rasterised fragments of each splat over the pixels of a view, mean over the views; 0 without any. `[n]`
pub fn rasterised_fragments(model: &Model, cameras: &[Camera]) -> Vec<f64> {
    let per_pixel = |splat: &Surfel, camera: &Camera| {
        let found = splat.projected(model, camera).map_or(0, |projected| projected.fragments());
        found as f64 / camera.pinhole.num_pixels() as f64
    };
    let of_splat = |i: usize| {
        let splat = Surfel::of(model, i);
        cameras.iter().map(|camera| per_pixel(&splat, camera)).sum::<f64>() / cameras.len().max(1) as f64
    };
    (0..model.num_splats()).into_par_iter().with_min_len(SPLATS_PER_TASK).map(of_splat).collect()
}

/// Shape and opacity of a splat.
struct Surfel {
    position: DVec3,
    axes: DMat3,
    scales: [f64; 2],
    opacity: f64,
}

/// Where a splat is seen in a view.
struct Support {
    size_px: [u32; 2],
    centre_px: DVec2,
    /// Columns of A: the round coordinates by an offset of a pixel to the right and down, at the centre.
    right: DVec2,
    down: DVec2,
    /// Gradient of the denominator.
    g: DVec2,
    /// Squared radius at which alpha falls to 1/255.
    r2: f64,
    /// Denominators of hits that are drawn: neither at infinity nor before the near plane.
    denominators: [f64; 2],
}

impl Surfel {
    fn of(model: &Model, i: usize) -> Self {
        let s = &model.splats;
        let number = |v: f32| f64::from(v);
        let [w, x, y, z] = [0, 1, 2, 3].map(|k| number(s.quaternions[4 * i + k]));
        Self {
            position: DVec3::from_array([0, 1, 2].map(|k| number(s.positions[3 * i + k]))),
            axes: DMat3::from_quat(DQuat::from_xyzw(x, y, z, w).normalize()),
            scales: [0, 1].map(|k| number(s.log_scales[2 * i + k]).exp()),
            opacity: 1.0 / (1.0 + (-number(s.opacity_logits[i])).exp()),
        }
    }

    /// The support in a view; `None` if the splat is culled.
    fn projected(&self, model: &Model, camera: &Camera) -> Option<Support> {
        let Self { position, axes, scales, opacity } = self;
        let (pinhole, near) = (&camera.pinhole, f64::from(model.near));
        let p = camera.camera_from_local.transform_point(*position);
        let [e_u, e_v, n] = [0, 1, 2].map(|k| camera.camera_from_local.rotation * axes.col(k));
        let finite = p.is_finite()
            && n.is_finite()
            && scales.iter().all(|s| s.is_finite() && *s > 0.0)
            && opacity.is_finite();
        if !finite || p.z < near || p.dot(n).abs() < EDGE_ON_MIN * p.length() {
            return None;
        }
        let centre_px = pinhole.project(p)?;
        let per_px = DVec2::new(1.0 / pinhole.fx_px, 1.0 / pinhole.fy_px) / (p.dot(n) / p.z);
        let a = e_v.cross(p).truncate() * per_px / scales[0];
        let b = p.cross(e_u).truncate() * per_px / scales[1];
        // The filter widens the falloff, and thins it by as much.
        let sigma_from_px = DMat2::from_cols(a, b).transpose();
        let spread =
            DMat2::IDENTITY + model.filter.variance_px2() * (sigma_from_px * sigma_from_px.transpose());
        let r2 = 2.0 * (opacity / spread.determinant().sqrt() / ALPHA_MIN).ln();
        if r2.is_nan() || r2 < 0.0 {
            return None;
        }
        // By the Cholesky factor of the spread.
        let along = spread.x_axis.x.sqrt();
        let shear = spread.x_axis.y / along;
        let across = (spread.determinant() / spread.x_axis.x).sqrt();
        let a = a / along;
        let b = (b - shear * a) / across;
        Some(Support {
            size_px: [pinhole.width_px, pinhole.height_px],
            centre_px,
            right: DVec2::new(a.x, b.x),
            down: DVec2::new(a.y, b.y),
            g: n.truncate() * per_px,
            r2,
            denominators: [DENOMINATOR_MIN, p.z / near],
        })
    }
}

impl Support {
    /// Number of pixels whose centres lie in it.
    fn fragments(&self) -> u64 {
        self.rows().map(|row| self.fragments_of_row(f64::from(row) + 0.5 - self.centre_px.y)).sum()
    }

    /// Rows that it may reach: all of the image where it is not an ellipse.
    fn rows(&self) -> std::ops::Range<u32> {
        let height = self.size_px[1];
        let [xx, xy, yy] = [
            self.right.length_squared() - self.r2 * self.g.x * self.g.x,
            self.right.dot(self.down) - self.r2 * self.g.x * self.g.y,
            self.down.length_squared() - self.r2 * self.g.y * self.g.y,
        ];
        let determinant = xx * yy - xy * xy;
        if !(xx > 0.0 && determinant > 0.0) {
            return 0..height;
        }
        let DVec2 { x, y } = self.g * self.r2 / determinant;
        let middle = DVec2::new(yy * x - xy * y, xx * y - xy * x);
        let half = (self.r2 * (1.0 + self.g.dot(middle)) * xx / determinant).sqrt();
        let at = self.centre_px.y + middle.y;
        // A row more than may be needed, for rounding.
        let row = |y: f64| y.clamp(0.0, f64::from(height)) as u32;
        row(at - half - 1.0)..row(at + half + 1.0)
    }

    /// Number of pixels of a row, `dy` below the projected centre, whose centres lie in it.
    fn fragments_of_row(&self, dy: f64) -> u64 {
        let (at_centre, denominator) = (self.down * dy, 1.0 + self.g.y * dy);
        // q(dx) = square dx^2 + 2 half dx + rest is at most 0 within.
        let square = self.right.length_squared() - self.r2 * self.g.x * self.g.x;
        let half = self.right.dot(at_centre) - self.r2 * self.g.x * denominator;
        let rest = at_centre.length_squared() - self.r2 * denominator * denominator;
        let discriminant = half * half - square * rest;
        let Some([first, last]) = self.drawn(denominator) else { return 0 };
        let within = |low: f64, high: f64| self.centres_between(low.max(first), high.min(last));
        if discriminant < 0.0 {
            return if square < 0.0 { within(f64::NEG_INFINITY, f64::INFINITY) } else { 0 };
        }
        let root = discriminant.sqrt();
        let [low, high] = [-half - root, -half + root].map(|end| end / square);
        if square > 0.0 {
            within(low, high)
        } else {
            // Beyond the roots, whose order is reversed: the denominator is positive beyond one of them only.
            within(f64::NEG_INFINITY, high) + within(low, f64::INFINITY)
        }
    }

    /// Offsets along a row between which hits are drawn, by the denominator in the middle of the row; `None`: nowhere.
    fn drawn(&self, denominator: f64) -> Option<[f64; 2]> {
        let [least, most] = self.denominators;
        if self.g.x == 0.0 {
            return (least..=most).contains(&denominator).then_some([f64::NEG_INFINITY, f64::INFINITY]);
        }
        let [a, b] = [least, most].map(|end| (end - denominator) / self.g.x);
        Some([a.min(b), a.max(b)])
    }

    /// Number of pixel centres of a row between two offsets from the projected centre.
    fn centres_between(&self, low: f64, high: f64) -> u64 {
        let width = f64::from(self.size_px[0]);
        let first = (low + self.centre_px.x - 0.5).ceil().max(0.0);
        let past = ((high + self.centre_px.x - 0.5).floor() + 1.0).min(width);
        if past > first { (past - first) as u64 } else { 0 }
    }
}
