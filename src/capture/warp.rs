//! Undistorts photos: resamples the rows of the image that a pinhole of the same size and focal length would have
//! taken. The lens models are in `lens.rs`.

use super::lens::Lens;
use glam::DVec2;

/// Samples a distorted image along the rows of its pinhole image.
pub(crate) struct Warp {
    lens: Lens,
    /// Rays farther from the axis than this, on z = 1, were imaged twice or not at all.
    max_radius: f64,
}

impl Warp {
    /// A warp for a lens given at the image's size.
    pub fn new(lens: Lens) -> Self {
        let c = &lens.pinhole;
        let corner = |x: f64, y: f64| c.direction_in_camera(DVec2::new(x, y)).truncate().length();
        let (w, h) = (f64::from(c.width_px), f64::from(c.height_px));
        let farthest = corner(0.0, 0.0).max(corner(w, 0.0)).max(corner(0.0, h)).max(corner(w, h));
        Self { lens, max_radius: lens.distortion.monotonic_radius(farthest) }
    }

    /// Where pixel `(x, y)` of the pinhole image lies in the distorted image; `None` outside.
    pub fn source_px(&self, x: usize, y: usize) -> Option<DVec2> {
        let c = &self.lens.pinhole;
        let centre = DVec2::new(x as f64 + 0.5, y as f64 + 0.5);
        let undistorted = c.direction_in_camera(centre).truncate();
        if undistorted.length() > self.max_radius {
            return None;
        }
        let distorted = self.lens.distortion.distort(undistorted);
        let at = DVec2::new(distorted.x * c.fx_px + c.cx_px, distorted.y * c.fy_px + c.cy_px);
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
