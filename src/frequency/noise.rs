//! Taking white noise out of a spectrum. Noise of a camera adds the same power to every frequency; the
//! published significance reads that as detail, starts at a finer scale and opens it sooner (measured
//! on six captures: with noise of 10/255, full size comes 17 to 46 % earlier; corrected, at most 8 %).
//! Ours, not the paper's.
//!
//! How much noise there is, is the smaller of two upper bounds. Noise is in every direction alike: no
//! more than the quietest direction holds in the highest band. And noise is everywhere in the image:
//! no more than quiet places show of their finest diagonal detail. Either alone takes detail for
//! noise: the first that of sharp synthetic images, whose aliases fill the highest band; the second
//! that of surfaces that are rough all over. (What is rough all over, in all directions, down to the
//! pixel remains taken for noise: nothing but its name tells it apart.)

use super::spectrum::{Cell, RINGS, SECTORS, Spectrum};
use super::stages::quantile;
use crate::image::TargetImage;

/// The highest band begins here.
const HIGHEST_BAND: f64 = 0.9;

/// Rings over which powers are averaged before the floor is taken off: few enough to follow the
/// spectrum, enough to average over hundreds of frequencies.
const RINGS_TOGETHER: usize = 16;

/// A little more than the floor is taken off, since what chance leaves above it comes back as a root:
/// 1 % of power as 10 % of amplitude. Measured on ten photos and fractals with noise of 10/255, by how
/// far the step of full size moves (root mean square): 6 % (1.0), 3 % (1.05), 4 % (1.1).
const OVERSUBTRACTION: f64 = 1.05;

/// Side of the patches that are judged by themselves: 64 blocks of 2x2 pixels.
const PATCH_PX: usize = 16;

/// Patches up to this quantile are quiet. Lower ones find black and saturated places, which have no
/// noise, higher ones detail (measured as above: 5 % at 0.1, 4 % at 0.3 and 0.4, 9 % for a median over
/// all blocks, which a photo with much detail moves).
const QUIET_PATCHES: f64 = 0.3;

/// That quantile of mean squares of 64 standard normal numbers (Wilson and Hilferty).
const QUIET_OF_NOISE: f64 = 0.900;

/// Amplitude of each ring without the noise, and the noise's variance (channel values 0 to 1).
///
/// Powers add up, amplitudes do not. Where the signal's coefficients are as scattered as the noise's,
/// amplitudes go as the root of the power, so each cell's amplitude falls as the root of what is left.
pub(super) fn denoised_rings(spectrum: &Spectrum) -> (Vec<f64>, f64) {
    let noise = variance(spectrum);
    let floor = OVERSUBTRACTION * noise * spectrum.mean_square_weight;
    let mut rings = Vec::with_capacity(RINGS);
    for band in spectrum.cells.chunks(RINGS_TOGETHER) {
        let together = sum(band);
        let kept = together.map(|cell| match cell.power > 0.0 {
            true => (1.0 - floor * cell.count / cell.power).max(0.0).sqrt(),
            false => 1.0,
        });
        rings.extend(
            band.iter().map(|ring| -> f64 { ring.iter().zip(kept).map(|(c, k)| c.amplitude * k).sum() }),
        );
    }
    (rings, noise)
}

/// Variance of the noise: the smaller of both bounds.
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

/// Sums over rings, by direction.
fn sum(rings: &[[Cell; SECTORS]]) -> [Cell; SECTORS] {
    let mut sums = [Cell::default(); SECTORS];
    for ring in rings {
        for (sum, cell) in sums.iter_mut().zip(ring) {
            sum.add(cell, 1.0);
        }
    }
    sums
}

/// Variance of the finest diagonal detail, a - b - c + d over blocks of 2x2 pixels, at quiet places;
/// mean over channels. 0 for photos without a whole patch.
pub(super) fn fine_variance(photo: &TargetImage) -> f64 {
    let (width, height) = (photo.width_px as usize, photo.height_px as usize);
    let pixels = photo.rgb.as_chunks::<3>().0;
    let counts = |i: usize| photo.mask.as_ref().is_none_or(|mask| mask[i] != 0);
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
    // Blocks of a patch, and the four pixels whose variances add up in each.
    let terms = (PATCH_PX * PATCH_PX) as f64;
    let quiet = patches.map(|sums| quantile(sums, QUIET_PATCHES).unwrap_or(0.0));
    quiet.iter().sum::<f64>() / 3.0 / terms / (255.0 * 255.0) / QUIET_OF_NOISE
}

#[cfg(test)]
mod tests {
    use super::*;

    /// White noise of a standard deviation of 8 bytes, with stripes in the upper part.
    fn noisy(width: usize, height: usize, striped_rows: usize) -> TargetImage {
        let mut state = 1_u32;
        let mut uniform = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            f64::from(state >> 8) / f64::from(1 << 24) - 0.5
        };
        let mut value = |i: usize| {
            // Twelve uniform numbers: variance 1.
            let noise: f64 = (0..12).map(|_| uniform()).sum();
            let striped = i / 3 / width < striped_rows && (i / 3 + i / 3 / width).is_multiple_of(2);
            (128.0 + 8.0 * noise + if striped { 40.0 } else { 0.0 }).round() as u8
        };
        TargetImage {
            width_px: width as u32,
            height_px: height as u32,
            rgb: (0..3 * width * height).map(&mut value).collect(),
            mask: None,
        }
    }

    fn deviation(photo: &TargetImage) -> f64 {
        255.0 * fine_variance(photo).sqrt()
    }

    #[test]
    fn quiet_places_tell_the_noise() {
        // Needed: 0.05; rounding to bytes adds 0.005.
        assert!((deviation(&noisy(320, 240, 0)) - 8.0).abs() < 0.15, "{}", deviation(&noisy(320, 240, 0)));
        // With detail in half of the image it is a higher quantile of the quiet half: 8.68.
        let half = deviation(&noisy(320, 240, 120));
        assert!((8.0..9.0).contains(&half), "{half}");
        assert!(deviation(&noisy(320, 240, 240)) > 30.0, "detail everywhere is taken for noise");
        assert_eq!(deviation(&noisy(15, 40, 0)), 0.0);
    }

    #[test]
    fn masked_places_do_not_count() {
        let mut photo = noisy(160, 128, 128);
        let rows = noisy(160, 128, 0).rgb;
        photo.rgb[160 * 96 * 3..].copy_from_slice(&rows[160 * 96 * 3..]);
        assert!(deviation(&photo) > 20.0);
        photo.mask = Some((0..160 * 128).map(|i| 255 * u8::from(i >= 160 * 96)).collect());
        assert!((deviation(&photo) - 8.0).abs() < 0.5, "{}", deviation(&photo));
    }
}
