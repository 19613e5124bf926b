//! The backdrop: large splats behind the points, where rays of the training views meet no points, as in the sky or on
//! blank walls (method 5.3). Without it, such pixels stay empty or fill with floaters.

use super::cells::{coarse, visit_cells};
use super::input::InitInput;
use super::points::{LocalPoint, quantile};
use super::random::local_from_cameras;
use crate::Result;
use crate::camera::Camera;
use crate::constants::MAP_SIGMA_MAX;
use crate::image::{TargetImage, is_background};
use crate::views::WantedPhoto;
use glam::{DMat3, DQuat, DVec2, DVec3};
use rayon::prelude::*;

/// Directions in which a splat may stand, evenly over the sphere: about 6 degrees apart.
const DIRECTIONS: usize = 1024;

/// Rays along the longer side of a view.
const RAYS_PER_SIDE: u32 = 24;

/// A ray meets the scene where it passes at least this many initial splats within their support. On a surface some
/// 28 overlap, as their standard deviation is the spacing of the points; a stray point is alone.
const SPLATS_MET: u16 = 3;

/// Empty rays that a direction needs for a splat.
const EMPTY_RAYS_MIN: usize = 2;

/// Cosine of the angle up to which the backdrop continues what views show into directions where none looks: 25 degrees.
const CONTINUED_COS: f64 = 0.906;

/// Standard deviation in units of the spacing of directions: neighbours together hide what is behind.
const SIGMA_PER_SPACING: f64 = 0.7;

/// Opacity of the splats.
const OPACITY: f64 = 0.9;

/// Distance from the cameras' mean where no points are near: this multiple of the distance that 98 % of the points keep,
/// within bounds in local units.
const FAR_FACTOR: f64 = 2.0;
const FAR_BOUNDS: (f64, f64) = (2.0, 30.0);

/// Distance in the other directions: this multiple of the distance that most of the nearest points by angle keep, but
/// behind the cameras.
const NEAR_FACTOR: f64 = 1.2;
const NEAR_POINTS: usize = 32;
const NEAR_QUANTILE: f64 = 0.8;
const NEAR_MIN: f64 = 1.5;

/// Cosine of the angle up to which points count as near: 15 degrees.
const NEAR_COS: f64 = 0.966;

/// Of more points, as many evenly spaced ones stand for all.
const POINTS_MAX: usize = 50_000;

/// Colours of the photos along the rays that end near one direction.
#[derive(Clone, Default)]
struct Seen {
    all: Vec<[f64; 3]>,
    /// Of the rays that meet no points.
    empty: Vec<[f64; 3]>,
}

/// The splats of the backdrop: where rays of the training views meet no points, and around what the views show.
///
/// # Errors
/// Whatever reading a photo reports.
pub(super) fn backdrop(
    input: &InitInput<'_>,
    points: &[LocalPoint],
    background: [f32; 3],
) -> Result<Vec<LocalPoint>> {
    let views = input.photo_views();
    let turned = local_from_cameras(input.views);
    let directions: Vec<DVec3> = directions().into_iter().map(|d| turned * d).collect();
    let radii = radii(&directions, points);
    let mut seen = vec![Seen::default(); directions.len()];
    input.views.prefetch(&WantedPhoto::full(&views));
    for &view in &views {
        let camera = input.views.camera(view);
        let photo = input.views.target(view)?;
        for ray in rays_of(&camera, &photo, points, input.near) {
            let nearest =
                &mut seen[met_direction(&directions, &radii, camera.centre_in_local(), ray.direction)];
            nearest.all.push(ray.rgb);
            if ray.is_empty {
                nearest.empty.push(ray.rgb);
            }
        }
    }
    let colours = colours(&directions, &seen, background);
    let splats = directions.iter().zip(radii).zip(colours);
    Ok(splats.filter_map(|((&at, radius), colour)| Some(splat(at, radius, colour?, turned))).collect())
}

