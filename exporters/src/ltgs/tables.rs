//! The metadata of a file as JSON: all of the asset except its arrays, and how numbers were rounded.

use super::integers::{compress, expand};
use super::steps::Quantiser;
use crate::Result;
use crate::asset::hash::hash_from_text;
use crate::asset::meta::{META_BYTES_MAX, Meta};
use serde::{Deserialize, Serialize};

/// Texts of this length or more are compressed.
const COMPRESSED_FROM_BYTES: usize = 1024;

/// Order of the splats in a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Order {
    /// The order of the asset.
    Given,
    /// By layer, then along a Morton curve.
    Morton,
}

/// The object. Names of fields are part of the format; unknown fields are ignored.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "camelCase")]
pub struct FileMeta {
    /// Name of the quality, as in the header.
    pub quality: String,
    /// Order of the splats.
    pub order: Order,
    /// [`crate::SplatAsset::hash`] of the decoded asset, 16 hexadecimal digits.
    pub hash: String,
    /// Steps and grid; absent in lossless files.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub quantiser: Option<Quantiser>,
    /// The object that all formats share.
    pub meta: Meta,
}

impl FileMeta {
    /// Returns the bytes in the file and the length of the text, which are equal if it is not compressed.
    ///
    /// # Errors
    /// [`crate::Error::TooLarge`] for more than 16 MiB of text.
    pub fn encode(&self) -> Result<(Vec<u8>, usize)> {
        let text = serde_json::to_vec(self).map_err(|e| invalid!("", "metadata: {e}"))?;
        let length = text.len();
        if length > META_BYTES_MAX {
            return Err(too_large!("", "metadata: {length} bytes, at most {META_BYTES_MAX}"));
        }
        let compressed = (length >= COMPRESSED_FROM_BYTES).then(|| compress(&text, 19)).flatten();
        Ok((compressed.filter(|c| c.len() < length).unwrap_or(text), length))
    }

    /// Decodes the bytes in the file.
    ///
    /// # Errors
    /// [`crate::Error::Invalid`].
    pub fn decode(bytes: &[u8], is_compressed: bool, text_bytes: usize) -> Result<Self> {
        let expanded;
        let text = if is_compressed {
            expanded = expand(bytes, text_bytes)?;
            &expanded
        } else {
            bytes
        };
        let meta: Self = serde_json::from_slice(text).map_err(|e| invalid!("", "metadata: {e}"))?;
        if let Some(quantiser) = &meta.quantiser {
            quantiser.validate()?;
        }
        Ok(meta)
    }

    /// The hash as a number.
    pub fn hash(&self) -> Option<u64> {
        hash_from_text(&self.hash)
    }
}
