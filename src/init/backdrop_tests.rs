//! Where the backdrop stands, and where not: cameras that look across a plain under a sky.

use super::*;
use crate::camera::{Camera, Pinhole, RigidTransform};
use crate::constants::SH_0;
use crate::image::TargetImage;
use crate::views::{SfmPoint, Split, TestViews};
use glam::{DMat3, DVec3};
use std::collections::HashSet;
use std::sync::Arc;

const SKY: [u8; 3] = [120, 160, 230];
const GROUND: [u8; 3] = [90, 120, 40];

/// Four cameras at the height 0.3 that look north across a plain, with half a unit between them; z is up.
fn plain(sky: [u8; 3]) -> TestViews {
    // x to the east, y down, z to the north.
    let rotation = DMat3::from_cols(DVec3::X, DVec3::Z, DVec3::NEG_Y);
    let pinhole = Pinhole { width_px: 48, height_px: 32, fx_px: 24.0, fy_px: 24.0, cx_px: 24.0, cy_px: 16.0 };
    // The horizon is the middle row.
    let rgb = (0..48 * 32).flat_map(|i| if i < 48 * 16 { sky } else { GROUND }).collect();
    let photo = Arc::new(TargetImage::opaque(48, 32, rgb));
    let view = |east: f64| {
        let translation = -(rotation * DVec3::new(east, 0.0, 0.3));
        let camera_from_local = RigidTransform { rotation, translation };
        ("plain.png", Camera { pinhole, camera_from_local }, Arc::clone(&photo))
    };
    TestViews(Split::Train, [-0.75, -0.25, 0.25, 0.75].map(view).to_vec())
}

/// A grid of points on the ground, or on both it and a wall in the north.
fn points(with_wall: bool) -> Vec<SfmPoint> {
    let ground = (0..3600).map(|i| DVec3::new(f64::from(i % 60) - 30.0, f64::from(i / 60) - 10.0, 0.0) * 0.2);
    let wall = (0..if with_wall { 12_800 } else { 0 })
        .map(|i| DVec3::new(0.2 * f64::from(i % 160) - 16.0, 9.0, 0.2 * f64::from(i / 160)));
    let dense = ground.clone().map(|p| DVec3::new(0.25 * p.x, 0.25 * p.y, 0.0));
    let points = ground.chain(wall).chain(dense).map(|p| p + DVec3::new(1e-4, 2e-4, 0.0) * p.y);
    points.map(|position_in_capture| SfmPoint { position_in_capture, rgb: GROUND }).collect()
}

/// Positions and colours of the splats that are not at points.
fn backdrop(sky: [u8; 3], points: &[SfmPoint], max_points: usize) -> Vec<([f32; 3], [f32; 3])> {
    let views = plain(sky);
    let model = |backdrop_on, max_points| {
        let input = InitInput::for_test(&views, InitPoints::Sparse(points));
        let options = InitOptions { backdrop_on, sh_degree: 0, max_points, ..InitOptions::default() };
        initial_model(&input, &options).unwrap().model
    };
    let (without, with) = (model(None, usize::MAX), model(Some([0.0; 3]), max_points));
    assert!(with.num_splats() <= max_points);
    let rows = |model: &Model| -> Vec<([f32; 3], [f32; 3])> {
        let s = &model.splats;
        let colour = |v: f32| 0.5 + v * SH_0 as f32;
        let rows = s.positions.as_chunks::<3>().0.iter().zip(s.sh.as_chunks::<3>().0);
        rows.map(|(p, c)| (*p, c.map(colour))).collect()
    };
    let known: HashSet<[u32; 3]> = rows(&without).iter().map(|(p, _)| p.map(f32::to_bits)).collect();
    rows(&with).into_iter().filter(|(p, _)| !known.contains(&p.map(f32::to_bits))).collect()
}

fn elevation_degrees(p: [f32; 3]) -> f32 {
    p[2].atan2(p[0].hypot(p[1])).to_degrees()
}

#[test]
fn the_backdrop_fills_the_sky_and_not_the_ground() {
    let splats = backdrop(SKY, &points(false), 100_000);
    let north: Vec<_> = splats.iter().filter(|(p, _)| p[1] > 2.0 * p[0].abs() && p[1] > 0.0).collect();
    let is = |colour: &[f32; 3], rgb: [u8; 3]| {
        colour.iter().zip(rgb).all(|(c, b)| (c - f32::from(b) / 255.0).abs() < 0.01)
    };
    let sky = north.iter().filter(|(p, c)| elevation_degrees(*p) > 8.0 && is(c, SKY)).count();
    assert!(sky > 50, "{sky} splats in the sky");
    // The views see 33 degrees down.
    let ground = |(p, _): &&&([f32; 3], [f32; 3])| (-25.0..-8.0).contains(&elevation_degrees(*p));
    assert_eq!(north.iter().filter(ground).count(), 0, "the ground has points");
    // Far from all points it stands behind them at one distance, near them just behind the nearest ones.
    let distance = |p: &[f32; 3]| p.iter().map(|v| v * v).sum::<f32>().sqrt();
    let is_far = |(p, _): &&([f32; 3], [f32; 3])| elevation_degrees(*p) > 25.0;
    let far: Vec<f32> = splats.iter().filter(is_far).map(|(p, _)| distance(p)).collect();
    assert!(far.len() > 20 && far.iter().all(|d| (d - far[0]).abs() < 1e-3 && *d > 10.0), "{far:?}");
    let is_near = |(p, _): &&([f32; 3], [f32; 3])| (8.0..14.0).contains(&elevation_degrees(*p));
    let near: Vec<f32> = splats.iter().filter(is_near).map(|(p, _)| distance(p)).collect();
    assert!(near.len() > 5 && near.iter().all(|d| (1.5 - 1e-3..0.9 * far[0]).contains(d)), "{near:?}");
    // Around what the views show it goes on, and no further: nothing stands in the south.
    assert!(splats.iter().all(|(p, _)| p[1] > 0.0 || elevation_degrees(*p).abs() > 30.0));
}

#[test]
fn neither_points_nor_background_get_a_backdrop() {
    let in_view = |(p, _): &&([f32; 3], [f32; 3])| {
        (8.0..25.0).contains(&elevation_degrees(*p)) && p[1] > 2.0 * p[0].abs()
    };
    let sky = backdrop(SKY, &points(false), 100_000);
    assert!(sky.iter().filter(in_view).count() > 20, "negative control");
    let behind_a_wall = backdrop(SKY, &points(true), 100_000);
    assert_eq!(behind_a_wall.iter().filter(in_view).count(), 0);
    let black = backdrop([0; 3], &points(false), 100_000);
    assert_eq!(black.iter().filter(in_view).count(), 0, "the photos show the background");
}

#[test]
fn a_backdrop_takes_at_most_a_quarter_of_a_budget() {
    let points = points(false);
    let len = backdrop(SKY, &points, 100_000).len();
    assert!(4 * len < points.len());
    assert_eq!(backdrop(SKY, &points, 4 * len).len(), len);
    assert_eq!(backdrop(SKY, &points, 4 * len - 1).len(), 0);
}