/// A ray through the middle of a cell of a view.
struct Ray {
    direction: DVec3,
    /// Mean of the photo's colours in the cell, 0 to 1.
    rgb: [f64; 3],
    is_empty: bool,
}

/// The rays of a view through pixels that count.
fn rays_of(camera: &Camera, photo: &TargetImage, points: &[LocalPoint], near: f32) -> Vec<Ray> {
    let camera = coarse(camera, RAYS_PER_SIDE);
    let (columns, rows) = (camera.pinhole.width_px, camera.pinhole.height_px);
    let reduced = photo.reduced(columns, rows);
    let met = splats_met(&camera, points, near);
    let local_from_camera = camera.camera_from_local.rotation.transpose();
    let counts = |cell: &usize| reduced.counts(*cell);
    (0..camera.pinhole.num_pixels())
        .filter(counts)
        .map(|cell| {
            let centre = DVec2::new((cell as u32 % columns).into(), (cell as u32 / columns).into()) + 0.5;
            Ray {
                direction: local_from_camera * camera.pinhole.direction_in_camera(centre),
                rgb: [0, 1, 2].map(|c| f64::from(reduced.rgb[3 * cell + c]) / 255.0),
                is_empty: met[cell] < SPLATS_MET,
            }
        })
        .collect()
}

/// For each cell of a view the initial splats whose support its centre lies in. `[rows, columns]`
fn splats_met(camera: &Camera, points: &[LocalPoint], near: f32) -> Vec<u16> {
    let sum = |mut a: Vec<u16>, b: Vec<u16>| {
        a.iter_mut().zip(b).for_each(|(a, b)| *a = a.saturating_add(b));
        a
    };
    let none = || vec![0_u16; camera.pinhole.num_pixels()];
    let add = |mut met: Vec<u16>, chunk: &[LocalPoint]| {
        visit_cells(camera, near, chunk, MAP_SIGMA_MAX, |cell| {
            met[cell] = met[cell].saturating_add(1);
        });
        met
    };
    points.par_chunks(1024).fold(none, add).reduce(none, sum)
}

/// Colours of the backdrop by direction; `None`: no splat. Directions without rays continue their neighbours.
fn colours(directions: &[DVec3], seen: &[Seen], background: [f32; 3]) -> Vec<Option<[f64; 3]>> {
    let shown: Vec<_> = seen.iter().map(|seen| median(&seen.all)).collect();
    let continued = |direction: DVec3| {
        let mut sum = [0.0; 4];
        for (other, colour) in directions.iter().zip(&shown) {
            let cos = direction.dot(*other);
            let Some(colour) = colour.filter(|_| cos > CONTINUED_COS) else { continue };
            // By far most weight to the nearest ones.
            let weight = (1.0 - cos).max(1e-6).powi(-3);
            colour.iter().chain(&[1.0]).zip(&mut sum).for_each(|(value, sum)| *sum += weight * value);
        }
        (sum[3] > 0.0).then(|| [0, 1, 2].map(|c| sum[c] / sum[3]))
    };
    // What looks like the background needs no splat.
    let differs = |colour: &[f64; 3]| !is_background(*colour, background);
    let of = |(seen, &direction): (&Seen, &DVec3)| match seen.all.len() {
        0 => continued(direction),
        _ if seen.empty.len() >= EMPTY_RAYS_MIN => median(&seen.empty),
        _ => None,
    };
    seen.iter().zip(directions).map(of).map(|colour| colour.filter(differs)).collect()
}

/// The median of each channel; `None` without colours.
fn median(colours: &[[f64; 3]]) -> Option<[f64; 3]> {
    let of_channel = |channel: usize| {
        let mut values: Vec<f64> = colours.iter().map(|colour| colour[channel]).collect();
        *values.select_nth_unstable_by(colours.len() / 2, f64::total_cmp).1
    };
    (!colours.is_empty()).then(|| [0, 1, 2].map(of_channel))
}

