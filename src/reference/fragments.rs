//! Counts fragments: tests every pixel against every splat (method 6.15).

use super::params::Params;
use super::project::{Projected, project};
use super::raster_fwd::{hit, raster_fwd};
use super::settings::Settings;
use crate::camera::Camera;
use glam::DVec2;

/// Fragments of a view.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Fragments {
    /// Pixels whose centres lie in the support of each splat, hidden or not. `[n]`
    pub rasterised: Vec<u64>,
    /// Samples that were blended.
    pub blended: u64,
}

/// Counts the fragments of a view.
pub fn fragments(params: &Params, camera: &Camera, settings: &Settings) -> Fragments {
    let projected: Vec<Option<Projected>> =
        (0..params.splats.len()).map(|i| project(params, i, camera, settings)).collect();
    let [width, height] = [camera.pinhole.width_px, camera.pinhole.height_px];
    let centre = |x: u32, y: u32| DVec2::new(f64::from(x) + 0.5, f64::from(y) + 0.5);
    let of_splat = |projected: &Projected| {
        let pixels = (0..height).flat_map(|y| (0..width).map(move |x| centre(x, y)));
        pixels.filter(|&pixel_px| hit(projected, pixel_px, settings).is_some()).count() as u64
    };
    let image = raster_fwd(params, &projected, camera, settings);
    Fragments {
        rasterised: projected.iter().map(|p| p.as_ref().map_or(0, of_splat)).collect(),
        blended: image.samples.iter().map(|samples| samples.len() as u64).sum(),
    }
}
