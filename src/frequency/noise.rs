//! Removes white noise from a spectrum (method 7.3; ours, not the paper's). Camera noise adds the same power to
//! every frequency; the published significance takes it for detail, starts at a finer scale and reaches full size
//! sooner (measured on six captures: with noise of 10/255, full size comes 17 to 46 % earlier; corrected, at most
//! 8 %).
//!
//! The noise is estimated by the smaller of two upper bounds. Noise has no direction: there is at most as much as
//! the quietest direction has in the highest band. And noise is everywhere in the image: there is at most as much
//! as quiet places have of the finest diagonal detail. Each bound alone takes some detail for noise: the first that
//! of sharp synthetic images, whose aliases fill the highest band; the second that of surfaces rough everywhere.
//! (A surface that is rough everywhere, in all directions and down to the pixel is still taken for noise; it cannot
//! be told apart.)

use super::spectrum::{Cell, RINGS, SECTORS, Spectrum};
use super::stages::quantile;
use crate::image::TargetImage;

/// Lower end of the highest band, in rho.
const HIGHEST_BAND: f64 = 0.9;

/// Rings over which powers are averaged before the noise floor is subtracted: few enough to follow the
/// spectrum, enough to average over hundreds of frequencies.
const RINGS_TOGETHER: usize = 16;

/// Factor of the noise floor that is subtracted. A little more than 1, since what chance leaves above the floor
/// returns as a square root: 1 % of power as 10 % of amplitude. Measured on ten photos and fractals with noise of
/// 10/255, by how far the step of full size moves (root mean square): 6 % (1.0), 3 % (1.05), 4 % (1.1).
const OVERSUBTRACTION: f64 = 1.05;

/// Side of the patches whose noise is estimated separately: 64 blocks of 2x2 pixels.
const PATCH_PX: usize = 16;

/// Quantile over patches that counts as quiet. Lower quantiles find black and saturated places, which have no
/// noise, higher ones find detail (measured as above: 5 % at 0.1, 4 % at 0.3 and 0.4, 9 % for a median over
/// all blocks, which shifts in photos with much detail).
const QUIET_PATCHES: f64 = 0.3;

/// The same quantile of the mean square of 64 standard normal numbers (Wilson and Hilferty).
const QUIET_OF_NOISE: f64 = 0.900;

/// Amplitude of each ring without the noise, and the variance of the noise (channel values 0 to 1).
///
/// Powers add up, amplitudes do not. Where the coefficients of the signal scatter like those of noise, amplitude is
/// proportional to the square root of power, so each cell's amplitude is scaled by the root of the remaining power.
pub(super) fn denoised_rings(spectrum: &Spectrum) -> (Vec<f64>, f64) {
    let noise = variance(spectrum);
    let floor = OVERSUBTRACTION * noise * spectrum.mean_square_weight;
    let mut rings = Vec::with_capacity(RINGS);
    for band in spectrum.cells.chunks(RINGS_TOGETHER) {
        let together = sum(band);
        let kept = together.map(|cell| {
            if cell.power > 0.0 { (1.0 - floor * cell.count / cell.power).max(0.0).sqrt() } else { 1.0 }
        });
        rings.extend(
            band.iter().map(|ring| -> f64 { ring.iter().zip(kept).map(|(c, k)| c.amplitude * k).sum() }),
        );
    }
    (rings, noise)
}

/// Variance of the noise: the smaller of the two bounds.
fn variance(spectrum: &Spectrum) -> f64 {
    let first = (HIGHEST_BAND * RINGS as f64).round() as usize;
    let highest = sum(&spectrum.cells[first..]);
    let quietest = highest
        .iter()
        .filter(|cell| cell.count > 0.0)
        .map(|cell| cell.power / cell.count)
        .fold(f64::INFINITY, f64::min);
    spectrum.fine_variance.min(quietest / spectrum.mean_square_weight)
}

/// Sums over rings, per direction.
fn sum(rings: &[[Cell; SECTORS]]) -> [Cell; SECTORS] {
    let mut sums = [Cell::default(); SECTORS];
    for ring in rings {
        for (sum, cell) in sums.iter_mut().zip(ring) {
            sum.add(cell, 1.0);
        }
    }
    sums
}

