//! Rate-distortion search for `.ltgs`: finds the coarsest quantisation steps within a loss or a size, by rendering. (The
//! quality-by-size charts are in `lab/src/chart/figures.rs`.)

use super::baked_scene::BakedScene;
use super::closed_loop::ClosedLoop;
use super::contribution::Contribution;
use super::difference::{Difference, EXPORT_VIEWS, evenly_spread, loss_db, mse_to_photos, target_of};
use super::limits::QualityLimits;
use super::renderer::{GoOn, SceneRenderer};
use super::scaled_steps::{FACTOR_LOG2, ROUNDS, Scaled, coarsest, factor_of_size, resolution, size_of};
use super::sensitivity::sensitivities;
use crate::backend::{Backend, RenderedImage};
use crate::eval::psnr_from_mse;
use crate::rounding::Quantisation;
use crate::text::format_bytes;
use crate::{Report, Result};
use litetex_exporters::ltgs::{PerSplat, Sensitivities, Steps, oriented, quantised, rounded};
use litetex_exporters::{AssetCamera, Quality, SplatAsset};

/// Training views at which sensitivities are measured and the loop is closed; the search itself uses [`EXPORT_VIEWS`]. Steps
/// are confirmed at all views, test views among them.
pub(super) const MEASURED_VIEWS: usize = 48;
/// Share of the allowed loss that is used: other views may lose a little more.
const USED_SHARE: f64 = 0.95;

/// Margin to the least PSNR, for other views.
const PSNR_MARGIN: f64 = 0.2;

/// Passes of the closed loop for each `--effort` beyond the first.
pub const PASSES_PER_EFFORT: u32 = 2;

/// What a `.ltgs` file should keep to.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RateGoal {
    /// The quality whose steps are scaled, and whose limits hold unless one of the bounds below is given.
    pub quality: Quality,
    /// Largest size of the file.
    pub max_bytes: Option<u64>,
    /// Most PSNR that may be lost, mean over the views, dB.
    pub max_loss_db: Option<f64>,
    /// Passes of the closed loop; 0: numbers are rounded to the nearest.
    pub passes: u32,
}

impl RateGoal {
    /// The goal of a file that keeps the limits of its quality.
    pub fn without_bounds(self) -> Self {
        Self { max_bytes: None, max_loss_db: None, ..self }
    }

    /// About how many views [`find_rounding`] renders for a scene with this many training views, and views in all.
    pub fn views_to_render(&self, training: usize, all: usize) -> usize {
        if self.quality == Quality::Lossless || training == 0 {
            return 0;
        }
        let [measured, searched] = [MEASURED_VIEWS, EXPORT_VIEWS].map(|most| training.min(most));
        let (confirmations, before) = (2 * all, 2 * measured + searched);
        // Passes, and the comparisons after them.
        let closed = |confirmations: usize| match self.passes {
            0 => 0,
            passes => (1 + passes as usize) * measured + confirmations,
        };
        if self.max_bytes.is_some() {
            let compared = 1 + self.passes.div_ceil(PASSES_PER_EFFORT) as usize;
            return before + 2 * confirmations + closed(compared * confirmations);
        }
        // What the file guarantees, where a bound replaces the limits of its quality.
        let found = if self.max_loss_db.is_some() { 2 * confirmations } else { 0 };
        before + (1 + ROUNDS as usize) * searched + confirmations + closed(3 * confirmations) + found
    }

    /// The limits that replace those of the quality; `None` if neither bound is given.
    pub fn own_limits(&self) -> Option<QualityLimits> {
        let bounded = |loss| QualityLimits { max_loss_db: Some(loss), ..QualityLimits::NONE };
        self.max_loss_db.map(bounded).or(self.max_bytes.map(|_| QualityLimits::NONE))
    }
}

/// Where the search computes; backends are opened only if it needs them.
pub struct Backends<'a> {
    /// Opens the backend that measures sensitivities.
    pub statistics: &'a dyn Fn() -> Result<Box<dyn Backend>>,
    /// Opens the backend that renders.
    pub rendering: &'a dyn Fn() -> Result<Box<dyn Backend>>,
    /// Whether to go on, asked before each view.
    pub go_on: GoOn<'a>,
}

