//! Lenses of RealityScan and RealityCapture: focal lengths on film, principal points in shares of the photo's longer side.

use crate::camera::Pinhole;

/// Width of the film that focal lengths refer to.
const FILM_MM: f64 = 36.0;

/// The pinhole of a photo of this size. The focal length refers to film of 36 mm along the photo's longer side; the offset
/// of the principal point from the middle of the photo is in shares of that side.
pub(super) fn pinhole(focal_mm: f64, offset: [f64; 2], (width_px, height_px): (u32, u32)) -> Pinhole {
    let longer_px = f64::from(width_px.max(height_px));
    let focal_px = focal_mm * longer_px / FILM_MM;
    Pinhole {
        width_px,
        height_px,
        fx_px: focal_px,
        fy_px: focal_px,
        cx_px: 0.5 * f64::from(width_px) + offset[0] * longer_px,
        cy_px: 0.5 * f64::from(height_px) + offset[1] * longer_px,
    }
}
