//! How far the images of two scenes lie apart, view by view.

use super::interrupt::Interrupt;
use super::log::Log;
use super::{devices, frozen::PSNR_TEST};
use litetex_exporters::{AssetCamera, ColourSpace, SplatAsset};
use litetex_gs::Result;
use litetex_gs::backend::{Backend, RenderOptions, RenderedImage, TargetImage};
use litetex_gs::bake::{camera, thaw};
use litetex_gs::eval::{ViewQuality, psnr_from_mse, quality_of, quantised};
use litetex_gs::model::AdamState;

/// PSNR on test views that is assumed of a scene that does not tell: most captures lie below.
const ASSUMED_PSNR: f64 = 30.0;

/// Views of a scene at which files are shaped and proven; "litetex verify" looks at all.
pub const VIEWS: usize = 12;

/// A scene on a device.
pub struct Stage {
    backend: Box<dyn Backend>,
    options: RenderOptions,
    colour_space: ColourSpace,
    interrupt: Interrupt,
}

impl Stage {
    /// Takes a device.
    ///
    /// # Errors
    /// What the device reports.
    pub fn open(device: &str, log: &Log) -> Result<Self> {
        let options = RenderOptions { background: [0.0; 3], sh_degree: 0, geometry: false };
        Ok(Self {
            backend: devices::open(device, log)?,
            options,
            colour_space: ColourSpace::default(),
            interrupt: Interrupt::current(),
        })
    }

    /// Puts a scene there.
    ///
    /// # Errors
    /// If it does not fit.
    pub fn show(&mut self, asset: &SplatAsset) -> Result<()> {
        let model = thaw(asset);
        self.options.sh_degree = asset.sh_degree;
        self.options.background = asset.background;
        self.colour_space = asset.colour_space;
        self.backend.upload(&model, &AdamState::zeros(&model))
    }

    /// An image of it.
    ///
    /// # Errors
    /// What the device reports, [`litetex_gs::Error::Interrupted`].
    pub fn render(&mut self, view: &AssetCamera) -> Result<RenderedImage> {
        self.interrupt.check()?;
        let mut image = self.backend.render(&camera(view), &self.options)?;
        to_display(&mut image, self.colour_space);
        Ok(image)
    }

    /// Images of a scene from several views.
    ///
    /// # Errors
    /// What the device reports.
    pub fn images(&mut self, asset: &SplatAsset, views: &[AssetCamera]) -> Result<Vec<RenderedImage>> {
        self.show(asset)?;
        views.iter().map(|view| self.render(view)).collect()
    }
}

/// Colours blended in another space as sRGB code values, which is what images hold.
pub fn to_display(image: &mut RenderedImage, space: ColourSpace) {
    if space != ColourSpace::SrgbRec709Display {
        image.rgb.iter_mut().for_each(|v| *v = space.srgb((*v).into()) as f32);
    }
}

/// Two images of one view against each other.
#[derive(Clone, Debug, PartialEq)]
pub struct Difference {
    /// SSIM, FLIP and so on, of 8 bits.
    pub quality: ViewQuality,
    /// Mean squared difference of the values clamped to [0, 1], not rounded.
    pub mse: f64,
    /// Largest difference of any value, not clamped.
    pub largest: f32,
}

impl Difference {
    /// Of an image from what it should be.
    pub fn of(name: &str, found: &RenderedImage, expected: &RenderedImage) -> Self {
        let target = TargetImage {
            width_px: expected.width_px,
            height_px: expected.height_px,
            rgb: quantised(&expected.rgb),
            mask: None,
        };
        let pairs = || found.rgb.iter().zip(&expected.rgb);
        let largest = pairs().map(|(a, b)| if a == b { 0.0 } else { (a - b).abs() });
        Self {
            quality: quality_of(name, &found.rgb, &target),
            mse: Self::mse_of(found, expected),
            // Not-a-number is as far off as can be.
            largest: largest.fold(0.0, |a, d| if d.is_nan() { f32::INFINITY } else { a.max(d) }),
        }
    }

    /// Mean squared difference of the values clamped to [0, 1].
    pub fn mse_of(found: &RenderedImage, expected: &RenderedImage) -> f64 {
        let pairs = found.rgb.iter().zip(&expected.rgb);
        let squares = pairs.map(|(a, b)| f64::from(a.clamp(0.0, 1.0) - b.clamp(0.0, 1.0)).powi(2));
        squares.sum::<f64>() / found.rgb.len().max(1) as f64
    }

    /// dB, without rounding to 8 bits.
    pub fn psnr(&self) -> f64 {
        psnr_from_mse(self.mse)
    }
}

/// The mean squared error of a scene's images from photos, as far as the asset tells.
pub fn mse_to_photos(asset: &SplatAsset) -> f64 {
    let told = asset.provenance.training.get(PSNR_TEST).and_then(|v| v.parse::<f64>().ok());
    10.0_f64.powf(-told.filter(|p| p.is_finite()).unwrap_or(ASSUMED_PSNR) / 10.0)
}

/// PSNR that is lost where an error of `mse` comes on top of one of `before`, independent of it; dB.
pub fn loss_db(mse: f64, before: f64) -> f64 {
    10.0 * (1.0 + mse / before).log10()
}

/// At most `most` of the views, evenly spread.
pub fn spread(views: &[AssetCamera], most: usize) -> Vec<AssetCamera> {
    let count = views.len().min(most.max(1));
    (0..count).map(|i| views[i * views.len() / count].clone()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

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
        // 0.1 dB at 30 dB: an error of 2.3 % of what was there.
        assert!((loss_db(2.33e-5, 1e-3) - 0.1).abs() < 1e-3);
    }

    #[test]
    fn views_are_spread_evenly() {
        let view = |i: usize| AssetCamera {
            name: i.to_string(),
            held_out: false,
            width_px: 1,
            height_px: 1,
            focal_px: [1.0; 2],
            principal_px: [0.5; 2],
            rotation_rows: [[0.0; 3]; 3],
            translation: [0.0; 3],
        };
        let views: Vec<AssetCamera> = (0..10).map(view).collect();
        let names = |most| spread(&views, most).into_iter().map(|v| v.name).collect::<Vec<_>>();
        assert_eq!(names(3), ["0", "3", "6"]);
        assert_eq!(names(50).len(), 10);
        assert_eq!(spread(&[], 3).len(), 0);
    }
}
