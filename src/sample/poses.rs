//! Poses of the cameras around the sample scene.

use super::options::SampleOptions;
use super::random::{Stream, stream, uniform};
use super::stress::StressKind as Kind;
use crate::camera::RigidTransform;
use glam::{DMat3, DVec3};

/// Point that the cameras look at, up to jitter.
const CENTRE: DVec3 = DVec3::new(0.03, -0.26, 0.1);

/// Largest azimuth of a camera to either side, before jitter.
const AZIMUTH_MAX_DEG: f64 = 66.0;

/// Elevations of the three heights, and of those of outdoor captures: the horizon is in the upper third.
const ELEVATIONS_DEG: [f64; 3] = [14.0, 44.0, 28.0];
const ELEVATIONS_OUTDOORS_DEG: [f64; 3] = [3.0, 9.0, 6.0];

/// Azimuth of the video around the cards, to either side; its elevation and distance.
const VIDEO: (f64, f64, f64) = (60.0, 20.0, 1.7);

/// The closed path: distance from the centre, mean elevation and its amplitude.
const CLOSED: (f64, f64, f64) = (1.2, 27.0, 9.0);

/// Distance of the cap's cameras from the origin, metres, and the largest angle between their axes and the z axis.
const CAP: (f64, f64) = (1.6, 35.0);

/// camera_from_capture of a camera at `position` that looks at `target` with its x axis level.
fn looking_at(position: DVec3, target: DVec3) -> RigidTransform {
    let forward = (target - position).normalize();
    let right = DVec3::Y.cross(forward).normalize();
    let down = forward.cross(right);
    from_centre_and_rotation(position, DMat3::from_cols(right, down, forward).transpose())
}

/// camera_from_capture of a camera at `centre`.
pub fn from_centre_and_rotation(centre: DVec3, rotation: DMat3) -> RigidTransform {
    RigidTransform { rotation, translation: -(rotation * centre) }
}

fn on_sphere(azimuth: f64, elevation: f64, radius: f64) -> DVec3 {
    let flat = radius * elevation.cos();
    CENTRE + DVec3::new(flat * azimuth.sin(), -radius * elevation.sin(), -flat * azimuth.cos())
}

/// `count` poses on an arc in front of the scene, alternating between three heights, with jitter.
pub fn arc(options: &SampleOptions, count: usize) -> Vec<RigidTransform> {
    let kind = options.stress.map_or(Kind::None, |s| s.kind);
    let grazing = options.stress.and_then(|s| s.level_of(Kind::Grazing));
    let elevations = match grazing {
        Some(level) => [0.5 * level, 1.5 * level, level],
        None if kind == Kind::Sky => ELEVATIONS_OUTDOORS_DEG,
        None => ELEVATIONS_DEG,
    };
    // Of the jitter of the elevation, degrees.
    let amplitude = grazing.map_or(4.0, |level| 0.25 * level).min(if kind == Kind::Sky { 1.0 } else { 4.0 });
    let mut rng = stream(options.seed, Stream::Cameras, 0);
    let mut jitter = |amplitude: f64| amplitude * (2.0 * uniform(&mut rng) - 1.0);
    (0..count)
        .map(|view| {
            let along = (view as f64 + 0.5) / count as f64 * 2.0 - 1.0;
            let azimuth = (AZIMUTH_MAX_DEG * along + jitter(2.0)).to_radians();
            let elevation = (elevations[view % 3] + jitter(amplitude)).to_radians();
            let radius = [1.75, 1.95, 1.45][view % 3] + jitter(0.12);
            let position = on_sphere(azimuth, elevation, radius);
            let target = CENTRE + DVec3::new(jitter(0.06), jitter(0.04), jitter(0.06));
            match kind {
                Kind::Coincident => {
                    let sideways = DVec3::new(0.6 * azimuth, 0.3 * (elevation - 0.5), 0.0);
                    looking_at(CENTRE + DVec3::new(0.0, -0.6, -1.7), target + sideways)
                }
                Kind::Parallel => {
                    let at = DVec3::new(1.1 * azimuth, -0.3 - elevation, -1.5);
                    looking_at(CENTRE + at, CENTRE + at + DVec3::new(0.0, 0.45, 1.5))
                }
                _ => looking_at(position, target),
            }
        })
        .collect()
}

/// `count` poses on a cap, at equal distances from the origin and evenly spread; the first is nearest to the middle.
pub fn cap(count: usize) -> Vec<RigidTransform> {
    let (distance, tilt_max_deg) = CAP;
    let golden_angle = std::f64::consts::PI * (3.0 - 5_f64.sqrt());
    (0..count)
        .map(|view| {
            let tilt = tilt_max_deg.to_radians() * ((view as f64 + 0.5) / count as f64).sqrt();
            let (sin, cos) = (golden_angle * view as f64).sin_cos();
            let from_origin = DVec3::new(tilt.sin() * cos, tilt.sin() * sin, -tilt.cos());
            looking_at(distance * from_origin, DVec3::ZERO)
        })
        .collect()
}

/// The same pose, `factor` times as far from the centre. Nearer cameras are raised above the objects.
pub fn at_distance(pose: &RigidTransform, factor: f64) -> RigidTransform {
    let raised = DVec3::new(0.0, -0.15 * (1.0 - factor).max(0.0), 0.0);
    let position = CENTRE + factor * (pose.origin_of_a_in_b() - CENTRE) + raised;
    looking_at(position, CENTRE)
}

/// A place on the floor behind the centre, as the camera sees it, `sideways` metres to the right.
pub fn behind_centre(pose: &RigidTransform, sideways: f64) -> DVec3 {
    let level = |axis: DVec3| DVec3::new(axis.x, 0.0, axis.z).normalize();
    let [right, forward] = [0, 2].map(|row| level(pose.rotation.transpose().col(row)));
    DVec3::new(CENTRE.x, 0.0, CENTRE.z) + 0.75 * forward + sideways * right
}

/// Poses of a video along the arc.
pub fn video(frames: usize) -> Vec<RigidTransform> {
    let (azimuth, elevation, radius) = VIDEO;
    (0..frames)
        .map(|frame| {
            let along = 2.0 * frame as f64 / (frames - 1).max(1) as f64 - 1.0;
            looking_at(on_sphere((azimuth * along).to_radians(), elevation.to_radians(), radius), CENTRE)
        })
        .collect()
}

/// Poses of a video once around the scene, up and down on the way, that ends where it began.
pub fn closed_path(frames: usize) -> Vec<RigidTransform> {
    let (radius, elevation, amplitude) = CLOSED;
    let pose = |frame| {
        let around = std::f64::consts::TAU * frame as f64 / frames as f64;
        let height = (elevation + amplitude * (2.0 * around).sin()).to_radians();
        looking_at(on_sphere(around, height, radius), CENTRE)
    };
    (0..frames).map(pose).collect()
}