/// A splat that faces the cameras.
fn splat(direction: DVec3, radius: f64, rgb: [f64; 3], turned: DQuat) -> LocalPoint {
    let spacing = (4.0 * std::f64::consts::PI / DIRECTIONS as f64).sqrt();
    let across = [DVec3::X, DVec3::Y, DVec3::Z]
        .map(|axis| direction.cross(turned * axis))
        .into_iter()
        .max_by(|a, b| a.length_squared().total_cmp(&b.length_squared()))
        .expect("three axes")
        .normalize();
    let axes = DMat3::from_cols(across, direction.cross(across), direction);
    let [x, y, z, w] = DQuat::from_mat3(&axes).normalize().to_array();
    LocalPoint {
        quaternion: [w, x, y, z].map(|v| v as f32),
        sigma: (SIGMA_PER_SPACING * spacing * radius) as f32,
        opacity: OPACITY,
        ..LocalPoint::new(direction * radius, rgb.map(|c| c as f32))
    }
}

/// Evenly spaced unit vectors: a spiral from pole to pole in steps of the golden angle.
fn directions() -> Vec<DVec3> {
    let golden = std::f64::consts::PI * (3.0 - 5.0_f64.sqrt());
    (0..DIRECTIONS)
        .map(|i| {
            let z = 1.0 - (2.0 * i as f64 + 1.0) / DIRECTIONS as f64;
            let (sin, cos) = (golden * i as f64).sin_cos();
            let ring = (1.0 - z * z).sqrt();
            DVec3::new(ring * cos, ring * sin, z)
        })
        .collect()
}

fn nearest(directions: &[DVec3], direction: DVec3) -> usize {
    let cos = |i: &usize| directions[*i].dot(direction);
    (0..directions.len()).max_by(|a, b| cos(a).total_cmp(&cos(b))).expect("there are directions")
}

/// Where a ray from inside the sphere leaves it.
fn hit(origin: DVec3, direction: DVec3, radius: f64) -> DVec3 {
    let direction = direction.normalize();
    let along = origin.dot(direction);
    let beyond = (along * along + radius * radius - origin.length_squared()).max(0.0).sqrt();
    origin + direction * (beyond - along)
}

/// The direction whose splat a ray would meet: two rounds are enough where neighbours keep similar distances.
fn met_direction(directions: &[DVec3], radii: &[f64], origin: DVec3, ray: DVec3) -> usize {
    let far = radii.iter().copied().fold(0.0, f64::max);
    let at = |radius| nearest(directions, hit(origin, ray, radius).normalize());
    at(radii[at(radii[at(far)])])
}

/// Distance of the backdrop in each direction.
fn radii(directions: &[DVec3], points: &[LocalPoint]) -> Vec<f64> {
    let step = points.len().div_ceil(POINTS_MAX).max(1);
    let points: Vec<(DVec3, f64)> = points
        .iter()
        .step_by(step)
        .map(|point| (point.position_in_local().normalize_or_zero(), point.distance.sqrt()))
        .collect();
    let mut distances: Vec<f64> = points.iter().map(|(_, distance)| *distance).collect();
    let far = FAR_FACTOR * quantile(&mut distances, 0.98);
    let far = far.clamp(FAR_BOUNDS.0, FAR_BOUNDS.1);
    let of = |direction: &DVec3| {
        let mut near: Vec<(f64, f64)> = points
            .iter()
            .map(|(at, distance)| (at.dot(*direction), *distance))
            .filter(|(cos, _)| *cos > NEAR_COS)
            .collect();
        if near.len() < NEAR_POINTS {
            return far;
        }
        near.select_nth_unstable_by(NEAR_POINTS - 1, |a, b| b.0.total_cmp(&a.0));
        let mut distances: Vec<f64> = near[..NEAR_POINTS].iter().map(|(_, distance)| *distance).collect();
        (NEAR_FACTOR * quantile(&mut distances, NEAR_QUANTILE)).clamp(NEAR_MIN, far)
    };
    directions.par_iter().map(of).collect()
}
