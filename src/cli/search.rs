//! How coarsely a `.ltgs` file may be rounded: steps are found by looking at the pictures.

use super::asset_args::AssetArgs;
use super::differences::{Difference, Stage, loss_db, mse_to_photos, spread};
use super::frozen::Frozen;
use super::log::Log;
use super::values::format_bytes;
use super::verdict::Limits;
use litetex_exporters::ltgs::{LtgsOptions, Steps, encode, quantised};
use litetex_exporters::{AssetCamera, Quality, SplatAsset};
use litetex_gs::backend::RenderedImage;
use litetex_gs::eval::psnr_from_mse;
use litetex_gs::{Error, Result};

/// Views that are looked at.
const VIEWS: usize = 12;
/// Bounds of the factor of all steps, as powers of two.
const FACTOR_LOG2: [f64; 2] = [-6.0, 6.0];
/// The factor is found to 3 %: `12 / 2^8` powers of two.
const ROUNDS: u32 = 8;
/// Of what may be lost, this much is used: views that are not looked at may lose more.
const USED_SHARE: f64 = 0.85;

/// The steps that were asked for, and what a file with them may be called. `None`: a lossless file.
///
/// # Errors
/// [`Error::Usage`] if no steps are good or small enough, or what the device reports.
pub fn steps(frozen: &Frozen, args: &AssetArgs, device: &str, log: &Log) -> Result<(Quality, Option<Steps>)> {
    let asked = match (args.quality, args.max_loss) {
        (None, Some(loss)) if loss > 0.02 => Quality::Tiny,
        _ => args.quality(),
    };
    if asked == Quality::Lossless {
        let contradicted = args.max_size.map(|_| "--max-size").or(args.max_loss.map(|_| "--max-loss"));
        return match contradicted {
            Some(flag) => Err(Error::Usage(format!(
                "--quality lossless has one size and loses nothing; leave {flag} out"
            ))),
            None => Ok((asked, None)),
        };
    }
    let asset = &frozen.asset;
    if let Some(most) = args.max_size {
        let factor = coarsest(|factor| Ok(size(asset, asked, factor)? > most))?;
        // One step coarser than what is too large.
        let factor = factor.map_or(FACTOR_LOG2[0], |f| f + resolution());
        let bytes = size(asset, asked, factor)?;
        if bytes > most {
            return Err(Error::Usage(format!(
                "--max-size {}: the coarsest file has {}; leave splats out with --crop or --min-contribution, or train \
                 a smaller scene with --max-splats",
                format_bytes(most),
                format_bytes(bytes)
            )));
        }
        return Ok((asked, Some(base(asset, asked).scaled(factor.exp2()))));
    }
    let training: Vec<AssetCamera> = asset.cameras.iter().filter(|c| !c.held_out).cloned().collect();
    if training.is_empty() {
        log.warn("not-measured", "the scene has no cameras: the steps are not measured by rendering", 1);
        return Ok((asked, None));
    }
    let limits = args.asked_limits().unwrap_or(Limits::of(asked));
    let mut look = Look::new(frozen, spread(&training, VIEWS), device, log)?;
    let found = coarsest(|factor| look.keeps(asset, &base(asset, asked).scaled(factor.exp2()), &limits))?;
    let factor = found.ok_or_else(|| {
        Error::Usage(format!("no steps lose as little as {limits:?} asks; use --quality lossless"))
    })?;
    log.detail(&format!("steps of {} times {:.3}", asked.name(), factor.exp2()));
    Ok((asked, Some(base(asset, asked).scaled(factor.exp2()))))
}

fn base(asset: &SplatAsset, quality: Quality) -> Steps {
    if quality == Quality::Tiny { Steps::tiny(asset) } else { Steps::balanced(asset) }
}

fn size(asset: &SplatAsset, quality: Quality, factor_log2: f64) -> Result<u64> {
    let steps = Some(base(asset, quality).scaled(factor_log2.exp2()));
    Ok(encode(asset, &LtgsOptions { quality, steps })?.len() as u64)
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

/// Views of a scene, ready to be compared.
struct Look {
    stage: Stage,
    views: Vec<AssetCamera>,
    expected: Vec<RenderedImage>,
    /// Mean squared error of the scene from photos, as far as it tells.
    mse: f64,
}

impl Look {
    fn new(frozen: &Frozen, views: Vec<AssetCamera>, device: &str, log: &Log) -> Result<Self> {
        let mut stage = Stage::open(device, log)?;
        let expected = stage.pictures(&frozen.asset, &views)?;
        Ok(Self { stage, views, expected, mse: mse_to_photos(&frozen.asset) })
    }

    /// Whether pictures with these steps keep to the limits.
    fn keeps(&mut self, asset: &SplatAsset, steps: &Steps, limits: &Limits) -> Result<bool> {
        let rounded = match quantised(asset, steps) {
            Ok(rounded) => rounded,
            // Steps beyond what the format can say.
            Err(_) => return Ok(false),
        };
        let pictures = self.stage.pictures(&rounded, &self.views)?;
        let pairs = pictures.iter().zip(&self.expected);
        let errors: Vec<f64> = pairs.map(|(found, expected)| Difference::mse_of(found, expected)).collect();
        let losses: Vec<f64> = errors.iter().map(|&mse| loss_db(mse, self.mse)).collect();
        let psnrs: Vec<f64> = errors.iter().map(|&mse| psnr_from_mse(mse)).collect();
        let count = self.views.len() as f64;
        let mean = |values: &[f64]| values.iter().sum::<f64>() / count;
        let within = |found: f64, limit: Option<f64>| limit.is_none_or(|l| found <= USED_SHARE * l);
        Ok(within(mean(&losses), limits.max_loss_db)
            && within(losses.iter().copied().fold(0.0, f64::max), limits.max_loss_worst_db)
            // Half a decibel of room, for the same reason.
            && limits.min_psnr.is_none_or(|least| mean(&psnrs) >= least + 0.5))
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
