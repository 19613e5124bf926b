//! Checks that the fallback in a file matches its textured scene: colours include the maps' means, splats are thin discs.

use crate::SplatAsset;
use crate::math::sh::SH_0;

/// Largest relative difference between a stored coefficient and what is computed here. Our files need 0, sums of other
/// programs in f32 about 1e-6.
const RELATIVE_TOLERANCE: f64 = 1e-5;

/// Largest absolute difference: a fortieth of a step of 8 bits.
const ABSOLUTE_TOLERANCE: f64 = 1e-4 / SH_0;

/// How far a coefficient of degree 0 may be from [`SplatAsset::untextured_dc`]. `texel_step` is the step between codes of
/// texels, 0 for floats: the mean may be that of the texels before they were rounded.
fn tolerance(expected: f32, texel_step: f64) -> f64 {
    ABSOLUTE_TOLERANCE + 0.5 * texel_step / SH_0 + RELATIVE_TOLERANCE * f64::from(expected).abs()
}

/// Offences of splats whose stored coefficients of degree 0 are not the exact ones plus the mean of the map.
pub(crate) fn wrong_dc(
    asset: &SplatAsset,
    stored: impl Iterator<Item = [f32; 3]>,
    texel_step: f64,
) -> impl Iterator<Item = String> {
    let wrong = move |(splat, found): (usize, [f32; 3])| {
        let expected = asset.untextured_dc(splat);
        let is_near = |c: usize| {
            let apart = f64::from(found[c]) - f64::from(expected[c]);
            apart.abs() <= tolerance(expected[c], texel_step)
        };
        let text = || format!("splat {splat}: {found:?}, expected {expected:?} with the mean of its map");
        (!(0..3).all(is_near)).then(text)
    };
    stored.take(asset.num_splats()).enumerate().filter_map(wrong)
}

/// Offences of splats whose third scale does not make an ellipsoid a disc.
pub(crate) fn wrong_thickness(stored: impl Iterator<Item = [f32; 3]>) -> impl Iterator<Item = String> {
    stored.enumerate().filter_map(|(splat, scales)| {
        let [u, v, w] = scales;
        let is_thin = w > 0.0 && w <= u.min(v);
        let text =
            || format!("splat {splat}: scales {scales:?}, expected the third positive and the smallest");
        (!is_thin).then(text)
    })
}
