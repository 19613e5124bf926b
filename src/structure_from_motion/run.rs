//! From what the user named to a capture, step by step.

use super::by_hand::{self, Material};
use super::camera::Camera;
use super::child::Observer;
use super::engine::{Engine, Job, Step, copy_features, largest_model};
use super::estimate;
use super::frames::{self, Detail};
use super::input::Input;
use super::install::{System, advice};
use super::pairs;
use super::photos::{Photo, cameras};
use super::settings::Settings;
use super::tools::Tools;
use super::video::Video;
use super::work_folder::{Begun, PUBLISHED, WorkFolder, remove};
use crate::{Error, Report, Result, atomic_file, text};
use std::path::{Path, PathBuf};

/// The number of frames of a video.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct VideoFrames {
    /// Those that were looked at.
    pub looked_at: usize,
    /// Those that became photos.
    pub taken: usize,
}

/// A capture that was made.
#[derive(Clone, Debug, PartialEq)]
pub struct Made {
    /// Photos in it.
    pub photos: usize,
    /// Those that have a pose.
    pub registered: usize,
    /// Cameras: devices, lenses and sizes.
    pub cameras: usize,
    /// Of a video.
    pub frames: Option<VideoFrames>,
    /// What found the poses.
    pub engine: String,
}

/// What there is to work on.
enum Source {
    /// The video is not known if ffprobe is missing.
    Video(PathBuf, Option<Video>),
    Photos(Vec<Photo>),
}

/// What is to be done, before it is.
pub struct Plan {
    capture: PathBuf,
    settings: Settings,
    tools: Tools,
    source: Source,
    report: Report,
}

/// Photos that lie in the work folder, with their cameras.
struct Ready {
    names: Vec<String>,
    cameras: Vec<Camera>,
    frames: Option<VideoFrames>,
    key: String,
}

impl Plan {
    /// Looks at what the user named and for the programs.
    ///
    /// # Errors
    /// [`Error::Usage`], [`Error::Io`], [`Error::InvalidInput`], [`Error::Unsupported`] for what cannot become a capture.
    pub fn new(inputs: &[PathBuf], capture: &Path, settings: &Settings) -> Result<Self> {
        let tools = Tools::find(settings);
        let mut report = Report::default();
        let source = match Input::find(inputs, capture)? {
            Input::Video(file) => {
                let video = tools.ffmpeg.as_ref().map(|ffmpeg| Video::look(&file, ffmpeg)).transpose()?;
                Source::Video(file, video)
            }
            Input::Photos(named, videos) => {
                if let [first, ..] = &videos[..] {
                    let (is, first) = (if videos.len() == 1 { "is" } else { "are" }, text::path(first));
                    let what = format!(
                        "{} beside the photos {is} left out ({first}); for a capture of a video, name that video alone",
                        text::counted(videos.len(), "video")
                    );
                    report.warn("videos-beside-photos", videos.len(), what);
                }
                Source::Photos(named.iter().map(Photo::look).collect::<Result<Vec<Photo>>>()?)
            }
        };
        Ok(Self { capture: capture.to_owned(), settings: settings.clone(), tools, source, report })
    }

    /// Warnings about what the user named.
    pub fn report(&self) -> &Report {
        &self.report
    }

    /// The commands with which a person would do the same.
    pub fn by_hand(&self) -> String {
        let material = match &self.source {
            Source::Video(file, video) => Material::Video(file, video.as_ref(), self.num_photos()),
            Source::Photos(photos) => Material::Photos(photos),
        };
        by_hand::commands(&material, &self.tools, &self.settings, &self.capture)
    }

    /// The number of photos that are expected.
    fn num_photos(&self) -> usize {
        match &self.source {
            Source::Video(_, Some(v)) => frames::count(v.duration_secs, v.frames(), self.settings.frames),
            Source::Video(_, None) => 0,
            Source::Photos(photos) => photos.len(),
        }
    }

    /// # Errors
    /// [`Error::Device`] if a program is missing, with what to install and the commands.
    pub fn check_tools(&self) -> Result<()> {
        let (is_video, has_heif) = match &self.source {
            Source::Video(..) => (true, false),
            Source::Photos(photos) => (false, photos.iter().any(Photo::is_converted)),
        };
        let missing = self.tools.missing(is_video, has_heif);
        if missing.is_empty() {
            return Ok(());
        }
        let unfit = self.tools.unfit.iter().map(|line| format!("{line}\n")).collect::<String>();
        Err(Error::Device(format!(
            "{unfit}{}Then run the same command again, or these instead (--print shows them in full):\n{}",
            advice(&missing, System::current()),
            self.by_hand().lines().take(12).collect::<Vec<_>>().join("\n"),
        )))
    }

