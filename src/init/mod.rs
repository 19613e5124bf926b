//! Initialisation: the model that training starts from, with a splat at each sparse point or at random
//! points (method section 5). Works from points and cameras; reading them from files is up to `dataset`.

mod knn;
mod random;
mod splats;
#[cfg(test)]
mod tests;

use crate::camera::Similarity;
use crate::constants::SH_DEGREE_MAX;
use crate::model::Model;
use crate::train::Policy;
use crate::train::density::morton_codes;
use crate::views::{SfmPoint, ViewSource};
use crate::{Error, Report, Result};
use glam::DVec3;
use random::{Stream, local_from_cameras, points_in_views, rotation};
use std::collections::HashSet;
use std::path::Path;

/// Points closer to a camera than this, in local units, give tiny splats and NaN
/// (graphdeco-inria/gaussian-splatting 41).
const CLEARANCE: f64 = 0.01;

/// Purposes of random streams: draws for one must not shift those for another.
const STREAM_POSITIONS: u128 = 1;
const STREAM_COLOURS: u128 = 2;
const STREAM_THINNING: u128 = 3;
const STREAM_ROTATIONS: u128 = 4;

/// Where the splats stand.
#[derive(Clone, Copy, Debug)]
pub enum InitPoints<'a> {
    /// At these points.
    Sparse(&'a [SfmPoint]),
    /// At so many random points in the views.
    Random(usize),
}

/// What a capture contributes to the initial model.
#[derive(Clone, Copy)]
pub struct InitInput<'a> {
    /// The cameras and their split.
    pub views: &'a dyn ViewSource,
    /// Where the splats stand.
    pub points: InitPoints<'a>,
    /// The file that the points were read from, for messages.
    pub points_file: &'a Path,
    /// Way back from the local frame.
    pub capture_from_local: Similarity,
    /// Near plane, local units.
    pub near: f32,
}

/// How the initial model is made.
#[derive(Clone, Debug, PartialEq)]
pub struct InitOptions {
    /// More points than this are thinned at random.
    pub max_points: usize,
    /// SH degree stored, 0 to 3.
    pub sh_degree: u32,
    /// Decides the size of the first texture maps.
    pub policy: Policy,
    /// Seed of everything random.
    pub seed: u64,
}

impl Default for InitOptions {
    fn default() -> Self {
        Self { max_points: 1_000_000, sh_degree: 3, policy: Policy::Litetex, seed: 42 }
    }
}

/// A point of the local frame that becomes a splat.
#[derive(Clone, Copy)]
struct LocalPoint {
    position: [f32; 3],
    /// Display space, 0 to 1.
    rgb: [f32; 3],
    /// Squared distance from the cameras' mean.
    distance: f64,
    /// local_from_surfel, wxyz.
    quaternion: [f32; 4],
}

impl LocalPoint {
    fn new(in_local: DVec3, rgb: [f32; 3]) -> Self {
        let position = in_local.as_vec3().to_array();
        Self { position, rgb, distance: in_local.length_squared(), quaternion: [1.0, 0.0, 0.0, 0.0] }
    }
}

/// The model that training starts from, and which points were left out.
///
/// # Errors
/// [`Error::Usage`] for options out of range, [`Error::InvalidInput`] if no usable point is left.
pub fn initial_model(input: &InitInput<'_>, options: &InitOptions) -> Result<(Model, Report)> {
    if options.sh_degree > SH_DEGREE_MAX || options.max_points == 0 {
        return Err(Error::Usage(format!(
            "initial model: SH degree {} (expected 0 to {SH_DEGREE_MAX}), at most {} points (expected 1 or more)",
            options.sh_degree, options.max_points
        )));
    }
    let mut report = Report::default();
    let mut points = match input.points {
        InitPoints::Sparse(points) => local_points(input, points),
        InitPoints::Random(count) => random_points(input, count, options.seed),
    };
    // What is drawn at random for a point must depend neither on its place in the file nor on how the
    // capture is turned.
    points.sort_by(|a, b| {
        let values = |p: &LocalPoint| p.position.into_iter().chain(p.rgb);
        let compared = values(a).zip(values(b)).map(|(a, b)| a.total_cmp(&b));
        compared.fold(a.distance.total_cmp(&b.distance), std::cmp::Ordering::then)
    });
    let points = usable(points, input.views, &mut report);
    let mut points = thinned(points, options, &mut report);
    if points.is_empty() {
        return Err(Error::invalid(
            input.points_file,
            "no usable point to start from; start from random points (random:COUNT)",
        ));
    }
    let (turned, mut stream) = (local_from_cameras(input.views), Stream::new(options.seed, STREAM_ROTATIONS));
    points.iter_mut().for_each(|point| point.quaternion = rotation(turned, &mut stream));
    Ok((splats::model(input, &along_a_curve(&points), options)?, report))
}

