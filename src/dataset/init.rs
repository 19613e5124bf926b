//! The model that training starts from: splats at the points of the capture, of a file or at random
//! (method section 5).

use super::frame::local_from_cameras;
use super::knn::mean_squared_spacing;
use super::random::{Stream, points_in_views};
use super::source::SfmPoint;
use super::{Capture, read_ply_points};
use crate::constants::{SH_0, SH_DEGREE_MAX, sh_coefficients};
use crate::model::{Model, SplatArrays, TexturePool, support_half_extent};
use crate::train::Policy;
use crate::train::density::{first_texel_size, morton_codes};
use crate::{Error, Report, Result};
use glam::{DQuat, DVec3};
use serde::{Deserialize, Serialize};
use std::collections::HashSet;
use std::fmt;
use std::path::PathBuf;
use std::str::FromStr;

/// Opacity at the start (3DGS).
const OPACITY: f64 = 0.1;

/// Floor of the mean squared spacing, local units (CAT).
const SPACING_FLOOR: f32 = 1e-7;

/// Bounds of the initial standard deviations, local units (method 5.1).
const SIGMA_BOUNDS: (f32, f32) = (1e-7, 1.0);

/// Points closer to a camera than this give tiny splats and NaN (graphdeco-inria/gaussian-splatting 41).
const CLEARANCE: f64 = 0.01;

/// Random points unless the user says otherwise.
const RANDOM_POINTS: usize = 20_000;

/// More cannot be asked for.
const RANDOM_POINTS_MAX: usize = 10_000_000;

/// Where the first splats come from.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub enum InitSource {
    /// The capture's points, else random ones.
    #[default]
    Auto,
    /// The capture's points.
    Sfm,
    /// A point cloud in the capture's frame.
    Ply(PathBuf),
    /// So many random points in the views.
    Random(usize),
}

impl FromStr for InitSource {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match (text, text.split_once(':')) {
            ("auto", _) => Ok(Self::Auto),
            ("sfm", _) => Ok(Self::Sfm),
            ("random", _) => Ok(Self::Random(RANDOM_POINTS)),
            (_, Some(("ply", path))) if !path.is_empty() => Ok(Self::Ply(path.into())),
            (_, Some(("random", count))) => match count.parse() {
                Ok(count @ 1..=RANDOM_POINTS_MAX) => Ok(Self::Random(count)),
                _ => Err(format!("{text:?}: expected random:COUNT with COUNT from 1 to 10,000,000")),
            },
            _ => Err(format!(
                "{text:?}: expected \"auto\", \"sfm\", \"random\", \"random:COUNT\" or \"ply:FILE\""
            )),
        }
    }
}

impl InitSource {
    /// Whether splats start at random places.
    pub fn is_random(&self, capture: &Capture) -> bool {
        match self {
            Self::Random(_) => true,
            Self::Auto => capture.points.is_empty(),
            Self::Sfm | Self::Ply(_) => false,
        }
    }
}

impl fmt::Display for InitSource {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Auto => f.write_str("auto"),
            Self::Sfm => f.write_str("sfm"),
            Self::Ply(path) => write!(f, "ply:{}", path.display()),
            Self::Random(count) => write!(f, "random:{count}"),
        }
    }
}

impl TryFrom<String> for InitSource {
    type Error = String;

    fn try_from(text: String) -> Result<Self, String> {
        text.parse()
    }
}

impl From<InitSource> for String {
    fn from(source: InitSource) -> Self {
        source.to_string()
    }
}

/// How the first model is made.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default, rename_all = "kebab-case")]
pub struct InitOptions {
    /// Where the points come from.
    pub source: InitSource,
    /// More points are thinned at random.
    pub max_points: usize,
    /// SH degree stored, 0 to 3.
    pub sh_degree: u32,
    /// Who gets how large a map.
    pub policy: Policy,
    /// Seed of everything random.
    pub seed: u64,
}

impl Default for InitOptions {
    fn default() -> Self {
        Self {
            source: InitSource::Auto,
            max_points: 1_000_000,
            sh_degree: 3,
            policy: Policy::Litetex,
            seed: 42,
        }
    }
}

/// A point of the local frame with its display-space colour.
#[derive(Clone, Copy)]
struct Seed {
    position: [f32; 3],
    rgb: [f32; 3],
    /// Squared, from the cameras' mean.
    distance: f64,
    /// local_from_surfel, wxyz.
    quaternion: [f32; 4],
}

