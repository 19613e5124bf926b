//! Whether a file renders as the scene that it was made from, in figures.

use super::capture::Capture;
use super::differences::{Difference, Stage, loss_db, mse_to_photos};
use super::table::Table;
use litetex_exporters::{AssetCamera, Contents, Format, Quality, SplatAsset};
use litetex_gs::backend::RenderedImage;
use litetex_gs::eval::{psnr_from_mse, quality_of};
use litetex_gs::views::ViewSource;
use litetex_gs::{Error, Result};
use serde::Serialize;
use std::path::Path;

/// What a file must keep to.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Limits {
    /// Nothing may differ at all.
    pub exact: bool,
    /// Most PSNR lost on photos, mean over the views, dB.
    pub max_loss_db: Option<f64>,
    /// The same of the worst view.
    pub max_loss_worst_db: Option<f64>,
    /// Least PSNR of the file's images against the scene's, mean over the views, dB.
    pub min_psnr: Option<f64>,
}

impl Limits {
    /// No limit.
    pub const NONE: Self = Self { exact: false, max_loss_db: None, max_loss_worst_db: None, min_psnr: None };

    /// What a profile of quality promises.
    pub fn of(quality: Quality) -> Self {
        let bounded = |mean, worst, psnr| Self {
            exact: false,
            max_loss_db: Some(mean),
            max_loss_worst_db: Some(worst),
            min_psnr: Some(psnr),
        };
        match quality {
            Quality::Lossless => Self { exact: true, ..Self::NONE },
            Quality::Balanced => bounded(0.02, 0.05, 48.0),
            Quality::Tiny => bounded(0.10, 0.25, 40.0),
            Quality::Custom => Self::NONE,
        }
    }

    /// What a file of a format that says nothing of its quality should keep: those without textures are held against
    /// the untextured scene. Measured on the sample: PLY 100 dB (the cap), SPZ 34.6 dB.
    pub fn of_format(format: Option<Format>) -> Self {
        match format {
            Some(Format::Ply) => Self { min_psnr: Some(60.0), ..Self::NONE },
            Some(Format::Spz) => Self { min_psnr: Some(25.0), ..Self::NONE },
            _ => Self::of(Quality::Lossless),
        }
    }
}

/// Least PSNR of a file's fallback against the scene without textures, dB. Measured on the sample: 100 (the cap) of
/// lossless files, 81 of balanced glTF.
const FALLBACK_PSNR_MIN: f64 = 45.0;

/// PSNR on photos, dB.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct OnPhotos {
    /// Of the scene.
    pub before: f64,
    /// Of the file.
    pub after: f64,
    /// Of the file in a program that knows no textures.
    pub fallback: f64,
}

/// The comparison of a file's images with the scene's.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Verdict {
    /// Views that were rendered.
    pub views: usize,
    /// Splats of the file and of the scene.
    pub splats: [usize; 2],
    /// Whether the scene was taken without its textures, since the format has none.
    pub untextured: bool,
    /// Mean over the views of the PSNR of the values, not rounded; capped. dB
    pub psnr: f64,
    /// Of the worst view.
    pub psnr_worst: f64,
    /// Mean over the views, of 8 bits.
    pub ssim: f64,
    /// Mean over the views, of 8 bits.
    pub flip: f64,
    /// Largest difference of any value.
    pub largest: f32,
    /// PSNR on photos that the differences cost at the scene's quality on test views, mean over the views: an error of `e`
    /// on top of one of `m` costs `10 log10(1 + e / m)`. dB
    pub loss_db: f64,
    /// Of the worst view.
    pub loss_worst_db: f64,
    /// How a program without textures shows the file, from what the file holds for such: PSNR against the whole scene. dB
    pub fallback_psnr: f64,
    /// The same against the scene without textures, which it should be; only of files with textures that others read. dB
    pub fallback_psnr_to_untextured: Option<f64>,
    /// On the views that were trained on.
    pub on_training_photos: Option<OnPhotos>,
    /// On the views that were held out.
    pub on_test_photos: Option<OnPhotos>,
    /// What it had to keep to.
    pub limits: Limits,
    /// What it did not keep to; empty: passed.
    pub failures: Vec<String>,
}

/// Images of a scene that files made of it are held against.
pub struct Expected<'a> {
    frozen: &'a SplatAsset,
    views: &'a [AssetCamera],
    whole: Vec<RenderedImage>,
    /// Without textures, as programs see it that know none.
    untextured: Vec<RenderedImage>,
}

