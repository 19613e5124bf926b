//! Formats by their files' extensions: one way in and one way out for all of them.

use crate::atlas::PAGE_SIDE;
use crate::{
    Contents, Error, Issue, Quality, ReadLimits, Result, Severity, SplatAsset, gltf, ltgs, ply, spz, usd,
    write_atomically,
};
use std::path::{Path, PathBuf};

/// A format of files.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    /// glTF in one file.
    Glb,
    /// glTF with its arrays and pages beside it.
    Gltf,
    /// Our compact binary format.
    Ltgs,
    /// OpenUSD as text.
    Usda,
    /// OpenUSD, binary.
    Usdc,
    /// OpenUSD with its pages in one file.
    Usdz,
    /// PLY of 3DGS and 2DGS.
    Ply,
    /// SPZ version 4.
    Spz,
}

/// What to write.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WriteOptions {
    /// Profile of quality, where the format has any.
    pub quality: Quality,
    /// Also a mesh of textured quads for programs that know no splats: a file of its own beside glTF, a variant in USD.
    pub mesh: bool,
    /// Sizes of steps of lossy `.ltgs` files; `None`: those that the quality begins with.
    pub steps: Option<ltgs::Steps>,
}

/// What was written.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Written {
    /// The files, the one that was asked for first.
    pub files: Vec<PathBuf>,
    /// Their size.
    pub bytes: u64,
    /// What a user should know.
    pub notes: Vec<String>,
}

impl Format {
    /// All.
    pub const ALL: [Self; 8] =
        [Self::Glb, Self::Gltf, Self::Ltgs, Self::Usda, Self::Usdc, Self::Usdz, Self::Ply, Self::Spz];

    /// Extension of its files.
    pub fn extension(self) -> &'static str {
        match self {
            Self::Glb => "glb",
            Self::Gltf => "gltf",
            Self::Ltgs => "ltgs",
            Self::Usda => "usda",
            Self::Usdc => "usdc",
            Self::Usdz => "usdz",
            Self::Ply => "ply",
            Self::Spz => "spz",
        }
    }

    /// The format that a file's name means.
    pub fn from_path(path: &Path) -> Option<Self> {
        let extension = path.extension()?.to_str()?.to_ascii_lowercase();
        Self::ALL.into_iter().find(|f| f.extension() == extension)
    }

    /// As [`Format::from_path`].
    ///
    /// # Errors
    /// [`Error::Unsupported`] with the extensions that are known.
    pub fn of(path: &Path) -> Result<Self> {
        Self::from_path(path).ok_or_else(|| {
            let known: Vec<String> = Self::ALL.iter().map(|f| format!(".{}", f.extension())).collect();
            let found = path.extension().unwrap_or_default().to_string_lossy();
            Error::unsupported(
                path,
                format!("no format has the extension {found:?}; known: {}", known.join(", ")),
            )
        })
    }

    /// Whether textures are kept.
    pub fn keeps_textures(self) -> bool {
        !matches!(self, Self::Ply | Self::Spz)
    }

    /// Profiles of quality; none: the format has one form only.
    pub fn qualities(self) -> &'static [Quality] {
        match self {
            Self::Ply | Self::Spz => &[],
            Self::Ltgs => &Quality::ALL,
            Self::Glb | Self::Gltf | Self::Usda | Self::Usdc | Self::Usdz => {
                &[Quality::Lossless, Quality::Balanced]
            }
        }
    }
}

impl Format {
    /// Refuses a quality that the format has not. `path` is only for messages.
    ///
    /// # Errors
    /// [`Error::Unsupported`] with those that it has.
    pub fn check_quality(self, quality: Quality, path: &Path) -> Result<()> {
        let known = self.qualities();
        if known.is_empty() || known.contains(&quality) {
            return Ok(());
        }
        let names: Vec<&str> = known.iter().map(|q| q.name()).collect();
        let what = format!("quality {:?}: .{} has {}", quality.name(), self.extension(), names.join(" and "));
        Err(Error::unsupported(path, what))
    }
}

/// Writes an asset in the format that the file's name means. Nothing is left behind if it fails.
///
/// # Errors
/// [`Error::Unsupported`] for an unknown extension or a quality that the format has not, else as the format's writer.
pub fn write_asset(path: &Path, asset: &SplatAsset, options: &WriteOptions) -> Result<Written> {
    let format = Format::of(path)?;
    format.check_quality(options.quality, path)?;
    let mut written = Written { files: vec![path.to_owned()], ..Written::default() };
    let quality = options.quality;
    match format {
        Format::Glb | Format::Gltf => {
            let gltf_options = gltf::GltfOptions { quality, page_side: PAGE_SIDE };
            written.files = gltf::write_gltf(path, asset, &gltf_options)?;
            if options.mesh {
                let (file, note) = write_mesh(path, asset)?;
                written.files.push(file);
                written.notes.extend(note);
            }
        }
        Format::Ltgs => {
            let ltgs_options = ltgs::LtgsOptions { quality, steps: options.steps };
            let bytes = ltgs::encode(asset, &ltgs_options).map_err(|e| e.at(path))?;
            write_atomically(path, &bytes).map_err(|e| Error::io(path, e))?;
        }
        Format::Usda | Format::Usdc | Format::Usdz => {
            let usd_options = usd::UsdOptions { quality, page_side: PAGE_SIDE, mesh: options.mesh };
            written.files = usd::write_usd(path, asset, &usd_options)?;
        }
        Format::Ply => {
            let summary = ply::write_ply(path, asset, &ply::PlyOptions::default())?;
            written.notes.extend(far_out(summary.position_error_texels));
        }
        Format::Spz => {
            let summary = spz::write_spz(path, asset)?;
            written.notes.extend(far_out(summary.position_error_texels));
            if summary.clamped_scales > 0 {
                written.notes.push(format!(
                    "{} splats are smaller or larger than SPZ can say (4.5e-5 to 380 units); see --scale",
                    summary.clamped_scales
                ));
            }
        }
    }
    for file in &written.files {
        written.bytes += std::fs::metadata(file).map_err(|e| Error::io(file, e))?.len();
    }
    Ok(written)
}

