//! How missing programs are installed, on each system.

/// A program that may be missing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Program {
    Ffmpeg,
    HeifConvert,
    ImageMagick,
    Pycolmap,
}

/// Systems that install programs in different ways.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum System {
    Debian,
    Fedora,
    Arch,
    OtherLinux,
    Mac,
    Windows,
}

impl System {
    /// The one that we run on.
    pub fn current() -> Self {
        if cfg!(windows) {
            return Self::Windows;
        }
        if cfg!(target_vendor = "apple") {
            return Self::Mac;
        }
        Self::of_release(&std::fs::read_to_string("/etc/os-release").unwrap_or_default())
    }

    /// The one that `/etc/os-release` describes.
    fn of_release(text: &str) -> Self {
        let ids = text.lines().filter_map(|l| l.strip_prefix("ID=").or_else(|| l.strip_prefix("ID_LIKE=")));
        let ids: Vec<&str> = ids.flat_map(|ids| ids.trim_matches('"').split(' ')).collect();
        let is = |names: &[&str]| ids.iter().any(|id| names.contains(id));
        match () {
            () if is(&["debian", "ubuntu"]) => Self::Debian,
            () if is(&["fedora", "rhel"]) => Self::Fedora,
            () if is(&["arch"]) => Self::Arch,
            () => Self::OtherLinux,
        }
    }
}

impl Program {
    /// What it is needed for.
    pub const fn purpose(self) -> &'static str {
        match self {
            Self::Ffmpeg => "ffmpeg, which reads videos",
            Self::HeifConvert => "heif-convert or ImageMagick, which decodes HEIC and AVIF",
            Self::ImageMagick => "ImageMagick, which turns and converts photos in commands by hand",
            Self::Pycolmap => "pycolmap 4 or COLMAP 3.8, which finds the poses",
        }
    }

    /// The commands that install it.
    pub const fn commands(self, system: System) -> &'static [&'static str] {
        use System as S;
        match (self, system) {
            (Self::Ffmpeg, S::Debian) => &["sudo apt install ffmpeg"],
            (Self::Ffmpeg, S::Fedora) => &["sudo dnf install ffmpeg-free"],
            (Self::Ffmpeg, S::Arch) => &["sudo pacman -S ffmpeg"],
            (Self::Ffmpeg, S::Mac) => &["brew install ffmpeg"],
            (Self::Ffmpeg, S::Windows) => &["winget install Gyan.FFmpeg"],
            (Self::HeifConvert, S::Debian) => &["sudo apt install libheif-examples"],
            (Self::HeifConvert, S::Fedora) => &["sudo dnf install libheif-tools"],
            (Self::HeifConvert, S::Arch) => &["sudo pacman -S libheif"],
            (Self::HeifConvert, S::Mac) => &["brew install libheif"],
            (Self::HeifConvert | Self::ImageMagick, S::Windows) => {
                &["winget install ImageMagick.ImageMagick"]
            }
            (Self::ImageMagick, S::Debian) => &["sudo apt install imagemagick"],
            (Self::ImageMagick, S::Fedora) => &["sudo dnf install ImageMagick"],
            (Self::ImageMagick, S::Arch) => &["sudo pacman -S imagemagick"],
            (Self::ImageMagick, S::Mac) => &["brew install imagemagick"],
            (Self::Ffmpeg | Self::HeifConvert | Self::ImageMagick, S::OtherLinux) => {
                &["(the package of your system)"]
            }
            (Self::Pycolmap, S::Windows) => &[
                "py -m venv litetex-python",
                "litetex-python\\Scripts\\pip install pycolmap",
                "setx LITETEX_PYTHON \"%CD%\\litetex-python\\Scripts\\python.exe\"",
            ],
            // Debian's Python makes no venv by itself.
            (Self::Pycolmap, S::Debian) => &[
                "sudo apt install python3-venv",
                "python3 -m venv ~/litetex-python",
                "~/litetex-python/bin/pip install pycolmap",
                "export LITETEX_PYTHON=~/litetex-python/bin/python",
            ],
            (Self::Pycolmap, _) => &[
                "python3 -m venv ~/litetex-python",
                "~/litetex-python/bin/pip install pycolmap",
                "export LITETEX_PYTHON=~/litetex-python/bin/python",
            ],
        }
    }
}

/// The command of ImageMagick once it is installed: Debian 12 and its kin have version 6, which has no `magick`.
pub const fn magick_name(system: System) -> &'static str {
    match system {
        System::Debian => "convert",
        _ => "magick",
    }
}

/// What to install for programs that are missing, one command on each line.
pub fn advice(missing: &[Program], system: System) -> String {
    let mut text = String::new();
    for program in missing {
        text.push_str(&format!("{}, is missing. Install it:\n", program.purpose()));
        text.extend(program.commands(system).iter().map(|command| format!("  {command}\n")));
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn systems_are_told_apart_and_each_has_commands() {
        for (text, system) in [
            ("NAME=x\nID=debian\n", System::Debian),
            ("ID=linuxmint\nID_LIKE=\"ubuntu debian\"\n", System::Debian),
            ("ID=fedora\n", System::Fedora),
            ("ID=manjaro\nID_LIKE=arch\n", System::Arch),
            ("ID=alpine\n", System::OtherLinux),
        ] {
            assert_eq!(System::of_release(text), system, "{text}");
        }
        let page = include_str!("../../docs/first-scene.md");
        for system in [System::Debian, System::Fedora, System::Arch, System::Mac, System::Windows] {
            for command in [Program::Ffmpeg, Program::Pycolmap].iter().flat_map(|p| p.commands(system)) {
                assert!(page.contains(command), "docs/first-scene.md lacks {command}");
            }
        }
        let all = [Program::Ffmpeg, Program::HeifConvert, Program::ImageMagick, Program::Pycolmap];
        let debian = advice(&all, System::Debian);
        for words in [
            "sudo apt install ffmpeg",
            "libheif-examples",
            "install imagemagick",
            "pip install pycolmap",
            "\npycolmap 4 or COLMAP 3.8, which finds the poses, is missing. Install it:\n",
        ] {
            assert!(debian.contains(words), "{debian}");
        }
        assert!(advice(&all[..1], System::Mac).contains("brew") && advice(&[], System::Mac).is_empty());
    }
}
