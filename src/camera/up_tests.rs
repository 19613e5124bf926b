//! Up of captures whose cameras stand as people and machines hold them. In the frame that they are made in, up is -y.

use super::symmetric::{covariance, eigen};
use super::up::{Up, UpSource, direction_text, find};
use glam::{DMat3, DVec3, EulerRot};
use rand::{RngExt as _, SeedableRng as _};
use rand_pcg::Pcg64Mcg;
use std::f64::consts::TAU;

/// Cameras by heading, pitch below the horizon and roll, degrees.
type Held = (f64, f64, f64);

/// The rotation of `camera_from_capture` in a capture that is turned.
fn rotation((heading, pitch, roll): Held, turn: DMat3) -> DMat3 {
    let [(sin_h, cos_h), (sin_p, cos_p), (sin_r, cos_r)] =
        [heading, pitch, roll].map(|angle: f64| angle.to_radians().sin_cos());
    let forward = DVec3::new(cos_p * sin_h, sin_p, cos_p * cos_h);
    let level = DVec3::new(cos_h, 0.0, -sin_h);
    let below = forward.cross(level);
    let (right, down) = (level * cos_r + below * sin_r, below * cos_r - level * sin_r);
    DMat3::from_cols(turn * right, turn * down, turn * forward).transpose()
}

/// Numbers from -1 to 1 that look random.
fn noise(i: usize) -> f64 {
    (i as f64 * 0.754_877_666 + 0.1).fract() * 2.0 - 1.0
}

/// `count` cameras over an arc of headings.
fn arc(count: usize, degrees: f64, held: impl Fn(usize) -> (f64, f64)) -> Vec<Held> {
    let heading = |i: usize| degrees * (i as f64 / count as f64 - 0.5);
    (0..count).map(|i| (heading(i), held(i).0, held(i).1)).collect()
}

fn found(cameras: &[Held], turn: DMat3, stated: Option<DVec3>) -> Up {
    find(cameras.iter().map(|held| rotation(*held, turn)), stated)
}

/// Degrees between what is found in a turned capture and what is up there.
fn off(cameras: &[Held], turn: DMat3) -> (f64, Up) {
    let up = found(cameras, turn, None);
    ((turn * DVec3::NEG_Y).dot(up.in_capture).clamp(-1.0, 1.0).acos().to_degrees(), up)
}

/// As captured, z up, tilted by 51 degrees, anyhow.
fn turns() -> [DMat3; 4] {
    [
        DMat3::IDENTITY,
        DMat3::from_rotation_x(90_f64.to_radians()),
        DMat3::from_rotation_x(51_f64.to_radians()),
        DMat3::from_euler(EulerRot::XYZ, 2.0, -0.7, 1.1),
    ]
}

#[test]
fn cameras_held_level_tell_what_is_up_whichever_way_they_look() {
    // All around and over an arc, looking ahead and down, by hand and by machine.
    for (turn, roll) in turns().into_iter().zip([0.0, 3.0, 0.0, 3.0]) {
        for (count, degrees) in [(12, 360.0), (40, 120.0), (9, 60.0)] {
            for pitch in [0.0, 30.0, 60.0] {
                let cameras = arc(count, degrees, |i| (pitch + 5.0 * noise(i + 7), roll * noise(i)));
                let (off, up) = off(&cameras, turn);
                // Needed 8.6e-7 without roll, 1.1 with: 9 cameras over 60 degrees.
                assert!(off < if roll > 0.0 { 1.5 } else { 1e-4 }, "{degrees} {pitch}: {off} {up:?}");
                assert_eq!((up.source, up.level_photos), (UpSource::LevelPhotos, count), "{up:?}");
            }
        }
    }
    // Negative control: the mean of the upward directions over an arc is tilted.
    let cameras = arc(40, 120.0, |_| (30.0, 0.0));
    let mean: DVec3 = cameras.iter().map(|held| -rotation(*held, DMat3::IDENTITY).row(1)).sum();
    assert!(mean.normalize().dot(DVec3::NEG_Y) < 24_f64.to_radians().cos());
}

