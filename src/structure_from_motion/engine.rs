//! What finds the poses: pycolmap through a script of ours, or the program COLMAP. Both write the same files.

use super::camera::Camera;
use super::child::Command;
use super::settings::PoseQuality;
use super::work_folder::{WorkFolder, remove};
use crate::{Error, Result, atomic_file};
use serde_json::json;
use std::path::{Path, PathBuf};

/// The script that calls pycolmap.
pub const SCRIPT: &str = include_str!("poses.py");

/// One focal length and one radial distortion: what phones and cameras need after their own correction.
const CAMERA_MODEL: &str = "SIMPLE_RADIAL";

/// Pairs between two lines of progress.
const PAIRS_PER_BLOCK: usize = 200;

/// From this version on, COLMAP's options of features that do not depend on SIFT have names of their own.
const RENAMED: (u32, u32) = (3, 13);

/// A program that finds poses.
#[derive(Clone, Debug)]
pub enum Engine {
    Pycolmap { python: PathBuf, version: (u32, u32) },
    Colmap { program: PathBuf, version: (u32, u32), has_gpu: bool },
}

/// The steps, in order.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Step {
    Features,
    Matching,
    Mapping,
}

impl Step {
    pub const fn name(self) -> &'static str {
        match self {
            Self::Features => "features",
            Self::Matching => "matching",
            Self::Mapping => "mapping",
        }
    }

    /// The number of parts that are done, `all` in number, if a line of output says it.
    pub fn done_in(self, line: &str, all: usize) -> Option<usize> {
        let number = |text: &str| -> Option<usize> {
            text.chars().take_while(char::is_ascii_digit).collect::<String>().parse().ok()
        };
        let after = |words: &str| line.split_once(words).map(|(_, rest)| rest);
        match self {
            Self::Features => number(after("Processed file [")?),
            Self::Matching => {
                // The block that begins, and their number; those before are done.
                let (block, rest) =
                    after("Processing block [").or_else(|| after("Matching block ["))?.split_once('/')?;
                Some(number(block)?.saturating_sub(1) * all / number(rest)?.max(1))
            }
            Self::Mapping => match after("num_reg_frames=") {
                Some(rest) => Some(number(rest)? + 1),
                None => number(after("Registering image #")?.split_once('(')?.1),
            },
        }
    }
}

/// What the steps work on.
pub struct Job<'a> {
    pub images: PathBuf,
    pub features_db: PathBuf,
    pub database: PathBuf,
    pub pairs: PathBuf,
    pub models: PathBuf,
    pub cameras: &'a [Camera],
    pub quality: PoseQuality,
    pub threads: Option<u16>,
}

impl<'a> Job<'a> {
    pub fn in_folder(
        folder: &Path,
        cameras: &'a [Camera],
        quality: PoseQuality,
        threads: Option<u16>,
    ) -> Self {
        Self {
            images: folder.join("images"),
            features_db: folder.join("features.db"),
            database: folder.join("database.db"),
            pairs: folder.join("pairs.txt"),
            models: folder.join("models"),
            cameras,
            quality,
            threads,
        }
    }

    fn threads(&self) -> i32 {
        self.threads.map_or(-1, i32::from)
    }
}

impl Camera {
    /// The parameters from which the search begins, if the focal length is known: f, cx, cy, k.
    fn parameters(&self) -> String {
        let (width, height) = (f64::from(self.size.0), f64::from(self.size.1));
        self.focal_px.map_or_else(String::new, |f| format!("{f:.2},{},{},0", width / 2.0, height / 2.0))
    }
}

impl Engine {
    /// Its name and version.
    pub fn name(&self) -> String {
        let (name, (major, minor)) = match self {
            Self::Pycolmap { version, .. } => ("pycolmap", version),
            Self::Colmap { version, .. } => ("COLMAP", version),
        };
        format!("{name} {major}.{minor}")
    }

    /// Writes the files that the commands of a step read.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub fn prepare(&self, work: &WorkFolder, job: &Job) -> Result<()> {
        match self {
            Self::Pycolmap { .. } => {
                atomic_file::write(&work.path("poses.py"), SCRIPT.as_bytes())?;
                for step in [Step::Features, Step::Matching, Step::Mapping] {
                    let text = self.job_json(step, job, true);
                    atomic_file::write(&work.path(&format!("{}.json", step.name())), text.as_bytes())?;
                }
            }
            Self::Colmap { .. } => {
                for (index, camera) in job.cameras.iter().enumerate() {
                    let list = camera.names.iter().map(|name| format!("{name}\n")).collect::<String>();
                    atomic_file::write(&work.path(&format!("camera-{index}.txt")), list.as_bytes())?;
                }
            }
        }
        Ok(())
    }

    /// What the script reads.
    pub fn job_json(&self, step: Step, job: &Job, leaves_with_parent: bool) -> String {
        let cameras: Vec<_> =
            job.cameras.iter().map(|c| json!({ "parameters": c.parameters(), "names": c.names })).collect();
        let database = if step == Step::Features { &job.features_db } else { &job.database };
        let found = json!({
            "images": job.images, "database": database, "pairs": job.pairs, "models": job.models,
            "side_max_px": job.quality.side_max_px(), "features_max": job.quality.features_max(),
            "threads": job.threads(), "camera_model": CAMERA_MODEL, "cameras": cameras,
            "pairs_per_block": PAIRS_PER_BLOCK, "leaves_with_parent": leaves_with_parent,
        });
        format!("{found:#}\n")
    }

    /// The commands of a step, which read the files of `folder`.
    pub fn commands(&self, step: Step, job: &Job, folder: &Path) -> Vec<Command> {
        match self {
            Self::Pycolmap { python, .. } => {
                let script = Command::new(python).arg(folder.join("poses.py")).arg(step.name());
                vec![script.arg(folder.join(format!("{}.json", step.name())))]
            }
            Self::Colmap { program, version, has_gpu } => {
                Colmap { program, is_renamed: *version >= RENAMED, has_gpu: *has_gpu, job }
                    .commands(step, folder)
            }
        }
    }
}