impl Seed {
    fn new(in_local: DVec3, rgb: [f32; 3]) -> Self {
        let position = in_local.as_vec3().to_array();
        Self { position, rgb, distance: in_local.length_squared(), quaternion: [1.0, 0.0, 0.0, 0.0] }
    }
}

/// The model that training starts from, and what was left out on the way.
///
/// # Errors
/// [`Error::Usage`] for options out of range, [`Error::InvalidInput`] if no usable point is left or a
/// point cloud cannot be read.
pub fn initial_model(capture: &Capture, options: &InitOptions) -> Result<(Model, Report)> {
    if options.sh_degree > SH_DEGREE_MAX || options.max_points == 0 {
        return Err(Error::Usage(format!(
            "initial model: SH degree {} (expected 0 to {SH_DEGREE_MAX}), at most {} points (expected more)",
            options.sh_degree, options.max_points
        )));
    }
    let mut report = Report::default();
    let mut seeds = seeds(capture, options, &mut report)?;
    // What is drawn at random for a point must depend neither on its place in the file nor on how the
    // capture is turned.
    seeds.sort_by(|a, b| {
        let values = |s: &Seed| s.position.into_iter().chain(s.rgb);
        let compared = values(a).zip(values(b)).map(|(a, b)| a.total_cmp(&b));
        compared.fold(a.distance.total_cmp(&b.distance), std::cmp::Ordering::then)
    });
    let seeds = filtered(seeds, capture, &mut report);
    let mut seeds = thinned(seeds, options, &mut report);
    if seeds.is_empty() {
        return Err(Error::invalid(
            &capture.poses,
            "no usable point to start from; start from random points (random:COUNT)",
        ));
    }
    let (turned, mut stream) = (local_from_cameras(capture), Stream::new(options.seed, 4));
    seeds.iter_mut().for_each(|seed| seed.quaternion = quaternion(turned, &mut stream));
    Ok((model(capture, &along_a_curve(&seeds), options)?, report))
}

fn seeds(capture: &Capture, options: &InitOptions, report: &mut Report) -> Result<Vec<Seed>> {
    match &options.source {
        InitSource::Sfm if capture.points.is_empty() => Err(Error::invalid(
            &capture.poses,
            "the capture has no points; start from random points (random:COUNT)",
        )),
        InitSource::Auto if capture.points.is_empty() => {
            report.warn(
                "random-start",
                RANDOM_POINTS,
                format!("the capture has no points: starts from {RANDOM_POINTS} random ones"),
            );
            Ok(random_seeds(capture, RANDOM_POINTS, options.seed))
        }
        InitSource::Auto | InitSource::Sfm => Ok(local_seeds(capture, &capture.points)),
        InitSource::Ply(path) => Ok(local_seeds(capture, &read_ply_points(path)?)),
        InitSource::Random(count) => Ok(random_seeds(capture, *count, options.seed)),
    }
}

fn local_seeds(capture: &Capture, points: &[SfmPoint]) -> Vec<Seed> {
    let local_from_capture = capture.capture_from_local.inverse();
    points
        .iter()
        .map(|p| {
            let in_local = local_from_capture.transform_point(p.position_in_capture);
            Seed::new(in_local, p.rgb.map(|c| f32::from(c) / 255.0))
        })
        .collect()
}

fn random_seeds(capture: &Capture, count: usize, seed: u64) -> Vec<Seed> {
    let mut stream = Stream::new(seed, 2);
    points_in_views(capture, count, seed)
        .into_iter()
        // Grey with a little variation, so that equal splats do not stay equal.
        .map(|p| Seed::new(p, [0; 3].map(|_| (0.4 + 0.2 * stream.uniform()) as f32)))
        .collect()
}

