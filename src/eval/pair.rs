//! What the quality figures compare: a render and its photo, both in 8 bits.

use crate::image::TargetImage;

/// A render and its photo as the metrics compare them: same size, 8 bits, black where masked.
#[derive(Clone, Debug, PartialEq)]
pub struct ImagePair {
    /// Width of both images.
    pub width_px: usize,
    /// Height of both images.
    pub height_px: usize,
    /// The render. `[height, width, 3]`
    pub rendered: Vec<u8>,
    /// The photo. `[height, width, 3]`
    pub target: Vec<u8>,
    /// Whether each pixel is compared; `None` if all are. `[height, width]`
    pub unmasked: Option<Vec<bool>>,
}

impl ImagePair {
    /// Clamps a render (display space, `[height, width, 3]`) to [0, 1], rounds it to 8 bits and pairs
    /// it with its photo. NaN becomes 0.
    ///
    /// # Panics
    /// If an array's length does not match the photo's size.
    pub fn new(rendered_rgb: &[f32], target: &TargetImage) -> Self {
        let (width_px, height_px) = (target.width_px as usize, target.height_px as usize);
        let num_pixels = width_px * height_px;
        assert_eq!(rendered_rgb.len(), 3 * num_pixels, "size of the render");
        assert_eq!(target.rgb.len(), 3 * num_pixels, "size of the photo");
        let mut pair = Self {
            width_px,
            height_px,
            rendered: quantised(rendered_rgb),
            target: target.rgb.clone(),
            unmasked: None,
        };
        if let Some(mask) = &target.mask {
            assert_eq!(mask.len(), num_pixels, "size of the mask");
            for (pixel, _) in mask.iter().enumerate().filter(|&(_, &m)| m == 0) {
                pair.rendered[3 * pixel..3 * pixel + 3].fill(0);
                pair.target[3 * pixel..3 * pixel + 3].fill(0);
            }
            pair.unmasked = Some(mask.iter().map(|&m| m != 0).collect());
        }
        pair
    }

    /// Whether the pixel in column `x` of row `y` is compared.
    pub fn is_unmasked(&self, x: usize, y: usize) -> bool {
        self.unmasked.as_ref().is_none_or(|u| u[y * self.width_px + x])
    }
}

/// Clamps to [0, 1] and rounds to 8 bits, half up; NaN becomes 0.
pub fn quantised(display_rgb: &[f32]) -> Vec<u8> {
    display_rgb.iter().map(|v| (v.clamp(0.0, 1.0) * 255.0).round() as u8).collect()
}