    /// # Errors
    /// [`Error::Usage`] if the folder of the capture cannot be used.
    pub fn check_place(&self) -> Result<()> {
        WorkFolder::check_place(&self.capture)
    }

    /// What it is made of, and how long finding the poses will take, in words.
    pub fn describe(&self) -> String {
        let Some(engine) = &self.tools.engine else { return String::new() };
        let count = self.num_photos();
        let (what, sizes) = match &self.source {
            Source::Video(_, video) => {
                let size = video.as_ref().map_or((0, 0), |video| video.size);
                let what = video.as_ref().map_or_else(String::new, Video::describe);
                (format!("{what}; about {count} frames of it"), vec![size; count])
            }
            Source::Photos(photos) => {
                let of = super::photos::cameras(photos).len();
                let what = format!("{count} photos of {}", text::counted(of, "camera"));
                (what, photos.iter().map(|photo| photo.size).collect())
            }
        };
        let pairs = pairs::pairs(count, matches!(self.source, Source::Video(..))).len();
        let cores = self.settings.threads.map_or_else(
            || std::thread::available_parallelism().map_or(2, std::num::NonZero::get),
            usize::from,
        );
        let secs = estimate::secs(engine, self.settings.quality, &sizes, pairs, cores);
        let [features, matching, mapping] = secs.map(text::format_duration);
        format!(
            "{what}; {} takes about {}: {features} for features, {matching} for {pairs} pairs, {mapping} for mapping",
            engine.name(),
            text::format_duration(secs.iter().sum())
        )
    }

    /// Makes the capture, or goes on with it.
    ///
    /// # Errors
    /// [`Error::Interrupted`]; [`Error::Usage`] if the folder holds something else; [`Error::Device`] if a program fails;
    /// [`Error::InvalidInput`] if there are no poses; [`Error::Unsupported`]; [`Error::Io`].
    pub fn run(&self, observer: &dyn Observer) -> Result<Made> {
        self.check_tools()?;
        let Some(engine) = &self.tools.engine else { return Err(usage!("no program that finds poses")) };
        let work = WorkFolder::open(&self.capture)?;
        let is_sequence = matches!(self.source, Source::Video(..));
        let ready = match &self.source {
            Source::Video(file, Some(video)) => self.frames(&work, file, video, observer)?,
            Source::Video(file, None) => return Err(invalid!(file, "ffprobe is missing")),
            Source::Photos(photos) => self.photos(&work, photos, observer)?,
        };
        let chosen = pairs::pairs(ready.names.len(), is_sequence);
        let job =
            Job::in_folder(&work.path(""), &ready.cameras, self.settings.quality, self.settings.threads);
        // Once the photos have moved to their place, only the rest of the publication is left.
        if work.path("images").exists() {
            atomic_file::write(&job.pairs, pairs::list(&ready.names, &chosen).as_bytes())?;
            engine.prepare(&work, &job)?;
            let key = format!("{}\n{} {:?}", ready.key, engine.name(), self.settings.quality);
            for (step, all) in [
                (Step::Features, ready.names.len()),
                (Step::Matching, chosen.len()),
                (Step::Mapping, ready.names.len()),
            ] {
                pose_step(engine, step, all, &job, &work, &key, observer)?;
            }
        }
        // A run that was killed while it moved the files left the model on its way.
        let places = [self.capture.join("sparse"), work.path(PUBLISHED), job.models.clone()];
        let models = places.iter().find(|place| place.join("0").exists()).unwrap_or(&job.models);
        let Some((model, registered)) = largest_model(models)? else {
            // Another try with the same settings would end here too.
            remove(&work.path("mapping.done"))?;
            return Err(invalid!(
                &self.capture,
                "no two photos fit together, so none has a pose. Shoot more slowly, so that each photo shows two thirds of \
                 the one before, in even light; or try --poses full"
            ));
        };
        if models == &places[0] {
            remove(&work.path(""))?
        } else {
            work.publish(&self.capture, &model)?
        }
        Ok(Made {
            photos: ready.names.len(),
            registered,
            cameras: ready.cameras.len(),
            frames: ready.frames,
            engine: engine.name(),
        })
    }