/// How the numbers of a file are rounded.
#[derive(Clone, Debug, PartialEq)]
pub struct Rounding {
    /// The quality whose limits the file keeps.
    pub quality: Quality,
    /// Quantisation steps; `None` for a lossless file.
    pub steps: Option<Steps>,
    /// For each splat the power of two that multiplies its steps; empty for all zeros.
    pub exponents: Vec<i8>,
    /// Blending weights of the splats, summed over views; empty if they were not measured.
    pub contributions: Vec<f32>,
    /// The scene to round instead of the one given, if the closed loop has moved its numbers.
    pub adapted: Option<SplatAsset>,
}

impl Rounding {
    /// A file of this quality with its own steps.
    pub fn plain(quality: Quality) -> Self {
        Self { quality, steps: None, exponents: Vec::new(), contributions: Vec::new(), adapted: None }
    }

    /// What is known of the splats.
    pub fn per_splat(&self) -> PerSplat<'_> {
        PerSplat { exponents: &self.exponents, contributions: &self.contributions }
    }
}

/// Finds the coarsest rounding that reaches the goal, or for a bounded size the finest.
///
/// # Errors
/// [`crate::Error::Usage`] if no steps are fine or coarse enough, what a device reports, or [`crate::Error::Interrupted`].
pub fn find_rounding(
    scene: &BakedScene,
    goal: &RateGoal,
    backends: &Backends<'_>,
    report: &mut Report,
) -> Result<Rounding> {
    if goal.quality == Quality::Lossless {
        return lossless(goal);
    }
    scene.asset.validate()?;
    if let Some(rounding) = as_trained(scene, goal)? {
        return Ok(rounding);
    }
    let asset = &oriented(&scene.asset);
    let training: Vec<AssetCamera> = asset.cameras.iter().filter(|c| !c.held_out).cloned().collect();
    if training.is_empty() {
        return unmeasured(scene, goal, report);
    }
    let measured = evenly_spread(&training, MEASURED_VIEWS);
    let mut backend = (backends.statistics)()?;
    let found = sensitivities(backend.as_mut(), asset, &measured, backends.go_on)?;
    let (base, exponents) = found.rounding(asset);
    let contributions = Contribution::measure(backend.as_mut(), asset, &measured, backends.go_on)?.weight_px;
    drop(backend);
    let renderer = SceneRenderer::new((backends.rendering)()?, backends.go_on);
    let per_splat = PerSplat { exponents: &exponents, contributions: &contributions };
    let scaled = Scaled { base, per_splat };
    let mut search = Search::new(asset, scaled, evenly_spread(&training, EXPORT_VIEWS), renderer)?;
    if let Some(most) = goal.max_bytes {
        let adapted = match goal.passes {
            0 => None,
            passes => search.adapted_to_size((backends, &found), &measured, goal.quality, (most, passes))?,
        };
        let shown = adapted.as_ref().unwrap_or(asset);
        let mut factor = finest_that_fits(shown, goal.quality, scaled, most)?;
        let mut quality = search.quality_of(shown, &scaled.steps(factor))?;
        // The file states the quality that it turns out to have, in as many bytes as its name takes.
        while size_of(shown, quality, scaled, factor)? > most {
            factor = finest_that_fits(shown, quality, scaled, most)?.max(factor + resolution());
            quality = search.quality_of(shown, &scaled.steps(factor))?;
        }
        let steps = Some(scaled.steps(factor));
        return Ok(Rounding { quality, steps, exponents, contributions, adapted });
    }
    let limits = goal.own_limits().unwrap_or(QualityLimits::of(goal.quality));
    let factor = search.coarsest_within(&limits)?.ok_or_else(|| {
        let most = limits.max_loss_db.unwrap_or_default();
        usage!("even the finest quantisation loses more than {most} dB; use --quality lossless")
    })?;
    let (factor, adapted) = match goal.passes {
        0 => (factor, None),
        passes => search.close((backends, &found), &measured, &limits, (factor, passes))?,
    };
    let steps = scaled.steps(factor);
    let quality = match goal.max_loss_db {
        Some(_) => search.quality_of(adapted.as_ref().unwrap_or(asset), &steps)?,
        None => goal.quality,
    };
    Ok(Rounding { quality, steps: Some(steps), exponents, contributions, adapted })
}

