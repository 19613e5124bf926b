//! Points from the photos, where a capture has few of its own: along rays of the training views, the depth at which
//! neighbouring photos show the same (plane sweep, Collins 1996; method 5.4).

use super::input::InitInput;
use super::patch::{Patch, ReducedPhoto};
use super::points::{LocalPoint, quantile};
use super::random::{Purpose, Stream};
use crate::Result;
use crate::camera::Camera;
use crate::views::WantedPhoto;
use glam::{DVec2, DVec3};
use rayon::prelude::*;

/// Pixels of a training view per point that a capture should have: with many views, and with a few. A point needs others to
/// confirm it: dense points from four views cost two dB of the test views (method 5.4).
const PIXELS_PER_POINT: [f64; 2] = [4.0, 25.0];
/// Pixels per point times number of views, in between.
const PIXELS_PER_POINT_OF_ONE_VIEW: f64 = 100.0;
/// Bounds of the number of points.
const WANTED_BOUNDS: (f64, f64) = (500.0, 20_000.0);

/// Longer side of the photos that are compared, pixels.
const SIDE_PX: u32 = 192;

/// Photos that each one is compared with, and the greatest angle between the optical axes: 45 degrees.
const NEIGHBOURS: usize = 4;
const AXES_COS: f64 = 0.707;

/// Preferred distance between the cameras of two photos, local units.
const BASELINE: f64 = 0.25;

/// Depths where no points tell, local units.
const DEPTHS: (f64, f64) = (0.3, 20.0);

/// Of the depths of known points in the views: the quantiles and factors that bound the search.
const DEPTH_QUANTILES: (f64, f64) = (0.02, 0.98);
const DEPTH_FACTORS: (f64, f64) = (0.7, 1.5);

/// Fewer known points than this tell nothing about the depths.
const POINTS_FOR_DEPTHS: usize = 10;

/// Depths that are tried along a ray.
const DEPTHS_TRIED: (f64, f64) = (32.0, 192.0);

/// Correlation of the patches that makes a match, and its lead over the best of other depths.
const MATCH_MIN: f32 = 0.85;
const MATCH_LEAD: f32 = 0.05;

/// Depths whose images lie within this many pixels of the best one belong to the same peak.
const PEAK_RADIUS_PX: f64 = 3.0;

/// Without a match, a ray's point is put on the plane through the nearest matches of its view: as many, within this share
/// of the longer side.
const PLANE_MATCHES: (usize, usize) = (4, 6);
const PLANE_RADIUS: f64 = 0.125;

/// Number of points that a capture should have, by the size of its views.
pub(super) fn wanted_points(input: &InitInput<'_>) -> usize {
    let views = input.photo_views();
    let pixels: f64 = views.iter().map(|&view| input.views.camera(view).pinhole.num_pixels() as f64).sum();
    let per_view = pixels / views.len().max(1) as f64;
    points_for(per_view, views.len())
}

/// Points for this number of views of this many pixels each.
pub(super) fn points_for(pixels: f64, num_views: usize) -> usize {
    let [dense, sparse] = PIXELS_PER_POINT;
    let pixels_per_point = (PIXELS_PER_POINT_OF_ONE_VIEW / num_views.max(1) as f64).clamp(dense, sparse);
    (pixels / pixels_per_point).clamp(WANTED_BOUNDS.0, WANTED_BOUNDS.1) as usize
}

