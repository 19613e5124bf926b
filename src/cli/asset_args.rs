//! Arguments of all commands that write assets.

use super::origin::{Origin, parse_origin};
use litetex_exporters::ply::PlyUp;
use litetex_exporters::spz::{SpzOptions, SpzVersion};
use litetex_exporters::{Cameras, Format, Quality};
use litetex_gs::console::values::{numbers, parse_bytes, parse_decibels, whole};
use litetex_gs::stand_in::bytes_for_scene;
use litetex_gs::verify::{PASSES_PER_EFFORT, RateGoal};

/// What is written of a scene, and how.
#[derive(Clone, Debug, Default, clap::Args)]
pub struct AssetArgs {
    /// How closely a file reproduces the scene [default: balanced]
    #[arg(long, value_name = "QUALITY")]
    pub quality: Option<QualityName>,
    /// Write a .ltgs file of at most this size, such as 5MB, at the best quality that fits
    #[arg(long, value_name = "SIZE", value_parser = parse_bytes)]
    pub max_size: Option<u64>,
    /// Write the smallest .ltgs file that loses at most this much PSNR, averaged over the views, such as 0.1dB
    #[arg(long, value_name = "DB", value_parser = parse_decibels, conflicts_with = "max_size")]
    pub max_loss: Option<f64>,
    /// Also write a mesh of textured quads for programs that cannot draw splats: FILE.mesh.glb next to glTF, a variant in USD
    #[arg(long)]
    pub mesh: bool,
    /// Version of .spz files: 3, which most programs read, or 4, which is smaller
    #[arg(long, value_name = "3|4", value_parser = whole::<u8>(3..=4), default_value_t = 3)]
    pub spz_version: u8,
    /// Cameras that glTF and USD files hold for other programs, and whether .spz files hold any [default: home, and none in .spz]
    #[arg(long, value_name = "CAMERAS")]
    pub cameras: Option<CamerasName>,
    /// Replace existing files
    #[arg(long)]
    pub force: bool,
    /// How long to look for a smaller .ltgs file, also inside glTF: above 1, numbers make up for the rounding of others, in two
    /// passes over the views for each level; with --max-size, for one nearer to the scene [default: 1]
    #[arg(long, value_name = "1-9", value_parser = whole::<u8>(1..=9))]
    pub effort: Option<u8>,
    /// Put a stand-in first in .ltgs files, also inside glTF files of quality tiny: a small scene that looks like the whole and is
    /// shown while little of it has arrived. A twelfth of the file, at most 128 KiB; none in files below 100 kB
    #[arg(long)]
    pub preview: bool,
    /// Do not verify the files by rendering them
    #[arg(long)]
    pub no_verify: bool,
    /// Keep only what lies in this box in the capture's frame: X0,Y0,Z0:X1,Y1,Z1
    #[arg(long, value_name = "BOX", value_parser = parse_box, allow_hyphen_values = true, help_heading = "Scene")]
    pub crop: Option<CropBox>,
    /// Drop splats that contribute less than this many pixels in total over the training views
    #[arg(long, value_name = "PIXELS", value_parser = parse_floor, help_heading = "Scene")]
    pub min_contribution: Option<f32>,
    /// Direction of the capture that points up in the files: x, -x, y, -y, z, -z or X,Y,Z [default: that of an asset, else the
    /// one to which the photos are level]. For .ply files, which do not say what is up, also the program that shows them: three, spark,
    /// babylon, playcanvas, splat-transform, or the axis :y, :-y or :z; both as in z:three
    #[arg(long, value_name = "UP", value_parser = parse_up, allow_hyphen_values = true, help_heading = "Scene")]
    pub up: Option<Up>,
    /// Length of one unit of the capture in the files: 0.01 turns centimetres into metres [default: that of an asset, else 1]
    #[arg(long, value_name = "FACTOR", value_parser = parse_factor, help_heading = "Scene")]
    pub scale: Option<f64>,
    /// Point of the capture that lies at the origin of the files, for coordinates that .ply and .spz files cannot hold, as
    /// in georeferenced captures: auto (a round one in the middle of the scene) or X,Y,Z [default: that of an asset, else 0,0,0]
    #[arg(long, value_name = "POINT", value_parser = parse_origin, allow_hyphen_values = true, help_heading = "Scene")]
    pub origin: Option<Origin>,
    /// Title of the work [default: name of the capture]
    #[arg(long, value_name = "TEXT", help_heading = "Provenance")]
    pub title: Option<String>,
    /// Author of the work
    #[arg(long, value_name = "TEXT", help_heading = "Provenance")]
    pub author: Option<String>,
    /// Licence of the data, such as CC-BY-4.0
    #[arg(long, value_name = "TEXT", visible_alias = "license", help_heading = "Provenance")]
    pub licence: Option<String>,
    /// Source of the work [default: name of the capture]
    #[arg(long = "source", value_name = "TEXT", help_heading = "Provenance")]
    pub made_from: Option<String>,
}

