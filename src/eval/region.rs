//! Figures of a part of the image: its error, how much of it is recognisable, and how many texels lie in it.

use super::pair::ImagePair;
use super::psnr::squared_error;
use crate::camera::Camera;
use crate::model::Model;
use glam::DVec3;

/// Largest error of a channel at which a pixel still has its colour: 10 % of the range.
const RECALL_ERROR: u8 = 25;

/// Sums over the pixels of a region.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct RegionError {
    /// Sum of the squared differences of code values.
    pub squares: u64,
    /// Number of pixels.
    pub pixels: u64,
    /// Those whose channels are all within 10 % of the photo's.
    pub recalled: u64,
}

impl RegionError {
    /// Adds the pixels of `region` that the photo's mask keeps. `region`: `[height, width]`
    pub fn add(&mut self, mut pair: ImagePair, region: &[bool]) {
        let inside: Vec<bool> = region
            .iter()
            .enumerate()
            .map(|(i, inside)| *inside && pair.unmasked.as_ref().is_none_or(|u| u[i]))
            .collect();
        let pixels = pair.rendered.as_chunks::<3>().0.iter().zip(pair.target.as_chunks::<3>().0);
        let is_recalled = |(a, b): (&[u8; 3], &[u8; 3])| (0..3).all(|c| a[c].abs_diff(b[c]) <= RECALL_ERROR);
        self.recalled +=
            pixels.zip(&inside).filter(|(pixel, inside)| **inside && is_recalled(*pixel)).count() as u64;
        pair.unmasked = Some(inside);
        let (squares, pixels) = squared_error(&pair);
        self.squares += squares;
        self.pixels += pixels;
    }
}

/// Number of texels of the splats whose centres project into `region`, and into the image. `region`:
/// `[height, width]`. What hides a splat does not count.
pub fn texels_in_region(model: &Model, camera: &Camera, region: &[bool]) -> (u64, u64) {
    let pinhole = &camera.pinhole;
    let (mut inside, mut all) = (0, 0);
    for (position, map) in model.splats.positions.as_chunks::<3>().0.iter().zip(&model.textures.maps) {
        let in_camera = camera.camera_from_local.transform_point(DVec3::from(position.map(f64::from)));
        let Some(at) = pinhole.project(in_camera).filter(|_| in_camera.z >= f64::from(model.near)) else {
            continue;
        };
        let is_inside = |x: f64, side: u32| x >= 0.0 && x < f64::from(side);
        if is_inside(at.x, pinhole.width_px) && is_inside(at.y, pinhole.height_px) {
            let texels = map.num_texels() as u64;
            all += texels;
            if region[at.y as usize * pinhole.width_px as usize + at.x as usize] {
                inside += texels;
            }
        }
    }
    (inside, all)
}
