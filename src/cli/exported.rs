//! What an export wrote: rows, JSON and failures.

use litetex_exporters::{ORIGIN_OPTION, Written};
use litetex_gs::console::{Output, columns, path_text};
use litetex_gs::report_page::FileFigures;
use litetex_gs::stand_in::MadeStandIn;
use litetex_gs::text::format_bytes;
use litetex_gs::verify::{PhotoPsnr, Verdict};
use litetex_gs::{Error, Result};
use serde_json::{Value, json};
use std::path::{Path, PathBuf};

/// How scenes for formats without textures are better trained.
const TRAIN_INSTEAD: &str = "litetex train --for engine";

/// The files that were written, in order, and the error that stopped the rest, if one did.
#[must_use]
pub struct Exports {
    pub files: Vec<Exported>,
    pub stopped: Option<Error>,
}

/// A file and how it compares with the scene; it is in its place only if nothing failed.
pub struct Exported {
    pub path: PathBuf,
    pub written: Written,
    /// Size of the scene's numbers as f32.
    pub raw_bytes: u64,
    /// The small scene at its beginning.
    pub stand_in: Option<MadeStandIn>,
    /// `None` if the file was not verified.
    pub verdict: Option<Verdict>,
    /// On the photos of the test views, if the capture of the run is still there.
    pub on_test_photos: Option<PhotoPsnr>,
    /// Whether the scene has textures that the format cannot hold.
    pub loses_textures: bool,
}

impl Exports {
    /// The files that another origin would help: their format cannot hold coordinates as far out as the scene's.
    pub fn files_for_origin(&self, outputs: &[PathBuf]) -> Vec<PathBuf> {
        let names = |text: &String| text.contains(ORIGIN_OPTION);
        let noted = |file: &&Exported| file.written.notes.iter().any(names);
        let mut files: Vec<PathBuf> = self.files.iter().filter(noted).map(|file| file.path.clone()).collect();
        // The one that stopped the rest, and the rest.
        if self.stopped.as_ref().is_some_and(|error| names(&error.to_string())) {
            files.extend_from_slice(&outputs[self.files.len()..]);
        }
        files
    }
    /// What the comparison of each file with the scene found.
    ///
    /// # Errors
    /// What stopped the writing, else [`Error::CheckFailed`] if a file failed verification.
    pub fn figures(self) -> Result<Vec<FileFigures>> {
        let failures: Vec<String> = self.files.iter().flat_map(Exported::failures).collect();
        let failed = (!failures.is_empty()).then(|| Error::CheckFailed(failures.join("; ")));
        if let Some(error) = self.stopped.or(failed) {
            return Err(error);
        }
        let figures = self.files.iter().filter_map(|file| {
            let verdict = (file.verdict.as_ref()?, file.on_test_photos);
            Some(FileFigures::new(&file.path, file.written.scene_bytes(), verdict, file.loses_textures))
        });
        Ok(figures.collect())
    }

    /// A row for each file, those beside the ones asked for included. The ratio is that of all files of a scene. It fails with what
    /// stopped the writing, else if a file failed verification.
    pub fn output(self) -> Output {
        let headings = ["file", "size", "ratio", "PSNR to scene", "lost", "test PSNR", "verified"];
        let rows: Vec<Vec<String>> = self.files.iter().flat_map(Exported::rows).collect();
        let mut text = columns(&headings, &rows);
        if self.files.iter().any(|f| f.verdict.as_ref().is_some_and(|v| v.untextured)) {
            text += "* against the untextured scene: this format has no textures, maps are averaged into the colours\n";
        }
        self.files.iter().filter_map(Exported::lost_textures).for_each(|line| text += &line);
        let failures: Vec<String> = self.files.iter().flat_map(Exported::failures).collect();
        let failed = (!failures.is_empty()).then(|| Error::CheckFailed(failures.join("; ")));
        let files: Vec<Value> = self.files.iter().map(Exported::json).collect();
        Output::new("litetex-export/1", json!({ "files": files }), text).failing(self.stopped.or(failed))
    }
}

impl Exported {
    fn failures(&self) -> impl Iterator<Item = String> {
        let all = self.verdict.iter().flat_map(|v| &v.failures);
        all.map(|f| format!("{}: not written, verification failed: {f}", self.path.display()))
    }

    fn json(&self) -> Value {
        let each =
            self.written.each().map(|(file, bytes)| json!({ "path": path_text(file), "bytes": bytes }));
        json!({
            "path": path_text(&self.path),
            "files": each.collect::<Vec<_>>(),
            "raw_bytes": self.raw_bytes,
            "stand_in": self.stand_in.as_ref().map(|made| json!({
                "bytes": made.file.len(),
                "splats": made.splats,
                "psnr_to_scene": made.psnr,
                "until_bytes": made.until_bytes,
                "scene_bytes": made.scene_bytes,
            })),
            "verdict": self.verdict,
            "on_test_photos": self.on_test_photos,
            "lost_textures": self.loses_textures.then(|| json!({
                "psnr_to_textured": self.verdict.as_ref().map(|v| v.fallback_psnr),
                "loss_db": self.verdict.as_ref().map(|v| v.fallback_loss_db),
                "train_instead": TRAIN_INSTEAD,
            })),
        })
    }

    /// What the scene's textures were good for, and how to train without them, as a line; `None` where none are lost. The test PSNRs
    /// are those of the row; without test photos, an estimate is made at other views.
    fn lost_textures(&self) -> Option<String> {
        self.loses_textures.then(|| {
            let cost = |loss_db: f64| match self.on_test_photos {
                Some(PhotoPsnr { before, after, .. }) => {
                    format!("test PSNR {before:.2} dB with the textures, {after:.2} dB without")
                }
                None => format!("an estimated {loss_db:.2} dB of test PSNR lost with the textures"),
            };
            let lost = self.verdict.as_ref().map_or_else(
                || "the textures are lost".to_owned(),
                |v| {
                    format!(
                        "{:.2} dB against the textured scene; {}",
                        v.fallback_psnr,
                        cost(v.fallback_loss_db)
                    )
                },
            );
            format!("{}: {lost}; train scenes for this format with: {TRAIN_INSTEAD}\n", self.path.display())
        })
    }

    /// A row for the file that was asked for, which tells of the scene, and one with the size of each file beside it.
    fn rows(&self) -> Vec<Vec<String>> {
        let cell = |of: &dyn Fn(&Verdict) -> String| self.verdict.as_ref().map_or_else(|| "-".to_owned(), of);
        let of_scene = [
            format!("{:.1}", self.raw_bytes as f64 / self.written.scene_bytes().max(1) as f64),
            cell(&|v| match v.largest {
                0.0 => "same".to_owned(),
                _ => format!("{:.1} dB{}", v.psnr, if v.untextured { " *" } else { "" }),
            }),
            cell(&|v| if v.untextured { "textures".to_owned() } else { format!("{:.3} dB", v.loss_db) }),
            self.on_test_photos.map_or_else(
                || "-".to_owned(),
                |PhotoPsnr { before, after, .. }| format!("{before:.2} -> {after:.2} dB"),
            ),
            cell(&|v| if v.failures.is_empty() { "yes".to_owned() } else { "NO".to_owned() }),
        ];
        let beside = std::array::from_fn(|_| "-".to_owned());
        let of_file = |(i, (file, bytes)): (usize, (&Path, u64))| {
            let cells = if i == 0 { &of_scene } else { &beside };
            [file.display().to_string(), format_bytes(bytes)]
                .into_iter()
                .chain(cells.iter().cloned())
                .collect()
        };
        self.written.each().enumerate().map(of_file).collect()
    }
}
