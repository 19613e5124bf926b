//! Geometry of the sample scene and ray intersection: a room with three boxes and a globe. Units are
//! metres; axes are COLMAP's: x right, y down (the floor is y = 0), z away from the cameras.

use super::extras::{self, Extras, Poster, SKY_DISTANCE, poster_coordinates};
use super::noise::Noise;
use super::options::SampleOptions;
use super::ray::{Hit, Ray, Surface};
use super::texture;
use glam::{DMat3, DVec2, DVec3};

/// A box on the floor, rotated about the vertical.
#[derive(Clone, Copy, Debug)]
pub struct StandingBox {
    /// Centre of the box.
    pub centre: DVec3,
    /// Half edge lengths.
    pub half: DVec3,
    /// scene_from_box
    pub rotation: DMat3,
}

/// Room, objects and patterns of the sample.
#[derive(Clone, Debug)]
pub struct Scene {
    /// Minimum and maximum corner of the room.
    pub room: [DVec3; 2],
    /// Crate, carton and pile of books.
    pub boxes: [StandingBox; 3],
    /// Centre and radius.
    pub globe: (DVec3, f64),
    /// What a stress adds.
    pub extras: Extras,
    noise: Noise,
}

impl Scene {
    /// The scene of a seed, which sets the patterns and varies the boxes' rotations by a few degrees. `focal_px` is
    /// that of a typical view.
    pub fn new(options: &SampleOptions, focal_px: f64) -> Self {
        let noise = Noise::new(options.seed);
        let standing = |index: i64, x: f64, base: f64, z: f64, half: DVec3, turn_deg: f64| StandingBox {
            centre: DVec3::new(x, base - half.y, z),
            half,
            rotation: DMat3::from_rotation_y(
                (turn_deg + 10.0 * (noise.cell(index, 1000) - 0.5)).to_radians(),
            ),
        };
        Self {
            room: [DVec3::new(-2.9, -2.6, -3.1), DVec3::new(2.9, 0.0, 1.5)],
            boxes: [
                standing(0, -0.52, 0.0, 0.18, DVec3::new(0.24, 0.2, 0.22), 24.0),
                standing(1, 0.12, 0.0, 0.38, DVec3::new(0.19, 0.29, 0.075), -9.0),
                standing(2, 0.1, 0.0, -0.22, DVec3::new(0.19, 0.055, 0.14), 17.0),
            ],
            globe: (DVec3::new(0.63, -0.23, 0.02), 0.23),
            extras: Extras::new(options, focal_px),
            noise,
        }
    }

    /// The nearest hit of a ray that starts in the room and outside the objects.
    pub fn cast(&self, ray: &Ray) -> Hit {
        let mut best = self.cast_room(ray);
        for (index, b) in self.boxes.iter().enumerate() {
            if let Some((t, axis, max_side)) = b.cast(ray, best.t) {
                let normal = b.rotation.col(axis) * if max_side { 1.0 } else { -1.0 };
                best = Hit {
                    t,
                    position: ray.origin + t * ray.direction,
                    normal,
                    surface: Surface::Box(index, axis, max_side),
                };
            }
        }
        if let Some(t) = self.cast_globe(ray).filter(|&t| t < best.t) {
            let position = ray.origin + t * ray.direction;
            best = Hit {
                t,
                position,
                normal: (position - self.globe.0) / self.globe.1,
                surface: Surface::Globe,
            };
        }
        self.extras.cast(ray, best.t).unwrap_or(best)
    }

    /// Whether an object intersects the segment from `origin` to `origin + direction`. The room is
    /// convex and never does.
    pub fn occludes(&self, ray: &Ray) -> bool {
        self.boxes.iter().any(|b| b.cast(ray, 1.0).is_some())
            || self.cast_globe(ray).is_some_and(|t| t < 1.0)
            || self.extras.cast(ray, 1.0).is_some()
    }

    fn cast_room(&self, ray: &Ray) -> Hit {
        let mut best = (f64::INFINITY, 0, false);
        for axis in 0..3 {
            let d = ray.direction[axis];
            let max_side = d > 0.0;
            let t = (self.room[usize::from(max_side)][axis] - ray.origin[axis]) / d;
            // 0 / 0, for a ray inside a wall, is NaN and fails the comparison.
            if t >= 0.0 && t < best.0 {
                best = (t, axis, max_side);
            }
        }
        let (t, axis, max_side) = best;
        let position = ray.origin + t * ray.direction;
        if self.extras.is_sky(position) {
            let direction = ray.direction.normalize();
            let t = SKY_DISTANCE / ray.direction.length();
            return Hit { t, position: SKY_DISTANCE * direction, normal: -direction, surface: Surface::Sky };
        }
        Hit {
            t,
            position,
            normal: DVec3::AXES[axis] * if max_side { -1.0 } else { 1.0 },
            surface: Surface::Room(axis, max_side),
        }
    }