fn local_points(input: &InitInput<'_>, points: &[SfmPoint]) -> Vec<LocalPoint> {
    let local_from_capture = input.capture_from_local.inverse();
    points
        .iter()
        .map(|p| {
            let in_local = local_from_capture.transform_point(p.position_in_capture);
            LocalPoint::new(in_local, p.rgb.map(|c| f32::from(c) / 255.0))
        })
        .collect()
}

fn random_points(input: &InitInput<'_>, count: usize, seed: u64) -> Vec<LocalPoint> {
    let mut stream = Stream::new(seed, STREAM_COLOURS);
    points_in_views(input.views, count, &mut Stream::new(seed, STREAM_POSITIONS))
        .into_iter()
        // Grey with a little variation, so that equal splats do not stay equal.
        .map(|p| LocalPoint::new(p, [0; 3].map(|_| (0.4 + 0.2 * stream.uniform()) as f32)))
        .collect()
}

/// Leaves out points that cannot become splats.
fn usable(points: Vec<LocalPoint>, views: &dyn ViewSource, report: &mut Report) -> Vec<LocalPoint> {
    let centres: Vec<DVec3> = (0..views.num_views()).map(|v| views.camera(v).centre_in_local()).collect();
    let (mut not_finite, mut at_camera, mut duplicates) = (0, 0, 0);
    let mut known = HashSet::new();
    let total = points.len();
    let kept: Vec<LocalPoint> = points
        .into_iter()
        .filter(|point| {
            let position = DVec3::from_array(point.position.map(f64::from));
            if !position.is_finite() {
                not_finite += 1;
                return false;
            }
            if centres.iter().any(|c| c.distance_squared(position) < CLEARANCE * CLEARANCE) {
                at_camera += 1;
                return false;
            }
            // + 0.0 makes -0.0 equal to 0.0.
            let is_new = known.insert(point.position.map(|v| (v + 0.0).to_bits()));
            duplicates += usize::from(!is_new);
            is_new
        })
        .collect();
    for (code, count, what) in [
        ("points-not-finite", not_finite, "are not finite"),
        ("points-at-camera", at_camera, "lie within 1 % of the cameras' extent of a camera"),
        ("points-duplicate", duplicates, "lie where another point lies"),
    ] {
        if count > 0 {
            report.warn(code, count, format!("{count} of {total} points {what} and are left out"));
        }
    }
    kept
}

/// At most as many points as allowed, chosen at random, in their order.
fn thinned(points: Vec<LocalPoint>, options: &InitOptions, report: &mut Report) -> Vec<LocalPoint> {
    let total = points.len();
    if total <= options.max_points {
        return points;
    }
    let mut stream = Stream::new(options.seed, STREAM_THINNING);
    let mut order: Vec<usize> = (0..total).collect();
    for chosen in 0..options.max_points {
        order.swap(chosen, chosen + stream.index(total - chosen));
    }
    order.truncate(options.max_points);
    order.sort_unstable();
    report.warn(
        "points-thinned",
        total - order.len(),
        format!("{} of {total} points kept, chosen at random", order.len()),
    );
    order.into_iter().map(|i| points[i]).collect()
}

/// In the order in which density control stores splats: neighbours in space are neighbours in memory.
fn along_a_curve(points: &[LocalPoint]) -> Vec<LocalPoint> {
    let positions: Vec<f32> = points.iter().flat_map(|point| point.position).collect();
    let mut order: Vec<(u64, usize)> = morton_codes(&positions).into_iter().zip(0..).collect();
    order.sort_unstable();
    order.into_iter().map(|(_, i)| points[i]).collect()
}
