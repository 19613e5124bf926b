//! The programs that we start: where they are, which version they have, and what they can do.

use super::child::Command;
use super::engine::Engine;
use super::install::{Program, System, magick_name};
use super::settings::Settings;
use std::env;
use std::path::{Path, PathBuf};

/// The first version of pycolmap whose functions the script calls.
const PYCOLMAP_MIN: (u32, u32) = (4, 0);

/// The first version of COLMAP whose options are known.
const COLMAP_MIN: (u32, u32) = (3, 8);

/// Names the Python that has pycolmap.
const PYTHON_VARIABLE: &str = "LITETEX_PYTHON";

/// The programs that were found.
#[derive(Clone, Debug, Default)]
pub struct Tools {
    pub ffmpeg: Option<Ffmpeg>,
    heif: Option<Heif>,
    /// ImageMagick.
    magick: Option<PathBuf>,
    pub engine: Option<Engine>,
    /// Programs that were named or found and do not serve, each in a line.
    pub unfit: Vec<String>,
}

/// ffmpeg and ffprobe.
#[derive(Clone, Debug)]
pub struct Ffmpeg {
    pub ffmpeg: PathBuf,
    pub ffprobe: PathBuf,
    pub version: (u32, u32),
}

/// What decodes HEIC and AVIF.
#[derive(Clone, Debug)]
enum Heif {
    Convert(PathBuf),
    Magick(PathBuf),
}

impl Tools {
    /// Looks for all of them: those of the settings, else those on the PATH.
    pub fn find(settings: &Settings) -> Self {
        let mut found = Self::default();
        if let (Some(ffmpeg), Some(ffprobe)) = (on_path("ffmpeg"), on_path("ffprobe")) {
            let version = Command::new(&ffmpeg).arg("-version").answer().and_then(|text| version_in(&text));
            // Builds from the middle of development have no number; they are new.
            found.ffmpeg = Some(Ffmpeg { ffmpeg, ffprobe, version: version.unwrap_or((99, 0)) });
        }
        // Windows has another program of that name.
        found.magick = on_path("magick").or_else(|| on_path("convert").filter(|_| cfg!(not(windows))));
        let heif_convert = on_path("heif-convert").map(Heif::Convert);
        found.heif = heif_convert.or_else(|| found.magick.clone().map(Heif::Magick));
        found.find_engine(settings);
        found
    }

    fn find_engine(&mut self, settings: &Settings) {
        if settings.colmap.is_none() {
            let named = settings.python.clone().or_else(|| env::var_os(PYTHON_VARIABLE).map(PathBuf::from));
            let pythons = match &named {
                Some(python) => vec![on_path_or(python)],
                None => ["python3", "python"].into_iter().filter_map(on_path).collect(),
            };
            for python in pythons {
                let ask = "import pycolmap; print('pycolmap', pycolmap.__version__)";
                let answer = Command::new(&python).option("-c", ask).answer();
                match answer.and_then(|text| version_in(&text)) {
                    Some(version) if version >= PYCOLMAP_MIN => {
                        self.engine = Some(Engine::Pycolmap { python, version });
                        return;
                    }
                    Some((major, minor)) => {
                        self.unfit.push(format!(
                            "found pycolmap {major}.{minor} of {}, expected 4 or later",
                            python.display()
                        ));
                    }
                    None if named.is_some() => {
                        let option = if settings.python.is_some() { "--python" } else { PYTHON_VARIABLE };
                        self.unfit.push(wrong(Some(option), &python, "cannot import pycolmap"));
                    }
                    None => {}
                }
            }
            if settings.python.is_some() {
                return;
            }
        }
        let colmap = settings.colmap.as_deref().map(on_path_or).or_else(|| on_path("colmap"));
        let Some(program) = colmap else { return };
        let help = Command::new(&program).arg("help").answer().unwrap_or_default();
        match version_in(&help) {
            Some(version) if version >= COLMAP_MIN => {
                let has_gpu = help.contains("with CUDA")
                    && on_path("nvidia-smi").is_some_and(|smi| {
                        Command::new(smi).arg("-L").answer().is_some_and(|text| text.contains("GPU"))
                    });
                self.engine = Some(Engine::Colmap { program, version, has_gpu });
            }
            Some((major, minor)) => {
                self.unfit.push(format!(
                    "found COLMAP {major}.{minor} at {}, expected 3.8 or later",
                    program.display()
                ));
            }
            None => {
                let option = settings.colmap.as_ref().map(|_| "--colmap");
                self.unfit.push(wrong(option, &program, "does not answer as COLMAP does"));
            }
        }
    }