fn read(path: &Path) -> Result<Vec<u8>> {
    std::fs::read(path).map_err(|e| Error::io(path, e))
}

/// The mesh of a glTF file, beside it.
fn write_mesh(path: &Path, asset: &SplatAsset) -> Result<(PathBuf, Option<String>)> {
    let file = path.with_extension("mesh.glb");
    let (bytes, summary) =
        gltf::encode_mesh(asset, &gltf::MeshOptions::default()).map_err(|e| e.at(&file))?;
    write_atomically(&file, &bytes).map_err(|e| Error::io(&file, e))?;
    let note = (summary.omitted > 0).then(|| {
        format!("the mesh shows the {} most visible splats, {} are left out", summary.quads, summary.omitted)
    });
    Ok((file, note))
}

/// A note where rounding moves splats by more than a tenth of a texel.
fn far_out(texels: f64) -> Option<String> {
    (texels > 0.1).then(|| format!("positions are rounded by up to {texels:.2} texels: the capture lies far from its origin, or is large"))
}

/// Reads an asset in the format that the file's name means.
///
/// # Errors
/// [`Error::Unsupported`] for an unknown extension, else as the format's reader.
pub fn read_asset(path: &Path, limits: &ReadLimits) -> Result<Contents> {
    match Format::of(path)? {
        Format::Ply => {
            let read = ply::read_ply(path, limits)?;
            let thick = read.num_thick;
            Ok(Contents {
                asset: read.asset,
                format: if read.is_surfel { "PLY of 2DGS" } else { "PLY of 3DGS" }.to_owned(),
                quality: None,
                hash: None,
                sections: read.sections,
                warnings: (thick > 0)
                    .then(|| format!("{thick} splats are no discs: their thinnest axis is left out"))
                    .into_iter()
                    .collect(),
            })
        }
        Format::Spz => spz::read_spz(path, limits),
        Format::Glb | Format::Gltf => gltf::read_gltf(path, limits),
        Format::Ltgs => ltgs::decode(&read(path)?, path, limits),
        Format::Usda | Format::Usdc | Format::Usdz => usd::read_usd(path, limits),
    }
}

/// What a program gets from a file that knows splats, but no textures: the attributes of `KHR_gaussian_splatting`, or the
/// prim of type `ParticleField3DGaussianSplat`, as they stand in this file. Frame and cameras are those of [`read_asset`].
/// `None`: the format has no textures that could be missed, or nobody else reads it, or there is no such prim.
///
/// # Errors
/// [`Error::Unsupported`] for an unknown extension, else as the format's reader.
pub fn read_fallback(path: &Path, limits: &ReadLimits) -> Result<Option<SplatAsset>> {
    match Format::of(path)? {
        Format::Glb | Format::Gltf => gltf::read_fallback(path, limits).map(Some),
        Format::Usda | Format::Usdc | Format::Usdz => usd::read_fallback(path, limits),
        Format::Ltgs | Format::Ply | Format::Spz => Ok(None),
    }
}

/// Checks a file against the rules of its format, worst first.
///
/// # Errors
/// [`Error::Io`] if it cannot be read, [`Error::Unsupported`] for an unknown extension. What is wrong inside is an issue.
pub fn validate_file(path: &Path) -> Result<Vec<Issue>> {
    let mut issues = match Format::of(path)? {
        Format::Ply => ply::validate(&read(path)?, path),
        Format::Spz => spz::validate(&read(path)?, path),
        Format::Glb | Format::Gltf => gltf::validate(&read(path)?, path),
        Format::Ltgs => ltgs::validate(&read(path)?, path),
        Format::Usda | Format::Usdc | Format::Usdz => usd::validate(path),
    };
    match read_asset(path, &ReadLimits::default()) {
        Ok(contents) => {
            // Rules of the plain formats say the same with numbers of their own.
            if Format::of(path)?.keeps_textures() {
                issues
                    .extend(contents.warnings.iter().map(|w| Issue::new("LT9002", Severity::Warning, "", w)));
            }
            if contents.hash.is_some_and(|hash| hash != contents.asset.hash()) {
                let what =
                    "the scene is not the one that the file was written with: another program has changed it";
                issues.push(Issue::new("LT9003", Severity::Warning, "", what));
            }
        }
        // Files beside it that are missing are wrong with it.
        Err(error @ Error::Io { .. }) if matches!(&error, Error::Io { path: p, .. } if p == path) => {
            return Err(error);
        }
        Err(error) => issues.push(Issue::new("LT9001", Severity::Error, "", &error.to_string())),
    }
    issues.sort_by_key(|i| std::cmp::Reverse(i.severity));
    Ok(issues)
}
