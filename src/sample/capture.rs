//! Cameras around the sample scene, the sparse points they observe, and the ground truth.

use super::colmap_write::{SparseImage, SparseModel, SparsePoint};
use super::options::SampleOptions;
use super::render;
use super::scene::{Ray, Scene};

use crate::camera::{Pinhole, RigidTransform};
use glam::{DMat3, DVec2, DVec3};
use rand::Rng;
use rand_pcg::Pcg32;
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

// Separate random streams: adding a view does not shift the random numbers of the points.
const STREAM_CAMERAS: u64 = 1;
const STREAM_POINTS: u64 = 2;

/// Point that the cameras look at, up to jitter.
const CENTRE: DVec3 = DVec3::new(0.03, -0.26, 0.1);

/// Largest azimuth of a camera to either side, before jitter.
const AZIMUTH_MAX_DEG: f64 = 66.0;

/// What was made.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SampleSummary {
    /// Images.
    pub views: usize,
    /// Sparse points.
    pub points: usize,
    /// Observations of the points over all images.
    pub observations: usize,
    /// Mean distance between an observation and the projection of its (noisy) point.
    pub mean_reprojection_error_px: f64,
}

/// The scene with its cameras and points.
pub struct Capture {
    options: SampleOptions,
    scene: Scene,
    /// Cameras and points, as written to `sparse/0`.
    pub sparse: SparseModel,
}

fn uniform(rng: &mut Pcg32) -> f64 {
    (f64::from(rng.next_u32()) + 0.5) / 4_294_967_296.0
}

/// Two independent standard normal numbers (Box-Muller).
fn normal_pair(rng: &mut Pcg32) -> DVec2 {
    let radius = (-2.0 * uniform(rng).ln()).sqrt();
    radius * DVec2::from_angle(std::f64::consts::TAU * uniform(rng))
}

/// camera_from_capture of a camera at `position` that looks at `target` with its x axis level.
fn looking_at(position: DVec3, target: DVec3) -> RigidTransform {
    let forward = (target - position).normalize();
    let right = DVec3::Y.cross(forward).normalize();
    let down = forward.cross(right);
    let rotation = DMat3::from_cols(right, down, forward).transpose();
    RigidTransform { rotation, translation: -(rotation * position) }
}

/// Poses on an arc in front of the scene, alternating between three heights, with jitter.
fn poses(options: &SampleOptions) -> Vec<RigidTransform> {
    let mut rng = Pcg32::new(options.seed, STREAM_CAMERAS);
    let mut jitter = |amplitude: f64| amplitude * (2.0 * uniform(&mut rng) - 1.0);
    (0..options.views)
        .map(|view| {
            let along = (view as f64 + 0.5) / options.views as f64 * 2.0 - 1.0;
            let azimuth = (AZIMUTH_MAX_DEG * along + jitter(2.0)).to_radians();
            let elevation = ([14.0, 44.0, 28.0][view % 3] + jitter(4.0)).to_radians();
            let radius = [1.75, 1.95, 1.45][view % 3] + jitter(0.12);
            let flat = radius * elevation.cos();
            let from_centre =
                DVec3::new(flat * azimuth.sin(), -radius * elevation.sin(), -flat * azimuth.cos());
            let target = CENTRE + DVec3::new(jitter(0.06), jitter(0.04), jitter(0.06));
            looking_at(CENTRE + from_centre, target)
        })
        .collect()
}

/// Sparse points on surfaces, each visible from at least two poses.
fn points(
    options: &SampleOptions,
    scene: &Scene,
    pinhole: &Pinhole,
    poses: &[RigidTransform],
) -> Vec<SparsePoint> {
    let mut rng = Pcg32::new(options.seed, STREAM_POINTS);
    let size = DVec2::new(f64::from(pinhole.width_px), f64::from(pinhole.height_px));
    let mut points = Vec::with_capacity(options.points);
    // Nearly every surface is visible from several cameras; the bound only matters for unusual options.
    for attempt in 0..8 * options.points {
        if points.len() == options.points {
            break;
        }
        let at = size * DVec2::new(uniform(&mut rng), uniform(&mut rng));
        let hit = scene.cast(&render::ray_through(pinhole, &poses[attempt % poses.len()], at));
        let (a, b) = (normal_pair(&mut rng), normal_pair(&mut rng));
        let position = hit.position + options.point_noise_m * DVec3::new(a.x, a.y, b.x);
        let observations: Vec<_> = poses
            .iter()
            .enumerate()
            .filter_map(|(view, pose)| {
                let seen = pinhole.project(pose.transform_point(hit.position))?;
                let inside = seen.cmpge(DVec2::ZERO).all() && seen.cmplt(size).all();
                let origin = hit.position + 1e-6 * hit.normal;
                let direction = pose.origin_of_a_in_b() - origin;
                let faces = direction.dot(hit.normal) > 0.0;
                (inside && faces && !scene.occludes(&Ray { origin, direction })).then_some((view, seen))
            })
            .collect();
        if observations.len() < 2 {
            continue;
        }
        let errors = observations.iter().map(|&(view, seen)| {
            let projected = pinhole.project(poses[view].transform_point(position));
            projected.map_or(0.0, |p| p.distance(seen))
        });
        points.push(SparsePoint {
            position,
            rgb: render::point_colour(scene, &hit),
            error_px: errors.sum::<f64>() / observations.len() as f64,
            observations,
        });
    }
    points
}