/// The rounding with which a scene was trained, if it reaches the goal: it loses nothing.
fn as_trained(scene: &BakedScene, goal: &RateGoal) -> Result<Option<Rounding>> {
    let Some(trained) = scene.quantisation.clone() else { return Ok(None) };
    let steps = trained.steps();
    let Quantisation { exponents, contributions, .. } = trained;
    let quality = if goal.max_bytes.is_some() { Quality::Balanced } else { goal.quality };
    let per_splat = PerSplat { exponents: &exponents, contributions: &contributions };
    let most = goal.max_bytes.unwrap_or(u64::MAX);
    let fits = goal.max_loss_db.is_none()
        && size_of(&scene.asset, quality, Scaled { base: steps, per_splat }, 0.0)? <= most;
    let rounding = Rounding { quality, steps: Some(steps), exponents, contributions, adapted: None };
    Ok(fits.then_some(rounding))
}

/// [`factor_of_size`], or an error that says what helps.
fn finest_that_fits(asset: &SplatAsset, quality: Quality, scaled: Scaled<'_>, most: u64) -> Result<f64> {
    factor_of_size(asset, quality, scaled, most)?.map_err(|bytes| {
        usage!(
            "--max-size {}: the coarsest file has {}; leave splats out with --crop or --min-contribution, or train \
             a smaller scene with --max-size",
            format_bytes(most),
            format_bytes(bytes)
        )
    })
}

fn lossless(goal: &RateGoal) -> Result<Rounding> {
    let contradicted = goal.max_bytes.map(|_| "--max-size").or(goal.max_loss_db.map(|_| "--max-loss"));
    match contradicted {
        Some(flag) => Err(usage!("--quality lossless has one size and loses nothing; leave {flag} out")),
        None => Ok(Rounding::plain(Quality::Lossless)),
    }
}

/// The rounding of a scene without cameras, which cannot be rendered.
fn unmeasured(scene: &BakedScene, goal: &RateGoal, report: &mut Report) -> Result<Rounding> {
    let asset = &scene.asset;
    let base = if goal.quality == Quality::Tiny { Steps::tiny() } else { Steps::balanced() };
    let steps = match (goal.max_bytes, goal.max_loss_db) {
        (Some(most), _) => {
            let scaled = Scaled { base, per_splat: PerSplat::default() };
            scaled.steps(finest_that_fits(asset, Quality::Custom, scaled, most)?)
        }
        (None, Some(_)) => {
            return Err(usage!(
                "{}: --max-loss is measured by rendering, and the scene has no cameras; use --max-size",
                scene.path.display()
            ));
        }
        (None, None) => {
            let what = "the scene has no training cameras by which to choose steps: standard ones are used, and the file is of quality \"custom\"";
            report.warn("not-measured", 1, what);
            base
        }
    };
    Ok(Rounding { steps: Some(steps), ..Rounding::plain(Quality::Custom) })
}

/// A scene with its images, with which those of rounded scenes are compared.
struct Search<'a> {
    asset: &'a SplatAsset,
    scaled: Scaled<'a>,
    renderer: SceneRenderer<'a>,
    views: Vec<AssetCamera>,
    /// The scene at the views.
    expected: Vec<RenderedImage>,
    /// Mean squared error of the scene against photos.
    mse_to_photos: f64,
}

impl<'a> Search<'a> {
    fn new(
        asset: &'a SplatAsset,
        scaled: Scaled<'a>,
        views: Vec<AssetCamera>,
        mut renderer: SceneRenderer<'a>,
    ) -> Result<Self> {
        let expected = renderer.images(asset, &views)?;
        Ok(Self { asset, scaled, renderer, views, expected, mse_to_photos: mse_to_photos(asset) })
    }

