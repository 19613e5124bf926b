//! Random streams, and random points where the cameras look: the start for captures without points.

use super::Capture;
use crate::camera::Camera;
use crate::views::{Split, ViewSource as _, by_place};
use glam::{DMat3, DQuat, DVec2, DVec3};
use rand::Rng as _;
use rand_pcg::Pcg64;

/// A stream of random numbers for one purpose.
pub(crate) struct Stream(Pcg64);

impl Stream {
    /// Streams of one seed and different purposes are independent.
    pub fn new(seed: u64, purpose: u128) -> Self {
        Self(Pcg64::new(seed.into(), purpose))
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

/// Depths of the rays' points where nothing else is known, in units of the cameras' extent.
const RAY_DEPTHS: (f64, f64) = (0.5, 20.0);

/// Above this length of the mean viewing direction (a cone of about 25 degrees) the cameras look the same
/// way rather than at something.
const SAME_WAY: f64 = 0.9;

/// Share of the training views that must show a point of the common region.
const SEEN_BY: f64 = 1.0 / 3.0;

/// `count` points of the local frame in the views: in the region that the cameras look at together, or
/// along random rays if there is none.
pub(crate) fn points_in_views(capture: &Capture, count: usize, seed: u64) -> Vec<DVec3> {
    let views = by_place(capture, capture.indices(Split::Train));
    let cameras: Vec<Camera> = views.into_iter().map(|v| capture.views[v].camera).collect();
    let mut stream = Stream::new(seed, 1);
    let turned = super::frame::local_from_cameras(capture);
    common_region(&cameras, count, turned, &mut stream)
        .unwrap_or_else(|| along_rays(&cameras, count, &mut stream))
}

fn shows(camera: &Camera, point: DVec3) -> bool {
    let in_camera = camera.camera_from_local.transform_point(point);
    camera.pinhole.project(in_camera).is_some_and(|p| {
        let (w, h) = (f64::from(camera.pinhole.width_px), f64::from(camera.pinhole.height_px));
        p.x >= 0.0 && p.y >= 0.0 && p.x <= w && p.y <= h
    })
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
    let seen = cameras.iter().filter(|c| shows(c, focus)).count();
    (focus.is_finite() && seen as f64 >= 0.75 * cameras.len() as f64).then_some(focus)
}

fn common_region(cameras: &[Camera], count: usize, turned: DQuat, stream: &mut Stream) -> Option<Vec<DVec3>> {
    let focus = focus(cameras)?;
    // The ball that a typical view just shows as a whole.
    let radii = cameras
        .iter()
        .map(|c| {
            let p = &c.pinhole;
            let half = (f64::from(p.width_px) / p.fx_px).min(f64::from(p.height_px) / p.fy_px) * 0.5;
            c.centre_in_local().distance(focus) * half.atan().sin()
        })
        .collect();
    let radius = super::frame::median(radii)?;
    let needed = (SEEN_BY * cameras.len() as f64).ceil() as usize;
    let mut points = Vec::with_capacity(count);
    // Bounded: a region that hardly any draw hits is no region.
    for _ in 0..20 * count {
        if points.len() == count {
            break;
        }
        let point = focus + radius * (turned * stream.in_ball());
        if cameras.iter().filter(|c| shows(c, point)).take(needed).count() >= needed {
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
