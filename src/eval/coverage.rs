//! How much of an image the splats cover.

use crate::image::TargetImage;

/// Alpha below which a pixel counts as uncovered: the background makes up most of its colour.
pub const UNCOVERED_ALPHA: f32 = 0.5;

/// Which pixels count and are uncovered. `alpha`: `[height, width]`, as is the result.
pub fn uncovered_pixels(alpha: &[f32], target: &TargetImage) -> Vec<bool> {
    let counts = |pixel: usize| target.mask.as_ref().is_none_or(|m| m[pixel] != 0);
    alpha.iter().enumerate().map(|(i, a)| *a < UNCOVERED_ALPHA && counts(i)).collect()
}

/// Share of the unmasked pixels that are uncovered, 0 to 1; 0 if all are masked.
pub fn uncovered_share(alpha: &[f32], target: &TargetImage) -> f64 {
    let count = target.mask.as_ref().map_or(alpha.len(), |m| m.iter().filter(|&&m| m != 0).count());
    let uncovered = uncovered_pixels(alpha, target).into_iter().filter(|u| *u).count();
    uncovered as f64 / count.max(1) as f64
}
