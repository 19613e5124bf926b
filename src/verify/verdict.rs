//! Compares the renders of a file with those of its scene: PSNR, loss, and which limits it exceeds.

use super::difference::{Difference, loss_db, mse_to_photos};
use super::limits::QualityLimits;
use super::renderer::SceneRenderer;
use crate::backend::RenderedImage;
use crate::eval::{psnr_from_mse, quality_of};
use crate::text::quoted;
use crate::views::ViewSource;
use crate::{Error, Result};
use litetex_exporters::{AssetCamera, SplatAsset};
use serde::Serialize;

/// Least PSNR of a file's fallback against the untextured file, dB. Measured on the sample: 100 (the cap) for
/// lossless and balanced glTF, 89 for tiny ones.
const FALLBACK_PSNR_MIN: f64 = 45.0;

/// Mean PSNR and gradient-PSNR against photos, dB.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct PhotoPsnr {
    /// PSNR of the scene, with its textures.
    pub before: f64,
    /// PSNR of the file.
    pub after: f64,
    /// PSNR of the file in a program that knows no textures.
    pub fallback: f64,
    /// Gradient-PSNR of the scene.
    pub grad_before: f64,
    /// Gradient-PSNR of the file.
    pub grad_after: f64,
}

/// How the images of a file compare with those of its scene.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Verdict {
    /// Number of views rendered.
    pub views: usize,
    /// Number of splats of the file and of the scene.
    pub splats: [usize; 2],
    /// Whether the scene was rendered without its textures, since the format has none. A scene without texels loses none.
    pub untextured: bool,
    /// PSNR of the unrounded values, capped, mean over the views, dB.
    pub psnr: f64,
    /// PSNR of the worst view, dB.
    pub psnr_worst: f64,
    /// SSIM at 8 bits, mean over the views.
    pub ssim: f64,
    /// FLIP at 8 bits, mean over the views.
    pub flip: f64,
    /// Largest difference of any value.
    pub largest: f32,
    /// PSNR on photos that the differences cost at the scene's test PSNR, mean over the views, dB: an error of `e`
    /// added to one of `m` costs `10 log10(1 + e / m)`.
    pub loss_db: f64,
    /// The same in the worst view, dB.
    pub loss_worst_db: f64,
    /// PSNR against the whole scene, dB, of what a program without textures shows of the file: of the file itself, if its format
    /// has none, else of the file's fallback, if it has one.
    pub fallback_psnr: f64,
    /// What that costs on photos, as `loss_db`.
    pub fallback_loss_db: f64,
    /// PSNR of the fallback against the untextured file at the fallback's SH degree, which it should equal, dB; `None` without a
    /// fallback.
    pub fallback_psnr_to_untextured: Option<f64>,
    /// On the photos of training views.
    pub on_training_photos: Option<PhotoPsnr>,
    /// On the photos of test views.
    pub on_test_photos: Option<PhotoPsnr>,
    /// What the file had to keep to.
    pub limits: QualityLimits,
    /// The limits that it exceeds, in words; empty if it passed.
    pub failures: Vec<String>,
}

/// Images of a scene, with which files made from it are compared.
pub struct ExpectedImages<'a> {
    scene: &'a SplatAsset,
    views: &'a [AssetCamera],
    whole: Vec<RenderedImage>,
    /// Without textures, as programs without textures show the scene.
    untextured: Vec<RenderedImage>,
}

impl<'a> ExpectedImages<'a> {
    /// Renders the scene.
    ///
    /// # Errors
    /// [`Error::Usage`] without views, or what the device reports.
    pub fn render(
        renderer: &mut SceneRenderer<'_>,
        scene: &'a SplatAsset,
        views: &'a [AssetCamera],
    ) -> Result<Self> {
        if views.is_empty() {
            return Err(Error::Usage("there is no view to render: the scene is empty".into()));
        }
        let whole = renderer.images(scene, views)?;
        let untextured = renderer.images(&scene.untextured(), views)?;
        Ok(Self { scene, views, whole, untextured })
    }
}

