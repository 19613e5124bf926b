//! Formats by their files' extensions: one way in and one way out for all of them.

use crate::atlas::PAGE_SIDE;
use crate::file::read_file;
use crate::staging::SideFile;
use crate::{
    Contents, Error, Issue, Quality, ReadLimits, Result, Severity, SplatAsset, Staged, gltf, ltgs, ply,
    sniff, spz, usd,
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
pub struct WriteOptions<'a> {
    /// Profile of quality, where the format has any.
    pub quality: Quality,
    /// Also a mesh of textured quads for programs that know no splats: a file of its own beside glTF, a variant in USD.
    pub mesh: bool,
    /// Sizes of steps of lossy `.ltgs` files; `None`: those that the quality begins with.
    pub steps: Option<ltgs::Steps>,
    /// Exponents of the splats' steps in lossy `.ltgs` files; empty: all zero. `[n]`
    pub exponents: &'a [i8],
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

    /// Refuses a name that the file itself could not hold, as the writers would.
    ///
    /// # Errors
    /// [`Error::Invalid`] with what it must be.
    pub fn check_name(self, path: &Path) -> Result<()> {
        match self {
            Self::Gltf => gltf::stem(path).map(drop),
            Self::Usda | Self::Usdc | Self::Usdz => usd::stem(path).map(drop),
            Self::Glb | Self::Ltgs | Self::Ply | Self::Spz => Ok(()),
        }
    }

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

impl Format {
    /// What writing `path` may take beside it, known before anything is written: files, of pages the first by either
    /// of its names, and in USD the folder of images. Programs refuse clashes with it early; that nothing is replaced
    /// is made sure by [`Staged::publish`].
    pub fn side_files(self, path: &Path, mesh: bool) -> Vec<PathBuf> {
        let stem = path.file_stem().unwrap_or_default().to_string_lossy();
        let mut names = match self {
            Self::Gltf => {
                let pages = ["png", "exr"].map(|extension| gltf::page_name(&stem, 0, extension));
                [gltf::arrays_name(&stem)].into_iter().chain(pages).collect()
            }
            Self::Usda | Self::Usdc => vec![usd::textures_name(&stem, self.extension())],
            Self::Glb | Self::Ltgs | Self::Usdz | Self::Ply | Self::Spz => Vec::new(),
        };
        let mut files: Vec<PathBuf> = names.drain(..).map(|name| path.with_file_name(name)).collect();
        if mesh && matches!(self, Self::Glb | Self::Gltf) {
            files.push(mesh_path(path));
        }
        files
    }
}

/// Writes an asset in the format that the file's name means, and replaces what was there: [`stage_asset`] and
/// [`Staged::publish`] at once. If it fails, nothing new stays and older files are as they were.
///
/// # Errors
/// As those.
pub fn write_asset(path: &Path, asset: &SplatAsset, options: &WriteOptions<'_>) -> Result<Written> {
    stage_asset(path, asset, options)?.publish(true)
}

/// Writes an asset in the format that the file's name means into a temporary folder beside its place, where it can be
/// read and proven before it replaces anything.
///
/// # Errors
/// [`Error::Unsupported`] for an unknown extension or a quality that the format has not, [`Error::Io`], else as the
/// format's writer.
pub fn stage_asset(path: &Path, asset: &SplatAsset, options: &WriteOptions<'_>) -> Result<Staged> {
    let format = Format::of(path)?;
    format.check_quality(options.quality, path)?;
    let encoded = encode(format, path, asset, options)?;
    let mut staged = Staged::new(path, encoded.root, encoded.side)?;
    staged.add_notes(encoded.notes);
    Ok(staged)
}

/// The files of an asset before they are written.
#[derive(Default)]
struct Encoded {
    root: Vec<u8>,
    side: Vec<SideFile>,
    notes: Vec<String>,
}

fn encode(format: Format, path: &Path, asset: &SplatAsset, options: &WriteOptions<'_>) -> Result<Encoded> {
    let mut encoded = Encoded::default();
    let quality = options.quality;
    match format {
        Format::Glb | Format::Gltf => {
            let gltf_options = gltf::GltfOptions { quality, page_side: PAGE_SIDE };
            (encoded.root, encoded.side) = gltf::encode_files(path, asset, &gltf_options)?;
            if options.mesh {
                add_mesh(&mut encoded, &mesh_path(path), asset)?;
            }
        }
        Format::Ltgs => {
            let ltgs_options =
                ltgs::LtgsOptions { quality, steps: options.steps, exponents: options.exponents };
            encoded.root = ltgs::encode(asset, &ltgs_options).map_err(|e| e.at(path))?;
        }
        Format::Usda | Format::Usdc | Format::Usdz => {
            let usd_options = usd::UsdOptions { quality, page_side: PAGE_SIDE, mesh: options.mesh };
            (encoded.root, encoded.side) = usd::encode_files(path, asset, &usd_options)?;
        }
        Format::Ply => {
            let (bytes, summary) =
                ply::encode_ply(asset, &ply::PlyOptions::default()).map_err(|e| e.at(path))?;
            encoded.root = bytes;
            encoded.notes.extend(far_out(summary.position_error_texels));
        }
        Format::Spz => {
            let (bytes, summary) = spz::encode_spz(asset).map_err(|e| e.at(path))?;
            encoded.root = bytes;
            encoded.notes.extend(far_out(summary.position_error_texels));
            if summary.clamped_scales > 0 {
                encoded.notes.push(format!(
                    "{} splats are smaller or larger than SPZ can say (4.5e-5 to 380 units); see --scale",
                    summary.clamped_scales
                ));
            }
        }
    }
    Ok(encoded)
}

/// The mesh beside a glTF file.
fn mesh_path(path: &Path) -> PathBuf {
    path.with_extension("mesh.glb")
}

fn add_mesh(encoded: &mut Encoded, file: &Path, asset: &SplatAsset) -> Result<()> {
    let (bytes, summary) = gltf::encode_mesh(asset, &gltf::MeshOptions::default()).map_err(|e| e.at(file))?;
    encoded.side.push((file.file_name().unwrap_or_default().to_owned(), bytes));
    if summary.omitted > 0 {
        encoded.notes.push(format!(
            "the mesh shows the {} most visible splats, {} are left out",
            summary.quads, summary.omitted
        ));
    }
    Ok(())
}

/// A note where rounding moves splats by more than a tenth of a texel.
fn far_out(texels: f64) -> Option<String> {
    (texels > 0.1).then(|| format!("positions are rounded by up to {texels:.2} texels: the capture lies far from its origin, or is large"))
}

/// Reads an asset in the format that the file's name means.
///
/// # Errors
/// [`Error::Unsupported`] for an unknown extension, [`Error::Invalid`] for a file that begins as another format does,
/// [`Error::TooLarge`] for one of more bytes than the limits allow to decode, else as the format's reader.
pub fn read_asset(path: &Path, limits: &ReadLimits) -> Result<Contents> {
    let format = Format::of(path)?;
    sniff::check(path, format)?;
    match format {
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
        Format::Ltgs => ltgs::decode(&read_file(path, limits.decoded_bytes)?, path, limits),
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

/// Checks a file against the rules of its format, worst first. Codes that are not the format's own:
///
/// | code | what is wrong |
/// |---|---|
/// | LT9001 | the file cannot be read as an asset |
/// | LT9002 | something is odd, but no reason to refuse the file |
/// | LT9003 | the scene is not the one that the file was written with |
/// | LT9004 | the file is of another format than its name says; nothing else is checked |
///
/// # Errors
/// [`Error::Io`] and [`Error::TooLarge`] if the file itself cannot be read, [`Error::Unsupported`] for an unknown
/// extension. What is wrong inside, or with the files that it names, is an issue.
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
        Format::Usda | Format::Usdc | Format::Usdz => usd::validate(path),
    };
    // It is no asset and need not be one.
    if !issues.iter().any(|i| i.code == gltf::QUADS_CODE) {
        check_reading(path, &limits, &mut issues);
    }
    issues.sort_by_key(|i| std::cmp::Reverse(i.severity));
    Ok(issues)
}

/// What shows when the file is read as an asset.
fn check_reading(path: &Path, limits: &ReadLimits, issues: &mut Vec<Issue>) {
    match read_asset(path, limits) {
        Ok(contents) => {
            // Rules of the plain formats say the same with numbers of their own.
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
        // A file beside it: the format's own rules name it.
        Err(Error::Io { .. }) if issues.iter().any(|i| i.severity == Severity::Error) => {}
        Err(error) => issues.push(Issue::new("LT9001", Severity::Error, "", &error.to_string())),
    }
}

#[cfg(test)]
mod tests;
