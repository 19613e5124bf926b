//! Sparse points of the sample capture: on surfaces, and wrong ones where a stress asks for them.

use super::colmap_write::SparsePoint;
use super::options::SampleOptions;
use super::patch::{GREY, Patch};
use super::planted::Planted;
use super::random::{Stream, normal_vector, stream, uniform};
use super::ray::{Hit, Ray, Surface};
use super::render;
use super::scene::Scene;
use super::stress::StressKind as Kind;
use super::views::View;
use glam::{DVec2, DVec3};

/// Half extent of the box in which wrong points lie, metres.
const OUTLIERS: f64 = 3.5;

/// Sparse points on surfaces, each visible from at least two views.
pub fn points(options: &SampleOptions, scene: &Scene, views: &[View]) -> Vec<SparsePoint> {
    let mut rng = stream(options.seed, Stream::Points, 0);
    let mut points = Vec::with_capacity(options.points);
    // Nearly every surface is visible from several cameras; the bound only matters for unusual options.
    for attempt in 0..8 * options.points {
        if points.len() == options.points {
            break;
        }
        let view = &views[attempt % views.len()];
        let at = size_of(view) * DVec2::new(uniform(&mut rng), uniform(&mut rng));
        let hit = scene.cast(&render::ray_through(&view.pinhole, &view.camera_from_capture, at));
        let noise = normal_vector(&mut rng);
        if hit.surface == Surface::Sky || scene.extras.is_mirror(&hit) {
            continue;
        }
        points.extend(point(scene, &hit, hit.position + options.point_noise_m * noise, views));
    }
    add_wrong(&mut points, options, views);
    points
}

fn size_of(view: &View) -> DVec2 {
    DVec2::new(f64::from(view.pinhole.width_px), f64::from(view.pinhole.height_px))
}

/// Position in the file of a photo, from that in the rendered photo.
fn in_file(view: &View, at: DVec2) -> DVec2 {
    view.padded.map_or(at, |(_, [left, top])| at + DVec2::new(f64::from(left), f64::from(top)))
}

/// Points of a patch, or near the splats of a planted scene.
pub fn points_on_patch(
    options: &SampleOptions,
    patch: &Patch,
    planted: Option<&Planted>,
    views: &[View],
) -> Vec<SparsePoint> {
    let mut rng = stream(options.seed, Stream::Points, 1);
    let places = match planted {
        Some(planted) => planted.points(options.points),
        None => (0..options.points).map(|_| patch.place(&mut rng).extend(0.0)).collect(),
    };
    let rgb = |place: DVec3| {
        let colour =
            if planted.is_some() { DVec3::splat(GREY) } else { patch.colour(place.truncate(), DVec3::NEG_Z) };
        colour.to_array().map(render::byte)
    };
    let point = |place: DVec3| {
        let position = place + options.point_noise_m * normal_vector(&mut rng);
        tracked(place, position, rgb(place), views, |_| true)
    };
    places.into_iter().filter_map(point).collect()
}

/// The point of a hit; `None` if fewer than two views see it.
fn point(scene: &Scene, hit: &Hit, position: DVec3, views: &[View]) -> Option<SparsePoint> {
    let origin = hit.position + 1e-6 * hit.normal;
    let is_visible = |view: &View| {
        let direction = view.camera_from_capture.origin_of_a_in_b() - origin;
        direction.dot(hit.normal) > 0.0 && !scene.occludes(&Ray { origin, direction })
    };
    tracked(hit.position, position, render::point_colour(scene, hit), views, is_visible)
}

/// The point that is said to be at `position` and is seen at `place`; `None` if fewer than two views see it.
fn tracked(
    place: DVec3,
    position: DVec3,
    rgb: [u8; 3],
    views: &[View],
    is_visible: impl Fn(&View) -> bool,
) -> Option<SparsePoint> {
    let observations: Vec<_> = views
        .iter()
        .enumerate()
        .filter_map(|(index, view)| {
            let seen = view.pinhole.project(view.camera_from_capture.transform_point(place))?;
            let inside = seen.cmpge(DVec2::ZERO).all() && seen.cmplt(size_of(view)).all();
            (inside && is_visible(view)).then_some((index, seen))
        })
        .collect();
    if observations.len() < 2 {
        return None;
    }
    let errors = observations.iter().map(|&(index, seen)| {
        let view = &views[index];
        let projected = view.pinhole.project(view.camera_from_capture.transform_point(position));
        projected.map_or(0.0, |p| p.distance(seen))
    });
    Some(SparsePoint {
        position,
        rgb,
        error_px: errors.sum::<f64>() / observations.len() as f64,
        observations: observations.into_iter().map(|(i, at)| (i, in_file(&views[i], at))).collect(),
    })
}

/// Moves, repeats or adds points as the stress says. Wrong points keep the observations of right ones.
fn add_wrong(points: &mut Vec<SparsePoint>, options: &SampleOptions, views: &[View]) {
    let Some(stress) = options.stress else { return };
    let mut rng = stream(options.seed, Stream::WrongPoints, 0);
    match stress.kind {
        Kind::Outliers => {
            for point in points {
                if uniform(&mut rng) < stress.level {
                    let mut anywhere = || OUTLIERS * (2.0 * uniform(&mut rng) - 1.0);
                    point.position = DVec3::new(anywhere(), anywhere(), anywhere());
                }
            }
        }
        Kind::Duplicates => {
            let chosen: Vec<_> =
                points.iter().filter(|_| uniform(&mut rng) < stress.level).cloned().collect();
            points.extend(chosen);
        }
        Kind::CameraPoints if !points.is_empty() => {
            for i in 0..stress.level as usize {
                let position = views[i % views.len()].camera_from_capture.origin_of_a_in_b();
                let point = SparsePoint { position, ..points[i % points.len()].clone() };
                points.push(point);
            }
        }
        _ => {}
    }
}