/// Without points that cannot become splats.
fn filtered(seeds: Vec<Seed>, capture: &Capture, report: &mut Report) -> Vec<Seed> {
    let centres: Vec<DVec3> = capture.views.iter().map(|v| v.camera.centre_in_local()).collect();
    let (mut not_finite, mut at_camera, mut duplicates) = (0, 0, 0);
    let mut known = HashSet::new();
    let total = seeds.len();
    let kept: Vec<Seed> = seeds
        .into_iter()
        .filter(|seed| {
            let position = DVec3::from_array(seed.position.map(f64::from));
            if !position.is_finite() {
                not_finite += 1;
                return false;
            }
            if centres.iter().any(|c| c.distance_squared(position) < CLEARANCE * CLEARANCE) {
                at_camera += 1;
                return false;
            }
            // + 0.0: both zeros are one place.
            let is_new = known.insert(seed.position.map(|v| (v + 0.0).to_bits()));
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

/// At most as many as allowed, chosen at random, in their order.
fn thinned(mut seeds: Vec<Seed>, options: &InitOptions, report: &mut Report) -> Vec<Seed> {
    let total = seeds.len();
    if total <= options.max_points {
        return seeds;
    }
    let mut stream = Stream::new(options.seed, 3);
    let mut order: Vec<usize> = (0..total).collect();
    for chosen in 0..options.max_points {
        order.swap(chosen, chosen + stream.index(total - chosen));
    }
    order.truncate(options.max_points);
    order.sort_unstable();
    seeds = order.into_iter().map(|i| seeds[i]).collect();
    report.warn(
        "points-thinned",
        total - seeds.len(),
        format!("{} of {total} points kept, chosen at random", seeds.len()),
    );
    seeds
}

/// In the order in which density-control steps store splats: neighbours in space are neighbours in memory.
fn along_a_curve(seeds: &[Seed]) -> Vec<Seed> {
    let positions: Vec<f32> = seeds.iter().flat_map(|seed| seed.position).collect();
    let mut order: Vec<(u64, usize)> = morton_codes(&positions).into_iter().zip(0..).collect();
    order.sort_unstable();
    order.into_iter().map(|(_, i)| seeds[i]).collect()
}

fn model(capture: &Capture, seeds: &[Seed], options: &InitOptions) -> Result<Model> {
    let mut splats = SplatArrays::zeros(seeds.len(), options.sh_degree);
    let positions: Vec<[f32; 3]> = seeds.iter().map(|s| s.position).collect();
    let sigmas: Vec<f32> = mean_squared_spacing(&positions)
        .into_iter()
        // A point alone is as large as allowed.
        .map(|spacing| spacing.map_or(SIGMA_BOUNDS.1, |s| s.max(SPACING_FLOOR).sqrt()))
        .map(|sigma| sigma.clamp(SIGMA_BOUNDS.0, SIGMA_BOUNDS.1))
        .collect();
    splats.positions = positions.into_flattened();
    splats.log_scales = sigmas.iter().flat_map(|s| [s.ln(); 2]).collect();
    splats.opacity_logits.fill((OPACITY / (1.0 - OPACITY)).ln() as f32);
    splats.quaternions = seeds.iter().flat_map(|seed| seed.quaternion).collect();
    let coefficients = 3 * sh_coefficients(options.sh_degree);
    for (sh, seed) in splats.sh.chunks_exact_mut(coefficients).zip(seeds) {
        for (out, c) in sh.iter_mut().zip(seed.rgb) {
            *out = ((f64::from(c) - 0.5) / SH_0) as f32;
        }
    }
    let extents = sigmas.iter().map(|&sigma| map_extent(sigma, options.policy));
    Ok(Model {
        textures: TexturePool::neutral(extents)?,
        splats,
        near: capture.near,
        capture_from_local: capture.capture_from_local,
    })
}

/// Uniform over all rotations, drawn in turned axes.
fn quaternion(turned: DQuat, stream: &mut Stream) -> [f32; 4] {
    loop {
        let ([a, b], [c, d]) = (stream.normals(), stream.normals());
        let drawn = DQuat::from_xyzw(b, c, d, a);
        if drawn.length() > 1e-6 {
            let [x, y, z, w] = (turned * drawn.normalize()).to_array();
            return [w, x, y, z].map(|v| v as f32);
        }
    }
}

/// Rows, columns and texel size of a round splat's map.
fn map_extent(sigma: f32, policy: Policy) -> (u16, u16, f32) {
    let half_extent = support_half_extent(f64::from(sigma), OPACITY);
    let side = policy.first_side();
    let texel_size = match policy {
        Policy::None | Policy::Plain => 0.0,
        Policy::Litetex => first_texel_size([half_extent; 2]),
        Policy::Fixed(_) | Policy::Cat => 2.0 * half_extent / f64::from(side - 1),
    };
    (side, side, texel_size as f32)
}