/// A file as it was read back.
#[derive(Clone, Copy)]
pub struct ReadBack<'a> {
    /// The whole scene of the file.
    pub asset: &'a SplatAsset,
    /// Whether its format has textures.
    pub textured: bool,
    /// What the file holds for programs without textures, if it holds something for them.
    pub fallback: Option<&'a SplatAsset>,
}

/// Renders a file as it was read back and compares it with its scene. `photos` are those of the scene's capture.
///
/// # Errors
/// What the device or the photos report.
pub fn verify(
    renderer: &mut SceneRenderer<'_>,
    expected: &ExpectedImages<'_>,
    file: ReadBack<'_>,
    photos: Option<&dyn ViewSource>,
    limits: QualityLimits,
) -> Result<Verdict> {
    let ExpectedImages { scene, views, whole, untextured } = expected;
    let mut found = file.asset.in_frame(&scene.capture_from_local);
    if !file.textured {
        // Formats without textures carry none of these.
        (found.near, found.background, found.filter) = (scene.near, scene.background, scene.filter);
    }
    let images = renderer.images(&found, views)?;
    let fallback =
        file.fallback.map(|fallback| fallback_images(renderer, fallback, &found, views)).transpose()?;
    let shown = match &fallback {
        Some([shown, _]) => shown,
        None if file.textured => untextured,
        None => &images,
    };
    let targets = if file.textured { whole } else { untextured };
    let pairs = views.iter().zip(&images).zip(targets);
    let differences: Vec<Difference> =
        pairs.map(|((view, image), target)| Difference::of(&view.name, image, target)).collect();
    let mut verdict = Verdict {
        untextured: !file.textured && scene.num_texels() > 0,
        splats: [found.num_splats(), scene.num_splats()],
        fallback_psnr: mean_psnr(shown, whole),
        fallback_loss_db: mean_of(shown, whole, |mse| loss_db(mse, mse_to_photos(scene))),
        fallback_psnr_to_untextured: fallback.as_ref().map(|[shown, meant]| mean_psnr(shown, meant)),
        ..Verdict::of(&differences, mse_to_photos(scene), limits)
    };
    if let Some(photos) = photos {
        let [before, after, fallback] = [
            on_photos(photos, views, whole)?,
            on_photos(photos, views, &images)?,
            on_photos(photos, views, shown)?,
        ];
        let side = |i: usize| {
            let ([before, grad_before], [after, grad_after], [fallback, _]) =
                (before[i]?, after[i]?, fallback[i]?);
            Some(PhotoPsnr { before, after, fallback, grad_before, grad_after })
        };
        (verdict.on_training_photos, verdict.on_test_photos) = (side(0), side(1));
    }
    verdict.failures = failures(&verdict);
    Ok(verdict)
}

/// Images of a file's fallback, and of what it should be: the file without textures, at the fallback's SH degree.
fn fallback_images(
    renderer: &mut SceneRenderer<'_>,
    fallback: &SplatAsset,
    file: &SplatAsset,
    views: &[AssetCamera],
) -> Result<[Vec<RenderedImage>; 2]> {
    let shown = fallback.in_frame(&file.capture_from_local);
    let shown = SplatAsset { near: file.near, filter: file.filter, ..shown };
    let mut meant = file.untextured();
    meant.limit_sh_degree(shown.sh_degree);
    Ok([renderer.images(&shown, views)?, renderer.images(&meant, views)?])
}

/// Mean PSNR of images against others, dB.
fn mean_psnr(found: &[RenderedImage], expected: &[RenderedImage]) -> f64 {
    mean_of(found, expected, psnr_from_mse)
}

/// Mean over images of a figure of their mean squared error.
fn mean_of(found: &[RenderedImage], expected: &[RenderedImage], figure: impl Fn(f64) -> f64) -> f64 {
    let figures = found.iter().zip(expected).map(|(f, e)| figure(Difference::mse_of(f, e)));
    figures.sum::<f64>() / expected.len() as f64
}

