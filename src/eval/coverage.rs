//! How much of an image the splats cover.

use crate::image::TargetImage;

/// Alpha below which a pixel counts as uncovered: the background makes up most of its colour.
pub const UNCOVERED_ALPHA: f32 = 0.5;

/// Which pixels are uncovered: they count, the model leaves them mostly to the background, and the photo shows something
/// else there. `alpha`: `[height, width]`, as is the result.
pub fn uncovered_pixels(alpha: &[f32], target: &TargetImage, background: [f32; 3]) -> Vec<bool> {
    let is_uncovered = |(i, a): (usize, &f32)| {
        *a < UNCOVERED_ALPHA && target.counts(i) && !target.shows_background(i, background)
    };
    alpha.iter().enumerate().map(is_uncovered).collect()
}

/// Share of the unmasked pixels that are uncovered, 0 to 1; 0 if all are masked.
pub fn uncovered_share(alpha: &[f32], target: &TargetImage, background: [f32; 3]) -> f64 {
    let count = target.mask.as_ref().map_or(alpha.len(), |m| m.iter().filter(|&&m| m != 0).count());
    let uncovered = uncovered_pixels(alpha, target, background).into_iter().filter(|u| *u).count();
    uncovered as f64 / count.max(1) as f64
}