/// Qualities that can be requested.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum QualityName {
    /// Every value is kept bit for bit
    Lossless,
    /// At most 0.02 dB lost on average
    Balanced,
    /// At most 0.1 dB lost on average (.ltgs and glTF)
    Tiny,
}

/// Cameras that files hold for other programs.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum CamerasName {
    /// One that shows the scene
    Home,
    /// That one first, then all others of the capture
    All,
}

impl From<QualityName> for Quality {
    fn from(name: QualityName) -> Self {
        match name {
            QualityName::Lossless => Self::Lossless,
            QualityName::Balanced => Self::Balanced,
            QualityName::Tiny => Self::Tiny,
        }
    }
}

/// An axis-aligned box in the capture's frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CropBox {
    pub low: [f64; 3],
    pub high: [f64; 3],
}

/// What is up in files.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Up {
    /// The direction in the capture's frame, of any length.
    pub in_capture: Option<[f64; 3]>,
    /// The axis of `.ply` files.
    pub ply: PlyUp,
}

/// Programs that show `.ply` files, and the axis that points up in them, by runs of each: see `docs/viewers.md`.
const PROGRAMS: [(&str, PlyUp); 5] = [
    ("three", PlyUp::Y),
    ("spark", PlyUp::Y),
    ("babylon", PlyUp::MinusY),
    ("playcanvas", PlyUp::Y),
    ("splat-transform", PlyUp::MinusY),
];

impl AssetArgs {
    /// The goal of the steps of a file in this format; `None` if it has no steps. Bounds of size and loss are only for `.ltgs`
    /// files.
    pub fn goal_of(&self, format: Format) -> Option<RateGoal> {
        let goal = self.rate_goal();
        let goal = if format == Format::Ltgs { goal } else { goal.without_bounds() };
        format.has_steps(self.quality()).then_some(goal)
    }

    /// Whether a file of this format and quality begins with a stand-in.
    pub fn puts_stand_in(&self, format: Format, quality: Quality) -> bool {
        let holds_it = match format {
            Format::Ltgs => true,
            // Pages hold the whole scene before anything of them runs.
            Format::Html => false,
            _ => format.has_steps(quality),
        };
        self.preview && holds_it
    }

    /// The quality requested.
    pub fn quality(&self) -> Quality {
        self.quality.map_or(Quality::Balanced, Quality::from)
    }

    /// Cameras for other programs.
    pub fn cameras(&self) -> Cameras {
        if self.cameras == Some(CamerasName::All) { Cameras::All } else { Cameras::Home }
    }

    /// How `.spz` files are written, but for the bits of their SH coefficients.
    pub fn spz(&self) -> SpzOptions {
        let version = if self.spz_version == 4 { SpzVersion::V4 } else { SpzVersion::V3 };
        SpzOptions { version, cameras: self.cameras() == Cameras::All, ..SpzOptions::default() }
    }

    /// What a `.ltgs` file should keep to.
    pub fn rate_goal(&self) -> RateGoal {
        RateGoal {
            quality: self.quality(),
            max_bytes: self.max_size.map(|max| if self.preview { bytes_for_scene(max) } else { max }),
            max_loss_db: self.max_loss,
            passes: PASSES_PER_EFFORT * (u32::from(self.effort.unwrap_or(1)) - 1),
        }
    }
}

fn parse_box(text: &str) -> Result<CropBox, String> {
    let parsed = text.split_once(':').and_then(|(a, b)| Some((numbers(a)?, numbers(b)?)));
    let (a, b) = parsed.ok_or_else(|| format!("{text:?}: expected two corners, X0,Y0,Z0:X1,Y1,Z1"))?;
    let pick = |f: fn(f64, f64) -> f64| std::array::from_fn(|i| f(a[i], b[i]));
    Ok(CropBox { low: pick(f64::min), high: pick(f64::max) })
}