impl Capture {
    /// Places cameras and points. Images are rendered on demand.
    pub fn new(options: &SampleOptions) -> Self {
        let (width, height) = (f64::from(options.width_px), f64::from(options.height_px));
        let focal_px = 0.95 * width.max(height);
        let pinhole = Pinhole {
            width_px: options.width_px,
            height_px: options.height_px,
            fx_px: focal_px,
            fy_px: focal_px,
            cx_px: 0.5 * width,
            cy_px: 0.5 * height,
        };
        let scene = Scene::new(options.seed);
        let poses = poses(options);
        let points = points(options, &scene, &pinhole, &poses);
        let images = poses
            .into_iter()
            .enumerate()
            .map(|(view, camera_from_capture)| SparseImage {
                name: format!("view_{view:04}.png"),
                camera_from_capture,
            })
            .collect();
        Self { options: options.clone(), scene, sparse: SparseModel { pinhole, images, points } }
    }

    /// The photo of a view, 8 bits, display space. `[height, width, 3]`
    pub fn image(&self, view: usize) -> Vec<u8> {
        let pose = &self.sparse.images[view].camera_from_capture;
        render::image(&self.scene, &self.sparse.pinhole, pose, self.options.supersampling)
    }

    /// Exact depth of a view along the optical axis, metres. `[height, width]`
    pub fn depth(&self, view: usize) -> Vec<f32> {
        render::depth(&self.scene, &self.sparse.pinhole, &self.sparse.images[view].camera_from_capture)
    }

    /// Counts and the mean reprojection error.
    pub fn summary(&self) -> SampleSummary {
        let points = &self.sparse.points;
        let observations: usize = points.iter().map(|p| p.observations.len()).sum();
        // Not sum(), which is -0 for an empty iterator.
        let error = points.iter().fold(0.0, |sum, p| sum + p.error_px * p.observations.len() as f64);
        SampleSummary {
            views: self.sparse.images.len(),
            points: points.len(),
            observations,
            mean_reprojection_error_px: error / observations.max(1) as f64,
        }
    }

    /// Contents of `truth/scene.json`: frame, options, geometry and cameras.
    pub fn description(&self) -> Value {
        let vector = |v: DVec3| v.to_array();
        let matrix_rows = |m: DMat3| m.transpose().to_cols_array_2d();
        let boxes = ["crate", "carton", "books"].iter().zip(&self.scene.boxes);
        let boxes: Vec<Value> = boxes
            .map(|(name, b)| {
                json!({
                    "name": name,
                    "centre": vector(b.centre),
                    "half_edges": vector(b.half),
                    "capture_from_box_rows": matrix_rows(b.rotation),
                })
            })
            .collect();
        let cameras: Vec<Value> = self
            .sparse
            .images
            .iter()
            .map(|i| {
                let pose = &i.camera_from_capture;
                json!({
                    "name": i.name,
                    "camera_from_capture_rows": matrix_rows(pose.rotation),
                    "translation": vector(pose.translation),
                })
            })
            .collect();
        json!({
            "frame": "x right, y down (the floor is y = 0), z away from the cameras; metres",
            "depth": "along the optical axis at pixel centres, metres; channel Y",
            "program_version": env!("CARGO_PKG_VERSION"),
            "options": self.options,
            "pinhole": self.sparse.pinhole,
            "room": self.scene.room.map(vector),
            "boxes": boxes,
            "globe": { "centre": vector(self.scene.globe.0), "radius": self.scene.globe.1 },
            "cameras": cameras,
        })
    }
}
