//! What a report says.

use super::coverage::Coverage;
use super::curve::TrainingCurve;
use super::picture::Picture;
use crate::capture::Verdict;
use crate::verify::{PhotoPsnr, Verdict as FileVerdict};
use serde::Serialize;
use std::path::Path;

/// All that the report says beneath the scene. Texts may hold anything: they are escaped where they are written.
#[derive(Clone, Debug, Default)]
pub struct ReportFigures {
    /// The worst views.
    pub views: Option<WorstViews>,
    /// What the training views show.
    pub coverage: Option<Coverage>,
    /// Losses and evaluations.
    pub curve: TrainingCurve,
    /// Files of the scene, the one in the page first.
    pub files: Vec<FileFigures>,
    /// The verdict on the capture.
    pub verdict: Option<Verdict>,
    /// Settings and results, by name.
    pub facts: Vec<(&'static str, String)>,
    /// Title, author, licence and source, by name.
    pub metadata: Vec<(&'static str, String)>,
    /// Why there are no photos; `None` if they are there.
    pub no_photos: Option<String>,
}

/// The views of a set with the lowest PSNR, worst first.
#[derive(Clone, Debug)]
pub struct WorstViews {
    /// Whether they are training views, for want of test views.
    pub are_training: bool,
    /// Number of views among which they are the worst.
    pub of_views: usize,
    /// Mean PSNR of the set, dB.
    pub psnr: f64,
    /// Mean gradient-PSNR of the set, dB.
    pub grad_psnr: f64,
    /// The views.
    pub views: Vec<WorstView>,
}

/// A view beside its photo.
#[derive(Clone, Debug)]
pub struct WorstView {
    /// Name of the photo.
    pub name: String,
    /// PSNR, dB.
    pub psnr: f64,
    /// Gradient-PSNR, dB.
    pub grad_psnr: f64,
    /// The photo as training sees it.
    pub photo: Picture,
    /// The render.
    pub render: Picture,
    /// Where they differ.
    pub error_map: Picture,
}

/// A file and how it compares with the trained scene.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct FileFigures {
    /// Its name, without folders.
    pub name: String,
    /// Size.
    pub bytes: u64,
    /// PSNR against the renders of the trained scene, dB; infinite if they are the same.
    pub psnr: f64,
    /// PSNR lost of what the scene has on photos, dB.
    pub loss_db: f64,
    /// Whether `psnr` and `loss_db` are those of a file without textures, against the textured scene.
    pub untextured: bool,
    /// Mean PSNR on the test photos of the scene and of the file, dB.
    pub on_test_photos: Option<[f64; 2]>,
}

impl FileFigures {
    /// What a comparison found; `has_textures` tells whether the scene has any.
    pub fn new(
        path: &Path,
        bytes: u64,
        (verdict, on_test_photos): (&FileVerdict, Option<PhotoPsnr>),
        has_textures: bool,
    ) -> Self {
        let untextured = verdict.untextured && has_textures;
        let (psnr, loss_db) = match untextured {
            true => (verdict.fallback_psnr, verdict.fallback_loss_db),
            false if verdict.largest == 0.0 => (f64::INFINITY, 0.0),
            false => (verdict.psnr, verdict.loss_db),
        };
        let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        let on_test_photos = on_test_photos.map(|photos| [photos.before, photos.after]);
        Self { name, bytes, psnr, loss_db, untextured, on_test_photos }
    }
}
