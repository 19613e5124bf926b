//! What the training cameras see of a scene: the home view that programs open a file with, and bounds that floaters and the
//! backdrop do not stretch. Both follow from centres and cameras alone, without rendering, on a sample of large scenes.

use crate::number::rounded;
use crate::{AssetCamera, SplatAsset};
use serde::{Deserialize, Serialize};

/// Splats that are looked at: every k-th.
const SPLATS_MAX: usize = 8192;
/// Cameras that are looked at: every k-th.
const CAMERAS_MAX: usize = 64;
/// Of the depths of the centres in an image, this quantile is that of what the photo is of.
const NEAR_SHARE: f64 = 0.25;
/// What lies more than this many times as deep is behind it: of four captures, the walls and the sky go and the table stays.
const REACH: f64 = 2.0;
/// Share of the weight that lies below and above the bounds before they are widened.
const TAIL: f64 = 0.02;
/// By this share of their length bounds are widened on each side: an evenly filled box gets all of its length back, and a bit.
const MARGIN: f64 = 0.1;
/// Digits of the bounds that files keep.
const DIGITS: usize = 6;

/// A box in the local frame.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Bounds {
    /// Smallest coordinates, local units.
    pub min: [f64; 3],
    /// Largest coordinates, local units.
    pub max: [f64; 3],
}

/// Bounds and home view of a scene.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Overview {
    /// Where the bulk of what is seen lies; `None` without splats.
    pub bounds: Option<Bounds>,
    /// Index of the camera of the home view; `None` without cameras.
    pub home: Option<usize>,
}

impl Overview {
    /// Looks at a scene.
    ///
    /// A camera sees a splat whose centre is in its image, beyond the near plane and at most twice as deep as the nearest quarter
    /// of such centres. A splat counts in proportion to its opacity and to the number of cameras that see it; where none sees
    /// any, by its opacity. The bounds are the 2 % and 98 % quantiles of each coordinate, widened by a tenth of their distance,
    /// but to no more than the bounds of all centres. The home view is the training camera that sees most of what training cameras
    /// see: the one with the largest sum of the weights in its image, of equals the first. Without training cameras, others serve.
    pub fn of(asset: &SplatAsset) -> Self {
        let is_training = |camera: &&AssetCamera| !camera.held_out;
        let any_training = asset.cameras.iter().any(|c| !c.held_out);
        let cameras: Vec<(usize, &AssetCamera)> =
            asset.cameras.iter().enumerate().filter(|(_, c)| !any_training || is_training(c)).collect();
        let cameras: Vec<_> = cameras.iter().step_by(cameras.len().div_ceil(CAMERAS_MAX).max(1)).collect();
        let n = asset.num_splats();
        let splats: Vec<usize> = (0..n).step_by(n.div_ceil(SPLATS_MAX).max(1)).collect();
        let seen: Vec<Vec<bool>> = cameras
            .iter()
            .map(|(_, camera)| {
                let depths: Vec<_> =
                    splats.iter().map(|&i| depth(camera, asset.near, asset.positions[i])).collect();
                let mut sorted: Vec<f64> = depths.iter().flatten().copied().collect();
                sorted.sort_by(f64::total_cmp);
                let near = sorted.get((NEAR_SHARE * sorted.len() as f64) as usize).copied().unwrap_or(0.0);
                depths.iter().map(|depth| depth.is_some_and(|z| z <= REACH * near)).collect()
            })
            .collect();
        let opacity = |i: usize| f64::from(asset.opacities[i]);
        let by_cameras = |k: usize| seen.iter().filter(|by| by[k]).count() as f64;
        let mut weights: Vec<f64> =
            splats.iter().enumerate().map(|(k, &i)| opacity(i) * by_cameras(k)).collect();
        if weights.iter().sum::<f64>() == 0.0 {
            weights = splats.iter().map(|&i| opacity(i)).collect();
        }
        let score =
            |by: &Vec<bool>| by.iter().zip(&weights).filter(|(seen, _)| **seen).map(|(_, w)| w).sum::<f64>();
        let mut home: Option<(usize, f64)> = None;
        for ((index, _), by) in cameras.iter().zip(&seen) {
            let score = score(by);
            if home.is_none_or(|(_, best)| score > best) {
                home = Some((*index, score));
            }
        }
        Self { bounds: bounds(asset, &splats, &weights), home: home.map(|(index, _)| index) }
    }
}