/// Points to add to `known` ones, so that there are at most `most`; none if there are at least half of those wanted.
///
/// # Errors
/// Whatever reading a photo reports.
pub(super) fn swept(
    input: &InitInput<'_>,
    known: &[LocalPoint],
    wanted: usize,
    most: usize,
    background: [f32; 3],
    seed: u64,
) -> Result<Vec<LocalPoint>> {
    let views = input.photo_views();
    let missing = wanted.min(most).saturating_sub(known.len());
    if 2 * known.len() >= wanted || missing == 0 || views.len() < 2 {
        return Ok(Vec::new());
    }
    let cameras: Vec<Camera> = views.iter().map(|&view| input.views.camera(view)).collect();
    input.views.prefetch(&WantedPhoto::full(&views));
    let photo = |(&view, camera): (&usize, &Camera)| {
        Ok(ReducedPhoto::new(&*input.views.target(view)?, camera, SIDE_PX))
    };
    let photos = views.iter().zip(&cameras).map(photo).collect::<Result<Vec<_>>>()?;
    let (near, far) = depths(&photos, known);
    let mut stream = Stream::new(seed, Purpose::Rays);
    let rays: Vec<Vec<DVec2>> = (0..photos.len())
        .map(|i| {
            // Shared evenly: all views get as many, the first ones one more.
            let count = (missing + photos.len() - 1 - i) / photos.len();
            let pinhole = &photos[i].camera.pinhole;
            let size = DVec2::new(pinhole.width_px.into(), pinhole.height_px.into());
            (0..count).map(|_| DVec2::new(stream.uniform(), stream.uniform()) * size).collect()
        })
        .collect();
    let of_view = |(i, rays): (usize, &Vec<DVec2>)| points_of_view(i, rays, &photos, (near, far), background);
    Ok(rays.par_iter().enumerate().map(of_view).collect::<Vec<_>>().concat())
}

/// The points of one view.
fn points_of_view(
    index: usize,
    rays: &[DVec2],
    photos: &[ReducedPhoto],
    (near, far): (f64, f64),
    background: [f32; 3],
) -> Vec<LocalPoint> {
    let photo = &photos[index];
    let neighbours = neighbours(index, photos);
    let mut matched: Vec<(DVec2, f64)> = Vec::new();
    let mut open = Vec::new();
    let shows_scene = |at: &&DVec2| photo.counts(**at) && !photo.shows_background(**at, background);
    for &at_px in rays.iter().filter(shows_scene) {
        let found = Patch::new(photo, at_px)
            .and_then(|patch| inverse_depth(&patch, &neighbours, (1.0 / far, 1.0 / near)));
        match found {
            Some(inverse) => matched.push((at_px, inverse)),
            None => open.push(at_px),
        }
    }
    let between = open.into_iter().filter_map(|at| Some((at, on_plane(at, &matched, photo)?)));
    let all: Vec<(DVec2, f64)> = matched.iter().copied().chain(between).collect();
    all.into_iter()
        .map(|(at_px, inverse)| {
            let in_camera = photo.camera.pinhole.direction_in_camera(at_px) / inverse;
            let in_local = photo.camera.camera_from_local.inverse().transform_point(in_camera);
            LocalPoint::new(in_local, photo.rgb(at_px).map(|c| c as f32))
        })
        .collect()
}

/// The photos that look the same way from a little aside.
fn neighbours(index: usize, photos: &[ReducedPhoto]) -> Vec<&ReducedPhoto> {
    let axis = |photo: &ReducedPhoto| photo.camera.camera_from_local.rotation.row(2);
    let own = &photos[index];
    let baseline =
        |other: &ReducedPhoto| other.camera.centre_in_local().distance(own.camera.centre_in_local());
    let mut near: Vec<&ReducedPhoto> = photos
        .iter()
        .enumerate()
        .filter(|(i, other)| *i != index && axis(other).dot(axis(own)) > AXES_COS && baseline(other) > 1e-3)
        .map(|(_, other)| other)
        .collect();
    let cost = |other: &ReducedPhoto| (baseline(other) - BASELINE).abs();
    near.sort_by(|a, b| cost(a).total_cmp(&cost(b)));
    near.truncate(NEIGHBOURS);
    near
}

/// Bounds of the depths, from the known points in the views.
fn depths(photos: &[ReducedPhoto], known: &[LocalPoint]) -> (f64, f64) {
    if known.len() < POINTS_FOR_DEPTHS {
        return DEPTHS;
    }
    let mut depths: Vec<f64> = Vec::new();
    for photo in photos {
        let in_view = known.iter().filter_map(|point| {
            let in_camera = photo.camera.camera_from_local.transform_point(point.position_in_local());
            let at = photo.camera.pinhole.project(in_camera)?;
            photo.contains(at).then_some(in_camera.z)
        });
        depths.extend(in_view);
    }
    if depths.is_empty() {
        return DEPTHS;
    }
    let near = DEPTH_FACTORS.0 * quantile(&mut depths, DEPTH_QUANTILES.0);
    let far = DEPTH_FACTORS.1 * quantile(&mut depths, DEPTH_QUANTILES.1);
    (near, far.max(1.5 * near))
}

