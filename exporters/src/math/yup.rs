//! The frame that glTF and USD share: y up, half a turn about x from the local frame (COLMAP's axes: y down, z forward).
//! Conversion only flips signs and reorders components, so nothing is rounded. The half turn is its own inverse, up to the
//! sign of quaternions.

use crate::Transform;
use crate::math::quaternion;

/// Half a turn about x, wxyz.
const HALF_TURN: [f64; 4] = [0.0, 1.0, 0.0, 0.0];

/// Signs of SH coefficients under half a turn about x.
pub const SH_SIGNS: [f32; 16] =
    [1.0, -1.0, -1.0, 1.0, -1.0, 1.0, 1.0, -1.0, 1.0, -1.0, 1.0, -1.0, -1.0, 1.0, -1.0, 1.0];

/// Thickness of discs for programs that draw ellipsoids, as a share of the smaller other scale: zero would make their
/// covariance singular.
const THICKNESS: f32 = 0.01;

/// The smallest positive f32.
const LEAST: f32 = f32::from_bits(1);

/// Third scale of a disc for programs that draw ellipsoids: positive, and not above the others.
pub fn thickness(scale_u: f32, scale_v: f32) -> f32 {
    (THICKNESS * scale_u.min(scale_v)).max(LEAST)
}

/// Converts a point, in either direction.
pub fn position([x, y, z]: [f32; 3]) -> [f32; 3] {
    [x, -y, -z]
}

/// `yup_from_surfel` from `local_from_surfel`, both wxyz.
pub fn rotation([w, x, y, z]: [f32; 4]) -> [f32; 4] {
    [-x, w, -z, y]
}

/// `local_from_surfel` from `yup_from_surfel`, both wxyz.
pub fn rotation_back([w, x, y, z]: [f32; 4]) -> [f32; 4] {
    [x, -w, z, -y]
}

/// Converts the SH coefficients of a splat, in either direction. `[(degree + 1)^2, 3]`
pub fn sh(coefficients: &[f32]) -> impl Iterator<Item = f32> {
    coefficients.iter().enumerate().map(|(i, c)| SH_SIGNS[i / 3] * c)
}

/// `world_from_yup` for a node, from a frame's transform: the same similarity with y up in both frames.
pub fn node(frame: &Transform) -> Transform {
    let [x, y, z] = frame.translation;
    Transform { scale: frame.scale, rotation: flipped(frame.rotation), translation: [x, -y, -z] }
}

/// The inverse of [`node`].
pub fn frame_of_node(node: &Transform) -> Transform {
    // Half a turn is its own inverse.
    self::node(node)
}

/// The same rotation in the other frame's axes.
fn flipped(q: [f64; 4]) -> [f64; 4] {
    let [w, x, y, z] =
        quaternion::product(quaternion::product(HALF_TURN, q), quaternion::conjugate(HALF_TURN));
    // No negative zeros, so that equal transforms make equal files.
    [w, x, y, z].map(|v| v + 0.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::asset::tests::fixture;
    use crate::math::sh::Turn;

    #[test]
    fn a_half_turn_flips_signs_and_is_undone_exactly() {
        let asset = fixture(9, 3);
        let turn = Turn::new(HALF_TURN);
        for i in 0..9 {
            let flipped: Vec<f32> = sh(asset.sh_of(i)).collect();
            for (found, expected) in flipped.iter().zip(turn.apply(asset.sh_of(i))) {
                assert!((f64::from(*found) - expected).abs() < 1e-14); // needed 5e-16
            }
            assert!(sh(&flipped).eq(asset.sh_of(i).iter().copied()));
            let q = rotation(asset.rotations[i]);
            let expected = quaternion::product(HALF_TURN, asset.rotations[i].map(f64::from));
            assert_eq!(q.map(f64::from), expected.map(|v| v + 0.0));
            assert_eq!(rotation_back(q), asset.rotations[i]);
            assert_eq!(position(position(asset.positions[i])), asset.positions[i]);
        }
    }

    #[test]
    fn the_node_transform_matches_the_frame() {
        let frame = Transform { scale: 2.5, rotation: [0.5, -0.1, 0.7, 0.5], translation: [4.0, -5.0, 6.0] };
        let node = node(&frame);
        let p = [0.3, -0.7, 1.1];
        let [x, y, z] = frame.transform_point(p);
        let found = node.transform_point(position(p));
        for (found, expected) in found.iter().zip([x, -y, -z]) {
            assert!((found - expected).abs() < 1e-14, "{found} {expected}"); // needed 0 here; other frames round
        }
        assert_eq!(frame_of_node(&node), frame);
    }
}
