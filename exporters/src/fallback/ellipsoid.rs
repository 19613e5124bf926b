//! Ellipsoids of other programs as splats: discs along their two largest axes.

use crate::math::{quaternion, yup};
use crate::{AssetMap, SplatAsset};

/// A quaternion keeps its bits while its norm is within this of 1 (what [`SplatAsset::validate`] allows).
const UNIT_TOLERANCE: f64 = 1e-5;

/// Quaternions of 8 bits are this far from norm 1 at most; beyond it something else is wrong.
const STORED_UNIT_TOLERANCE: f64 = 0.05;

/// An ellipsoid is a disc while its thickness is at most this share of its smaller other scale.
const DISC_THICKNESS: f64 = 0.1;

/// Whether an ellipsoid, thinnest axis last, looks different as a disc.
pub(crate) fn is_thick(scales: [f64; 3]) -> bool {
    scales[2] > DISC_THICKNESS * scales[0].min(scales[1])
}

/// Renames the axes cyclically so that the thinnest is z. Quaternions wxyz.
pub(crate) fn thinnest_last([w, x, y, z]: [f64; 4], s: [f64; 3]) -> ([f64; 4], [f64; 3]) {
    if s[2] <= s[0] && s[2] <= s[1] {
        ([w, x, y, z], s)
    } else if s[0] <= s[1] {
        // New axes (y, z, x): times (1 + i + j + k) / 2.
        let q = [w - x - y - z, w + x + y - z, w - x + y + z, w + x - y + z];
        (q.map(|v| 0.5 * v), [s[1], s[2], s[0]])
    } else {
        // New axes (z, x, y): times (1 - i - j - k) / 2.
        let q = [w + x + y + z, -w + x - y + z, -w + x + y - z, -w - x + y + z];
        (q.map(|v| 0.5 * v), [s[2], s[0], s[1]])
    }
}

/// A stored quaternion, normalised only if its norm is off by more than assets allow; `None` if it is not a rotation.
pub(crate) fn unit(q: [f32; 4]) -> Option<[f32; 4]> {
    let norm = quaternion::norm(q.map(f64::from));
    match (norm - 1.0).abs() {
        off if off <= UNIT_TOLERANCE => Some(q),
        off if off <= STORED_UNIT_TOLERANCE => Some(q.map(|v| (f64::from(v) / norm) as f32)),
        _ => None,
    }
}

/// Appends an activated ellipsoid of a file with y up, without map and colours; returns whether it is thick.
///
/// # Errors
/// Says which number is out of range.
pub(crate) fn push(
    asset: &mut SplatAsset,
    rotation: [f32; 4],
    scales: [f32; 3],
    opacity: f32,
) -> Result<bool, String> {
    if !scales.iter().all(|s| *s >= 0.0 && s.is_finite()) {
        return Err(format!("scales {scales:?} are not finite and at least 0"));
    }
    if !(0.0..=1.0).contains(&opacity) {
        return Err(format!("opacity {opacity} is not in [0, 1]"));
    }
    let q = unit(rotation).ok_or_else(|| format!("rotation {rotation:?} (wxyz) is not a unit quaternion"))?;
    let (q, scales) = thinnest_last(q.map(f64::from), scales.map(f64::from));
    asset.rotations.push(yup::rotation_back(q.map(|v| v as f32)));
    // Zeros become as small as f32 can be, so that the rules of assets hold.
    asset.scales.push([scales[0], scales[1]].map(|s| (s as f32).max(f32::MIN_POSITIVE)));
    asset.opacities.push(opacity.max(f32::MIN_POSITIVE));
    asset.maps.push(AssetMap::default());
    Ok(is_thick(scales))
}

/// Appends what cannot be seen, in place of an ellipsoid that [`push`] refuses.
pub(crate) fn push_nothing(asset: &mut SplatAsset) {
    asset.rotations.push([1.0, 0.0, 0.0, 0.0]);
    asset.scales.push([f32::MIN_POSITIVE; 2]);
    asset.opacities.push(f32::MIN_POSITIVE);
    asset.maps.push(AssetMap::default());
}
