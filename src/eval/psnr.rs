//! Peak signal-to-noise ratio.

use super::pair::ImagePair;

/// Upper limit of every PSNR: identical images need a figure and JSON has no infinity. Nothing of
/// interest lies above; at 8 bits, one value in 5 million off by one is 115 dB.
pub const PSNR_CAP_DB: f64 = 100.0;

/// PSNR in dB for a peak of 1: `-10 log10(mse)`, at most [`PSNR_CAP_DB`].
pub fn psnr_from_mse(mse: f64) -> f64 {
    (-10.0 * mse.log10()).min(PSNR_CAP_DB)
}

/// Sum of the squared differences of code values over the unmasked pixels, and their number. Integer sums are exact.
pub fn squared_error(pair: &ImagePair) -> (u64, u64) {
    let (mut sum, mut pixels) = (0, 0);
    for (pixel, (a, b)) in pair.rendered.chunks_exact(3).zip(pair.target.chunks_exact(3)).enumerate() {
        if pair.unmasked.as_ref().is_none_or(|u| u[pixel]) {
            pixels += 1;
            sum += (0..3).map(|c| u64::from(a[c].abs_diff(b[c])).pow(2)).sum::<u64>();
        }
    }
    (sum, pixels)
}

/// PSNR in dB of sums by [`squared_error`]; [`PSNR_CAP_DB`] without pixels.
pub fn psnr_from_squares((sum, pixels): (u64, u64)) -> f64 {
    if pixels == 0 {
        return PSNR_CAP_DB;
    }
    psnr_from_mse(sum as f64 / (3.0 * pixels as f64 * 255.0 * 255.0))
}

/// PSNR over all channels of the unmasked pixels, dB; [`PSNR_CAP_DB`] if every pixel is masked.
pub fn psnr(pair: &ImagePair) -> f64 {
    psnr_from_squares(squared_error(pair))
}
