//! Taking white noise out of a spectrum. Noise of a camera adds the same power to every frequency; the
//! published significance reads that as detail, starts at a finer scale and opens it sooner (measured:
//! with noise of 10/255, full size comes 20 to 35 % earlier on photos). Ours, not the paper's.
//!
//! How much noise there is, is the smaller of two upper bounds. Noise is in every direction alike: no
//! more than the quietest direction holds in the highest band. And noise is everywhere in the picture:
//! no more than the typical place shows of its finest diagonal detail. Either alone takes detail for
//! noise: the first that of sharp synthetic pictures, whose aliases fill the highest band; the second
//! that of surfaces that are rough all over. (What is rough all over, in all directions, down to the
//! pixel remains taken for noise: nothing but its name tells it apart.)

use super::spectrum::{Cell, RINGS, SECTORS, Spectrum};
use crate::backend::TargetImage;

/// The highest band begins here.
const HIGHEST_BAND: f64 = 0.9;

/// Rings over which powers are averaged before the floor is taken off: few enough to follow the
/// spectrum, enough to average over hundreds of frequencies.
const RINGS_TOGETHER: usize = 16;

/// A little more than the floor is taken off, since what chance leaves above it comes back as a root:
/// 1 % of power as 10 % of amplitude. Measured on nine photos and fractals with noise of 10/255, by how
/// far the step of full size moves: 6 % (1.0), 3 % (1.05), 4 % (1.1); without any subtraction 40 %.
const OVERSUBTRACTION: f64 = 1.05;

/// Median of |x| of a standard normal x.
const NORMAL_MEDIAN: f64 = 0.674_489_75;

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

/// Variance that the typical place has of its finest diagonal detail: from the median of |a - b - c + d|
/// over blocks of 2x2 pixels (the robust estimate of Donoho and Johnstone 1994, "Ideal spatial
/// adaptation by wavelet shrinkage", on the Haar basis), mean over channels. 0 without whole blocks.
pub(super) fn fine_variance(photo: &TargetImage) -> f64 {
    /// Largest |a - b - c + d|.
    const LARGEST: usize = 2 * 255;
    let (width, height) = (photo.width_px as usize, photo.height_px as usize);
    let pixels = photo.rgb.as_chunks::<3>().0;
    let counts = |i: usize| photo.mask.as_ref().is_none_or(|mask| mask[i] != 0);
    let mut histograms = [[0_u32; LARGEST + 1]; 3];
    for y in (0..height.saturating_sub(1)).step_by(2) {
        for x in (0..width.saturating_sub(1)).step_by(2) {
            let block = [0, 1, width, width + 1].map(|offset| y * width + x + offset);
            if block.iter().all(|&i| counts(i)) {
                for (channel, histogram) in histograms.iter_mut().enumerate() {
                    let [a, b, c, d] = block.map(|i| i32::from(pixels[i][channel]));
                    histogram[(a - b - c + d).unsigned_abs() as usize] += 1;
                }
            }
        }
    }
    let variance = |histogram: &[u32; LARGEST + 1]| {
        // The sum of four values has twice the standard deviation of one.
        let deviation = median(histogram) / (2.0 * NORMAL_MEDIAN * 255.0);
        deviation * deviation
    };
    histograms.iter().map(variance).sum::<f64>() / 3.0
}

/// Median of magnitudes that were rounded to integers: each stands for all values that round to it,
/// since whole steps would be too coarse for quiet photos.
fn median(histogram: &[u32]) -> f64 {
    let half = histogram.iter().map(|&n| f64::from(n)).sum::<f64>() / 2.0;
    let mut below = 0.0;
    for (value, &n) in histogram.iter().enumerate() {
        let n = f64::from(n);
        if n > 0.0 && below + n >= half {
            let part = (half - below) / n;
            return if value == 0 { 0.5 * part } else { value as f64 - 0.5 + part };
        }
        below += n;
    }
    0.0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn medians_of_rounded_magnitudes_lie_within_their_step() {
        assert_eq!(median(&[4]), 0.25);
        assert_eq!(median(&[0, 0, 8]), 2.0);
        assert_eq!(median(&[1, 2, 1]), 1.0);
        assert_eq!(median(&[0, 0]), 0.0);
    }
}
