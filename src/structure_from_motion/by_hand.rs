//! The same work as commands that a person may run, for `--print` and where a program is missing.

use super::child::Command;
use super::engine::{Engine, Job, SCRIPT, Step};
use super::pairs::{EVERY, EXHAUSTIVE_MAX, NEXT};
use super::photos::{Photo, cameras};
use super::settings::Settings;
use super::tools::{Ffmpeg, Tools};
use super::video::Video;
use crate::capture::shell_word;
use std::path::Path;

/// What there is to work on.
pub enum Material<'a> {
    /// `None` if ffprobe is missing.
    Video(&'a Path, Option<&'a Video>, usize),
    Photos(&'a [Photo]),
}

/// Commands of a POSIX shell that make the capture, one on each line.
pub fn commands(material: &Material, tools: &Tools, settings: &Settings, capture: &Path) -> String {
    let images = capture.join("images");
    let mut text = format!("mkdir -p {} {}\n", shell_word(&images), shell_word(&capture.join("models")));
    let ffmpeg = tools.ffmpeg.clone().unwrap_or_else(|| Ffmpeg {
        ffmpeg: "ffmpeg".into(),
        ffprobe: "ffprobe".into(),
        version: (99, 0),
    });
    let groups;
    let is_sequence = match material {
        Material::Video(file, video, count) => {
            text.push_str(
                "# Frames at even times; \"litetex capture\" takes the sharpest of each stretch of time.\n",
            );
            let command = match video {
                Some(video) => video.even_extraction(&ffmpeg, *count, &images),
                None => Command::new("ffmpeg")
                    .option("-i", *file)
                    .option("-vf", "fps=3")
                    .option("-q:v", "2")
                    .arg(images.join("frame_%05d.jpg")),
            };
            text.push_str(&format!("{}\n", command.shell()));
            groups = Vec::new();
            true
        }
        Material::Photos(photos) => {
            for photo in *photos {
                text.push_str(&format!("{}\n", photo.by_hand(tools, &images.join(&photo.name))));
            }
            groups = cameras(photos);
            photos.len() > EXHAUSTIVE_MAX
        }
    };
    // Which pairs: each with each, or each with the next ones and every tenth with every tenth.
    let is_pair =
        if is_sequence { format!("j<=i+{NEXT}||i%{EVERY}==1&&j%{EVERY}==1") } else { "1".to_owned() };
    text.push_str(&format!(
        "(cd {} && find . -type f | sed 's|^./||' | sort) > {names}\n\
         awk '{{n[NR]=$0}} END{{for(i=1;i<=NR;i++)for(j=i+1;j<=NR;j++)if({is_pair})print n[i],n[j]}}' {names} > {}\n",
        shell_word(&images),
        shell_word(&capture.join("pairs.txt")),
        names = shell_word(&capture.join("camera-0.txt")),
    ));
    let job = Job::in_folder(capture, &groups, settings.quality, settings.threads);
    poses(&mut text, tools.engine.as_ref(), &job, capture);
    text.push_str(&format!(
        "mkdir -p {sparse}; mv {}/0 {sparse}/\nlitetex train {} -o RUN\n",
        shell_word(&job.models),
        shell_word(capture),
        sparse = shell_word(&capture.join("sparse")),
    ));
    text
}

fn poses(text: &mut String, engine: Option<&Engine>, job: &Job, capture: &Path) {
    let none = Engine::Colmap { program: "colmap".into(), version: (4, 0), has_gpu: false };
    let engine = engine.unwrap_or(&none);
    let write = |text: &mut String, name: &str, content: &str| {
        text.push_str(&format!("cat > {} <<'END'\n{content}END\n", shell_word(&capture.join(name))));
    };
    match engine {
        Engine::Pycolmap { .. } => {
            write(text, "poses.py", SCRIPT);
            for step in [Step::Features, Step::Matching, Step::Mapping] {
                write(text, &format!("{}.json", step.name()), &engine.job_json(step, job, false));
            }
        }
        Engine::Colmap { .. } => {
            for (index, camera) in job.cameras.iter().enumerate() {
                let list: String = camera.names.iter().map(|name| format!("{name}\n")).collect();
                write(text, &format!("camera-{index}.txt"), &list);
            }
        }
    }
    for step in [Step::Features, Step::Matching, Step::Mapping] {
        if step == Step::Matching {
            let copy = Command::new("cp").arg(&job.features_db).arg(&job.database);
            text.push_str(&format!("{}\n", copy.shell()));
        }
        for command in engine.commands(step, job, capture) {
            text.push_str(&format!("{}\n", command.shell()));
        }
    }
}
