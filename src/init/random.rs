//! Random numbers of the initial model: rotations, rays of the sweep, and for captures without points, positions that the
//! cameras see.

use crate::camera::Camera;
use crate::views::{Split, ViewSource, by_place};
use glam::{DMat3, DQuat, DVec2, DVec3};
use rand::Rng as _;
use rand_pcg::Pcg64;

/// What a stream of random numbers is for: draws for one purpose must not shift those for another.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Purpose {
    Positions = 1,
    Colours = 2,
    Thinning = 3,
    Rotations = 4,
    Rays = 5,
}

/// A stream of random numbers for one purpose.
pub(super) struct Stream(Pcg64);

impl Stream {
    /// Streams of one seed for different purposes are independent.
    pub fn new(seed: u64, purpose: Purpose) -> Self {
        Self(Pcg64::new(seed.into(), purpose as u128))
    }

    /// Uniform in [0, 1).
    pub fn uniform(&mut self) -> f64 {
        (self.0.next_u64() >> 11) as f64 * (1.0 / (1_u64 << 53) as f64)
    }

    /// Uniform in 0..count; the bias of `count` / 2^53 does not matter here.
    pub fn index(&mut self, count: usize) -> usize {
        ((self.uniform() * count as f64) as usize).min(count - 1)
    }

    /// Two independent standard normal numbers (Box and Muller).
    pub fn normals(&mut self) -> [f64; 2] {
        let radius = (-2.0 * (1.0 - self.uniform()).ln()).sqrt();
        let (sin, cos) = (std::f64::consts::TAU * self.uniform()).sin_cos();
        [radius * cos, radius * sin]
    }

    /// Uniform in the unit ball.
    fn in_ball(&mut self) -> DVec3 {
        loop {
            let p = DVec3::new(self.uniform(), self.uniform(), self.uniform()) * 2.0 - 1.0;
            if p.length_squared() <= 1.0 {
                return p;
            }
        }
    }
}

/// Depths of points on rays, where nothing else is known; in units of the cameras' extent.
const RAY_DEPTHS: (f64, f64) = (0.5, 20.0);

/// If the mean of the viewing directions is longer than this (all within a cone of about 25 degrees), the
/// cameras look the same way rather than at a common subject.
const SAME_WAY: f64 = 0.9;

/// Share of the training views that must show a point for it to lie in the common region.
const SEEN_BY: f64 = 1.0 / 3.0;

/// Axes that turn with the capture: towards the farthest camera, and across the mean downward direction of
/// the images. What is drawn at random in them turns too, so that a capture that was turned starts alike.
pub(super) fn local_from_cameras(views: &dyn ViewSource) -> DQuat {
    let order = by_place(views, (0..views.num_views()).collect());
    let cameras: Vec<Camera> = order.iter().map(|&view| views.camera(view)).collect();
    let Some(farthest) = cameras.last() else { return DQuat::IDENTITY };
    let down: DVec3 = cameras.iter().map(|c| c.camera_from_local.rotation.row(1)).sum();
    let first = farthest.centre_in_local().try_normalize();
    let third = first.and_then(|first| first.cross(down).try_normalize());
    match (first, third) {
        (Some(first), Some(third)) => {
            DQuat::from_mat3(&DMat3::from_cols(first, third.cross(first), third)).normalize()
        }
        // All cameras in one place, or the farthest one exactly above the others: any axes will do.
        _ => DQuat::IDENTITY,
    }
}

/// Uniform over all rotations, drawn in turned axes; wxyz.
pub(super) fn rotation(turned: DQuat, stream: &mut Stream) -> [f32; 4] {
    loop {
        let ([a, b], [c, d]) = (stream.normals(), stream.normals());
        let drawn = DQuat::from_xyzw(b, c, d, a);
        if drawn.length() > 1e-6 {
            let [x, y, z, w] = (turned * drawn.normalize()).to_array();
            return [w, x, y, z].map(|v| v as f32);
        }
    }
}

/// `count` points of the local frame in the training views: in the region that the cameras look at
/// together, or along random rays if there is none.
pub(super) fn points_in_views(views: &dyn ViewSource, count: usize, stream: &mut Stream) -> Vec<DVec3> {
    let order = by_place(views, views.indices(Split::Train));
    let cameras: Vec<Camera> = order.into_iter().map(|v| views.camera(v)).collect();
    common_region(&cameras, count, local_from_cameras(views), stream)
        .unwrap_or_else(|| along_rays(&cameras, count, stream))
}

fn axis_in_local(camera: &Camera) -> DVec3 {
    camera.camera_from_local.rotation.transpose() * DVec3::Z
}

/// The point nearest to all optical axes, if the cameras look at it from several sides.
fn focus(cameras: &[Camera]) -> Option<DVec3> {
    let mean_axis = cameras.iter().map(axis_in_local).sum::<DVec3>() / cameras.len() as f64;
    if mean_axis.length() > SAME_WAY {
        return None;
    }
    let mut matrix = DMat3::ZERO;
    let mut rhs = DVec3::ZERO;
    for camera in cameras {
        let axis = axis_in_local(camera);
        let across = DMat3::IDENTITY - DMat3::from_cols(axis * axis.x, axis * axis.y, axis * axis.z);
        matrix += across;
        rhs += across * camera.centre_in_local();
    }
    let focus = matrix.inverse() * rhs;
    let seen = cameras.iter().filter(|c| c.shows(focus)).count();
    (focus.is_finite() && seen as f64 >= 0.75 * cameras.len() as f64).then_some(focus)
}

fn common_region(cameras: &[Camera], count: usize, turned: DQuat, stream: &mut Stream) -> Option<Vec<DVec3>> {
    let focus = focus(cameras)?;
    // The largest ball around the focus that a typical view shows whole.
    let mut radii: Vec<f64> = cameras
        .iter()
        .map(|c| {
            let p = &c.pinhole;
            let half = (f64::from(p.width_px) / p.fx_px).min(f64::from(p.height_px) / p.fy_px) * 0.5;
            c.centre_in_local().distance(focus) * half.atan().sin()
        })
        .collect();
    let middle = (0.5 * (radii.len() - 1) as f64).round() as usize;
    let radius = *radii.select_nth_unstable_by(middle, f64::total_cmp).1;
    let needed = (SEEN_BY * cameras.len() as f64).ceil() as usize;
    let mut points = Vec::with_capacity(count);
    // Bounded: if hardly any draw hits, there is no common region.
    for _ in 0..20 * count {
        if points.len() == count {
            break;
        }
        let point = focus + radius * (turned * stream.in_ball());
        if cameras.iter().filter(|c| c.shows(point)).take(needed).count() >= needed {
            points.push(point);
        }
    }
    (points.len() == count).then_some(points)
}

/// Points on rays through random pixels of random views, uniform in inverse depth.
fn along_rays(cameras: &[Camera], count: usize, stream: &mut Stream) -> Vec<DVec3> {
    (0..count)
        .map(|_| {
            let camera = &cameras[stream.index(cameras.len())];
            let size = DVec2::new(camera.pinhole.width_px.into(), camera.pinhole.height_px.into());
            let position_px = DVec2::new(stream.uniform(), stream.uniform()) * size;
            let (near, far) = RAY_DEPTHS;
            let depth = 1.0 / (1.0 / far + stream.uniform() * (1.0 / near - 1.0 / far));
            let in_camera = camera.pinhole.direction_in_camera(position_px) * depth;
            camera.camera_from_local.inverse().transform_point(in_camera)
        })
        .collect()
}