    /// The factor, as a power of two, of the coarsest steps that keep the limits at all views; `None` if none do.
    fn coarsest_within(&mut self, limits: &QualityLimits) -> Result<Option<f64>> {
        let scaled = self.scaled;
        let Some(mut factor) = coarsest(|factor| self.keeps(&scaled.steps(factor), limits))? else {
            return Ok(None);
        };
        while !self.keeps_everywhere(self.asset, &scaled.steps(factor), limits)? {
            factor -= resolution();
            if factor < FACTOR_LOG2[0] {
                return Ok(None);
            }
        }
        Ok(Some(factor))
    }

    /// The best quality whose limits the steps keep at all views.
    fn quality_of(&mut self, adapted: &SplatAsset, steps: &Steps) -> Result<Quality> {
        for quality in [Quality::Balanced, Quality::Tiny] {
            if self.keeps_everywhere(adapted, steps, &QualityLimits::of(quality))? {
                return Ok(quality);
            }
        }
        Ok(Quality::Custom)
    }

    /// Whether images rounded with these steps keep the limits at the views of the search.
    fn keeps(&mut self, steps: &Steps, limits: &QualityLimits) -> Result<bool> {
        // The format cannot express steps that are too coarse: they keep no limit.
        let Ok(rounded) = rounded(self.asset, steps, self.scaled.per_splat) else { return Ok(false) };
        let images = self.renderer.images(&rounded.asset, &self.views)?;
        let pairs = images.iter().zip(&self.expected);
        Ok(self.are_within(&pairs.map(|(i, e)| Difference::mse_of(i, e)).collect::<Vec<_>>(), limits))
    }

    /// Closes the loop: the factor and the moved scene of a smaller file than that of the open loop, or the latter's factor.
    fn close(
        &mut self,
        (backends, sensitivities): (&Backends<'_>, &Sensitivities),
        views: &[AssetCamera],
        limits: &QualityLimits,
        (open, passes): (f64, u32),
    ) -> Result<(f64, Option<SplatAsset>)> {
        let (scaled, asset) = (self.scaled, self.asset);
        let mut closed = self.closed_loop((backends, sensitivities), views)?;
        let allowed = self.mse_within(limits);
        let (mut adapted, mut factor) = (asset.clone(), open);
        for pass in 0..passes {
            // The format cannot express steps that are too coarse.
            let now = rounded(&adapted, &scaled.steps(factor), scaled.per_splat);
            let Ok(now) = now else { return Ok((open, None)) };
            let mse = closed.pass(&mut adapted, &now)?;
            if pass + 1 < passes {
                // The error goes with the square of the steps.
                factor += (0.5 * (allowed / mse).log2()).clamp(-0.2, 0.2);
            }
        }
        drop(closed);
        factor = (factor / resolution()).round() * resolution();
        while factor >= open && !self.keeps_everywhere(&adapted, &scaled.steps(factor), limits)? {
            factor -= resolution();
        }
        if factor.is_nan() || factor < open {
            return Ok((open, None));
        }
        while factor < FACTOR_LOG2[1]
            && self.keeps_everywhere(&adapted, &scaled.steps(factor + resolution()), limits)?
        {
            factor += resolution();
        }
        let bytes = |asset: &SplatAsset, factor: f64| size_of(asset, Quality::Custom, scaled, factor);
        let is_smaller = bytes(&adapted, factor)? < bytes(asset, open)?;
        Ok(if is_smaller { (factor, Some(adapted)) } else { (open, None) })
    }

    /// The scene with its numbers moved by the closed loop for a file of a wanted size; `None` if that does not bring the images of
    /// the file nearer to those of the scene.
    fn adapted_to_size(
        &mut self,
        (backends, sensitivities): (&Backends<'_>, &Sensitivities),
        views: &[AssetCamera],
        quality: Quality,
        (most, passes): (u64, u32),
    ) -> Result<Option<SplatAsset>> {
        let (scaled, asset) = (self.scaled, self.asset);
        let open = finest_that_fits(asset, quality, scaled, most)?;
        let mut closed = self.closed_loop((backends, sensitivities), views)?;
        let mut error = |asset: &SplatAsset, factor: f64| -> Result<f64> {
            let errors = self.errors(asset, &scaled.steps(factor))?;
            Ok(errors.map_or(f64::INFINITY, |errors| errors.iter().sum()))
        };
        let (mut best, mut least) = (None, error(asset, open)?);
        let mut adapted = asset.clone();
        for pass in 1..=passes {
            let now = rounded(&adapted, &scaled.steps(open), scaled.per_splat)?;
            closed.pass(&mut adapted, &now)?;
            // What each effort would end with: later passes may be worse, since the steps then have to be coarser.
            if pass.is_multiple_of(PASSES_PER_EFFORT) || pass == passes {
                let found = error(&adapted, finest_that_fits(&adapted, quality, scaled, most)?)?;
                if found < least {
                    (best, least) = (Some(adapted.clone()), found);
                }
            }
        }
        Ok(best)
    }

    /// A closed loop towards the images of the scene at these views.
    fn closed_loop<'s>(
        &mut self,
        (backends, sensitivities): (&Backends<'s>, &'s Sensitivities),
        views: &[AssetCamera],
    ) -> Result<ClosedLoop<'s>> {
        let backend = (backends.statistics)()?;
        let mut closed = ClosedLoop { backend, views: Vec::new(), sensitivities, go_on: backends.go_on };
        for view in views {
            let images = self.renderer.images(self.asset, std::slice::from_ref(view))?;
            closed.views.extend(images.iter().map(|image| (view.clone(), target_of(image))));
        }
        Ok(closed)
    }

