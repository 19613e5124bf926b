//! A photo as training and evaluation see it.

use super::resample::{by_area, to_byte};

/// A photo as the loss sees it: in display space, composited on the background unless alpha is kept, at the rendered
/// size.
#[derive(Clone, Debug, PartialEq)]
pub struct TargetImage {
    /// Width in pixels.
    pub width_px: u32,
    /// Height in pixels.
    pub height_px: u32,
    /// Colours, row-major; with alpha those over black. `[height, width, 3]`
    pub rgb: Vec<u8>,
    /// 255 for pixels that count in loss and metrics, 0 for masked ones; `None`: all count. `[height, width]`
    pub mask: Option<Vec<u8>>,
    /// Opacity of the photo, 0 to [`ALPHA_LEVELS`]; `None`: opaque, or already composited. `[height, width]`
    pub alpha: Option<Vec<u8>>,
}

/// Value of an opaque pixel in [`TargetImage::alpha`]: seven bits, which leave one for the mask where both share a byte.
pub const ALPHA_LEVELS: u8 = 127;

/// Difference per channel up to which a colour counts as the background.
const BACKGROUND_TOLERANCE: f64 = 4.0 / 255.0;

/// Whether a colour, 0 to 1, looks like the background.
pub fn is_background(rgb: [f64; 3], background: [f32; 3]) -> bool {
    rgb.iter().zip(background).all(|(c, b)| (c - f64::from(b)).abs() <= BACKGROUND_TOLERANCE)
}

impl TargetImage {
    /// A photo of which every pixel counts and is opaque.
    pub fn opaque(width_px: u32, height_px: u32, rgb: Vec<u8>) -> Self {
        Self { width_px, height_px, rgb, mask: None, alpha: None }
    }

    /// Whether any pixel counts in loss and metrics, that is, whether the photo is not wholly masked.
    pub fn has_counted_pixels(&self) -> bool {
        self.mask.as_ref().is_none_or(|mask| mask.iter().any(|&m| m != 0))
    }

    /// Whether a pixel counts in loss and metrics.
    #[inline(always)]
    pub fn counts(&self, pixel: usize) -> bool {
        self.mask.as_ref().is_none_or(|mask| mask[pixel] != 0)
    }

    /// Whether a pixel is mostly transparent or, where alpha is not known, looks like the background.
    pub fn shows_background(&self, pixel: usize, background: [f32; 3]) -> bool {
        match &self.alpha {
            Some(alpha) => alpha[pixel] <= ALPHA_LEVELS / 2,
            None => {
                let rgb = &self.rgb[3 * pixel..3 * pixel + 3];
                is_background([0, 1, 2].map(|c| f64::from(rgb[c]) / 255.0), background)
            }
        }
    }

    /// The photo's colour of a pixel over a background, 0 to 1.
    #[inline(always)]
    pub fn colour(&self, pixel: usize, background: [f32; 3]) -> [f32; 3] {
        let behind = self.alpha.as_ref().map_or(0.0, |alpha| f32::from(ALPHA_LEVELS - alpha[pixel]))
            / f32::from(ALPHA_LEVELS);
        [0, 1, 2].map(|c| f32::from(self.rgb[3 * pixel + c]) / 255.0 + behind * background[c])
    }

    /// Memory of the pixels, the mask and alpha.
    pub fn num_bytes(&self) -> u64 {
        [&self.mask, &self.alpha].map(|plane| plane.as_ref().map_or(0, Vec::len)).iter().sum::<usize>() as u64
            + self.rgb.len() as u64
    }

    /// Reduced by area. A pixel counts if most of what it covers counts; it shows the mean of everything that
    /// it covers, masked pixels included.
    pub fn reduced(&self, width_px: u32, height_px: u32) -> Self {
        let (from, to) = ((self.width_px, self.height_px), (width_px, height_px));
        let channels = |values: &[u8], count: usize| -> Vec<u8> {
            let stride = from.0 as usize * count;
            let means = by_area(from, to, count, |y, row| {
                row.iter_mut().zip(&values[y * stride..]).for_each(|(r, &v)| *r = f32::from(v));
            });
            means.into_iter().map(to_byte).collect()
        };
        let mask = self
            .mask
            .as_ref()
            .map(|mask| channels(mask, 1).into_iter().map(|m| if m >= 128 { 255 } else { 0 }).collect());
        let alpha = self.alpha.as_ref().map(|alpha| channels(alpha, 1));
        Self { width_px, height_px, rgb: channels(&self.rgb, 3), mask, alpha }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn reduced_photos_average_colours_and_masks_by_majority() {
        let rgb: Vec<u8> =
            (0..8 * 6).flat_map(|i| [if i % 2 == 0 { 200 } else { 100 }, 7, i as u8]).collect();
        let mask = Some((0..8 * 6).map(|i| if i % 8 < 4 { 255 } else { 0 }).collect());
        let half = TargetImage { width_px: 8, height_px: 6, rgb, mask, alpha: None }.reduced(4, 3);
        assert_eq!((half.width_px, half.height_px, half.rgb.len()), (4, 3, 36));
        assert!(half.rgb.chunks_exact(3).all(|p| p[0] == 150 && p[1] == 7));
        assert_eq!(half.mask.as_ref().unwrap()[..4], [255, 255, 0, 0]);
    }
}
