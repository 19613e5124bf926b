//! PSNR after a correction of the colours: photos whose exposure or white balance drifts differ from a good render by
//! an affine map of the colours, which says nothing about the scene.

use super::pair::ImagePair;
use super::psnr::psnr_from_mse;
use glam::{DMat4, DVec4};

/// Weight per pixel of the distance from the identity, so that flat images have a map too.
const RIDGE: f64 = 1e-6;

/// PSNR of the right half after an affine map of the render's colours fitted by least squares on the left half, dB:
/// what is scored is not what was fitted. `None` if a half has no unmasked pixel.
pub fn corrected_psnr(pair: &ImagePair) -> Option<f64> {
    let middle = pair.width_px / 2;
    let map = fit(pixels(pair, 0..middle))?;
    let (mut sum, mut count) = (0.0, 0_u64);
    for (rendered, target) in pixels(pair, middle..pair.width_px) {
        for (row, target) in map.iter().zip(target) {
            sum += (row.dot(rendered).clamp(0.0, 1.0) - target).powi(2);
        }
        count += 3;
    }
    (count > 0).then(|| psnr_from_mse(sum / count as f64))
}

/// Rows of the affine map from (r, g, b, 1) to the target's channels; `None` without pixels.
fn fit(pixels: impl Iterator<Item = (DVec4, [f64; 3])>) -> Option<[DVec4; 3]> {
    let mut normal = DMat4::ZERO;
    let mut sides = [DVec4::ZERO; 3];
    let mut count = 0_u64;
    for (rendered, target) in pixels {
        normal += DMat4::from_cols(
            rendered * rendered.x,
            rendered * rendered.y,
            rendered * rendered.z,
            rendered * rendered.w,
        );
        for (side, target) in sides.iter_mut().zip(target) {
            *side += rendered * target;
        }
        count += 1;
    }
    if count == 0 {
        return None;
    }
    let ridge = RIDGE * count as f64;
    let inverse = (normal + DMat4::from_diagonal(DVec4::splat(ridge))).inverse();
    let identity = [DVec4::X, DVec4::Y, DVec4::Z];
    Some([0, 1, 2].map(|c| inverse * (sides[c] + ridge * identity[c])))
}

/// Unmasked pixels of some columns: the render's colour with a 1 appended, and the photo's colour.
fn pixels(pair: &ImagePair, columns: std::ops::Range<usize>) -> impl Iterator<Item = (DVec4, [f64; 3])> + '_ {
    let rows = 0..pair.height_px;
    rows.flat_map(move |y| columns.clone().map(move |x| (x, y))).filter(|&(x, y)| pair.is_unmasked(x, y)).map(
        |(x, y)| {
            let at = 3 * (y * pair.width_px + x);
            let value = |image: &[u8], c: usize| f64::from(image[at + c]) / 255.0;
            let [r, g, b] = [0, 1, 2].map(|c| value(&pair.rendered, c));
            (DVec4::new(r, g, b, 1.0), [0, 1, 2].map(|c| value(&pair.target, c)))
        },
    )
}
