//! Points on a textured wall that several cameras see, and none where the photos contradict each other.

use super::sweep::{points_for, swept, wanted_points};
use super::*;
use crate::camera::{Camera, Pinhole, RigidTransform};
use crate::image::TargetImage;
use crate::init::points::LocalPoint;
use crate::views::{Split, TestViews};
use glam::{DMat3, DVec2, DVec3};
use std::sync::Arc;

const SIZE: (u32, u32) = (96, 64);

/// Distance of the wall, which faces the cameras.
const WALL: f64 = 3.0;

/// Cameras side by side before a wall.
struct Wall {
    /// Whether every photo shows a texture of its own.
    differ: bool,
    /// Colour of the wall's left half, which is plain; `None`: textured like the right half.
    plain: Option<u8>,
    /// Between the cameras.
    baseline: f64,
}

const WALL_OF_TEXTURE: Wall = Wall { differ: false, plain: None, baseline: 0.25 };

/// A texture without repetition at the scale of the wall.
fn texture(at: DVec2) -> f64 {
    let waves = [(7.1, 3.3), (-4.7, 9.2), (12.9, -6.1), (2.3, 14.7), (17.0, 5.9)];
    waves.iter().zip(1..).map(|((a, b), i)| (a * at.x + b * at.y + f64::from(i * i)).sin()).sum::<f64>() * 0.2
}

impl Wall {
    fn views(&self) -> TestViews {
        TestViews(Split::Train, (0..3).map(|view| self.view(view.into())).collect())
    }

    fn view(&self, view: f64) -> (&'static str, Camera, Arc<TargetImage>) {
        let centre = DVec3::new(self.baseline * (view - 1.0), 0.0, 0.0);
        let (width_px, height_px) = SIZE;
        let pinhole = Pinhole { width_px, height_px, fx_px: 80.0, fy_px: 80.0, cx_px: 48.0, cy_px: 32.0 };
        let camera_from_local = RigidTransform { rotation: DMat3::IDENTITY, translation: -centre };
        let turn = DVec2::from_angle(if self.differ { 1.2 * view } else { 0.0 });
        let grey = |i: u32| {
            let at_px = DVec2::new((i % width_px).into(), (i / width_px).into()) + 0.5;
            let on_wall = centre + pinhole.direction_in_camera(at_px) * WALL;
            match self.plain.filter(|_| on_wall.x < 0.0) {
                Some(value) => value,
                None => (127.5 + 120.0 * texture(turn.rotate(on_wall.truncate()))) as u8,
            }
        };
        let rgb = (0..width_px * height_px).flat_map(|i| [grey(i); 3]).collect();
        let photo = Arc::new(TargetImage::opaque(width_px, height_px, rgb));
        ("wall.png", Camera { pinhole, camera_from_local }, photo)
    }
}

fn sweep(wall: &Wall, known: &[LocalPoint], most: usize) -> Vec<DVec3> {
    let views = wall.views();
    let input = InitInput::for_test(&views, InitPoints::Missing(1));
    let points = swept(&input, known, wanted_points(&input), most, [0.0; 3], 7).unwrap();
    points.iter().map(LocalPoint::position_in_local).collect()
}

fn share(points: &[DVec3], is: impl Fn(&DVec3) -> bool) -> f64 {
    points.iter().filter(|p| is(p)).count() as f64 / points.len().max(1) as f64
}

#[test]
fn points_lie_on_the_wall_that_photos_show() {
    let points = sweep(&WALL_OF_TEXTURE, &[], usize::MAX);
    assert!((400..=500).contains(&points.len()), "{} of 500", points.len());
    let on_wall = share(&points, |p| (p.z - WALL).abs() < 0.05 * WALL);
    assert!(on_wall > 0.95, "{on_wall}");
    // Negative control. Smooth textures match by chance: measured 64.
    let contradicting = sweep(&Wall { differ: true, ..WALL_OF_TEXTURE }, &[], usize::MAX);
    assert!(contradicting.len() < 100, "{} points of photos that show different things", contradicting.len());
}

#[test]
fn next_to_matches_plain_regions_lie_on_the_same_plane_and_further_away_get_nothing() {
    let points = sweep(&Wall { plain: Some(90), ..WALL_OF_TEXTURE }, &[], usize::MAX);
    let on_wall = share(&points, |p| (p.z - WALL).abs() < 0.05 * WALL);
    assert!(on_wall > 0.9, "{on_wall}");
    let left = |from: f64, to: f64| points.iter().filter(|p| (-to..-from).contains(&p.x)).count();
    assert!(left(0.1, 0.3) > 5, "{} beside the texture", left(0.1, 0.3));
    assert_eq!(left(0.6, 3.0), 0, "far from it");
    let background = sweep(&Wall { plain: Some(0), ..WALL_OF_TEXTURE }, &[], usize::MAX);
    assert_eq!(share(&background, |p| p.x < -0.05), 0.0, "the background is not filled");
}

#[test]
fn the_number_of_points_follows_from_pixels_and_views() {
    // One point in 25 pixels with up to 4 views, one in 10 with 10, one in 4 from 25 on.
    assert_eq!([2, 4, 10, 25, 60].map(|views| points_for(2e4, views)), [800, 800, 2_000, 5_000, 5_000]);
    assert_eq!([points_for(1e3, 60), points_for(1e6, 60), points_for(1e6, 0)], [500, 20_000, 20_000]);
}

#[test]
fn enough_points_get_no_more() {
    let wall = WALL_OF_TEXTURE;
    let point = |i: i32| LocalPoint::new(DVec3::new(0.001 * f64::from(i) - 0.1, 0.0, WALL), [0.5; 3]);
    let known: Vec<LocalPoint> = (0..250).map(point).collect();
    assert_eq!(sweep(&wall, &known, usize::MAX).len(), 0);
    // So does a budget that the known ones fill.
    assert_eq!(sweep(&wall, &known[..200], 200).len(), 0);
    // With fewer, they narrow the depths that are searched.
    let added = sweep(&wall, &known[..200], usize::MAX);
    assert!((200..=300).contains(&added.len()), "{}", added.len());
    assert!(share(&added, |p| (p.z - WALL).abs() < 0.05 * WALL) > 0.95);
    // A budget that has room for a few more gets those.
    let few = sweep(&wall, &known[..200], 300).len();
    assert!((70..=100).contains(&few), "{few}");
}

#[test]
fn cameras_in_one_place_tell_no_depths() {
    let wall = Wall { baseline: 0.005, ..WALL_OF_TEXTURE };
    assert_eq!(sweep(&wall, &[], usize::MAX).len(), 0);
}

#[test]
fn a_capture_without_points_starts_from_those_found_or_else_from_random_ones() {
    let first = |wall: &Wall| {
        let views = wall.views();
        let input = InitInput::for_test(&views, InitPoints::Missing(700));
        let options = InitOptions { sweep_on: Some([0.0; 3]), sh_degree: 0, ..InitOptions::default() };
        let first = initial_model(&input, &options).unwrap();
        (first.model.num_splats(), first.report.warnings.last().unwrap().code.clone())
    };
    let (count, code) = first(&WALL_OF_TEXTURE);
    assert!((400..=500).contains(&count) && code == "few-points", "{count} {code}");
    // A few matches, by chance, are none.
    let contradicting = Wall { differ: true, ..WALL_OF_TEXTURE };
    assert_eq!(first(&contradicting), (700, "random-initialisation".to_owned()));
    let blind = Wall { baseline: 0.005, ..WALL_OF_TEXTURE };
    assert_eq!(first(&blind), (700, "random-initialisation".to_owned()));
}