#[test]
fn rolled_photos_and_photos_in_portrait_do_not_mislead() {
    let rolled = |i: usize| if i % 10 < 3 { 20.0 + 40.0 * noise(i).abs() } else { 2.0 * noise(i) };
    let some_portrait = |i: usize| if i % 5 < 2 { 90.0 + 2.0 * noise(i) } else { 2.0 * noise(i) };
    let portrait = |i: usize| 90.0 + 2.0 * noise(i);
    let upside_down = |i: usize| if i.is_multiple_of(4) { 180.0 } else { 0.0 };
    for turn in turns() {
        for degrees in [360.0, 120.0] {
            for pitch in [0.0, 15.0, 30.0, 45.0] {
                for (roll, least) in [
                    (&rolled as &dyn Fn(usize) -> f64, 27),
                    (&some_portrait, 40),
                    (&upside_down, 40),
                    (&portrait, 40),
                ] {
                    let only_portrait = least == 40 && roll(0) > 45.0 && roll(2) > 45.0;
                    // Photos in portrait over less than half a circle that look ahead are as those of a camera that tilts.
                    if only_portrait && degrees < 180.0 && pitch < 30.0 {
                        continue;
                    }
                    let cameras = arc(40, degrees, |i| (pitch, roll(i)));
                    let (off, up) = off(&cameras, turn);
                    assert!(off < 0.5, "{degrees} {pitch} {}: {off} {up:?}", roll(0)); // needed 0.36
                    assert!(up.source == UpSource::LevelPhotos && up.level_photos >= least, "{up:?}");
                }
            }
        }
    }
    // The other quarter turn, as DSLR cameras are held: looking down tells.
    let (off, _) = off(&arc(40, 360.0, |_| (20.0, -90.0)), turns()[2]);
    assert!(off < 0.1, "{off}");
    // Negative control: held anyhow, cameras tell nothing.
    let anyhow: Vec<Held> =
        (0..60).map(|i| (180.0 * noise(i), 90.0 * noise(3 * i + 1), 180.0 * noise(7 * i + 2))).collect();
    let up = found(&anyhow, DMat3::IDENTITY, None);
    assert!(up.source != UpSource::LevelPhotos && up.uncertainty().is_some(), "{up:?}");
}

/// A standard normal number (Box and Muller).
fn normal(random: &mut Pcg64Mcg) -> f64 {
    let (a, b): (f64, f64) = (random.random(), random.random());
    (-2.0 * (1.0 - a).ln()).sqrt() * (TAU * b).cos()
}

/// 15 captures over a third of a circle.
struct OffByRoll {
    /// Degrees by which what is found is off, sorted.
    all: Vec<f64>,
    /// The same of least squares of the right axes.
    plain: Vec<f64>,
    /// How many are warned of.
    warned: usize,
    /// How many are off by more than 15 degrees without a warning.
    silent: usize,
}

/// With a quarter turn besides, degrees.
fn off_by_roll(count: usize, roll: f64, quarter: fn(usize) -> f64) -> OffByRoll {
    let turn = turns()[3];
    let mut result = OffByRoll { all: Vec::new(), plain: Vec::new(), warned: 0, silent: 0 };
    for seed in 0..15 {
        let mut random = Pcg64Mcg::seed_from_u64(seed);
        let cameras: Vec<Held> = (0..count)
            .map(|i| {
                let heading = 120.0 * (i as f64 / count as f64 - 0.5);
                (heading, 25.0 + 8.0 * normal(&mut random), quarter(i) + roll * normal(&mut random))
            })
            .collect();
        let (off, up) = off(&cameras, turn);
        result.all.push(off);
        result.warned += usize::from(up.uncertainty().is_some());
        result.silent += usize::from(off > 15.0 && up.uncertainty().is_none());
        let right_axes = cameras.iter().map(|held| (rotation(*held, DMat3::IDENTITY).row(0), 1.0));
        result.plain.push(eigen(covariance(right_axes)).1[0].y.abs().acos().to_degrees());
    }
    result.all.sort_by(f64::total_cmp);
    result.plain.sort_by(f64::total_cmp);
    result
}

#[test]
fn roll_misleads_no_more_than_least_squares_of_the_right_axes() {
    for count in [12, 32, 60] {
        for roll in [0.0, 3.0, 8.0, 15.0, 20.0] {
            let OffByRoll { all, plain, warned, .. } = off_by_roll(count, roll, |_| 0.0);
            // Needed 1.15 times in the middle. At worst, the mean is taken, off by 29.
            assert!(all[7] <= 1.2 * plain[7] + 1e-4, "{count} {roll}: {all:?} {plain:?}");
            assert!(all[14] <= (plain[14] + 1.0).max(30.0), "{count} {roll}: {all:?} {plain:?}");
            // Photos that are held level are not warned of, rolled ones are.
            assert!(
                if roll <= 3.0 { warned == 0 } else { roll < 15.0 || warned >= 14 },
                "{count} {roll}: {warned}"
            );
        }
    }
    // Negative control: photos in portrait mislead least squares of the right axes, by 29 to 40 degrees.
    for count in [12, 32, 60] {
        let OffByRoll { all, plain, warned, .. } =
            off_by_roll(count, 3.0, |i| if i % 4 == 1 { 90.0 } else { 0.0 });
        assert!(all[14] < 4.0 && plain[0] > 20.0 && warned == 0, "{count}: {all:?} {plain:?}"); // needed 2.8
    }
}