/// Variance of the finest diagonal detail, a - b - c + d over blocks of 2x2 pixels, at quiet places, as a mean over
/// channels. 0 for photos without a complete patch.
pub(super) fn fine_variance(photo: &TargetImage) -> f64 {
    let (width, height) = (photo.width_px as usize, photo.height_px as usize);
    let pixels = photo.rgb.as_chunks::<3>().0;
    let counts = |i: usize| photo.counts(i);
    let mut patches: [Vec<f64>; 3] = Default::default();
    for top in (0..=height.saturating_sub(PATCH_PX)).step_by(PATCH_PX) {
        for left in (0..=width.saturating_sub(PATCH_PX)).step_by(PATCH_PX) {
            let rows = || (top..top + PATCH_PX).map(|y| y * width + left);
            let whole = top + PATCH_PX <= height && left + PATCH_PX <= width;
            if !whole || !rows().all(|first| (first..first + PATCH_PX).all(counts)) {
                continue;
            }
            let mut sums = [0_i64; 3];
            for first in rows().step_by(2) {
                for at in (first..first + PATCH_PX).step_by(2) {
                    let block = [at, at + 1, at + width, at + width + 1].map(|i| pixels[i]);
                    for (channel, sum) in sums.iter_mut().enumerate() {
                        let [a, b, c, d] = block.map(|pixel| i64::from(pixel[channel]));
                        *sum += (a - b - c + d).pow(2);
                    }
                }
            }
            for (values, sum) in patches.iter_mut().zip(sums) {
                values.push(sum as f64);
            }
        }
    }
    // Blocks per patch, times the four pixels whose variances add up in a block.
    let terms = (PATCH_PX * PATCH_PX) as f64;
    let quiet = patches.map(|sums| quantile(sums, QUIET_PATCHES).unwrap_or(0.0));
    quiet.iter().sum::<f64>() / 3.0 / terms / (255.0 * 255.0) / QUIET_OF_NOISE
}

#[cfg(test)]
mod tests {
    use super::*;

    /// White noise with a standard deviation of 8/255, with stripes in the upper rows.
    fn noisy(width: usize, height: usize, striped_rows: usize) -> TargetImage {
        let mut state = 1_u32;
        let mut uniform = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            f64::from(state >> 8) / f64::from(1 << 24) - 0.5
        };
        let mut value = |i: usize| {
            // The sum of twelve uniform numbers has variance 1.
            let noise: f64 = (0..12).map(|_| uniform()).sum();
            let striped = i / 3 / width < striped_rows && (i / 3 + i / 3 / width).is_multiple_of(2);
            (128.0 + 8.0 * noise + if striped { 40.0 } else { 0.0 }).round() as u8
        };
        TargetImage::opaque(width as u32, height as u32, (0..3 * width * height).map(&mut value).collect())
    }

    fn deviation(photo: &TargetImage) -> f64 {
        255.0 * fine_variance(photo).sqrt()
    }

    #[test]
    fn noise_is_measured_at_quiet_places() {
        // Needed: 0.05; rounding to bytes adds 0.005.
        assert!((deviation(&noisy(320, 240, 0)) - 8.0).abs() < 0.15, "{}", deviation(&noisy(320, 240, 0)));
        // With detail in half of the image, the quantile lies higher in the quiet half: 8.68.
        let half = deviation(&noisy(320, 240, 120));
        assert!((8.0..9.0).contains(&half), "{half}");
        assert!(deviation(&noisy(320, 240, 240)) > 30.0, "detail everywhere is taken for noise");
        assert_eq!(deviation(&noisy(15, 40, 0)), 0.0);
    }

    #[test]
    fn masked_patches_are_ignored() {
        let mut photo = noisy(160, 128, 128);
        let rows = noisy(160, 128, 0).rgb;
        photo.rgb[160 * 96 * 3..].copy_from_slice(&rows[160 * 96 * 3..]);
        assert!(deviation(&photo) > 20.0);
        photo.mask = Some((0..160 * 128).map(|i| 255 * u8::from(i >= 160 * 96)).collect());
        assert!((deviation(&photo) - 8.0).abs() < 0.5, "{}", deviation(&photo));
    }
}
