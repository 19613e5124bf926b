//! The formats, their extensions, qualities and the names of their files.

use crate::files::written::mesh_path;
use crate::{Error, Quality, Result, gltf, quoted, usd};
use std::path::{Path, PathBuf};

/// A file format in which assets are written and read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    /// glTF in one file.
    Glb,
    /// glTF with its arrays and atlas pages in sidecar files.
    Gltf,
    /// Our compact binary format.
    Ltgs,
    /// A web page that shows the scene: `.ltgs` inside HTML.
    Html,
    /// OpenUSD as text.
    Usda,
    /// OpenUSD, binary.
    Usdc,
    /// OpenUSD with its atlas pages in one file.
    Usdz,
    /// PLY of 3DGS and 2DGS.
    Ply,
    /// SPZ, versions 1 to 4.
    Spz,
}

impl Format {
    /// All formats, those that keep textures first.
    pub const ALL: [Self; 9] = [
        Self::Glb,
        Self::Gltf,
        Self::Ltgs,
        Self::Html,
        Self::Usda,
        Self::Usdc,
        Self::Usdz,
        Self::Ply,
        Self::Spz,
    ];

    /// Extension of the format's files, without the dot.
    pub fn extension(self) -> &'static str {
        match self {
            Self::Glb => "glb",
            Self::Gltf => "gltf",
            Self::Ltgs => "ltgs",
            Self::Html => "html",
            Self::Usda => "usda",
            Self::Usdc => "usdc",
            Self::Usdz => "usdz",
            Self::Ply => "ply",
            Self::Spz => "spz",
        }
    }

    /// The format that the extension of a file names.
    pub fn from_path(path: &Path) -> Option<Self> {
        let extension = path.extension()?.to_str()?.to_ascii_lowercase();
        Self::ALL.into_iter().find(|f| f.extension() == extension)
    }

    /// As [`Format::from_path`], but requires a known extension.
    ///
    /// # Errors
    /// [`Error::Unsupported`] listing the known extensions.
    pub fn of(path: &Path) -> Result<Self> {
        Self::from_path(path).ok_or_else(|| unknown_kind(path, &Self::all_named()))
    }

    /// All formats by their extensions, for messages.
    pub fn all_named() -> String {
        let extensions = Self::ALL.map(|f| format!(".{}", f.extension()));
        format!("an asset ({})", extensions.join(", "))
    }

    /// Whether the format keeps textures.
    pub fn keeps_textures(self) -> bool {
        !matches!(self, Self::Ply | Self::Spz)
    }

    /// The qualities that the format offers; none if it leaves no choice.
    pub fn qualities(self) -> &'static [Quality] {
        match self {
            Self::Ply | Self::Spz => &[],
            Self::Glb | Self::Gltf | Self::Ltgs | Self::Html => &Quality::ALL,
            Self::Usda | Self::Usdc | Self::Usdz => &[Quality::Lossless, Quality::Balanced],
        }
    }

    /// Whether files of this quality hold numbers rounded by [`crate::ltgs::Steps`]: `.ltgs` files, and pages and glTF files with
    /// one in them.
    pub fn has_steps(self, quality: Quality) -> bool {
        match self {
            Self::Ltgs | Self::Html => true,
            Self::Glb | Self::Gltf => gltf::embeds_file(quality),
            _ => false,
        }
    }

    /// Refuses early the names that writers would refuse because the file must hold them.
    ///
    /// # Errors
    /// [`Error::Invalid`] saying what a name must be.
    pub fn check_name(self, path: &Path) -> Result<()> {
        match self {
            Self::Gltf => gltf::stem(path).map(drop),
            Self::Usda | Self::Usdc | Self::Usdz => usd::stem(path).map(drop),
            Self::Glb | Self::Ltgs | Self::Html | Self::Ply | Self::Spz => Ok(()),
        }
    }

    /// Refuses a quality that the format does not offer. `path` is only for messages.
    ///
    /// # Errors
    /// [`Error::Unsupported`] listing those that it offers.
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
    /// Sidecar files that writing `path` may make, known before anything is written: of atlas pages the first, under
    /// either of its names; in USD the folder of images. For refusing clashes early;
    /// [`Staged::publish`](crate::Staged::publish) makes sure that nothing is replaced.
    pub fn sidecar_files(self, path: &Path, mesh: bool) -> Vec<PathBuf> {
        let stem = path.file_stem().unwrap_or_default().to_string_lossy();
        let mut names = match self {
            Self::Gltf => {
                let pages = ["png", "exr"].map(|extension| gltf::page_name(&stem, 0, extension));
                [gltf::arrays_name(&stem)].into_iter().chain(pages).collect()
            }
            Self::Usda | Self::Usdc => vec![usd::textures_name(&stem, self.extension())],
            Self::Glb | Self::Ltgs | Self::Html | Self::Usdz | Self::Ply | Self::Spz => Vec::new(),
        };
        let mut files: Vec<PathBuf> = names.drain(..).map(|name| path.with_file_name(name)).collect();
        if mesh && matches!(self, Self::Glb | Self::Gltf) {
            files.push(mesh_path(path));
        }
        files
    }
}

/// What to say of a file whose name tells no kind that can be used in its place; `expected` are those that can.
pub fn unknown_kind(path: &Path, expected: &str) -> Error {
    let found = match path.extension() {
        Some(extension) => format!("{} file", quoted(&format!(".{}", extension.to_string_lossy()))),
        None if path.is_dir() => "folder".to_owned(),
        None => "file without an extension".to_owned(),
    };
    unsupported!(path, "a {found} cannot be used here; expected {expected}")
}