/// The program COLMAP with the options of its version.
struct Colmap<'a> {
    program: &'a Path,
    is_renamed: bool,
    has_gpu: bool,
    job: &'a Job<'a>,
}

impl Colmap<'_> {
    fn commands(&self, step: Step, folder: &Path) -> Vec<Command> {
        match step {
            Step::Features => {
                let camera = |index| self.features(index, &folder.join(format!("camera-{index}.txt")));
                (0..self.job.cameras.len()).map(camera).collect()
            }
            Step::Matching => vec![self.matching()],
            Step::Mapping => vec![self.mapping()],
        }
    }

    fn command(&self, name: &str) -> Command {
        Command::new(self.program).arg(name)
    }

    fn general(&self, command: Command, sift: &str, renamed: &str) -> Command {
        let group = if self.is_renamed { renamed } else { sift };
        command
            .option(&format!("--{group}.use_gpu"), if self.has_gpu { "1" } else { "0" })
            .option(&format!("--{group}.num_threads"), self.job.threads().to_string())
    }

    fn features(&self, camera: usize, list: &Path) -> Command {
        let (job, camera) = (self.job, &self.job.cameras[camera]);
        let size_group = if self.is_renamed { "FeatureExtraction" } else { "SiftExtraction" };
        let command = self
            .command("feature_extractor")
            .option("--database_path", &job.features_db)
            .option("--image_path", &job.images)
            .option("--image_list_path", list)
            .option("--ImageReader.single_camera", "1")
            .option("--ImageReader.camera_model", CAMERA_MODEL)
            .option(&format!("--{size_group}.max_image_size"), job.quality.side_max_px().to_string())
            .option("--SiftExtraction.max_num_features", job.quality.features_max().to_string());
        let command = match camera.parameters() {
            none if none.is_empty() => command,
            parameters => command.option("--ImageReader.camera_params", parameters),
        };
        self.general(command, "SiftExtraction", "FeatureExtraction")
    }

    fn matching(&self) -> Command {
        let command = self
            .command("matches_importer")
            .option("--database_path", &self.job.database)
            .option("--match_list_path", &self.job.pairs)
            .option("--match_type", "pairs");
        self.general(command, "SiftMatching", "FeatureMatching")
    }

    fn mapping(&self) -> Command {
        self.command("mapper")
            .option("--database_path", &self.job.database)
            .option("--image_path", &self.job.images)
            .option("--output_path", &self.job.models)
            .option("--Mapper.num_threads", self.job.threads().to_string())
    }
}

/// The model with the most photos, and their number.
///
/// # Errors
/// [`Error::Io`]; [`Error::InvalidInput`] if there is none.
pub fn largest_model(models: &Path) -> Result<Option<(PathBuf, usize)>> {
    let entries = std::fs::read_dir(models).map_err(|e| Error::io(models, e))?;
    let mut found: Vec<(usize, PathBuf)> = Vec::new();
    for path in entries.flatten().map(|entry| entry.path()) {
        // A count of 8 bytes comes first.
        let images = std::fs::read(path.join("images.bin")).ok();
        let count = images.as_deref().and_then(|b| Some(u64::from_le_bytes(b.get(..8)?.try_into().ok()?)));
        found.extend(count.map(|count| (count as usize, path)));
    }
    // Of equal ones the first.
    found.sort_by(|a, b| b.0.cmp(&a.0).then(a.1.cmp(&b.1)));
    Ok(found.into_iter().next().filter(|(count, _)| *count > 0).map(|(count, path)| (path, count)))
}

/// Begins with a copy of the features, so that pairs of older settings do not remain.
///
/// # Errors
/// [`Error::Io`].
pub fn copy_features(job: &Job) -> Result<()> {
    for end in ["", "-wal", "-shm"] {
        let mut path = job.database.clone().into_os_string();
        path.push(end);
        remove(Path::new(&path))?;
    }
    std::fs::copy(&job.features_db, &job.database).map_err(|e| Error::io(&job.features_db, e))?;
    Ok(())
}