impl<'a> Expected<'a> {
    /// Renders them.
    ///
    /// # Errors
    /// [`Error::Usage`] without views, or what the device reports.
    pub fn of(stage: &mut Stage, frozen: &'a SplatAsset, views: &'a [AssetCamera]) -> Result<Self> {
        if views.is_empty() {
            let what = "the scene has no cameras to render: verify a file made of it that has, or name its capture with --capture";
            return Err(Error::Usage(what.into()));
        }
        let whole = stage.images(frozen, views)?;
        let untextured = stage.images(&frozen.untextured(), views)?;
        Ok(Self { frozen, views, whole, untextured })
    }
}

/// What was read of a file.
pub struct Found<'a> {
    /// All of it.
    pub asset: &'a SplatAsset,
    /// Whether its format has textures.
    pub textured: bool,
    /// What it holds for programs that know no textures, if it holds something for them.
    pub fallback: Option<&'a SplatAsset>,
}

/// Renders what was read of a file, and compares.
///
/// # Errors
/// What the device or the capture report.
pub fn judge(
    stage: &mut Stage,
    scene: &Expected<'_>,
    Found { asset, textured, fallback }: Found<'_>,
    capture: Option<&Capture>,
    limits: Limits,
) -> Result<Verdict> {
    let Expected { frozen, views, whole, untextured } = scene;
    let mut found = asset.in_frame(&frozen.capture_from_local);
    if !textured {
        // Such formats know neither.
        (found.near, found.background) = (frozen.near, frozen.background);
    }
    let expected = if textured { whole } else { untextured };
    let images = stage.images(&found, views)?;
    let pairs = views.iter().zip(&images).zip(expected);
    let differences: Vec<Difference> = pairs.map(|((v, p), e)| Difference::of(&v.name, p, e)).collect();
    let mean = |of: &dyn Fn(&Difference) -> f64| differences.iter().map(of).sum::<f64>() / views.len() as f64;
    let shown = fallback
        .map(|fallback| {
            let fallback = fallback.in_frame(&frozen.capture_from_local);
            stage.images(&SplatAsset { near: frozen.near, ..fallback }, views)
        })
        .transpose()?;
    let mean_psnr = |a: &[RenderedImage], b: &[RenderedImage]| {
        let all = a.iter().zip(b).map(|(a, b)| psnr_from_mse(Difference::mse_of(a, b)));
        all.sum::<f64>() / views.len() as f64
    };
    let before = mse_to_photos(frozen);
    let estimated = |d: &Difference| loss_db(d.mse, before);
    let mut verdict = Verdict {
        views: views.len(),
        splats: [found.num_splats(), frozen.num_splats()],
        untextured: !textured,
        psnr: mean(&Difference::psnr),
        psnr_worst: differences.iter().map(Difference::psnr).fold(f64::INFINITY, f64::min),
        ssim: mean(&|d| d.quality.ssim_3dgs),
        flip: mean(&|d| d.quality.flip),
        largest: differences.iter().map(|d| d.largest).fold(0.0, f32::max),
        loss_db: mean(&estimated),
        loss_worst_db: differences.iter().map(estimated).fold(0.0, f64::max),
        fallback_psnr: mean_psnr(shown.as_deref().unwrap_or(untextured), whole),
        fallback_psnr_to_untextured: shown.as_ref().map(|shown| mean_psnr(shown, untextured)),
        on_training_photos: None,
        on_test_photos: None,
        limits,
        failures: Vec::new(),
    };
    if let Some(capture) = capture {
        let shown = shown.as_ref().unwrap_or(untextured);
        let before = on_photos(capture, views, expected)?;
        let after = on_photos(capture, views, &images)?;
        let fallback = on_photos(capture, views, shown)?;
        let of = |i: usize| {
            let (before, after, fallback) = (before[i]?, after[i]?, fallback[i]?);
            Some(OnPhotos { before, after, fallback })
        };
        (verdict.on_training_photos, verdict.on_test_photos) = (of(0), of(1));
    }
    verdict.failures = failures(&verdict);
    if verdict.has_fewer_splats() && !verdict.failures.is_empty() {
        let [found, scene] = verdict.splats;
        let what = format!(
            "it holds {found} of the scene's {scene} splats: if it was cut, compare it with what it was cut from"
        );
        verdict.failures.push(what);
    }
    Ok(verdict)
}

