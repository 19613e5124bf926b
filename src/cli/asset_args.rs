//! Arguments of everything that writes assets.

use super::contribution::Contribution;
use super::frozen::Frozen;
use super::log::Log;
use super::values::{format_count, parse_bytes, parse_decibels};
use super::verdict::Limits;
use litetex_exporters::{Quality, SplatAsset};
use litetex_gs::{Error, Result};

/// How an asset is written.
#[derive(Clone, Debug, Default, clap::Args)]
pub struct AssetArgs {
    /// How much of the scene a file keeps [default: balanced]
    #[arg(long, value_name = "QUALITY")]
    pub quality: Option<QualityName>,
    /// Make a .ltgs file at most this large, such as 5MB, and as good as it gets
    #[arg(long, value_name = "SIZE", value_parser = parse_bytes)]
    pub max_size: Option<u64>,
    /// Make a .ltgs file as small as it gets while at most this much PSNR is lost, mean over the views, such as 0.1dB
    #[arg(long, value_name = "DB", value_parser = parse_decibels, conflicts_with = "max_size")]
    pub max_loss: Option<f64>,
    /// Also make a mesh of textured quads for programs that know no splats: FILE.mesh.glb beside glTF, a variant in USD
    #[arg(long)]
    pub mesh: bool,
    /// Replace existing files
    #[arg(long)]
    pub force: bool,
    /// Do not render the files to prove that they are right
    #[arg(long)]
    pub no_verify: bool,
    /// Keep what lies in this box of the capture's frame: X0,Y0,Z0:X1,Y1,Z1
    #[arg(long, value_name = "BOX", value_parser = parse_box, allow_hyphen_values = true, help_heading = "Scene")]
    pub crop: Option<Box6>,
    /// Leave out splats that contribute less than this many pixels to all training views together
    #[arg(long, value_name = "PIXELS", value_parser = parse_floor, help_heading = "Scene")]
    pub min_contribution: Option<f32>,
    /// Direction of the capture that is up in the files: x, -x, y, -y, z, -z or X,Y,Z [default: that of an asset, else -y, as COLMAP's images]
    #[arg(long, value_name = "DIRECTION", value_parser = parse_direction, allow_hyphen_values = true, help_heading = "Scene")]
    pub up: Option<Direction>,
    /// Length of the capture's unit in the files: 0.01 makes metres of a capture in centimetres [default: that of an asset, else 1]
    #[arg(long, value_name = "FACTOR", value_parser = parse_factor, help_heading = "Scene")]
    pub scale: Option<f64>,
    /// Title of the work [default: name of the capture]
    #[arg(long, value_name = "TEXT", help_heading = "Provenance")]
    pub title: Option<String>,
    /// Who made it
    #[arg(long, value_name = "TEXT", help_heading = "Provenance")]
    pub author: Option<String>,
    /// Licence of the data, such as CC-BY-4.0
    #[arg(long, value_name = "TEXT", visible_alias = "license", help_heading = "Provenance")]
    pub licence: Option<String>,
    /// What it was made from [default: name of the capture]
    #[arg(long = "source", value_name = "TEXT", help_heading = "Provenance")]
    pub made_from: Option<String>,
}

/// Qualities as typed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum QualityName {
    /// Every number comes back bit for bit
    Lossless,
    /// At most 0.02 dB lost on average
    Balanced,
    /// At most 0.1 dB lost on average (.ltgs only)
    Tiny,
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

/// A box.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Box6 {
    low: [f64; 3],
    high: [f64; 3],
}

/// A direction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Direction([f64; 3]);

impl AssetArgs {
    /// The quality that was asked for.
    pub fn quality(&self) -> Quality {
        self.quality.map_or(Quality::Balanced, Quality::from)
    }

    /// What a `.ltgs` file has to keep where a size or a loss was asked for; `None`: what its quality promises.
    pub fn asked_limits(&self) -> Option<Limits> {
        let loss = |loss| Limits { max_loss_db: Some(loss), ..Limits::NONE };
        self.max_loss.map(loss).or(self.max_size.map(|_| Limits::NONE))
    }

