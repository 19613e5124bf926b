//! The same work as commands that a person may run, for `--print` and where a program is missing.

use super::camera::Camera;
use super::child::Command;
use super::engine::{Engine, Job, SCRIPT, Step};
use super::install::{Program, System, advice};
use super::pairs::{EVERY, EXHAUSTIVE_MAX, NEXT};
use super::photos::{Photo, cameras};
use super::settings::Settings;
use super::tools::{Ffmpeg, Tools};
use super::video::Video;
use crate::text::shell_word;
use std::collections::BTreeSet;
use std::path::Path;

/// All photos, in order, one name on each line.
const NAMES: &str = "names.txt";

/// What there is to work on.
pub enum Material<'a> {
    /// `None` if ffprobe is missing.
    Video(&'a Path, Option<&'a Video>, usize),
    Photos(&'a [Photo]),
}

/// Commands of a POSIX shell that make the capture.
pub fn commands(material: &Material, tools: &Tools, settings: &Settings, capture: &Path) -> String {
    let images = capture.join("images");
    let mut text = format!("mkdir -p {} {}\n", shell_word(&images), shell_word(&capture.join("models")));
    let names = shell_word(&capture.join(NAMES));
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
            // One camera for all frames, whose names are not known yet.
            let size = video.map_or((0, 0), |video| video.size);
            groups = vec![Camera { focal_px: None, size, names: Vec::new() }];
            true
        }
        Material::Photos(photos) => {
            let inner = photos.iter().filter_map(|photo| Path::new(&photo.name).parent());
            for folder in inner.filter(|f| !f.as_os_str().is_empty()).collect::<BTreeSet<_>>() {
                text.push_str(&format!("mkdir -p {}\n", shell_word(&images.join(folder))));
            }
            if photos.iter().any(Photo::is_rewritten) && !tools.has_magick() {
                let advice = advice(&[Program::ImageMagick], System::current());
                text.extend(advice.lines().map(|line| format!("# {line}\n")));
            }
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
        "(cd {} && find . -type f | sed 's|^./||' | LC_ALL=C sort) > {names}\n\
         awk '{{n[NR]=$0}} END{{for(i=1;i<=NR;i++)for(j=i+1;j<=NR;j++)if({is_pair})print n[i],n[j]}}' {names} > {}\n",
        shell_word(&images),
        shell_word(&capture.join("pairs.txt")),
    ));
    let job = Job::in_folder(capture, &groups, settings.quality, settings.threads);
    poses(&mut text, tools.engine.as_ref(), &job, capture);
    // Each model begins with the number of its photos; the first of the largest is kept.
    text.push_str(&format!(
        "largest=$(cd {models} && for model in *; do echo $(od -An -tu8 -N8 \"$model/images.bin\") \"$model\"; done \
         | sort -s -k1,1nr | sed -n '1s/^[0-9]* //p')\n\
         mkdir -p {sparse} && mv {models}/\"$largest\" {sparse}/0\n\
         litetex train {} -o RUN\n",
        shell_word(capture),
        models = shell_word(&job.models),
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
                let file = format!("camera-{index}.txt");
                if camera.names.is_empty() {
                    let copy = Command::new("cp").arg(capture.join(NAMES)).arg(capture.join(file));
                    text.push_str(&format!("{}\n", copy.shell()));
                    continue;
                }
                let list: String = camera.names.iter().map(|name| format!("{name}\n")).collect();
                write(text, &file, &list);
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
