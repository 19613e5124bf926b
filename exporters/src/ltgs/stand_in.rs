//! Stand-ins: a small scene at the beginning of a file, itself a `.ltgs` file, that is shown until enough of the file's own has
//! arrived.

use crate::asset::hash::text_from_hash;
use serde::{Deserialize, Serialize};
use twox_hash::XxHash3_64;

/// A stand-in to be written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct StandIn<'a> {
    /// A whole `.ltgs` file without a stand-in of its own.
    pub file: &'a [u8],
    /// Once this many bytes behind it have arrived, the scene itself looks better.
    pub until_bytes: u64,
}

impl StandIn<'_> {
    /// What the metadata say of it.
    pub(super) fn entry(&self) -> StandInEntry {
        StandInEntry {
            bytes: self.file.len() as u64,
            hash: text_from_hash(XxHash3_64::oneshot(self.file)),
            until_bytes: self.until_bytes,
        }
    }
}

/// A stand-in as the metadata describe it. Names of fields are part of the format.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "camelCase")]
pub struct StandInEntry {
    /// Its bytes, right behind the table of contents.
    pub bytes: u64,
    /// Their xxh3-64, 16 hexadecimal digits.
    pub hash: String,
    /// As [`StandIn::until_bytes`].
    pub until_bytes: u64,
}

/// The size of a file's stand-in.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct StandInSize {
    /// Its bytes in the file.
    pub bytes: u64,
    /// Its splats; `None` if its header is damaged.
    pub splats: Option<u64>,
    /// As [`StandIn::until_bytes`].
    pub until_bytes: u64,
}
