//! The metadata entry and the checksum of a checkpoint.

use safetensors::Dtype;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Identifier of the layout; a change that old programs cannot read raises the number.
pub const FORMAT: &str = "litetex-checkpoint/16";
/// Key of the only metadata entry.
pub(super) const METADATA_KEY: &str = "litetex";
/// Name of the tensor that holds the CRC-32.
pub(super) const CHECKSUM: &str = "checksum";

/// JSON object of the metadata entry.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Header {
    pub format: String,
    pub version: String,
    pub strings: BTreeMap<String, String>,
}

/// CRC-32 over the header and all other tensors, in the order of their names.
pub(super) struct Checksum(crc32fast::Hasher);

impl Checksum {
    pub fn new(header: &str) -> Self {
        let mut hasher = crc32fast::Hasher::new();
        hasher.update(header.as_bytes());
        Self(hasher)
    }

    pub fn add(&mut self, name: &str, dtype: Dtype, shape: &[usize], bytes: &[u8]) {
        self.0.update(format!("{name} {dtype:?} {shape:?}").as_bytes());
        self.0.update(bytes);
    }

    pub fn finish(self) -> u32 {
        self.0.finalize()
    }
}
