//! Which splats keep the spacing: a camera before a wall of points.

use super::*;
use crate::camera::{Camera, Pinhole, RigidTransform};
use crate::image::TargetImage;
use crate::views::{SfmPoint, Split, TestViews};
use glam::{DMat3, DVec3};
use std::sync::Arc;

/// A camera at the origin that looks along z.
fn view(focal_px: f64) -> TestViews {
    let pinhole =
        Pinhole { width_px: 48, height_px: 48, fx_px: focal_px, fy_px: focal_px, cx_px: 24.0, cy_px: 24.0 };
    let camera_from_local = RigidTransform { rotation: DMat3::IDENTITY, translation: DVec3::ZERO };
    let photo = Arc::new(TargetImage::opaque(48, 48, vec![128; 3 * 48 * 48]));
    TestViews(Split::Train, vec![("wall.png", Camera { pinhole, camera_from_local }, photo)])
}

/// For each splat of a wall of 30 x 30 points, 2 units wide and 2 away, whether it stands in one of the 3 rows next to the
/// border, its standard deviation in units of the spacing, and its opacity.
fn wall(start: Start, focal_px: f64) -> Vec<(bool, f32, f32)> {
    let spacing = 2.0 / 30.0;
    let at = |i: i32| spacing * (f64::from(i) - 14.5);
    let place = |i: i32| DVec3::new(at(i % 30), at(i / 30), 2.0);
    let points: Vec<SfmPoint> =
        (0..900).map(|i| SfmPoint { position_in_capture: place(i), rgb: [128; 3] }).collect();
    let views = view(focal_px);
    let input = InitInput::for_test(&views, InitPoints::Sparse(&points));
    let options = InitOptions { start, sh_degree: 0, ..InitOptions::default() };
    let splats = initial_model(&input, &options).unwrap().model.splats;
    let of = |splat: usize| {
        let [x, y] = [0, 1].map(|axis| f64::from(splats.positions[3 * splat + axis]));
        let is_near_border = x.abs().max(y.abs()) > at(26);
        let sigma = splats.log_scales[2 * splat].exp() / spacing as f32;
        (is_near_border, sigma, 1.0 / (1.0 + (-splats.opacity_logits[splat]).exp()))
    };
    (0..splats.len()).map(of).collect()
}

#[test]
fn splats_are_small_and_opaque_where_enough_remain() {
    // The wall fills half of the view: where it ends, rays would pass nothing.
    let splats = wall(Start::Coverage, 24.0);
    assert_eq!(splats.len(), 900);
    for &(is_near_border, sigma, opacity) in &splats {
        let is_small = (sigma - 0.5).abs() < 1e-3 && (opacity - 0.5).abs() < 1e-4;
        assert!(is_near_border || is_small, "{sigma}, {opacity}");
    }
    let kept =
        splats.iter().filter(|(_, sigma, opacity)| (sigma - 1.0).abs() < 1e-3 && *opacity < 0.3).count();
    assert!((100..=324).contains(&kept), "{kept} of the 324 near the border");
    // Negative control: a view that does not see where it ends needs none of them.
    assert!(wall(Start::Coverage, 72.0).iter().all(|(_, sigma, _)| *sigma < 0.6));
    // 3DGS's start.
    assert!(
        wall(Start::Spacing, 24.0)
            .iter()
            .all(|(_, sigma, opacity)| *sigma > 0.999 && (opacity - 0.1).abs() < 1e-4)
    );
}