/// Mean PSNR of images on the photos that were trained on, and on those held out; dB.
fn on_photos(capture: &Capture, views: &[AssetCamera], images: &[RenderedImage]) -> Result<[Option<f64>; 2]> {
    let mut psnrs = [Vec::new(), Vec::new()];
    for (view, image) in views.iter().zip(images) {
        let index = (0..capture.num_views()).find(|&v| capture.name(v) == view.name);
        let index = index.ok_or_else(|| {
            Error::Usage(format!(
                "the capture has no photo {:?}: it is not the one that was trained on",
                view.name
            ))
        })?;
        let photo = capture.target(index)?;
        if [photo.width_px, photo.height_px] != [view.width_px, view.height_px] {
            return Err(Error::Usage(format!(
                "{:?}: the photo has {} x {} pixels here, {} x {} in training; use the same --max-resolution",
                view.name, photo.width_px, photo.height_px, view.width_px, view.height_px
            )));
        }
        psnrs[usize::from(view.held_out)].push(quality_of(&view.name, &image.rgb, &photo).psnr);
    }
    let mean = |all: Vec<f64>| (!all.is_empty()).then(|| all.iter().sum::<f64>() / all.len() as f64);
    Ok(psnrs.map(mean))
}

fn failures(v: &Verdict) -> Vec<String> {
    let mut out = Vec::new();
    if v.limits.exact && v.largest != 0.0 {
        out.push(format!("images differ by up to {:e}, expected no difference at all", v.largest));
    }
    let mut at_most = |name: &str, found: f64, limit: Option<f64>| {
        if let Some(limit) = limit.filter(|l| found.is_nan() || found > *l) {
            out.push(format!("{name}: {found:.4} dB lost, at most {limit}"));
        }
    };
    at_most("mean over the views", v.loss_db, v.limits.max_loss_db);
    at_most("worst view", v.loss_worst_db, v.limits.max_loss_worst_db);
    if let Some(found) = v.fallback_psnr_to_untextured.filter(|f| f.is_nan() || *f < FALLBACK_PSNR_MIN) {
        out.push(format!(
            "programs without textures show something else than the scene without them: {found:.2} dB, at least \
             {FALLBACK_PSNR_MIN}"
        ));
    }
    if let Some(least) = v.limits.min_psnr.filter(|least| v.psnr.is_nan() || v.psnr < *least) {
        out.push(format!("{:.2} dB against the scene's images, at least {least}", v.psnr));
    }
    out
}

impl Verdict {
    fn has_fewer_splats(&self) -> bool {
        self.splats[0] != self.splats[1]
    }

    /// For people.
    pub fn tell(&self, table: &mut Table) {
        let scene = if self.untextured { "the scene without textures" } else { "the scene" };
        table.row("views", self.views);
        if self.has_fewer_splats() {
            table.row("splats", format!("{} of the scene's {}", self.splats[0], self.splats[1]));
        }
        table.row("PSNR", format!("{:.2} dB, worst {:.2} dB, against {scene}", self.psnr, self.psnr_worst));
        table.row("SSIM, FLIP", format!("{:.6}, {:.6}", self.ssim, self.flip));
        table.row("largest difference", format!("{:e}", self.largest));
        let [mean, worst] = [self.loss_db, self.loss_worst_db];
        table.row("lost", format!("{mean:.4} dB at the scene's quality, worst view {worst:.4} dB"));
        for (name, figures) in
            [("training photos", self.on_training_photos), ("test photos", self.on_test_photos)]
        {
            if let Some(OnPhotos { before, after, .. }) = figures {
                table.row(name, format!("{before:.3} dB before, {after:.3} dB after (told, not judged)"));
            }
        }
        let on_photos = self.on_test_photos.or(self.on_training_photos);
        let on_photos = on_photos.map_or_else(String::new, |p| format!(", {:.3} dB on photos", p.fallback));
        let fallback = self.fallback_psnr;
        table.row("fallback", format!("{fallback:.2} dB where textures are not known{on_photos}"));
        table.row(
            "verified",
            if self.limits == Limits::NONE {
                "nothing is promised; --max-loss and --min-psnr set limits".to_owned()
            } else if self.failures.is_empty() {
                "yes".to_owned()
            } else {
                format!("no: {}", self.failures.join("; "))
            },
        );
    }
}

/// What a file that was read has to keep to.
pub fn limits_of(path: &Path, contents: &Contents) -> Limits {
    match contents.quality {
        Some(quality) => Limits::of(quality),
        None => Limits::of_format(Format::from_path(path)),
    }
}