    fn cast_globe(&self, ray: &Ray) -> Option<f64> {
        let (centre, radius) = self.globe;
        let from_centre = ray.origin - centre;
        let a = ray.direction.length_squared();
        let b = from_centre.dot(ray.direction);
        let discriminant = b * b - a * (from_centre.length_squared() - radius * radius);
        if discriminant <= 0.0 {
            return None;
        }
        let t = (-b - discriminant.sqrt()) / a;
        (t > 1e-9).then_some(t)
    }

    /// Albedo at a hit, linear light.
    pub fn albedo(&self, hit: &Hit) -> DVec3 {
        let p = hit.position;
        let n = &self.noise;
        match hit.surface {
            Surface::Room(1, true) => texture::floor(n, DVec2::new(p.x, p.z)),
            Surface::Room(1, false) => texture::plaster(n, DVec2::new(p.x, p.z)),
            Surface::Room(2, true) => match self.extras.poster {
                Poster::Checker(period) if self.extras.is_region(hit) => {
                    texture::checkerboard(poster_coordinates(p), period)
                }
                _ => texture::back_wall(n, DVec2::new(p.x, -p.y - 1.0)),
            },
            Surface::Room(2, false) => texture::plaster(n, DVec2::new(p.x, p.y)),
            Surface::Room(_, false) => texture::plaid(n, DVec2::new(p.z, -p.y)),
            Surface::Room(_, true) => texture::wallpaper(n, DVec2::new(-p.z, -p.y)),
            Surface::Box(index, axis, max_side) => {
                let b = &self.boxes[index];
                let local = b.rotation.transpose() * (p - b.centre);
                let (at, half) = b.face_coordinates(local, axis, max_side);
                match index {
                    0 => texture::crate_face(n, at, half),
                    1 => texture::carton_face(n, at, half),
                    _ => texture::book_face(n, at, half, axis == 1),
                }
            }
            Surface::Globe => texture::globe(n, hit.normal),
            _ => extras::albedo(n, hit),
        }
    }

    /// Approximate ambient occlusion: 1 in the open, falling towards 0 near corners and objects.
    pub fn openness(&self, hit: &Hit) -> f64 {
        let p = hit.position + 0.02 * hit.normal;
        let mut open = 1.0;
        for axis in 0..3 {
            for (side, corner) in self.room.iter().enumerate() {
                if hit.surface != Surface::Room(axis, side == 1) {
                    open *= 1.0 - 0.45 * (-(p[axis] - corner[axis]).abs() / 0.22).exp();
                }
            }
        }
        for (index, b) in self.boxes.iter().enumerate() {
            if !matches!(hit.surface, Surface::Box(i, _, _) if i == index) {
                open *= 1.0 - 0.5 * (-b.distance(p) / 0.07).exp();
            }
        }
        if hit.surface != Surface::Globe {
            let distance = (p - self.globe.0).length() - self.globe.1;
            open *= 1.0 - 0.6 * (-distance.max(0.0) / 0.08).exp();
        }
        open
    }
}

impl StandingBox {
    /// Entry of a ray from outside if it lies before `limit`: t, axis of the face, whether the face is
    /// at the axis' maximum.
    fn cast(&self, ray: &Ray, limit: f64) -> Option<(f64, usize, bool)> {
        let box_from_scene = self.rotation.transpose();
        let origin = box_from_scene * (ray.origin - self.centre);
        let direction = box_from_scene * ray.direction;
        let (mut enter, mut leave, mut face) = (f64::NEG_INFINITY, f64::INFINITY, (0, false));
        for axis in 0..3 {
            let inverse = 1.0 / direction[axis];
            let a = (-self.half[axis] - origin[axis]) * inverse;
            let b = (self.half[axis] - origin[axis]) * inverse;
            if a.min(b) > enter {
                enter = a.min(b);
                face = (axis, b < a);
            }
            leave = leave.min(a.max(b));
        }
        (enter > 1e-9 && enter < leave && enter < limit).then_some((enter, face.0, face.1))
    }

    /// Position on a face (right, up as seen from outside) and the face's half size.
    fn face_coordinates(&self, local: DVec3, axis: usize, max_side: bool) -> (DVec2, DVec2) {
        let sign = if max_side { 1.0 } else { -1.0 };
        let h = self.half;
        match axis {
            0 => (DVec2::new(sign * local.z, -local.y), DVec2::new(h.z, h.y)),
            1 => (DVec2::new(local.x, local.z), DVec2::new(h.x, h.z)),
            _ => (DVec2::new(-sign * local.x, -local.y), DVec2::new(h.x, h.y)),
        }
    }

    fn distance(&self, position: DVec3) -> f64 {
        let local = self.rotation.transpose() * (position - self.centre);
        (local.abs() - self.half).max(DVec3::ZERO).length()
    }
}
