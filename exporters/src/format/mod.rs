//! Dispatches reading and writing by the extension of a file.

pub mod contents;
pub mod kind;
pub mod quality;
pub mod sniff;

use self::kind::Format;
use crate::atlas::PAGE_SIDE;
use crate::files::read::read_file;
use crate::files::staging::SidecarFile;
use crate::files::written::mesh_path;
use crate::{
    Cameras, Contents, Error, Issue, Quality, ReadLimits, Result, Severity, SplatAsset, Staged, Written,
    gltf, html, ltgs, ply, spz, usd,
};
use std::path::Path;

/// How to write an asset.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct WriteOptions<'a> {
    /// How exactly the file keeps the scene, where the format leaves a choice.
    pub quality: Quality,
    /// Whether to add a mesh of textured quads for programs without splat support: a sidecar file in glTF, a variant in USD.
    pub mesh: bool,
    /// Quantisation steps of lossy `.ltgs` files, also of those in pages and glTF; `None` takes those of the quality.
    pub steps: Option<ltgs::Steps>,
    /// What is known of the splats, for lossy `.ltgs` files.
    pub per_splat: ltgs::PerSplat<'a>,
    /// A small scene that `.ltgs` files, also those in pages and glTF, show first.
    pub stand_in: Option<ltgs::StandIn<'a>>,
    /// Cameras that glTF and USD files hold for other programs.
    pub cameras: Cameras,
    /// The axis of PLY files that points up.
    pub ply_up: ply::PlyUp,
    /// How to write SPZ.
    pub spz: spz::SpzOptions,
}

/// Writes an asset in the format that the extension names, and replaces what was there: [`stage_asset`] and
/// [`Staged::publish`] at once.
///
/// # Errors
/// As [`stage_asset`] and [`Staged::publish`].
pub fn write_asset(path: &Path, asset: &SplatAsset, options: &WriteOptions<'_>) -> Result<Written> {
    stage_asset(path, asset, options)?.publish(true)
}

/// Writes an asset in the format that the extension names into a staging folder next to its place, where it can be read
/// and verified before it replaces anything.
///
/// # Errors
/// [`Error::Unsupported`] for an unknown extension or a quality that the format does not offer, [`Error::Io`], and those
/// of the format's writer.
pub fn stage_asset(path: &Path, asset: &SplatAsset, options: &WriteOptions<'_>) -> Result<Staged> {
    let format = Format::of(path)?;
    format.check_quality(options.quality, path)?;
    let encoded = encode(format, path, asset, options)?;
    let mut staged = Staged::new(path, encoded.root, encoded.side)?;
    staged.add_notes(encoded.notes);
    Ok(staged)
}

/// The files of an asset, not written yet.
#[derive(Default)]
struct Encoded {
    root: Vec<u8>,
    side: Vec<SidecarFile>,
    notes: Vec<String>,
}

fn encode(format: Format, path: &Path, asset: &SplatAsset, options: &WriteOptions<'_>) -> Result<Encoded> {
    let mut encoded = Encoded::default();
    let quality = options.quality;
    match format {
        Format::Glb | Format::Gltf => {
            let WriteOptions { steps, per_splat, stand_in, cameras, .. } = *options;
            let page_side = PAGE_SIDE;
            let gltf_options = gltf::GltfOptions { quality, page_side, steps, per_splat, stand_in, cameras };
            (encoded.root, encoded.side) = gltf::encode_files(path, asset, &gltf_options)?;
            if options.mesh {
                add_mesh(&mut encoded, &mesh_path(path), asset)?;
            }
        }
        Format::Ltgs | Format::Html => {
            let WriteOptions { steps, per_splat, stand_in, .. } = *options;
            let ltgs_options =
                ltgs::LtgsOptions { quality, steps, per_splat, stand_in, ..ltgs::LtgsOptions::default() };
            let encode = if format == Format::Html { html::encode_html } else { ltgs::encode };
            encoded.root = encode(asset, &ltgs_options).map_err(|e| e.at(path))?;
        }
        Format::Usda | Format::Usdc | Format::Usdz => {
            let WriteOptions { mesh, cameras, .. } = *options;
            let usd_options = usd::UsdOptions { quality, page_side: PAGE_SIDE, mesh, cameras };
            (encoded.root, encoded.side) = usd::encode_files(path, asset, &usd_options)?;
        }
        Format::Ply => {
            // The viewer of 3DGS reads no other degrees than 0 and 3.
            let sh_degree = if asset.sh_degree == 0 { 0 } else { 3 };
            let ply_options = ply::PlyOptions {
                sh_degree: Some(sh_degree),
                up: options.ply_up,
                ..ply::PlyOptions::default()
            };
            let (bytes, summary) = ply::encode_ply(asset, &ply_options).map_err(|e| e.at(path))?;
            encoded.root = bytes;
            encoded.notes.extend(summary.spacing.note("f32"));
        }
        Format::Spz => {
            let (bytes, summary) = spz::encode_spz(asset, &options.spz).map_err(|e| e.at(path))?;
            encoded.root = bytes;
            encoded.notes.extend(summary.spacing.note("24 bits"));
            if summary.clamped_scales > 0 {
                encoded.notes.push(format!(
                    "{} splats are smaller or larger than SPZ can store (4.5e-5 to 380 units); see --scale",
                    summary.clamped_scales
                ));
            }
        }
    }
    Ok(encoded)
}

fn add_mesh(encoded: &mut Encoded, file: &Path, asset: &SplatAsset) -> Result<()> {
    let (bytes, summary) = gltf::encode_mesh(asset, &gltf::MeshOptions::default()).map_err(|e| e.at(file))?;
    encoded.side.push((file.file_name().unwrap_or_default().to_owned(), bytes));
    if summary.omitted > 0 {
        encoded.notes.push(format!(
            "the mesh shows the {} splats that contribute most and omits {}",
            summary.quads, summary.omitted
        ));
    }
    Ok(())
}

