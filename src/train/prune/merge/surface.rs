//! The plane in which neighbours lie.

use super::part::Part;
use glam::{DMat3, DVec3};

/// Largest distance of neighbours from their plane, root mean square, pixels of the nearest view.
const THICKNESS_PX: f64 = 1.0;

/// Rounds of inverse iteration, which finds the thinnest direction.
const ITERATIONS: usize = 8;

/// Normal of the plane in which a part and its neighbours lie; `None` if they do not. Splats of a few pixels hardly
/// know their own normal: on a wall, they are tilted at random.
pub fn normal(part: &Part, neighbours: &[&Part]) -> Option<DVec3> {
    let count = 1.0 + neighbours.len() as f64;
    let all = || neighbours.iter().map(|n| n.position).chain([part.position]);
    let mean = all().sum::<DVec3>() / count;
    let covariance = all().fold(DMat3::ZERO, |sum, position| {
        let d = position - mean;
        sum + DMat3::from_cols(d * d.x, d * d.y, d * d.z)
    }) * (1.0 / count);
    let trace = covariance.x_axis.x + covariance.y_axis.y + covariance.z_axis.z;
    let inverse = (covariance + DMat3::from_diagonal(DVec3::splat(1e-9 * trace))).inverse();
    // Begins with its own normal, turned a little, lest it lie in the plane.
    let mut normal = part.axes.z_axis + 0.1 * part.axes.x_axis + 0.1 * part.axes.y_axis;
    for _ in 0..ITERATIONS {
        normal = (inverse * normal).normalize_or_zero();
    }
    let thickness = normal.dot(covariance * normal).max(0.0).sqrt();
    (normal != DVec3::ZERO && trace > 0.0 && thickness <= THICKNESS_PX * part.pixel).then_some(normal)
}
