//! How coarsely a `.ltgs` file may be rounded: steps are found by looking at the images.

use super::asset_args::AssetArgs;
use super::contribution::Contribution;
use super::differences::{Difference, Stage, VIEWS, loss_db, mse_to_photos, spread};
use super::frozen::Frozen;
use super::log::Log;
use super::values::format_bytes;
use super::verdict::Limits;
use litetex_exporters::ltgs::{LtgsOptions, Steps, encode, exponents_from_weights, quantised};
use litetex_exporters::{AssetCamera, Quality, SplatAsset};
use litetex_gs::backend::RenderedImage;
use litetex_gs::eval::psnr_from_mse;
use litetex_gs::{Error, Result};

/// Views by which steps are confirmed, those that were held out among them; `VIEWS` lead there.
const CONFIRMED_VIEWS: usize = 48;
/// Bounds of the factor of all steps, as powers of two.
const FACTOR_LOG2: [f64; 2] = [-6.0, 6.0];
/// The factor is found to 3 %: `12 / 2^8` powers of two.
const ROUNDS: u32 = 8;
/// Of what may be lost, this much is used: other views may lose a little more.
const USED_SHARE: f64 = 0.95;

/// How a file is rounded.
pub struct Rounding {
    /// What it may be called.
    pub quality: Quality,
    /// Sizes of steps; `None`: a lossless file.
    pub steps: Option<Steps>,
    /// Exponents of splats; empty: zeros.
    pub exponents: Vec<i8>,
}

impl Rounding {
    const LOSSLESS: Self = Self { quality: Quality::Lossless, steps: None, exponents: Vec::new() };
}

/// The rounding that was asked for.
///
/// # Errors
/// [`Error::Usage`] if no steps are good or small enough, or what the device reports.
pub fn rounding(frozen: &Frozen, args: &AssetArgs, device: &str, log: &Log) -> Result<Rounding> {
    let asked = args.quality();
    if asked == Quality::Lossless {
        let contradicted = args.max_size.map(|_| "--max-size").or(args.max_loss.map(|_| "--max-loss"));
        return match contradicted {
            Some(flag) => Err(Error::Usage(format!(
                "--quality lossless has one size and loses nothing; leave {flag} out"
            ))),
            None => Ok(Rounding::LOSSLESS),
        };
    }
    let asset = &frozen.asset;
    let training: Vec<AssetCamera> = asset.cameras.iter().filter(|c| !c.held_out).cloned().collect();
    if training.is_empty() {
        if let Some(most) = args.max_size {
            let steps = Some(of_size(asset, asked, &[], most)?);
            return Ok(Rounding { quality: Quality::Custom, steps, exponents: Vec::new() });
        }
        if args.max_loss.is_some() {
            let what = "--max-loss is measured by rendering, and the scene has no cameras; use --max-size";
            return Err(Error::Usage(format!("{}: {what}", frozen.path.display())));
        }
        log.warn(
            "not-measured",
            "the scene has no cameras: nothing is measured by rendering, and the file is of quality \"custom\"",
            1,
        );
        let steps = Some(base(asset, asked));
        return Ok(Rounding { quality: Quality::Custom, steps, exponents: Vec::new() });
    }
    let contribution = Contribution::of(asset, &spread(&training, CONFIRMED_VIEWS), log)?;
    let exponents = exponents_from_weights(&contribution.squared_weight_px);
    let mut look = Look::new(asset, &exponents, spread(&training, VIEWS), device, log)?;
    if let Some(most) = args.max_size {
        let steps = of_size(asset, asked, &exponents, most)?;
        return Ok(Rounding { quality: look.quality_of(&steps)?, steps: Some(steps), exponents });
    }
    let limits = args.asked_limits().unwrap_or(Limits::of(asked));
    let factor = look.coarsest_within(asked, &limits)?.ok_or_else(|| {
        let most = limits.max_loss_db.unwrap_or_default();
        Error::Usage(format!("no steps lose as little as {most} dB; use --quality lossless"))
    })?;
    log.detail(&format!("steps of {} times {:.3}", asked.name(), factor.exp2()));
    let steps = base(asset, asked).scaled(factor.exp2());
    let quality = if args.max_loss.is_some() { look.quality_of(&steps)? } else { asked };
    Ok(Rounding { quality, steps: Some(steps), exponents })
}

/// The finest steps of a file that is small enough.
fn of_size(asset: &SplatAsset, asked: Quality, exponents: &[i8], most: u64) -> Result<Steps> {
    let size = |factor: f64| -> Result<u64> {
        let steps = Some(base(asset, asked).scaled(factor.exp2()));
        Ok(encode(asset, &LtgsOptions { quality: asked, steps, exponents })?.len() as u64)
    };
    let factor = coarsest(|factor| Ok(size(factor)? > most))?;
    // One step coarser than what is too large.
    let factor = factor.map_or(FACTOR_LOG2[0], |f| f + resolution());
    let bytes = size(factor)?;
    if bytes > most {
        return Err(Error::Usage(format!(
            "--max-size {}: the coarsest file has {}; leave splats out with --crop or --min-contribution, or train \
             a smaller scene with --max-splats",
            format_bytes(most),
            format_bytes(bytes)
        )));
    }
    Ok(base(asset, asked).scaled(factor.exp2()))
}