/// Reads an asset in the format that the extension names.
///
/// # Errors
/// [`Error::Unsupported`] for an unknown extension, [`Error::Invalid`] for a file that begins as another format does or that is
/// mixed with sidecar files of another export,
/// [`Error::TooLarge`] for one with more bytes than the limits allow to decode, and those of the format's reader.
pub fn read_asset(path: &Path, limits: &ReadLimits) -> Result<Contents> {
    let format = Format::of(path)?;
    sniff::check(path, format)?;
    match format {
        Format::Ply => {
            let read = ply::read_ply(path, limits)?;
            let thick = (read.num_thick > 0).then(|| {
                format!("{} splats are thick: drawn as discs, they lose their thinnest axis", read.num_thick)
            });
            Ok(Contents {
                asset: read.asset,
                format: if read.is_surfel { "PLY of 2DGS" } else { "PLY of 3DGS" }.to_owned(),
                quality: None,
                hash: None,
                sections: read.sections,
                layers: Vec::new(),
                stand_in: None,
                warnings: read
                    .left_out
                    .into_iter()
                    .chain(read.dropped_sh)
                    .chain(read.lost_frame)
                    .chain(thick)
                    .collect(),
            })
        }
        Format::Spz => spz::read_spz(path, limits),
        Format::Glb | Format::Gltf => gltf::read_gltf(path, limits),
        Format::Ltgs => ltgs::decode(&read_file(path, limits.decoded_bytes)?, path, limits),
        Format::Html => html::read_html(path, limits),
        Format::Usda | Format::Usdc | Format::Usdz => usd::read_usd(path, limits),
    }
}

/// Reads what programs without texture support show of a file: the attributes of `KHR_gaussian_splatting`, or the prim of
/// type `ParticleField3DGaussianSplat`, as the file holds them. Frame and cameras are those of [`read_asset`]. `None` if
/// the format has no textures, if only this crate reads it, or if there is no such prim.
///
/// # Errors
/// [`Error::Unsupported`] for an unknown extension, and those of the format's reader.
pub fn read_fallback(path: &Path, limits: &ReadLimits) -> Result<Option<SplatAsset>> {
    let format = Format::of(path)?;
    match format {
        Format::Glb | Format::Gltf => gltf::read_fallback(path, limits).map(Some),
        Format::Usda | Format::Usdc | Format::Usdz => usd::read_fallback(path, limits),
        Format::Ltgs | Format::Html | Format::Ply | Format::Spz => Ok(None),
    }
}

/// Checks a file against the rules of its format and lists the issues, worst first. Codes for all formats:
///
/// | code | what is wrong |
/// |---|---|
/// | LT9001 | the file cannot be read as an asset |
/// | LT9002 | something is odd, but not a reason to refuse the file |
/// | LT9003 | the scene is not the one that the file was written with |
/// | LT9004 | the file is not of the format that its extension names; nothing else is checked |
///
/// # Errors
/// [`Error::Io`] and [`Error::TooLarge`] if the file itself cannot be read, [`Error::Unsupported`] for an unknown
/// extension. Problems inside it, or with its sidecar files, are issues.
pub fn validate_file(path: &Path) -> Result<Vec<Issue>> {
    let format = Format::of(path)?;
    match sniff::check(path, format) {
        Ok(()) => {}
        Err(Error::Invalid { what, .. }) => {
            return Ok(vec![Issue::new("LT9004", Severity::Error, "", &what)]);
        }
        Err(error) => return Err(error),
    }
    let limits = ReadLimits::default();
    let read = || read_file(path, limits.decoded_bytes);
    let mut issues = match format {
        Format::Ply => ply::validate(&read()?, path),
        Format::Spz => spz::validate(&read()?, path),
        Format::Glb | Format::Gltf => gltf::validate(&read()?, path),
        Format::Ltgs => ltgs::validate(&read()?, path),
        Format::Html => html::validate(&read()?, path),
        Format::Usda | Format::Usdc | Format::Usdz => usd::validate(path),
    };
    // A mesh of quads is not an asset; a .ltgs file has just been read as one, also in a page.
    if !matches!(format, Format::Ltgs | Format::Html) && !issues.iter().any(|i| i.code == gltf::QUADS_CODE) {
        check_reading(path, &limits, &mut issues);
    }
    issues.sort_by_key(|i| std::cmp::Reverse(i.severity));
    Ok(issues)
}

/// Issues that only show when the file is read as an asset.
fn check_reading(path: &Path, limits: &ReadLimits, issues: &mut Vec<Issue>) {
    match read_asset(path, limits) {
        Ok(contents) => {
            // Formats without textures have codes of their own for warnings.
            if Format::from_path(path).is_some_and(Format::keeps_textures) {
                issues
                    .extend(contents.warnings.iter().map(|w| Issue::new("LT9002", Severity::Warning, "", w)));
            }
            if contents.hash.is_some_and(|hash| hash != contents.asset.hash()) {
                let what =
                    "the scene is not the one that the file was written with: another program has changed it";
                issues.push(Issue::new("LT9003", Severity::Warning, "", what));
            }
        }
        // What the format's own issues have named: a sidecar file, or this.
        Err(Error::Io { .. }) if issues.iter().any(|i| i.severity == Severity::Error) => {}
        Err(error) if issues.iter().any(|i| i.message.contains(&error.text())) => {}
        Err(error) => issues.push(Issue::new("LT9001", Severity::Error, "", &error.text())),
    }
}

#[cfg(test)]
mod tests;