    /// Changes a scene as was asked for; tells what was left out.
    ///
    /// # Errors
    /// [`Error::Usage`] if nothing is left.
    pub fn edit(&self, frozen: &mut Frozen, log: &Log) -> Result<()> {
        let asset = &mut frozen.asset;
        let before = asset.num_splats();
        let count = |n: usize| format_count(n as u64);
        if let Some(floor) = self.min_contribution {
            let training: Vec<_> = asset.cameras.iter().filter(|c| !c.held_out).cloned().collect();
            let contribution = Contribution::of(asset, &training, log)?;
            let keep: Vec<bool> = contribution.weight_px.iter().map(|c| *c >= floor).collect();
            let gone = asset.retain(&keep);
            log.info(&format!(
                "{} of {} splats contribute less than {floor} pixels and are left out",
                count(gone),
                count(before)
            ));
        }
        if let Some(Box6 { low, high }) = self.crop {
            let gone = asset.crop(low, high);
            log.info(&format!(
                "{} of {} splats lie outside of the box and are left out",
                count(gone),
                count(before)
            ));
        }
        if asset.num_splats() == 0 {
            let why = if before == 0 {
                "the scene has no splats"
            } else {
                "--crop and --min-contribution leave no splat"
            };
            return Err(Error::Usage(format!("{}: {why}", frozen.path.display())));
        }
        if let Some(Direction(up)) = self.up {
            asset.set_up(up);
        }
        if let Some(factor) = self.scale {
            asset.set_scale(factor);
        }
        self.name(asset);
        Ok(())
    }

    fn name(&self, asset: &mut SplatAsset) {
        let facts = &mut asset.provenance;
        let given = [&self.title, &self.author, &self.licence, &self.made_from];
        let fields = [&mut facts.title, &mut facts.author, &mut facts.licence, &mut facts.source];
        for (field, text) in fields.into_iter().zip(given) {
            if let Some(text) = text {
                field.clone_from(text);
            }
        }
    }
}

fn numbers(text: &str) -> Option<[f64; 3]> {
    let values: Option<Vec<f64>> =
        text.split(',').map(|v| v.trim().parse().ok().filter(|v: &f64| v.is_finite())).collect();
    values?.try_into().ok()
}

fn parse_box(text: &str) -> Result<Box6, String> {
    let parsed = text.split_once(':').and_then(|(a, b)| Some((numbers(a)?, numbers(b)?)));
    let (a, b) = parsed.ok_or_else(|| format!("{text:?}: expected two corners, X0,Y0,Z0:X1,Y1,Z1"))?;
    let pick = |f: fn(f64, f64) -> f64| std::array::from_fn(|i| f(a[i], b[i]));
    Ok(Box6 { low: pick(f64::min), high: pick(f64::max) })
}

fn parse_direction(text: &str) -> Result<Direction, String> {
    let (sign, axis) = text.strip_prefix('-').map_or((1.0, text), |rest| (-1.0, rest));
    let direction = match axis {
        "x" => Some([sign, 0.0, 0.0]),
        "y" => Some([0.0, sign, 0.0]),
        "z" => Some([0.0, 0.0, sign]),
        // Lengths whose squares are numbers.
        _ => numbers(text).filter(|v| v.iter().map(|v| v * v).sum::<f64>().is_normal()),
    };
    direction.map(Direction).ok_or_else(|| format!("{text:?}: expected x, -x, y, -y, z, -z or X,Y,Z"))
}

fn parse_floor(text: &str) -> Result<f32, String> {
    let floor = text.parse::<f32>().ok().filter(|f| f.is_finite() && *f >= 0.0);
    floor.ok_or_else(|| format!("{text:?}: expected a number of pixels, 0 or more"))
}

fn parse_factor(text: &str) -> Result<f64, String> {
    let factor = text.parse::<f64>().ok().filter(|f| f.is_finite() && *f > 0.0);
    factor.ok_or_else(|| format!("{text:?}: expected a positive number"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn boxes_and_directions_are_read() {
        let found = parse_box("0,5,-2:1,-5.5,3").unwrap();
        assert_eq!((found.low, found.high), ([0.0, -5.5, -2.0], [1.0, 5.0, 3.0]));
        assert_eq!(parse_direction("-z").unwrap().0, [0.0, 0.0, -1.0]);
        assert_eq!(parse_direction("-1,0,2").unwrap().0, [-1.0, 0.0, 2.0]);
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