/// The inverse depth at which the neighbours match a patch; `None` without a clear match.
fn inverse_depth(patch: &Patch, neighbours: &[&ReducedPhoto], (least, most): (f64, f64)) -> Option<f64> {
    let neighbour_rays: Vec<_> = neighbours.iter().map(|photo| patch.seen_by(photo)).collect();
    // A step moves the patch by about a pixel, as far as the largest number of steps reaches.
    let path_px = neighbour_rays.iter().map(|rays| rays.path_px(least, most)).fold(0.0, f64::max);
    // Where the neighbours hardly look from aside, every depth matches.
    if path_px <= PEAK_RADIUS_PX {
        return None;
    }
    let count = path_px.clamp(DEPTHS_TRIED.0, DEPTHS_TRIED.1) as usize;
    let step = (most - least) / (count - 1) as f64;
    let score = |inverse: f64| {
        let mut matches: Vec<f32> =
            neighbour_rays.iter().map(|rays| patch.correlation(rays, inverse)).collect();
        matches.sort_unstable_by(|a, b| b.total_cmp(a));
        // The best two: others may not see the place. A single neighbour must do where there is no second.
        let best = &matches[..matches.len().min(2)];
        best.iter().sum::<f32>() / best.len().max(1) as f32
    };
    let scores: Vec<f32> = (0..count).map(|i| score(least + step * i as f64)).collect();
    let best = (0..count).max_by(|&a, &b| scores[a].total_cmp(&scores[b]))?;
    let is_other = |i: &usize| i.abs_diff(best) as f64 * path_px / count as f64 > PEAK_RADIUS_PX;
    let others = (0..count).filter(is_other).map(|i| scores[i]);
    if scores[best] < MATCH_MIN || others.fold(f32::MIN, f32::max) > scores[best] - MATCH_LEAD {
        return None;
    }
    // Twice halved steps around the best one.
    let mut found = (scores[best], least + step * best as f64);
    for width in [0.5 * step, 0.25 * step] {
        let middle = found.1;
        for inverse in [middle - width, middle + width] {
            let score = score(inverse);
            if inverse > 0.0 && score > found.0 {
                found = (score, inverse);
            }
        }
    }
    Some(found.1)
}

/// Inverse depth of the plane through the nearest matches of the view: on a plane it is linear in the image.
fn on_plane(at_px: DVec2, matched: &[(DVec2, f64)], photo: &ReducedPhoto) -> Option<f64> {
    let pinhole = &photo.camera.pinhole;
    let radius = PLANE_RADIUS * f64::from(pinhole.width_px.max(pinhole.height_px));
    let mut near: Vec<(f64, DVec2, f64)> = matched
        .iter()
        .map(|(at, inverse)| (at.distance_squared(at_px), *at - at_px, *inverse))
        .filter(|(squared, ..)| *squared < radius * radius)
        .collect();
    if near.len() < PLANE_MATCHES.0 {
        return None;
    }
    near.sort_unstable_by(|a, b| a.0.total_cmp(&b.0));
    near.truncate(PLANE_MATCHES.1);
    // Weighted least squares for the value at the pixel, with a ridge against matches on a line.
    let (mut matrix, mut rhs) = (glam::DMat3::ZERO, DVec3::ZERO);
    for (squared, offset, inverse) in &near {
        let weight = 1.0 / (1.0 + squared);
        let row = DVec3::new(1.0, offset.x / radius, offset.y / radius);
        matrix += glam::DMat3::from_cols(row * row.x, row * row.y, row * row.z) * weight;
        rhs += row * (weight * inverse);
    }
    let ridge = 1e-3 * matrix.x_axis.x;
    matrix.y_axis.y += ridge;
    matrix.z_axis.z += ridge;
    let at = (matrix.inverse() * rhs).x;
    let bounds = near.iter().fold((f64::MAX, 0.0_f64), |(low, high), (.., i)| (low.min(*i), high.max(*i)));
    (0.8 * bounds.0..=1.25 * bounds.1).contains(&at).then_some(at)
}
