//! Rays and what they hit.

use glam::DVec3;

/// The points `origin + t * direction` for t > 0.
#[derive(Clone, Copy, Debug)]
pub struct Ray {
    /// Position at t = 0.
    pub origin: DVec3,
    /// Of any length. If its z in camera axes is 1, t is the depth.
    pub direction: DVec3,
}

/// A surface with its own pattern.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Surface {
    /// A wall, the floor or the ceiling: axis of its normal, and whether it is at the axis' maximum.
    Room(usize, bool),
    /// A face of a box: index of the box, axis of the normal, and whether it is at the axis' maximum.
    Box(usize, usize, bool),
    /// The whole sphere.
    Globe,
    /// One of the wires.
    Wire(usize),
    /// The walking figure; whether it is the head.
    Figure(bool),
    /// One of the crossing cards.
    Card(usize),
    /// Far behind everything.
    Sky,
}

/// Where a ray meets a surface.
#[derive(Clone, Copy, Debug)]
pub struct Hit {
    /// Ray parameter: distance in lengths of the ray's direction.
    pub t: f64,
    /// Position of the hit.
    pub position: DVec3,
    /// Unit normal, on the side of the ray's origin.
    pub normal: DVec3,
    /// The surface that was hit.
    pub surface: Surface,
}