/// The depth of a centre that is beyond the near plane and in the image.
fn depth(camera: &AssetCamera, near: f32, position: [f32; 3]) -> Option<f64> {
    let p = position.map(f64::from);
    let along = |i: usize| {
        let row = camera.rotation_rows[i];
        row[0] * p[0] + row[1] * p[1] + row[2] * p[2] + camera.translation[i]
    };
    let z = along(2);
    let inside = |i: usize, size: u32| {
        let at = camera.focal_px[i] * along(i) / z + camera.principal_px[i];
        at >= 0.0 && at <= f64::from(size)
    };
    let is_seen =
        z >= f64::from(near) && z > 0.0 && inside(0, camera.width_px) && inside(1, camera.height_px);
    is_seen.then_some(z)
}

fn bounds(asset: &SplatAsset, splats: &[usize], weights: &[f64]) -> Option<Bounds> {
    let total: f64 = weights.iter().sum();
    if total.is_nan() || total <= 0.0 {
        return None;
    }
    let mut bounds = Bounds { min: [0.0; 3], max: [0.0; 3] };
    for axis in 0..3 {
        let mut along: Vec<(f64, f64)> =
            splats.iter().zip(weights).map(|(&i, &w)| (asset.positions[i][axis].into(), w)).collect();
        along.sort_by(|a, b| a.0.total_cmp(&b.0));
        let quantile = |share: f64| {
            let mut below = 0.0;
            let reached = along.iter().find(|(_, weight)| {
                below += weight;
                below >= share * total
            });
            reached.or(along.last()).map_or(0.0, |(at, _)| *at)
        };
        let (low, high) = (quantile(TAIL), quantile(1.0 - TAIL));
        let all = asset.positions.iter().map(|p| f64::from(p[axis]));
        let least = all.clone().fold(f64::INFINITY, f64::min);
        let most = all.fold(f64::NEG_INFINITY, f64::max);
        bounds.min[axis] = rounded((low - MARGIN * (high - low)).max(least), DIGITS);
        bounds.max[axis] = rounded((high + MARGIN * (high - low)).min(most), DIGITS);
    }
    Some(bounds)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::asset::tests::{fixture, front};

    /// A camera at `(x, 0, -distance)` that looks along z.
    fn camera(x: f64, distance: f64, held_out: bool) -> AssetCamera {
        AssetCamera { held_out, translation: [-x, 0.0, distance], ..front(100.0) }
    }

    /// A grid of 11^3 splats in [-1, 1]^3, a backdrop behind it and a floater before the cameras.
    fn scene() -> SplatAsset {
        let mut asset = fixture(1331 + 200 + 1, 0);
        for (i, p) in asset.positions.iter_mut().enumerate() {
            let at = |k: usize| (k % 11) as f32 / 5.0 - 1.0;
            *p = match i {
                0..1331 => [at(i), at(i / 11), at(i / 121)],
                1331..1531 => [at(i) * 40.0, at(i / 11) * 40.0, 80.0],
                _ => [0.0, 0.0, -300.0],
            };
        }
        asset.opacities.fill(0.9);
        asset.cameras = vec![camera(2.0, 4.0, false), camera(0.4, 4.0, false), camera(0.0, 4.0, true)];
        asset
    }

    #[test]
    fn bounds_leave_out_the_backdrop_and_floaters() {
        let asset = scene();
        let bounds = Overview::of(&asset).bounds.unwrap();
        for axis in 0..3 {
            let [low, high] = [bounds.min[axis], bounds.max[axis]];
            // Quantiles fall on planes of the grid, 0.2 apart.
            assert!((low + 1.0).abs() < 0.21 && (high - 1.0).abs() < 0.21, "{bounds:?}");
        }
        // Negative control: the bounds of all centres.
        assert!(asset.positions.iter().any(|p| p[2] < -200.0) && asset.positions.iter().any(|p| p[2] > 70.0));
        // They never exceed them.
        let mut few = asset.clone();
        few.retain(&(0..asset.num_splats()).map(|i| i < 1331).collect::<Vec<_>>());
        let bounds = Overview::of(&few).bounds.unwrap();
        assert!(bounds.min.iter().all(|v| *v >= -1.0) && bounds.max.iter().all(|v| *v <= 1.0), "{bounds:?}");
    }

    #[test]
    fn the_home_view_is_the_training_camera_that_sees_most() {
        let mut asset = scene();
        assert_eq!(Overview::of(&asset).home, Some(1));
        // Test cameras serve where there are no others.
        asset.cameras.iter_mut().for_each(|c| c.held_out = true);
        assert_eq!(Overview::of(&asset).home, Some(1));
        asset.cameras.clear();
        let without = Overview::of(&asset);
        assert_eq!(without.home, None);
        assert!(without.bounds.is_some(), "opacities alone serve");
    }
}
