//! Symmetric matrices of three directions: covariances about the origin and their eigenvectors.

use glam::{DMat3, DVec3};

/// Weighted mean of the products of the vectors' components; zero if there are none.
pub(super) fn covariance(vectors: impl Iterator<Item = (DVec3, f64)>) -> DMat3 {
    let (mut sum, mut weights) = (DMat3::ZERO, 0.0);
    for (v, weight) in vectors {
        sum += DMat3::from_cols(v * v.x, v * v.y, v * v.z) * weight;
        weights += weight;
    }
    if weights > 0.0 { sum * (1.0 / weights) } else { sum }
}

/// Eigenvalues, ascending, and eigenvectors of a symmetric matrix, by Jacobi's rotations.
pub(super) fn eigen(mut matrix: DMat3) -> ([f64; 3], [DVec3; 3]) {
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

/// The unit vector `v` with the least `v.above(v) / v.below(v)`; `below` is positive definite.
pub(super) fn least_ratio(above: DMat3, below: DMat3) -> DVec3 {
    let (values, vectors) = eigen(below);
    let turn = DMat3::from_cols_array_2d(&vectors.map(|v| v.to_array()));
    let root =
        turn * DMat3::from_diagonal(DVec3::from_array(values.map(|v| v.sqrt().recip()))) * turn.transpose();
    (root * eigen(root * above * root).1[0]).normalize()
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

    #[test]
    fn the_least_ratio_is_least() {
        let turn = DMat3::from_euler(glam::EulerRot::XYZ, 0.3, -1.1, 2.0);
        let above = turn * DMat3::from_diagonal(DVec3::new(0.6, 0.1, 0.3)) * turn.transpose();
        let other = DMat3::from_euler(glam::EulerRot::XYZ, 0.4, -1.0, 2.1);
        let below = other * DMat3::from_diagonal(DVec3::new(1.0, 0.1, 0.7)) * other.transpose();
        let ratio = |v: DVec3| v.dot(above * v) / v.dot(below * v);
        let least = least_ratio(above, below);
        for aside in [DVec3::X, DVec3::Y, DVec3::Z] {
            for step in [-1e-3, 1e-3] {
                assert!(ratio(least + aside * step) > ratio(least), "{aside}");
            }
        }
        // Negative control: the eigenvector does not have it.
        assert!(ratio(eigen(above).1[0]) > 1.1 * ratio(least));
    }
}