/// Mean PSNR and gradient-PSNR of images on the photos of training views and on those of test views, dB.
fn on_photos(
    photos: &dyn ViewSource,
    views: &[AssetCamera],
    images: &[RenderedImage],
) -> Result<[Option<[f64; 2]>; 2]> {
    let mut figures = [Vec::new(), Vec::new()];
    for (view, image) in views.iter().zip(images) {
        let name = quoted(&view.name);
        let index = (0..photos.num_views()).find(|&v| photos.name(v) == view.name);
        let index = index.ok_or_else(|| {
            usage!("the capture has no photo {name}: it is not the one that the scene was trained on")
        })?;
        let photo = photos.target(index)?;
        if [photo.width_px, photo.height_px] != [view.width_px, view.height_px] {
            return Err(usage!(
                "{name}: the photo has {} x {} pixels here and had {} x {} in training; use the same --max-resolution",
                photo.width_px,
                photo.height_px,
                view.width_px,
                view.height_px
            ));
        }
        let quality = quality_of(&view.name, &image.rgb, &photo);
        figures[usize::from(view.held_out)].push([quality.psnr, quality.grad_psnr]);
    }
    let mean = |all: Vec<[f64; 2]>| {
        let mean = |i: usize| all.iter().map(|figures| figures[i]).sum::<f64>() / all.len() as f64;
        (!all.is_empty()).then(|| [0, 1].map(mean))
    };
    Ok(figures.map(mean))
}

/// The limits that a file exceeds, in words.
fn failures(v: &Verdict) -> Vec<String> {
    let mut out = Vec::new();
    if v.limits.exact && v.largest != 0.0 {
        out.push(format!("the images differ by up to {:e}, expected no difference at all", v.largest));
    }
    let mut at_most = |name: &str, found: f64, limit: Option<f64>| {
        if let Some(limit) = limit.filter(|l| found.is_nan() || found > *l) {
            out.push(format!("{name}: {found:.4} dB lost, at most {limit} allowed"));
        }
    };
    at_most("mean over the views", v.loss_db, v.limits.max_loss_db);
    at_most("worst view", v.loss_worst_db, v.limits.max_loss_worst_db);
    if let Some(found) = v.fallback_psnr_to_untextured.filter(|f| f.is_nan() || *f < FALLBACK_PSNR_MIN) {
        out.push(format!(
            "the fallback differs from the untextured file: {found:.2} dB, expected at \
             least {FALLBACK_PSNR_MIN}"
        ));
    }
    if let Some(least) = v.limits.min_psnr.filter(|least| v.psnr.is_nan() || v.psnr < *least) {
        out.push(format!("{:.2} dB against the scene's images, expected at least {least}", v.psnr));
    }
    if v.has_other_splats() && !out.is_empty() {
        let [found, scene] = v.splats;
        out.push(format!(
            "it holds {found} of the scene's {scene} splats: verify a cropped file against a lossless export with the same crop"
        ));
    }
    out
}

impl Verdict {
    /// The figures of differences at the views; the rest is left empty.
    fn of(differences: &[Difference], mse_before: f64, limits: QualityLimits) -> Self {
        let mean = |figure: &dyn Fn(&Difference) -> f64| {
            differences.iter().map(figure).sum::<f64>() / differences.len() as f64
        };
        let loss = |d: &Difference| loss_db(d.mse, mse_before);
        Self {
            views: differences.len(),
            splats: [0; 2],
            untextured: false,
            psnr: mean(&Difference::psnr),
            psnr_worst: differences.iter().map(Difference::psnr).fold(f64::INFINITY, f64::min),
            ssim: mean(&|d| d.quality.ssim_3dgs),
            flip: mean(&|d| d.quality.flip),
            largest: differences.iter().map(|d| d.largest).fold(0.0, f32::max),
            loss_db: mean(&loss),
            loss_worst_db: differences.iter().map(loss).fold(0.0, f64::max),
            fallback_psnr: 0.0,
            fallback_loss_db: 0.0,
            fallback_psnr_to_untextured: None,
            on_training_photos: None,
            on_test_photos: None,
            limits,
            failures: Vec::new(),
        }
    }

    /// Whether the numbers of splats differ.
    pub fn has_other_splats(&self) -> bool {
        self.splats[0] != self.splats[1]
    }
}
