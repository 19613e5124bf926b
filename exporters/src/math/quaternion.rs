//! Arithmetic of quaternions **wxyz** in f64.

/// Largest deviation of a quaternion's norm from 1; rounding unit quaternions to f32 needs 1.2e-7.
pub(crate) const QUATERNION_NORM_TOLERANCE: f64 = 1e-5;

/// The length of a quaternion.
pub fn norm(q: [f64; 4]) -> f64 {
    q.iter().map(|v| v * v).sum::<f64>().sqrt()
}

/// The rotation `b`, followed by `a`.
pub fn product([aw, ax, ay, az]: [f64; 4], [bw, bx, by, bz]: [f64; 4]) -> [f64; 4] {
    [
        aw * bw - ax * bx - ay * by - az * bz,
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
    ]
}

/// The inverse of a rotation.
pub fn conjugate([w, x, y, z]: [f64; 4]) -> [f64; 4] {
    [w, -x, -y, -z]
}

/// A vector rotated by a unit quaternion.
pub fn turned(q: [f64; 4], v: [f64; 3]) -> [f64; 3] {
    let [_, x, y, z] = product(product(q, [0.0, v[0], v[1], v[2]]), conjugate(q));
    [x, y, z]
}

/// The rows of the matrix of a rotation by a quaternion of any length but 0.
pub fn rows([w, x, y, z]: [f64; 4]) -> [[f64; 3]; 3] {
    let two = 2.0 / (w * w + x * x + y * y + z * z);
    [
        [1.0 - two * (y * y + z * z), two * (x * y - w * z), two * (x * z + w * y)],
        [two * (x * y + w * z), 1.0 - two * (x * x + z * z), two * (y * z - w * x)],
        [two * (x * z - w * y), two * (y * z + w * x), 1.0 - two * (x * x + y * y)],
    ]
}

/// The shortest rotation from one direction to another; both of any length but zero.
pub fn between(from: [f64; 3], to: [f64; 3]) -> [f64; 4] {
    let dot = |a: [f64; 3], b: [f64; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    let cross = |a: [f64; 3], b: [f64; 3]| {
        [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
    };
    let lengths = (dot(from, from) * dot(to, to)).sqrt();
    let cosine = dot(from, to) / lengths;
    if cosine < -1.0 + 1e-12 {
        // Half a turn about any perpendicular axis.
        let axis = if from[0].abs() < from[1].abs() { [1.0, 0.0, 0.0] } else { [0.0, 1.0, 0.0] };
        let [x, y, z] = cross(from, axis);
        let n = (x * x + y * y + z * z).sqrt();
        return [0.0, x / n, y / n, z / n];
    }
    let [x, y, z] = cross(from, to).map(|v| v / lengths);
    let q = [1.0 + cosine, x, y, z];
    let n = norm(q);
    q.map(|v| v / n)
}

/// The rotation that turns the axes into these: orthogonal, of length 1 and right-handed.
pub fn from_axes([x, y, z]: [[f64; 3]; 3]) -> [f64; 4] {
    // Of the four formulas for the quaternion, the one that divides by the largest number.
    let (xx, yy, zz) = (x[0], y[1], z[2]);
    let ways = [
        [1.0 + xx + yy + zz, y[2] - z[1], z[0] - x[2], x[1] - y[0]],
        [y[2] - z[1], 1.0 + xx - yy - zz, x[1] + y[0], z[0] + x[2]],
        [z[0] - x[2], x[1] + y[0], 1.0 - xx + yy - zz, y[2] + z[1]],
        [x[1] - y[0], z[0] + x[2], y[2] + z[1], 1.0 - xx - yy + zz],
    ];
    let best = (0..4).fold(0, |best, i| if ways[i][i] > ways[best][best] { i } else { best });
    let norm = norm(ways[best]);
    ways[best].map(|v| v / norm)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rotations_map_axes_correctly() {
        let directions =
            [[0.0, 1.0, 0.0], [0.0, -2.0, 0.0], [3.0, 0.0, 0.0], [0.3, -0.4, 1.2], [0.0, 0.0, -1.0]];
        for from in directions {
            for to in directions {
                let found = turned(between(from, to), from);
                let [a, b] = [from, to].map(|v| norm([0.0, v[0], v[1], v[2]]));
                // Needed 4e-16.
                assert!(
                    (0..3).all(|i| (found[i] / a - to[i] / b).abs() < 1e-14),
                    "{from:?} {to:?} {found:?}"
                );
            }
        }
        let (a, b) = (between([1.0, 0.0, 0.0], [0.0, 1.0, 0.0]), between([0.0, 1.0, 0.0], [0.0, 0.0, 1.0]));
        let both = turned(product(b, a), [1.0, 0.0, 0.0]);
        assert!((both[2] - 1.0).abs() < 1e-15, "{both:?}");
        let q = [0.5, -0.5, 0.1, 0.7];
        for (row, axis) in rows(q.map(|v| 3.0 * v)).into_iter().zip(0..3) {
            let columns = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]].map(|v| turned(q, v)[axis]);
            assert!((0..3).all(|i| (row[i] - columns[i]).abs() < 1e-15), "{row:?} {columns:?}");
        }
    }
}
