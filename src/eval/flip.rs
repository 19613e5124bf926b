//! FLIP (Andersson et al. 2020): the difference a viewer perceives when flipping between two images.

use super::pair::ImagePair;

/// Mean LDR-FLIP error over the unmasked pixels, 0 to 1; 0 if every pixel is masked. Assumes 67 pixels
/// per degree, the metric's default: a 4K screen 0.7 m wide, viewed from 0.7 m.
pub fn mean_flip(pair: &ImagePair) -> f64 {
    // Image sizes come from u32, so the narrowing is exact.
    let (width, height) = (pair.width_px as u32, pair.height_px as u32);
    if width == 0 || height == 0 {
        return 0.0;
    }
    let image = |rgb: &[u8]| nv_flip::FlipImageRgb8::with_data(width, height, rgb);
    let errors =
        nv_flip::flip(image(&pair.target), image(&pair.rendered), nv_flip::DEFAULT_PIXELS_PER_DEGREE)
            .to_vec();
    let (mut sum, mut count) = (0.0, 0_u64);
    for (pixel, &error) in errors.iter().enumerate() {
        if pair.unmasked.as_ref().is_none_or(|u| u[pixel]) {
            sum += f64::from(error);
            count += 1;
        }
    }
    if count == 0 { 0.0 } else { sum / count as f64 }
}
