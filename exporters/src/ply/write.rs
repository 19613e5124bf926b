//! Writes PLY files of splats.

use super::escape::escaped;
use super::{COMMENT_2DGS, world_comment};
use crate::fallback::baked::{Baked, Baker};
use crate::fallback::spacing::{self, Spacing, Spacings};
use crate::{Result, SplatAsset, Transform, num_sh_coefficients};

/// The layout of a PLY file.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum PlyFlavour {
    /// That of 3DGS, for every viewer: the third scale is thin.
    #[default]
    Ellipsoid,
    /// That of 2DGS, for viewers that draw discs: two scales, and a comment that says so.
    Surfel,
}

/// The axis of a file that points up: the format does not say, so that programs show a file as they see fit.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum PlyUp {
    /// As the trainers of 3DGS leave it: y down.
    #[default]
    MinusY,
    /// For programs that show a file as it is in a frame with y up.
    Y,
    /// For programs with z up.
    Z,
}

impl PlyUp {
    /// All of them.
    pub const ALL: [Self; 3] = [Self::MinusY, Self::Y, Self::Z];

    /// `-y`, `y` or `z`.
    pub fn name(self) -> &'static str {
        match self {
            Self::MinusY => "-y",
            Self::Y => "y",
            Self::Z => "z",
        }
    }

    /// From the frame with y down to that of the file: a turn about x.
    pub(super) fn turn(self) -> Transform {
        let half = std::f64::consts::FRAC_1_SQRT_2;
        let rotation = match self {
            Self::MinusY => return Transform::IDENTITY,
            Self::Y => [0.0, 1.0, 0.0, 0.0],
            Self::Z => [half, -half, 0.0, 0.0],
        };
        Transform { rotation, ..Transform::IDENTITY }
    }
}

/// How to write a PLY file.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PlyOptions {
    /// The layout of rows.
    pub flavour: PlyFlavour,
    /// SH degree of the file, `None` for that of the asset: higher degrees are left out, missing ones are zero. The
    /// original 3DGS viewer reads degree 3 only.
    pub sh_degree: Option<u32>,
    /// The axis that points up.
    pub up: PlyUp,
}

/// Facts about a file that was written.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PlySummary {
    /// Size of the file.
    pub bytes: usize,
    /// Splats whose maps were averaged into their colours.
    pub averaged_maps: usize,
    /// How finely f32 resolves the splats where they lie.
    pub spacing: Spacing,
}

/// Thickness of discs for viewers of ellipsoids, world units: its logarithm must be finite, and the disc must look flat.
const THICKNESS: f64 = 1e-6;

/// Encodes a binary little-endian file.
///
/// # Errors
/// [`crate::Error::Invalid`] if the asset breaks a rule or a value is not finite in the world frame, [`crate::Error::TooLarge`].
pub fn encode_ply(asset: &SplatAsset, options: &PlyOptions) -> Result<(Vec<u8>, PlySummary)> {
    asset.validate()?;
    let sh_degree = options.sh_degree.unwrap_or(asset.sh_degree);
    if sh_degree > 3 {
        return Err(invalid!("", "SH degree {sh_degree} requested, at most 3"));
    }
    let mut bytes = header(asset, options, sh_degree).into_bytes();
    let mut summary = PlySummary::default();
    let mut spacings = Spacings::default();
    let (mut row, baker) =
        (Vec::new(), Baker::in_frame(asset, options.up.turn().after(&asset.world_from_local())));
    for splat in 0..asset.num_splats() {
        row.clear();
        let baked = baker.splat(splat);
        push_splat(&mut row, &baked, options.flavour, sh_degree);
        if !row.iter().all(|v| v.is_finite()) {
            return Err(invalid!("", "splat {splat}: not finite in the frame of the file"));
        }
        bytes.extend(row.iter().flat_map(|v| v.to_le_bytes()));
        summary.averaged_maps += usize::from(asset.maps[splat].num_texels() > 0);
        let farthest = baked.position.iter().fold(0.0_f64, |farthest, v| farthest.max(v.abs()));
        spacings.add(&baked, spacing::of_f32(farthest));
    }
    summary.spacing = spacings.summary();
    summary.bytes = bytes.len();
    Ok((bytes, summary))
}

