//! Random numbers of the sample capture. Separate streams: adding a view does not shift the numbers of the points.

use glam::{DVec2, DVec3};
use rand::Rng;
use rand_pcg::Pcg32;

/// What random numbers are for.
#[derive(Clone, Copy)]
pub enum Stream {
    /// Poses of the cameras.
    Cameras = 1,
    /// Positions of the sparse points.
    Points = 2,
    /// Sparse points that are wrong.
    WrongPoints = 3,
    /// Exposure of the photos, and errors of their poses.
    Photos = 4,
    /// Colours of grids, and planted splats.
    Grids = 5,
    /// Noise of the photos; each takes a stream of its own from here on.
    PhotoNoise = 1000,
}

/// The numbers of a stream, `index` apart from it.
pub fn stream(seed: u64, stream: Stream, index: usize) -> Pcg32 {
    Pcg32::new(seed, stream as u64 + index as u64)
}

/// A number in (0, 1).
pub fn uniform(rng: &mut Pcg32) -> f64 {
    (f64::from(rng.next_u32()) + 0.5) / 4_294_967_296.0
}

/// Two independent standard normal numbers (Box-Muller).
pub fn normal_pair(rng: &mut Pcg32) -> DVec2 {
    let radius = (-2.0 * uniform(rng).ln()).sqrt();
    radius * DVec2::from_angle(std::f64::consts::TAU * uniform(rng))
}

/// Three independent standard normal numbers.
pub fn normal_vector(rng: &mut Pcg32) -> DVec3 {
    let (a, b) = (normal_pair(rng), normal_pair(rng));
    DVec3::new(a.x, a.y, b.x)
}
