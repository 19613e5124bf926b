//! Fits the direction to which the photos of a capture are level: people hold cameras without roll, or turned by a quarter
//! for photos in portrait, but look down as often as not. Photos that were held otherwise weigh little.

use glam::{DMat3, DVec3};

/// Roll at which a photo weighs a quarter of a level one, as a sine. Measured, root mean square of the roll: flower 0.4
/// degrees, castle of Sceaux 0.9, bonsai 1.4, fox 2.4, lego 0.
const ROLL_SIN: f64 = 0.0872; // 5 degrees

/// A photo counts as level up to this roll, as a sine.
const LEVEL_SIN: f64 = 0.1736; // 10 degrees

/// A photo is in portrait only where its right axis rises at least this much: with a pitch of up to 60 degrees. Without
/// it, the axis that parallel cameras look along would pass for up.
const PORTRAIT_RISE: f64 = 0.5;

/// What it costs to take a photo for one in portrait, where 1 is the cost of a photo that is not level at all. Decides only
/// between directions that fit alike.
const PORTRAIT_COST: f64 = 0.1;

/// Photos whose pairs propose directions; more do not find better ones where half of the photos are level.
const PROPOSING: usize = 24;

/// Rounds of reweighting; each changes the direction less than a tenth as much as the one before.
const ROUNDS: usize = 30;

/// The axes of a photo's camera in the frame of the capture.
#[derive(Clone, Copy, Debug)]
pub(super) struct Axes {
    pub right: DVec3,
    pub down: DVec3,
    pub forward: DVec3,
}

impl Axes {
    /// Of the rotation of `camera_from_capture`.
    pub fn of(rotation: &DMat3) -> Self {
        Self { right: rotation.row(0), down: rotation.row(1), forward: rotation.row(2) }
    }

    /// The axis that is level where `up` is up, whether the photo is in portrait, and what it costs, 0 to 1.
    fn level(&self, up: DVec3) -> (DVec3, bool, f64) {
        let cost = |axis: DVec3| {
            let squared = axis.dot(up).powi(2);
            squared / (squared + ROLL_SIN * ROLL_SIN)
        };
        let (landscape, portrait) = (cost(self.right), cost(self.down) + PORTRAIT_COST);
        if self.right.dot(up).abs() >= PORTRAIT_RISE && portrait < landscape {
            (self.down, true, portrait)
        } else {
            (self.right, false, landscape)
        }
    }
}

/// A direction and how well the photos agree on it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Fit {
    /// Up or down.
    pub vertical: DVec3,
    /// Eigenvalues of the covariance of the level axes about the origin, ascending; their sum is 1.
    pub eigenvalues: [f64; 3],
    /// The eigenvector of the largest.
    pub common: DVec3,
    /// Photos that are level.
    pub num_level: usize,
    cost: f64,
}

/// The direction to which the photos are level; `None` without photos.
pub(super) fn fit(photos: &[Axes]) -> Option<Fit> {
    let all = |axis: fn(&Axes) -> DVec3| eigen(covariance(photos.iter().map(|p| (axis(p), 1.0)))).1;
    let mut proposed: Vec<DVec3> = [all(|p| p.right), all(|p| p.down)].concat();
    let every = photos.len().div_ceil(PROPOSING).max(1);
    let proposing: Vec<&Axes> = photos.iter().step_by(every).collect();
    for (i, a) in proposing.iter().enumerate() {
        for b in &proposing[..i] {
            let pairs = [(a.right, b.right), (a.right, b.down), (a.down, b.right), (a.down, b.down)];
            proposed.extend(pairs.iter().filter_map(|(a, b)| a.cross(*b).try_normalize()));
        }
    }
    let cost = |up: &DVec3| photos.iter().map(|p| p.level(*up).2).sum::<f64>();
    let best = proposed.into_iter().map(|up| (cost(&up), up)).min_by(|a, b| a.0.total_cmp(&b.0))?;
    (!photos.is_empty()).then(|| fit_near(photos, best.1))
}