#[test]
fn half_of_the_photos_in_portrait_to_either_side_mislead_little() {
    let half = |i: usize| [0.0, 90.0, 0.0, -90.0][i % 4];
    for (count, roll) in [(32, 8.0), (32, 12.0), (60, 12.0)] {
        let OffByRoll { all, plain, silent, .. } = off_by_roll(count, roll, half);
        assert!(all[10] < 10.0 && silent == 0, "{count} {roll}: {silent} of {all:?}");
        // Negative control: least squares of the right axes finds none of them.
        assert!(plain[0] > 20.0, "{count} {roll}: {plain:?}");
    }
}

#[test]
fn cameras_that_all_face_alike_leave_it_to_the_format_or_their_mean() {
    // As the capture flower: they look ahead, a little to the sides, and up and down.
    let cameras: Vec<Held> =
        (0..30).map(|i| (12.0 * noise(i), 9.0 * noise(i + 40), 2.0 * noise(i + 80))).collect();
    for turn in turns() {
        let (off, up) = off(&cameras, turn);
        assert!(off < 0.5 && up.source == UpSource::MeanOfPhotos, "{off} {up:?}"); // needed 0.39
        let up = found(&cameras, turn, Some(DVec3::Z));
        assert!(up.source == UpSource::PoseFormat && up.in_capture == DVec3::Z, "{up:?}");
        // Only where z lies along the photos' right axes, it cannot be.
        let is_aside = (turn * DVec3::X).dot(DVec3::Z).abs() > 0.35;
        assert_eq!(up.disagreement().is_some(), is_aside, "{up:?}");
    }
    // A camera that tilts by a third of a circle.
    let tilting: Vec<Held> = (0..20).map(|i| (0.0, 6.0 * f64::from(i) - 20.0, 0.0)).collect();
    let up = found(&tilting, DMat3::IDENTITY, None);
    assert!(up.source == UpSource::MeanOfPhotos && up.in_capture.x.abs() < 1e-9, "{up:?}");
    // One camera: its own up, snapped; and none.
    let (off, up) = off(&[(20.0, 4.0, 0.0)], turns()[1]);
    assert!(off < 1e-9 && up.source == UpSource::MeanOfPhotos && up.in_capture == DVec3::NEG_Z, "{up:?}");
    let up = find([], None);
    assert!(up.source == UpSource::Assumed && up.in_capture == DVec3::NEG_Y, "{up:?}");
    assert_eq!(find([], Some(DVec3::Z)).in_capture, DVec3::Z);
}

#[test]
fn cameras_that_look_straight_down_see_the_ground() {
    // Of a drone that turns as it goes.
    let cameras: Vec<Held> = (0..24).map(|i| (45.0 * f64::from(i), 89.0, 0.0)).collect();
    for turn in turns() {
        let (off, up) = off(&cameras, turn);
        assert!(off < 0.1 && up.source == UpSource::LevelPhotos, "{off} {up:?}");
    }
}

#[test]
fn up_is_an_axis_of_the_format_where_it_is_near_one() {
    let cameras = arc(24, 360.0, |_| (20.0, 0.0));
    let tilted = |degrees: f64| found(&cameras, DMat3::from_rotation_z(degrees.to_radians()), None);
    assert_eq!(tilted(4.9).in_capture, DVec3::NEG_Y);
    assert_ne!(tilted(5.1).in_capture, DVec3::NEG_Y);
    assert!(tilted(4.9).words().starts_with("-y: 24 of 24 photos"), "{}", tilted(4.9).words());
    assert_eq!(direction_text([0.0, 0.0, 2.0]), "z");
    assert_eq!(direction_text([0.6, -0.8, 0.0]), "0.6000,-0.8000,0.0000");
    assert_eq!(direction_text([0.6, -0.8, -1e-9]), "0.6000,-0.8000,0.0000");
}

#[test]
fn a_format_that_says_otherwise_is_warned_of() {
    let cameras = arc(24, 360.0, |_| (20.0, 0.0));
    let tilted = |degrees: f64| {
        let turn = DMat3::from_rotation_x((90.0 + degrees).to_radians());
        found(&cameras, turn, Some(DVec3::NEG_Z))
    };
    assert_eq!(tilted(0.0).in_capture, DVec3::NEG_Z);
    assert_eq!((tilted(0.0).disagreement(), tilted(19.0).disagreement()), (None, None));
    let said = tilted(34.0).disagreement().unwrap();
    assert!(said.contains("34 degrees apart") && said.contains("24 of 24"), "{said}");
}
