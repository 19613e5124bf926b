//! Undistorts photos: resamples the rows of the image that a pinhole of the same size and principal point would have
//! taken. The lens models are in `lens.rs`.

use super::lens::Lens;
use crate::camera::Pinhole;
use glam::{DMat2, DVec2};

/// Accuracy and most steps of Newton's method for the inverse of a distortion.
const NEWTON_PX: f64 = 1e-6;
const NEWTON_STEPS: u32 = 50;

/// Distance over which a distortion's slope is taken, pixels.
const SLOPE_PX: f64 = 1e-3;

/// Most times that a step is halved.
const HALVINGS: i32 = 20;

/// Samples a distorted image along the rows of its pinhole image.
pub(crate) struct Warp {
    lens: Lens,
    /// Of the same size and principal point as the lens.
    pinhole: Pinhole,
    /// Rays farther from the axis than this, on z = 1, were imaged twice or not at all.
    max_radius: f64,
}

impl Warp {
    /// A warp for a lens given at the image's size, to a pinhole whose focal length is `focal_scale` times the lens's.
    pub fn new(lens: Lens, focal_scale: f64) -> Self {
        let pinhole = with_focal_scale(&lens.pinhole, focal_scale);
        let c = &pinhole;
        let corner = |x: f64, y: f64| c.direction_in_camera(DVec2::new(x, y)).truncate().length();
        let (w, h) = (f64::from(c.width_px), f64::from(c.height_px));
        let farthest = corner(0.0, 0.0).max(corner(w, 0.0)).max(corner(0.0, h)).max(corner(w, h));
        Self { lens, pinhole, max_radius: lens.distortion.monotonic_radius(farthest) }
    }

    /// Where a position in the pinhole image lies in the distorted image, which may end before; `None` if the lens does
    /// not image it.
    pub fn distorted_px(&self, at_px: DVec2) -> Option<DVec2> {
        let undistorted = self.pinhole.direction_in_camera(at_px).truncate();
        if undistorted.length() > self.max_radius {
            return None;
        }
        let c = &self.lens.pinhole;
        let distorted = self.lens.distortion.distort(undistorted);
        Some(DVec2::new(distorted.x * c.fx_px + c.cx_px, distorted.y * c.fy_px + c.cy_px))
    }

    /// Where a position in the distorted image lies in the pinhole image; `None` if no ray of the pinhole leads there.
    pub fn undistorted_px(&self, at_px: DVec2) -> Option<DVec2> {
        let c = &self.lens.pinhole;
        let is_inside = |v: f64, size: u32| (0.0..=f64::from(size)).contains(&v);
        if !(is_inside(at_px.x, c.width_px) && is_inside(at_px.y, c.height_px)) {
            return None;
        }
        let error = |guess: DVec2| self.distorted_px(guess).map(|px| px - at_px);
        // Newton's method in pixels, in steps as long as they bring it nearer: beyond the largest radius there is nothing.
        let middle = DVec2::new(c.cx_px, c.cy_px);
        let (mut guess, mut off) = (middle, error(middle)?);
        for _ in 0..NEWTON_STEPS {
            if off.length() < NEWTON_PX {
                return Some(guess);
            }
            // Slopes towards the middle, where the lens surely images.
            let slope = |axis: DVec2| {
                let d = axis * SLOPE_PX * if (middle - guess).dot(axis) < 0.0 { -1.0 } else { 1.0 };
                Some((error(guess + d)? - off) / d.dot(axis))
            };
            let step = DMat2::from_cols(slope(DVec2::X)?, slope(DVec2::Y)?).inverse() * off;
            let nearer = (0..HALVINGS).find_map(|halvings| {
                let next = guess - step * 0.5_f64.powi(halvings);
                error(next).filter(|e| e.length() < off.length()).map(|e| (next, e))
            });
            (guess, off) = nearer?;
        }
        None
    }

    /// Where pixel `(x, y)` of the pinhole image lies in the distorted image; `None` outside.
    pub fn source_px(&self, x: usize, y: usize) -> Option<DVec2> {
        let at = self.distorted_px(DVec2::new(x as f64 + 0.5, y as f64 + 0.5))?;
        let c = &self.lens.pinhole;
        let inside =
            at.x >= 0.0 && at.y >= 0.0 && at.x <= f64::from(c.width_px) && at.y <= f64::from(c.height_px);
        inside.then_some(at)
    }

    /// Writes row `y`: the image's channels times validity, then validity (0 or 1).
    /// `pixel(x, y)` gives the channels of the distorted image. `[width, CHANNELS + 1]`
    pub fn fill_row<const CHANNELS: usize>(
        &self,
        y: usize,
        row: &mut [f32],
        pixel: impl Fn(usize, usize) -> [f32; CHANNELS],
    ) {
        let last_x = self.lens.pinhole.width_px as usize - 1;
        let last_y = self.lens.pinhole.height_px as usize - 1;
        for (x, out) in row.chunks_exact_mut(CHANNELS + 1).enumerate() {
            let Some(at) = self.source_px(x, y) else {
                out.fill(0.0);
                continue;
            };
            // Bilinear between pixel centres; the outermost half pixel repeats the border.
            let (u, v) = ((at.x - 0.5).max(0.0), (at.y - 0.5).max(0.0));
            let (x0, y0) = ((u as usize).min(last_x), (v as usize).min(last_y));
            let (x1, y1) = ((x0 + 1).min(last_x), (y0 + 1).min(last_y));
            let (fx, fy) = ((u - x0 as f64) as f32, (v - y0 as f64) as f32);
            let [a, b, c, d] = [pixel(x0, y0), pixel(x1, y0), pixel(x0, y1), pixel(x1, y1)];
            for channel in 0..CHANNELS {
                let upper = a[channel] + fx * (b[channel] - a[channel]);
                let lower = c[channel] + fx * (d[channel] - c[channel]);
                out[channel] = upper + fy * (lower - upper);
            }
            out[CHANNELS] = 1.0;
        }
    }
}

/// A pinhole of the same size and principal point with another focal length.
pub(crate) fn with_focal_scale(pinhole: &Pinhole, focal_scale: f64) -> Pinhole {
    Pinhole { fx_px: pinhole.fx_px * focal_scale, fy_px: pinhole.fy_px * focal_scale, ..*pinhole }
}
