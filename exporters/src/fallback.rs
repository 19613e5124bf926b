//! What programs without textures find in a file: is it the textured scene's, with the maps' means in its colours?

use crate::SplatAsset;
use crate::sh::SH_0;

/// Largest share by which a stored coefficient may differ from what is computed here; our own files need 0, sums of
/// another program in f32 some 1e-6.
const RELATIVE_TOLERANCE: f64 = 1e-5;

/// The same, absolute: a fortieth of a step of 8 bits.
const ABSOLUTE_TOLERANCE: f64 = 1e-4 / SH_0;

/// How far a coefficient of degree 0 may be from [`SplatAsset::untextured_dc`]. `texel_step`: step of texels' codes, 0
/// for floats; the mean may be that of the texels before they were rounded.
fn tolerance(expected: f32, texel_step: f64) -> f64 {
    ABSOLUTE_TOLERANCE + 0.5 * texel_step / SH_0 + RELATIVE_TOLERANCE * f64::from(expected).abs()
}

/// Splats whose stored coefficients of degree 0 are not the exact ones with the mean of the map in them.
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
        let text = || format!("splat {splat}: {found:?}, with the mean of its map it is {expected:?}");
        (!(0..3).all(is_near)).then(text)
    };
    stored.take(asset.num_splats()).enumerate().filter_map(wrong)
}

/// Splats whose third scale makes no disc of an ellipsoid.
pub(crate) fn wrong_thickness(stored: impl Iterator<Item = [f32; 3]>) -> impl Iterator<Item = String> {
    stored.enumerate().filter_map(|(splat, scales)| {
        let [u, v, w] = scales;
        let is_thin = w > 0.0 && w <= u.min(v);
        let text = || format!("splat {splat}: scales {scales:?}, the third is positive and the smallest");
        (!is_thin).then(text)
    })
}
