//! What readers and validators return besides the asset, the same for all formats.

use crate::ltgs::StandInSize;
use crate::{Quality, SplatAsset, text};

/// What a part of a file describes: reports give sizes per splat, per texel or as they are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Describes {
    /// Attributes of splats.
    Splats,
    /// Texels of maps.
    Texels,
    /// Anything else: headers, tables, metadata, fallbacks.
    Other,
}

/// A part of a file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Section {
    /// Name. An attribute that is stored apart has the same name in all formats: `positions`, `rotations`, `scales`,
    /// `opacities`, `sh0`, `sh_rest`, `sh_degrees`, `maps`, `texels`, `metadata`, `fallback`, ...
    pub name: String,
    /// Its bytes in the file.
    pub bytes: u64,
    /// What the part describes.
    pub describes: Describes,
}

impl Section {
    /// Adds bytes to the part with a name, made if need be.
    pub(crate) fn add(parts: &mut Vec<Self>, name: &str, describes: Describes, bytes: u64) {
        match parts.iter_mut().find(|part| part.name == name) {
            Some(part) => part.bytes += bytes,
            None if bytes > 0 => parts.push(Self { name: name.to_owned(), bytes, describes }),
            None => {}
        }
    }
}

/// A layer of a `.ltgs` file.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct LayerSize {
    /// Its splats.
    pub splats: u64,
    /// Texels of their maps.
    pub texels: u64,
    /// Bytes of its blocks of geometry, SH of degree 0 included.
    pub geometry_bytes: u64,
    /// Bytes of its blocks of the other SH.
    pub sh_bytes: u64,
    /// Bytes of its blocks of texels.
    pub texel_bytes: u64,
}

/// A file as read.
#[derive(Clone, Debug, PartialEq)]
pub struct Contents {
    /// The scene of the file.
    pub asset: SplatAsset,
    /// Name of the format with its version.
    pub format: String,
    /// Quality that the file states; `None` if the format has none.
    pub quality: Option<Quality>,
    /// [`SplatAsset::hash`] that the file states; differs from that of `asset` if values were changed. `None` if layers were left
    /// out.
    pub hash: Option<u64>,
    /// Parts of the file; their sum is the file's size.
    pub sections: Vec<Section>,
    /// Layers of the file, those that were left out included; empty if the format has none.
    pub layers: Vec<LayerSize>,
    /// The stand-in of a `.ltgs` file, if it has one.
    pub stand_in: Option<StandInSize>,
    /// What is odd about the file, but not a reason to refuse it.
    pub warnings: Vec<String>,
}

/// How bad an issue is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Severity {
    /// Allowed, but good to know.
    Info,
    /// Some programs will not show the file as meant.
    Warning,
    /// The file breaks a rule.
    Error,
}

/// A problem that validation found.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Issue {
    /// A number that stays the same over versions: `LT1xxx` glTF, `LT2xxx` USD, `LT3xxx` `.ltgs`, `LT4xxx` PLY and SPZ,
    /// `LT5xxx` HTML, `LT9xxx` any format.
    pub code: &'static str,
    /// How bad it is.
    pub severity: Severity,
    /// Where in the file: a JSON pointer, a prim path, a chunk; empty for the file as a whole.
    pub place: String,
    /// What was found and what was expected.
    pub message: String,
}

impl Issue {
    /// Makes an issue; place and message are cut and escaped as those of errors are.
    pub fn new(code: &'static str, severity: Severity, place: &str, message: &str) -> Self {
        let [place, message] = [place, message].map(|t| text::message(t.to_owned()));
        Self { code, severity, place, message }
    }
}

/// Most issues of a file; a hostile one has no end of them.
const ISSUES_MAX: usize = 1000;

/// Splats that are listed per rule; one more issue counts the rest.
const LISTED_MAX: usize = 3;

/// The issues of a file found so far.
#[derive(Default)]
pub(crate) struct Issues {
    pub(crate) list: Vec<Issue>,
}

impl Issues {
    pub(crate) fn push(
        &mut self,
        code: &'static str,
        severity: Severity,
        place: &str,
        message: impl AsRef<str>,
    ) {
        if self.list.len() < ISSUES_MAX {
            self.list.push(Issue::new(code, severity, place, message.as_ref()));
        }
    }

    pub(crate) fn error(&mut self, code: &'static str, place: &str, message: impl AsRef<str>) {
        self.push(code, Severity::Error, place, message);
    }

    pub(crate) fn warning(&mut self, code: &'static str, place: &str, message: impl AsRef<str>) {
        self.push(code, Severity::Warning, place, message);
    }

    pub(crate) fn info(&mut self, code: &'static str, place: &str, message: impl AsRef<str>) {
        self.push(code, Severity::Info, place, message);
    }

    /// Offences of many splats against one rule: the first few, then how many more.
    pub(crate) fn many(
        &mut self,
        code: &'static str,
        place: &str,
        mut offences: impl Iterator<Item = String>,
    ) {
        for offence in offences.by_ref().take(LISTED_MAX) {
            self.error(code, place, offence);
        }
        let others = offences.count();
        if others > 0 {
            self.error(code, place, format!("and {others} more"));
        }
    }

    pub(crate) fn has_errors(&self) -> bool {
        self.list.iter().any(|i| i.severity == Severity::Error)
    }
}