    /// What is missing for this work.
    pub fn missing(&self, is_video: bool, has_heif: bool) -> Vec<Program> {
        let needed = [
            (is_video && self.ffmpeg.is_none(), Program::Ffmpeg),
            (has_heif && self.heif.is_none(), Program::HeifConvert),
            (self.engine.is_none(), Program::Pycolmap),
        ];
        needed.into_iter().filter(|(is_missing, _)| *is_missing).map(|(_, program)| program).collect()
    }

    /// The program that decodes HEIC and AVIF.
    pub fn heif_name(&self) -> &'static str {
        match self.heif {
            Some(Heif::Magick(_)) => "ImageMagick",
            _ => "heif-convert",
        }
    }

    /// Whether ImageMagick was found.
    pub fn has_magick(&self) -> bool {
        self.magick.is_some()
    }

    /// Writes a photo upright as JPEG, as a person does it.
    pub fn turn_command(&self, file: &Path, to: &Path) -> Command {
        let program = self.magick.clone().unwrap_or_else(|| magick_name(System::current()).into());
        Command::new(program).arg(file).arg("-auto-orient").option("-quality", "95").arg(to)
    }

    /// Decodes a HEIC or AVIF file into a PNG or JPEG file.
    pub fn heif_command(&self, file: &Path, to: &Path) -> Command {
        match &self.heif {
            Some(Heif::Magick(program)) => Command::new(program).arg(file).arg(to),
            Some(Heif::Convert(program)) => Command::new(program).arg(file).arg(to),
            None => Command::new("heif-convert").arg(file).arg(to),
        }
    }
}

/// Says what is wrong with a program; `option` is what named it, if anything did.
fn wrong(option: Option<&str>, program: &Path, what: &str) -> String {
    let what = if program.exists() { what } else { "no such program" };
    match option {
        Some(option) => format!("{option} {}: {what}; name another, or leave it out", program.display()),
        None => format!("{}: {what}", program.display()),
    }
}

/// The file of a program, which may be named without its folder.
fn on_path_or(named: &Path) -> PathBuf {
    named
        .to_str()
        .filter(|name| !name.contains(['/', '\\']))
        .and_then(on_path)
        .unwrap_or_else(|| named.to_owned())
}

fn on_path(name: &str) -> Option<PathBuf> {
    let folders = env::var_os("PATH")?;
    let names = if cfg!(windows) {
        vec![format!("{name}.exe"), format!("{name}.bat")]
    } else {
        vec![name.to_owned()]
    };
    env::split_paths(&folders)
        .flat_map(|f| names.iter().map(move |n| f.join(n)).collect::<Vec<_>>())
        .find(|p| p.is_file())
}

/// The first version number of a text: "COLMAP 3.8 -- Structure", "ffmpeg version n7.1-3".
fn version_in(text: &str) -> Option<(u32, u32)> {
    text.split_whitespace().find_map(|word| {
        let mut parts = word.trim_start_matches(|c: char| !c.is_ascii_digit()).split('.');
        let major = parts.next()?.parse().ok()?;
        let minor: String = parts.next()?.chars().take_while(char::is_ascii_digit).collect();
        Some((major, minor.parse().ok()?))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn versions_are_found_in_what_programs_print() {
        for (text, version) in [
            ("ffmpeg version 5.1.9-0+deb12u1 Copyright (c)", Some((5, 1))),
            ("ffmpeg version n7.1-3-g5", Some((7, 1))),
            ("ffmpeg version N-12-g5 Copyright (c) 2000", None),
            ("COLMAP 3.8 -- Structure-from-Motion", Some((3, 8))),
            ("COLMAP 4.0.1 -- Structure", Some((4, 0))),
            ("pycolmap 4.2.1\n", Some((4, 2))),
            ("COLMAP 3.14.0.dev0 -- ", Some((3, 14))),
        ] {
            assert_eq!(version_in(text), version, "{text}");
        }
    }
}
