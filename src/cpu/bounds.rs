//! Pixel bounds and row spans of a splat (twin: `reference/bounds.rs`), from which the tile lists follow.

use super::view::ViewF32;
use crate::constants::{ALPHA_MIN, CONIC_MARGIN};

/// Spans are widened by this to absorb rounding: f32 centres of pixels far from the origin are off by up to 1e-4 px
/// (measured: test `no_pixel_lies_outside_its_bounds`).
const MARGIN_PX: f32 = 0.01;

/// Where a splat can reach alpha 1/255: a box of pixels, and within it an ellipse or the whole box.
#[derive(Clone, Copy, Debug)]
pub(super) struct Bounds {
    /// Half-open ranges of pixels.
    pub x0: i32,
    pub x1: i32,
    pub y0: i32,
    pub y1: i32,
    centre_px: [f32; 2],
    /// 1 / half height; 0 where every row spans the whole box.
    per_half_height: f32,
    /// Shift of a span's middle per row.
    shear: f32,
    /// Half length of the span through the centre.
    half_span_px: f32,
}

impl Bounds {
    /// Half-open range of the pixels of row `y` that may be inside.
    #[inline(always)]
    pub(super) fn row_span(&self, y: i32) -> (i32, i32) {
        let dy = y as f32 + 0.5 - self.centre_px[1];
        let t = dy * self.per_half_height;
        let half = self.half_span_px * (1.0 - t * t).max(0.0).sqrt() + MARGIN_PX;
        let middle = self.centre_px[0] + self.shear * dy - 0.5;
        let first = (middle - half).ceil() as i32;
        let past = (middle + half).floor() as i32 + 1;
        (first.max(self.x0), past.min(self.x1))
    }
}

/// Bounds of a splat of conjugate `half_axes`, on whose ellipse the falloff is that of a standard deviation; `None` where no
/// pixel centre lies within.
pub(super) fn bounds(
    p: [f32; 3],
    half_axes: [[f32; 3]; 2],
    opacity: f32,
    centre_px: [f32; 2],
    view: &ViewF32,
) -> Option<Bounds> {
    let r2 = 2.0 * (opacity / ALPHA_MIN as f32).ln();
    if r2 < 0.0 {
        return None;
    }
    conic(p, half_axes, r2, centre_px, view).or_else(|| clipped(p, half_axes, r2.sqrt(), view))?.within(view)
}

impl Bounds {
    /// Clips the box to the image; `None` if it becomes empty.
    fn within(mut self, view: &ViewF32) -> Option<Self> {
        self.x0 = self.x0.max(0);
        self.y0 = self.y0.max(0);
        self.x1 = self.x1.min(view.size_px[0] as i32);
        self.y1 = self.y1.min(view.size_px[1] as i32);
        (self.x0 < self.x1 && self.y0 < self.y1).then_some(self)
    }
}

/// Half-open range of the pixels whose centres lie in `[low, high]`, widened by the margin; saturates.
fn pixels(low: f32, high: f32) -> (i32, i32) {
    ((low - 0.5 - MARGIN_PX).ceil() as i32, ((high - 0.5 + MARGIN_PX).floor() as i32).saturating_add(1))
}

/// The ellipse that the disc projects to, from homography rows relative to the projected centre; `None` if the disc
/// reaches the camera plane, where the conic is not an ellipse.
fn conic(
    p: [f32; 3],
    half_axes: [[f32; 3]; 2],
    r2: f32,
    centre_px: [f32; 2],
    view: &ViewF32,
) -> Option<Bounds> {
    let row = |e: [f32; 3]| {
        let t = [0, 1].map(|i| view.focal_px[i] * (e[i] - p[i] / p[2] * e[2]));
        (t, e[2])
    };
    let ((t0, w0), (t1, w1)) = (row(half_axes[0]), row(half_axes[1]));
    let denominator = r2 * (w0 * w0 + w1 * w1) - p[2] * p[2];
    if denominator > -(CONIC_MARGIN as f32) * p[2] * p[2] {
        return None;
    }
    let f = r2 / denominator;
    let offset = [0, 1].map(|i| (t0[i] * w0 + t1[i] * w1) * f);
    let half2 = [0, 1].map(|i| (offset[i] * offset[i] - (t0[i] * t0[i] + t1[i] * t1[i]) * f).max(0.0));
    let covariance = offset[0] * offset[1] - (t0[0] * t0[1] + t1[0] * t1[1]) * f;
    let half = half2.map(f32::sqrt);
    let centre = [0, 1].map(|i| centre_px[i] + offset[i]);
    let (x0, x1) = pixels(centre[0] - half[0], centre[0] + half[0]);
    let (y0, y1) = pixels(centre[1] - half[1], centre[1] + half[1]);
    // For needles the difference cancels with an error of order f32::EPSILON * half2: widen by that much.
    let height2 = half2[1].max(f32::MIN_POSITIVE);
    let span2 = (half2[0] - covariance * covariance / height2).max(0.0) + 4e-6 * half2[0];
    let flat = half[1] < 1e-3;
    Some(Bounds {
        x0,
        x1,
        y0,
        y1,
        centre_px: centre,
        per_half_height: if flat { 0.0 } else { 1.0 / (half[1] + MARGIN_PX) },
        shear: if flat { 0.0 } else { covariance / height2 },
        half_span_px: if flat { half[0] } else { span2.sqrt() },
    })
}

/// Box of the disc's bounding quad, clipped at the near plane.
fn clipped(p: [f32; 3], [u, v]: [[f32; 3]; 2], r: f32, view: &ViewF32) -> Option<Bounds> {
    let corner = |su: f32, sv: f32| [0, 1, 2].map(|i| p[i] + u[i] * (su * r) + v[i] * (sv * r));
    let quad = [corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)];
    let mut low = [f32::INFINITY; 2];
    let mut high = [f32::NEG_INFINITY; 2];
    let mut add = |v: [f32; 3]| {
        for i in 0..2 {
            let px = view.focal_px[i] * v[i] / v[2] + view.principal_px[i];
            low[i] = low[i].min(px);
            high[i] = high[i].max(px);
        }
    };
    for k in 0..4 {
        let (from, to) = (quad[k], quad[(k + 1) % 4]);
        if from[2] >= view.near {
            add(from);
        }
        if (from[2] >= view.near) != (to[2] >= view.near) {
            let t = (view.near - from[2]) / (to[2] - from[2]);
            let mut crossing = [0, 1, 2].map(|i| from[i] + (to[i] - from[i]) * t);
            crossing[2] = view.near;
            add(crossing);
        }
    }
    if low[0] > high[0] {
        return None;
    }
    // Rounding of distant intersections: widen by a relative 1e-5.
    let slack = [0, 1].map(|i| 1e-5 * (high[i].abs() + low[i].abs()));
    let (x0, x1) = pixels(low[0] - slack[0], high[0] + slack[0]);
    let (y0, y1) = pixels(low[1] - slack[1], high[1] + slack[1]);
    Some(Bounds {
        x0,
        x1,
        y0,
        y1,
        centre_px: [0.0; 2],
        per_half_height: 0.0,
        shear: 0.0,
        // Wider than any image: row spans are clipped to the box.
        half_span_px: 1e9,
    })
}