fn base(asset: &SplatAsset, quality: Quality) -> Steps {
    if quality == Quality::Tiny { Steps::tiny(asset) } else { Steps::balanced(asset) }
}

fn resolution() -> f64 {
    (FACTOR_LOG2[1] - FACTOR_LOG2[0]) / f64::from(1_u32 << ROUNDS)
}

/// The largest factor, as a power of two, for which `holds`, which must hold below and not above; `None` if it holds
/// nowhere.
fn coarsest(mut holds: impl FnMut(f64) -> Result<bool>) -> Result<Option<f64>> {
    let (mut low, mut high) = (0_u32, 1_u32 << ROUNDS);
    let at = |i: u32| FACTOR_LOG2[0] + f64::from(i) * resolution();
    if !holds(at(0))? {
        return Ok(None);
    }
    while high - low > 1 {
        let middle = low.midpoint(high);
        if holds(at(middle))? {
            low = middle;
        } else {
            high = middle;
        }
    }
    Ok(Some(at(low)))
}

/// A scene and its images, ready to be compared.
struct Look<'a> {
    asset: &'a SplatAsset,
    exponents: &'a [i8],
    stage: Stage,
    views: Vec<AssetCamera>,
    expected: Vec<RenderedImage>,
    /// Mean squared error of the scene from photos, as far as it tells.
    mse: f64,
}

impl<'a> Look<'a> {
    fn new(
        asset: &'a SplatAsset,
        exponents: &'a [i8],
        views: Vec<AssetCamera>,
        device: &str,
        log: &Log,
    ) -> Result<Self> {
        let mut stage = Stage::open(device, log)?;
        let expected = stage.images(asset, &views)?;
        Ok(Self { asset, exponents, stage, views, expected, mse: mse_to_photos(asset) })
    }

    /// The factor, as a power of two, of the coarsest steps that keep to the limits at all views; `None`: no steps do.
    fn coarsest_within(&mut self, asked: Quality, limits: &Limits) -> Result<Option<f64>> {
        let asset = self.asset;
        let steps = |factor: f64| base(asset, asked).scaled(factor.exp2());
        let Some(mut factor) = coarsest(|factor| self.keeps(&steps(factor), limits))? else {
            return Ok(None);
        };
        while !self.keeps_everywhere(&steps(factor), limits)? {
            factor -= resolution();
            if factor < FACTOR_LOG2[0] {
                return Ok(None);
            }
        }
        Ok(Some(factor))
    }

    /// The best quality whose promises steps keep at all views.
    fn quality_of(&mut self, steps: &Steps) -> Result<Quality> {
        for quality in [Quality::Balanced, Quality::Tiny] {
            if self.keeps_everywhere(steps, &Limits::of(quality))? {
                return Ok(quality);
            }
        }
        Ok(Quality::Custom)
    }

    /// Whether images of the views with these steps keep to the limits.
    fn keeps(&mut self, steps: &Steps, limits: &Limits) -> Result<bool> {
        // Steps beyond what the format can say keep to nothing.
        let Ok(rounded) = quantised(self.asset, steps, self.exponents) else { return Ok(false) };
        let images = self.stage.images(&rounded, &self.views)?;
        let pairs = images.iter().zip(&self.expected);
        Ok(self.are_within(&pairs.map(|(p, e)| Difference::mse_of(p, e)).collect::<Vec<_>>(), limits))
    }

    /// The same of more views.
    fn keeps_everywhere(&mut self, steps: &Steps, limits: &Limits) -> Result<bool> {
        let Ok(rounded) = quantised(self.asset, steps, self.exponents) else { return Ok(false) };
        let mut errors = Vec::new();
        // A few at a time: images are large.
        for views in spread(&self.asset.cameras, CONFIRMED_VIEWS).chunks(VIEWS) {
            let expected = self.stage.images(self.asset, views)?;
            let images = self.stage.images(&rounded, views)?;
            errors.extend(images.iter().zip(&expected).map(|(p, e)| Difference::mse_of(p, e)));
        }
        Ok(self.are_within(&errors, limits))
    }

    /// Whether mean squared errors of views keep to the limits.
    fn are_within(&self, errors: &[f64], limits: &Limits) -> bool {
        let losses: Vec<f64> = errors.iter().map(|&mse| loss_db(mse, self.mse)).collect();
        let psnrs: Vec<f64> = errors.iter().map(|&mse| psnr_from_mse(mse)).collect();
        let mean = |values: &[f64]| values.iter().sum::<f64>() / errors.len().max(1) as f64;
        let within = |found: f64, limit: Option<f64>| limit.is_none_or(|l| found <= USED_SHARE * l);
        within(mean(&losses), limits.max_loss_db)
            && within(losses.iter().copied().fold(0.0, f64::max), limits.max_loss_worst_db)
            // A little room, for the same reason.
            && limits.min_psnr.is_none_or(|least| mean(&psnrs) >= least + 0.2)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_coarsest_that_holds_is_found() {
        for limit in [-5.9, -0.3, 0.0, 2.22, 5.99] {
            let mut asked = 0;
            let found = coarsest(|factor| {
                asked += 1;
                Ok(factor <= limit)
            });
            let found = found.unwrap().unwrap();
            assert!(found <= limit && found > limit - resolution(), "{limit}: {found}");
            assert!(asked <= ROUNDS + 1);
        }
        assert_eq!(coarsest(|_| Ok(false)).unwrap(), None);
    }
}