/// The fit that reweighting finds from a direction near it.
pub(super) fn fit_near(photos: &[Axes], near: DVec3) -> Fit {
    let at = |vertical: DVec3| {
        let weighted = photos.iter().map(|photo| {
            let (axis, _, _) = photo.level(vertical);
            let squared = ROLL_SIN * ROLL_SIN;
            (axis, (squared / (axis.dot(vertical).powi(2) + squared)).powi(2))
        });
        eigen(covariance(weighted))
    };
    let of = |vertical: DVec3| {
        let (eigenvalues, vectors) = at(vertical);
        let is_level = |p: &&Axes| p.level(vertical).0.dot(vertical).abs() <= LEVEL_SIN;
        Fit {
            vertical,
            eigenvalues,
            common: vectors[2],
            num_level: photos.iter().filter(is_level).count(),
            cost: photos.iter().map(|p| p.level(vertical).2).sum(),
        }
    };
    let mut best = of(near);
    for _ in 0..ROUNDS {
        let next = of(at(best.vertical).1[0]);
        if next.cost >= best.cost {
            break;
        }
        best = next;
    }
    best
}

impl Fit {
    /// Of the photos that are level, those in portrait and the others.
    pub fn level<'a>(&self, photos: &'a [Axes]) -> (Vec<&'a Axes>, Vec<&'a Axes>) {
        let level = photos.iter().filter(|p| p.level(self.vertical).0.dot(self.vertical).abs() <= LEVEL_SIN);
        level.partition(|p| p.level(self.vertical).1)
    }
}

/// Weighted mean of the products of the vectors' components; zero if there are none.
fn covariance(vectors: impl Iterator<Item = (DVec3, f64)>) -> DMat3 {
    let (mut sum, mut weights) = (DMat3::ZERO, 0.0);
    for (v, weight) in vectors {
        sum += DMat3::from_cols(v * v.x, v * v.y, v * v.z) * weight;
        weights += weight;
    }
    if weights > 0.0 { sum * (1.0 / weights) } else { sum }
}

/// Eigenvalues, ascending, and eigenvectors of a symmetric matrix, by Jacobi's rotations.
fn eigen(mut matrix: DMat3) -> ([f64; 3], [DVec3; 3]) {
    let mut vectors = DMat3::IDENTITY;
    for _ in 0..12 {
        for (p, q) in [(0, 1), (0, 2), (1, 2)] {
            let off = matrix.col(p)[q];
            if off.abs() < 1e-300 {
                continue;
            }
            let angle = 0.5 * f64::atan2(2.0 * off, matrix.col(q)[q] - matrix.col(p)[p]);
            let (sin, cos) = angle.sin_cos();
            let mut turn = DMat3::IDENTITY;
            turn.col_mut(p)[p] = cos;
            turn.col_mut(q)[q] = cos;
            turn.col_mut(q)[p] = sin;
            turn.col_mut(p)[q] = -sin;
            matrix = turn.transpose() * matrix * turn;
            vectors *= turn;
        }
    }
    let mut order = [0, 1, 2];
    order.sort_by(|&a, &b| matrix.col(a)[a].total_cmp(&matrix.col(b)[b]));
    (order.map(|i| matrix.col(i)[i]), order.map(|i| vectors.col(i).normalize()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn eigenvectors_of_a_turned_matrix_are_found() {
        let turn = DMat3::from_euler(glam::EulerRot::XYZ, 0.3, -1.1, 2.0);
        let matrix = turn * DMat3::from_diagonal(DVec3::new(0.6, 0.1, 0.3)) * turn.transpose();
        let (values, vectors) = eigen(matrix);
        for (found, expected) in values.iter().zip([0.1, 0.3, 0.6]) {
            assert!((found - expected).abs() < 1e-14, "{values:?}"); // needed 6e-17
        }
        for (found, column) in vectors.iter().zip([1, 2, 0]) {
            assert!((found.dot(turn.col(column)).abs() - 1.0).abs() < 1e-14, "{vectors:?}");
        }
        // Negative control: of a matrix that is not turned, the vectors are others.
        assert!(eigen(DMat3::from_diagonal(DVec3::new(0.6, 0.1, 0.3))).1[0].dot(vectors[0]).abs() < 0.9);
    }
}