    /// The mean squared error that just keeps the limits of the mean.
    fn mse_within(&self, limits: &QualityLimits) -> f64 {
        let of_loss = |db: f64| self.mse_to_photos * (10.0_f64.powf(USED_SHARE * db / 10.0) - 1.0);
        let loss = limits.max_loss_db.map_or(f64::INFINITY, of_loss);
        loss.min(limits.min_psnr.map_or(f64::INFINITY, |psnr| 10.0_f64.powf(-(psnr + PSNR_MARGIN) / 10.0)))
    }

    /// [`Search::keeps`] at all views, for the scene with its numbers moved.
    fn keeps_everywhere(
        &mut self,
        adapted: &SplatAsset,
        steps: &Steps,
        limits: &QualityLimits,
    ) -> Result<bool> {
        Ok(self.errors(adapted, steps)?.is_some_and(|errors| self.are_within(&errors, limits)))
    }

    /// Mean squared errors of the scene with its numbers moved and rounded, at all views; `None` for steps that are too coarse for the
    /// format.
    fn errors(&mut self, adapted: &SplatAsset, steps: &Steps) -> Result<Option<Vec<f64>>> {
        let Ok(rounded) = quantised(adapted, steps, self.scaled.per_splat) else { return Ok(None) };
        let mut errors = Vec::new();
        // A few at a time: images are large.
        for views in self.asset.cameras.chunks(EXPORT_VIEWS) {
            let expected = self.renderer.images(self.asset, views)?;
            let images = self.renderer.images(&rounded, views)?;
            errors.extend(images.iter().zip(&expected).map(|(i, e)| Difference::mse_of(i, e)));
        }
        Ok(Some(errors))
    }

    /// See [`are_within`].
    fn are_within(&self, errors: &[f64], limits: &QualityLimits) -> bool {
        are_within(errors, self.mse_to_photos, limits)
    }
}

/// Whether the mean squared errors of some views keep the limits, with a margin for other views. `mse_to_photos` is that of the
/// scene against photos.
pub(super) fn are_within(errors: &[f64], mse_to_photos: f64, limits: &QualityLimits) -> bool {
    let losses: Vec<f64> = errors.iter().map(|&mse| loss_db(mse, mse_to_photos)).collect();
    let psnrs: Vec<f64> = errors.iter().map(|&mse| psnr_from_mse(mse)).collect();
    let mean = |values: &[f64]| values.iter().sum::<f64>() / errors.len().max(1) as f64;
    let within = |found: f64, limit: Option<f64>| limit.is_none_or(|l| found <= USED_SHARE * l);
    within(mean(&losses), limits.max_loss_db)
        && within(losses.iter().copied().fold(0.0, f64::max), limits.max_loss_worst_db)
        && limits.min_psnr.is_none_or(|least| mean(&psnrs) >= least + PSNR_MARGIN)
}
