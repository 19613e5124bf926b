//! What readers return besides the asset, alike for all formats.

use crate::{Quality, SplatAsset};

/// What a part of a file describes; sizes are given per splat, per texel or as they are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Describes {
    /// Splats.
    Splats,
    /// Texels.
    Texels,
    /// Everything else: headers, tables, metadata, fallbacks.
    Other,
}

/// A part of a file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Section {
    /// Name, the same attribute under the same name in all formats where it is stored apart: `positions`, `rotations`,
    /// `scales`, `opacities`, `sh0`, `sh_rest`, `maps`, `texels`, `metadata`, `fallback`, ...
    pub name: String,
    /// Bytes in the file.
    pub bytes: u64,
    /// What it describes.
    pub describes: Describes,
}

/// A file that was read.
#[derive(Clone, Debug, PartialEq)]
pub struct Contents {
    /// The scene.
    pub asset: SplatAsset,
    /// Name of the format with its version.
    pub format: String,
    /// As the file says; `None` where the format has no such thing.
    pub quality: Option<Quality>,
    /// [`SplatAsset::hash`] of what the file should hold, as it says.
    pub hash: Option<u64>,
    /// Parts of the file; their sum is the file's size.
    pub sections: Vec<Section>,
    /// What is odd about the file but no reason to refuse it.
    pub warnings: Vec<String>,
}

/// What a reader may use.
///
/// Sizes that a file states are compared with it before anything is allocated for them. A file of a few bytes gets
/// less than a large one: see [`ReadLimits::of_file`]. What readers take besides, as shares of the file:
///
/// | format | what small files can blow up | bound |
/// |---|---|---|
/// | `.ltgs` | neutral texels (zstd, 1 : 20,000) | `of_file`; chunks and the whole at a time: twice that at worst |
/// | glTF | neutral pages (PNG, 1 : 1,040; 15 bytes a texel) | `of_file`, over all pages |
/// | glTF | JSON of empty objects (1 : 250) | 131,072 objects and 2,097,152 values |
/// | USD | pages, as glTF | `of_file`, over all pages |
/// | USD text | prims, properties, entries (1 : 45) and their paths | `of_file`, counted as they are read |
/// | USD binary | tables (LZ4, 1 : 255), paths, values | 2^20 entries; values 16 times the file and 32 MiB |
/// | USD package | entries of its table | 1,000 |
/// | PLY | properties of a byte (1 : 5), header | the file's own size; 17 MiB and 1,024 names |
/// | SPZ | splats of zeros (zstd) | streams 80 times the file, at least 16 MiB; splats four times that |
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ReadLimits {
    /// Most bytes that a file may decode to, and most that it may have itself.
    pub decoded_bytes: u64,
}

impl Default for ReadLimits {
    /// 4 GiB: some ten million splats of SH degree 3, or a million of them with 300 million texels.
    fn default() -> Self {
        Self { decoded_bytes: 4 << 30 }
    }
}

/// How bad an issue is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Severity {
    /// Allowed, but worth knowing.
    Info,
    /// Some programs will not show the file as meant.
    Warning,
    /// The file breaks a rule.
    Error,
}

/// Something that a validation found.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Issue {
    /// Number that stays the same over versions: `LT1xxx` glTF, `LT2xxx` USD, `LT3xxx` `.ltgs`, `LT4xxx` PLY and SPZ,
    /// `LT9xxx` any.
    pub code: &'static str,
    /// How bad.
    pub severity: Severity,
    /// Where in the file: a JSON pointer, a path of prims, a chunk.
    pub place: String,
    /// What was found, what was expected.
    pub message: String,
}

impl Issue {
    /// An issue.
    pub fn new(code: &'static str, severity: Severity, place: &str, message: &str) -> Self {
        Self { code, severity, place: place.to_owned(), message: message.to_owned() }
    }
}
