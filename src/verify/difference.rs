//! Differences between the images of two scenes, view by view.

use crate::backend::{RenderedImage, TargetImage};
use crate::eval::{ViewQuality, psnr_from_mse, quality_of, quantised};
use litetex_exporters::SplatAsset;

/// Views at which a file is shaped and checked while it is written; a later, separate check may look at all.
pub const EXPORT_VIEWS: usize = 12;

/// PSNR on test views, dB, assumed of a scene that states none: most captures lie below it.
const ASSUMED_PSNR: f64 = 30.0;

/// Key of a training's test PSNR among the facts that an asset carries about its training.
pub const PSNR_TEST: &str = "psnr_test";

/// The differences between two images of one view.
#[derive(Clone, Debug, PartialEq)]
pub struct Difference {
    /// SSIM, FLIP and the other figures, of images rounded to 8 bits.
    pub quality: ViewQuality,
    /// Mean squared difference of the values clamped to [0, 1], not rounded.
    pub mse: f64,
    /// Largest difference of any value, not clamped.
    pub largest: f32,
}

impl Difference {
    /// Compares an image with what it should be.
    pub fn of(name: &str, found: &RenderedImage, expected: &RenderedImage) -> Self {
        let target = target_of(expected);
        let pairs = || found.rgb.iter().zip(&expected.rgb);
        let largest = pairs().map(|(a, b)| if a == b { 0.0 } else { (a - b).abs() });
        Self {
            quality: quality_of(name, &found.rgb, &target),
            mse: Self::mse_of(found, expected),
            // NaN counts as infinitely far off.
            largest: largest.fold(0.0, |a, d| if d.is_nan() { f32::INFINITY } else { a.max(d) }),
        }
    }

    /// Mean squared difference of the values clamped to [0, 1].
    pub fn mse_of(found: &RenderedImage, expected: &RenderedImage) -> f64 {
        let pairs = found.rgb.iter().zip(&expected.rgb);
        let squares = pairs.map(|(a, b)| f64::from(a.clamp(0.0, 1.0) - b.clamp(0.0, 1.0)).powi(2));
        squares.sum::<f64>() / found.rgb.len().max(1) as f64
    }

    /// PSNR of the values without rounding to 8 bits, dB.
    pub fn psnr(&self) -> f64 {
        psnr_from_mse(self.mse)
    }
}

/// An image in 8 bits, to compare others with.
pub(super) fn target_of(image: &RenderedImage) -> TargetImage {
    TargetImage::opaque(image.width_px, image.height_px, quantised(&image.rgb))
}

/// Mean squared error of a scene's images against photos, by the test PSNR that the asset states, if it does.
pub(super) fn mse_to_photos(asset: &SplatAsset) -> f64 {
    let stated = asset.provenance.training.get(PSNR_TEST).and_then(|v| v.parse::<f64>().ok());
    10.0_f64.powf(-stated.filter(|p| p.is_finite()).unwrap_or(ASSUMED_PSNR) / 10.0)
}

/// PSNR lost, dB, where an independent error of `mse` is added to one of `before`.
pub(super) fn loss_db(mse: f64, before: f64) -> f64 {
    10.0 * (1.0 + mse / before).log10()
}

/// At most `most` of the views, evenly spread over their order.
pub fn evenly_spread<T: Clone>(views: &[T], most: usize) -> Vec<T> {
    let count = views.len().min(most.max(1));
    (0..count).map(|i| views[i * views.len() / count].clone()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use litetex_exporters::AssetCamera;

    fn image(value: f32) -> RenderedImage {
        let rgb = (0..16 * 16 * 3).map(|i| value + (i % 7) as f32 / 100.0).collect();
        RenderedImage {
            width_px: 16,
            height_px: 16,
            rgb,
            alpha: vec![1.0; 256],
            depth: vec![],
            normal: vec![],
        }
    }

    #[test]
    fn differences_are_measured_before_rounding() {
        let (a, mut b) = (image(0.25), image(0.25));
        assert_eq!(Difference::of("a", &a, &b).largest, 0.0);
        b.rgb[5] += 1e-4;
        let found = Difference::of("a", &b, &a);
        assert!((found.largest - 1e-4).abs() < 1e-7 && found.mse > 0.0, "{found:?}");
        b.rgb[5] = f32::NAN;
        assert_eq!(Difference::of("a", &b, &a).largest, f32::INFINITY);
        // 0.1 dB at 30 dB: 2.3 % of the error before.
        assert!((loss_db(2.33e-5, 1e-3) - 0.1).abs() < 1e-3);
    }

    #[test]
    fn views_are_spread_evenly() {
        let view = |i: usize| AssetCamera { name: i.to_string(), ..AssetCamera::default() };
        let views: Vec<AssetCamera> = (0..10).map(view).collect();
        let names = |most| evenly_spread(&views, most).into_iter().map(|v| v.name).collect::<Vec<_>>();
        assert_eq!(names(3), ["0", "3", "6"]);
        assert_eq!(names(50).len(), 10);
        assert_eq!(evenly_spread::<AssetCamera>(&[], 3).len(), 0);
    }
}
