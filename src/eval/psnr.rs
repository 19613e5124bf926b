//! Peak signal-to-noise ratio.

use super::pair::ImagePair;

/// PSNR is at most this: JSON has no infinity, and identical images must have a figure. At 8 bits
/// one wrong code value in 5 million is 115 dB, so nothing of interest lies above.
pub const PSNR_CAP_DB: f64 = 100.0;

/// `20 log10(1 / sqrt(mse))` for a peak of 1, capped.
pub fn psnr_from_mse(mse: f64) -> f64 {
    (-10.0 * mse.log10()).min(PSNR_CAP_DB)
}

/// PSNR over the pixels that count and all channels, dB; the cap if no pixel counts.
pub fn psnr(pair: &ImagePair) -> f64 {
    // Squares of code values are summed as integers: exact, so in any order the same.
    let (mut sum, mut pixels) = (0_u64, 0_u64);
    for (pixel, (a, b)) in pair.rendered.chunks_exact(3).zip(pair.target.chunks_exact(3)).enumerate() {
        if pair.counts.as_ref().is_none_or(|c| c[pixel]) {
            pixels += 1;
            sum += (0..3).map(|c| u64::from(a[c].abs_diff(b[c])).pow(2)).sum::<u64>();
        }
    }
    if pixels == 0 {
        return PSNR_CAP_DB;
    }
    psnr_from_mse(sum as f64 / (3.0 * pixels as f64 * 255.0 * 255.0))
}