    /// Chooses and extracts frames.
    fn frames(
        &self,
        work: &WorkFolder,
        file: &Path,
        video: &Video,
        observer: &dyn Observer,
    ) -> Result<Ready> {
        let Some(ffmpeg) = &self.tools.ffmpeg else { return Err(invalid!(file, "ffmpeg is missing")) };
        let key = format!("{} {video:?} {:?}", stamp(file)?, self.settings.frames);
        let list = work.path("sharpness.txt");
        if work.begin("sharpness", &key)? != Begun::Done {
            observer.step("looking for sharp frames");
            let found = video.details(ffmpeg, &work.log("sharpness"), observer)?;
            let text: String = found.iter().map(|[a, b, c, d]| format!("{a} {b} {c} {d}\n")).collect();
            atomic_file::write(&list, text.as_bytes())?;
            work.end("sharpness")?;
        }
        let text = std::fs::read_to_string(&list).map_err(|e| Error::io(&list, e))?;
        let detail = |line: &str| {
            line.split(' ').map(|v| v.parse().ok()).collect::<Option<Vec<f32>>>()?.try_into().ok()
        };
        let details: Vec<Detail> = text.lines().filter_map(detail).collect();
        let asked = frames::count(video.duration_secs, details.len(), self.settings.frames);
        let chosen = frames::choose(&details, asked);
        let names: Vec<String> = chosen.iter().map(|frame| format!("frame_{frame:05}.jpg")).collect();
        if work.begin("frames", &key)? != Begun::Done {
            observer.step("extracting frames");
            let folder = work.fresh_folder("extracted")?;
            let command = video.extraction(ffmpeg, &chosen, &folder);
            command.run(&work.log("frames"), observer, |_| {})?;
            for (index, name) in names.iter().enumerate() {
                let from = folder.join(format!("{:05}.jpg", index + 1));
                std::fs::rename(&from, folder.join(name)).map_err(|_| {
                    let log = work.log("frames");
                    invalid!(file, "ffmpeg wrote {index} of {} frames; see {}", names.len(), log.display())
                })?;
            }
            let images = work.path("images");
            remove(&images)?;
            std::fs::rename(&folder, &images).map_err(|e| Error::io(&images, e))?;
            work.end("frames")?;
        }
        let camera = Camera { focal_px: None, size: video.size, names: names.clone() };
        let frames = VideoFrames { looked_at: details.len(), taken: chosen.len() };
        Ok(Ready { names, cameras: vec![camera], frames: Some(frames), key })
    }

    /// Converts or copies the photos.
    fn photos(&self, work: &WorkFolder, photos: &[Photo], observer: &dyn Observer) -> Result<Ready> {
        let stamps = photos.iter().map(Photo::stamp).collect::<Result<Vec<String>>>()?;
        let key = format!("{} {}", self.tools.heif_name(), stamps.join("\n"));
        let begun = work.begin("photos", &key)?;
        if begun != Begun::Done {
            observer.step("copying and converting photos");
            if begun == Begun::Fresh {
                work.fresh_folder("images")?;
            }
            let images = work.path("images");
            for (index, photo) in photos.iter().enumerate() {
                observer.check()?;
                // Files appear whole, so those that are there are done.
                if !images.join(&photo.name).exists() {
                    photo.write(&images, &self.tools, &work.log("photos"), observer)?;
                }
                observer.progress(index + 1, photos.len());
            }
            work.end("photos")?;
        }
        let names = photos.iter().map(|photo| photo.name.clone()).collect();
        Ok(Ready { names, cameras: cameras(photos), frames: None, key })
    }
}

fn pose_step(
    engine: &Engine,
    step: Step,
    all: usize,
    job: &Job,
    work: &WorkFolder,
    key: &str,
    observer: &dyn Observer,
) -> Result<()> {
    let begun = work.begin(step.name(), key)?;
    if begun == Begun::Done {
        return Ok(());
    }
    observer.step(match step {
        Step::Features => "finding features",
        Step::Matching => "matching pairs",
        Step::Mapping => "finding poses",
    });
    match step {
        // A second run would make another camera for the rest of the photos.
        Step::Features => remove(&job.features_db)?,
        // Pairs that are matched are skipped.
        Step::Matching if begun == Begun::Continued && job.database.exists() => {}
        Step::Matching => copy_features(job)?,
        Step::Mapping => drop(work.fresh_folder("models")?),
    }
    let (mut before, mut done) = (0, 0);
    for (index, command) in engine.commands(step, job, &work.path("")).iter().enumerate() {
        command.run(&work.log(step.name()), observer, |line| {
            if let Some(found) = step.done_in(line, all) {
                done = before + found;
                observer.progress(done.min(all), all);
            }
        })?;
        // COLMAP counts the photos of each camera.
        before += job.cameras.get(index).map_or(0, |camera| camera.names.len());
    }
    work.end(step.name())
}

/// What tells a file from another: path, size and time of the last change.
pub fn stamp(file: &Path) -> Result<String> {
    let facts = std::fs::metadata(file).map_err(|e| Error::io(file, e))?;
    let secs = facts.modified().ok().and_then(|t| t.duration_since(std::time::UNIX_EPOCH).ok());
    let path = file.canonicalize().unwrap_or_else(|_| file.to_owned());
    Ok(format!("{} {} {}", path.display(), facts.len(), secs.map_or(0, |s| s.as_nanos())))
}

impl Photo {
    fn stamp(&self) -> Result<String> {
        Ok(format!("{} {}", stamp(self.file())?, self.name))
    }
}