fn header(asset: &SplatAsset, options: &PlyOptions, sh_degree: u32) -> String {
    let PlyOptions { flavour, up, .. } = *options;
    let facts = &asset.provenance;
    let mut lines = vec!["ply".to_owned(), "format binary_little_endian 1.0".to_owned()];
    if flavour == PlyFlavour::Surfel {
        lines.push(format!("comment {COMMENT_2DGS}"));
    }
    let mut comment = |name: &str, text: String| {
        if !text.is_empty() {
            lines.push(format!("comment {name}: {text}"));
        }
    };
    comment("written by", concat!("litetex ", env!("CARGO_PKG_VERSION")).to_owned());
    comment("colours", "texture maps are averaged into f_dc".to_owned());
    let frame = match (up, asset.world_from_capture.is_identity()) {
        (PlyUp::MinusY, true) if facts.up.is_empty() => "of the capture; what is up there is not known",
        (PlyUp::MinusY, true) => "of the capture (up is -y)",
        (PlyUp::MinusY, false) if facts.up.is_empty() => {
            "the file's own, see world_from_capture; what is up there is not known"
        }
        (PlyUp::MinusY, false) => "the file's own (up is -y), see world_from_capture",
        _ => "the file's own, turned about x from one in which up is -y",
    };
    comment("frame", frame.to_owned());
    if up != PlyUp::default() {
        comment("up", up.name().to_owned());
    }
    if !asset.world_from_capture.is_identity() {
        comment("world_from_capture", world_comment(&asset.world_from_capture));
    }
    if let Some([x, y, z]) = asset.origin_in_capture() {
        comment("origin", format!("{x} {y} {z}"));
    }
    comment("up_in_capture", escaped(&facts.up));
    comment("scale", escaped(&facts.scale));
    comment("title", escaped(&facts.title));
    comment("author", escaped(&facts.author));
    comment("licence", escaped(&facts.licence));
    comment("source", escaped(&facts.source));
    comment("program_version", escaped(&facts.program_version));
    for (name, value) in &facts.training {
        // The first equals sign ends the name.
        comment("training", format!("{} = {}", escaped(name).replace('=', "\\u{3d}"), escaped(value)));
    }
    for camera in &asset.cameras {
        comment("camera", escaped(&camera.name));
    }
    lines.push(format!("element vertex {}", asset.num_splats()));
    let num_rest = 3 * (num_sh_coefficients(sh_degree) - 1);
    let num_scales = if flavour == PlyFlavour::Surfel { 2 } else { 3 };
    let plain = ["x", "y", "z", "nx", "ny", "nz"].map(str::to_owned);
    let numbered = |name: &'static str, count: usize| (0..count).map(move |i| format!("{name}_{i}"));
    let properties = plain
        .into_iter()
        .chain(numbered("f_dc", 3))
        .chain(numbered("f_rest", num_rest))
        .chain(std::iter::once("opacity".to_owned()))
        .chain(numbered("scale", num_scales))
        .chain(numbered("rot", 4));
    lines.extend(properties.map(|name| format!("property float {name}")));
    lines.push("end_header\n".to_owned());
    lines.join("\n")
}

/// Appends the row of a splat, in the order of the header.
fn push_splat(row: &mut Vec<f32>, splat: &Baked, flavour: PlyFlavour, sh_degree: u32) {
    row.extend(splat.position.map(|v| v as f32));
    row.extend(normal(splat.rotation));
    row.extend(splat.sh[..3].iter().map(|&v| v as f32));
    for channel in 0..3 {
        let coefficient = |k: usize| splat.sh.get(3 * k + channel).map_or(0.0, |&v| v as f32);
        row.extend((1..num_sh_coefficients(sh_degree)).map(coefficient));
    }
    row.push(logit(splat.opacity));

    let scales = splat.scales;
    row.extend(scales.map(|s| s.ln() as f32));
    if flavour == PlyFlavour::Ellipsoid {
        // Always the thinnest axis, however small the splat is in the unit of the capture.
        let thickness = THICKNESS.min(0.01 * scales[0].min(scales[1]));
        row.push(thickness.ln() as f32);
    }
    row.extend(splat.rotation);
}

/// The splat's z axis.
fn normal([w, x, y, z]: [f32; 4]) -> [f32; 3] {
    [2.0 * (x * z + w * y), 2.0 * (y * z - w * x), 1.0 - 2.0 * (x * x + y * y)]
}

/// Logit of an opacity in (0, 1]; 1 counts as the largest f32 below it, so that the result is finite.
fn logit(opacity: f32) -> f32 {
    let o = f64::from(opacity.min(1.0 - f32::EPSILON / 2.0));
    (o / (1.0 - o)).ln() as f32
}