fn parse_up(text: &str) -> Result<Up, String> {
    let of_file = |name: &str| {
        let program = PROGRAMS.iter().find(|(program, _)| *program == name).map(|(_, up)| *up);
        program.or_else(|| PlyUp::ALL.into_iter().find(|up| up.name() == name))
    };
    if let Some((_, ply)) = PROGRAMS.iter().find(|(program, _)| *program == text) {
        return Ok(Up { in_capture: None, ply: *ply });
    }
    let (direction, file) = text.split_once(':').map_or((text, None), |(d, f)| (d, Some(f)));
    let in_capture =
        if direction.is_empty() && file.is_some() { None } else { Some(parse_direction(direction)?) };
    let ply = file.map(|name| {
        let programs = PROGRAMS.map(|(program, _)| program).join(", ");
        of_file(name).ok_or_else(|| format!("{name:?}: expected y, -y, z or a program: {programs}"))
    });
    Ok(Up { in_capture, ply: ply.transpose()?.unwrap_or_default() })
}

fn parse_direction(text: &str) -> Result<[f64; 3], String> {
    let (sign, axis) = text.strip_prefix('-').map_or((1.0, text), |rest| (-1.0, rest));
    let direction = match axis {
        "x" => Some([sign, 0.0, 0.0]),
        "y" => Some([0.0, sign, 0.0]),
        "z" => Some([0.0, 0.0, sign]),
        // Neither underflow nor overflow in the squared length.
        _ => numbers(text).filter(|v| v.iter().map(|v| v * v).sum::<f64>().is_normal()),
    };
    direction.ok_or_else(|| {
        let programs = PROGRAMS.map(|(program, _)| program).join(", ");
        format!("{text:?}: expected x, -x, y, -y, z, -z, X,Y,Z or a program: {programs}")
    })
}

fn parse_floor(text: &str) -> Result<f32, String> {
    let floor = text.parse::<f32>().ok().filter(|f| f.is_finite() && *f >= 0.0);
    floor.ok_or_else(|| "expected a number of pixels, 0 or more".to_owned())
}

fn parse_factor(text: &str) -> Result<f64, String> {
    let factor = text.parse::<f64>().ok().filter(|f| f.is_finite() && *f > 0.0);
    factor.ok_or_else(|| "expected a positive number".to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn boxes_directions_and_factors_are_parsed() {
        let found = parse_box("0,5,-2:1,-5.5,3").unwrap();
        assert_eq!((found.low, found.high), ([0.0, -5.5, -2.0], [1.0, 5.0, 3.0]));
        assert_eq!(parse_direction("-z").unwrap(), [0.0, 0.0, -1.0]);
        assert_eq!(parse_direction("-1,0,2").unwrap(), [-1.0, 0.0, 2.0]);
        let up = |text| parse_up(text).map(|up| (up.in_capture, up.ply));
        assert_eq!(up("three"), Ok((None, PlyUp::Y)));
        assert_eq!(up("-z:splat-transform"), Ok((Some([0.0, 0.0, -1.0]), PlyUp::MinusY)));
        assert_eq!(up("1,2,3:z"), Ok((Some([1.0, 2.0, 3.0]), PlyUp::Z)));
        assert_eq!((up(":y"), up("y")), (Ok((None, PlyUp::Y)), Ok((Some([0.0, 1.0, 0.0]), PlyUp::MinusY))));
        assert!(up(":x").is_err() && up("three:y").is_err() && up("threee").unwrap_err().contains("spark"));
        for wrong in ["", "1,2,3", "1,2:3,4", "0,0,nan:1,1,1"] {
            assert!(parse_box(wrong).is_err(), "{wrong}");
        }
        for wrong in ["", "w", "0,0,0", "--x", "1,2", "1e-300,0,0", "1e300,0,0"] {
            assert!(parse_direction(wrong).is_err(), "{wrong}");
        }
        assert!(parse_floor("NaN").is_err() && parse_floor("-1").is_err() && parse_floor("0.5") == Ok(0.5));
        assert!(parse_factor("0").is_err() && parse_factor("0.01") == Ok(0.01));
    }
}
