//! The metadata of a file as JSON: all of the asset except its arrays, and how numbers were rounded.

use super::integers::{compress, expand};
use super::stand_in::StandInEntry;
use super::steps::Quantiser;
use crate::Result;
use crate::asset::hash::hash_from_text;
use crate::asset::meta::{META_BYTES_MAX, Meta};
use serde::{Deserialize, Serialize};

/// Words that metadata consist of, and numbers like theirs: the dictionary with which zstd compresses them. Part of the format.
const WORDS: &[u8] = include_bytes!("../../schema/ltgs-words.txt");

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
    /// A small scene that is shown first.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub stand_in: Option<StandInEntry>,
    /// The object that all formats share.
    pub meta: Meta,
}

impl FileMeta {
    /// Returns the bytes in the file and the length of the text.
    ///
    /// # Errors
    /// [`crate::Error::TooLarge`] for more than 16 MiB of text, [`crate::Error::Invalid`] if zstd fails.
    pub fn encode(&self) -> Result<(Vec<u8>, usize)> {
        let text = serde_json::to_vec(self).map_err(|e| invalid!("", "metadata: {e}"))?;
        let length = text.len();
        if length > META_BYTES_MAX {
            return Err(too_large!("", "metadata: {length} bytes, at most {META_BYTES_MAX}"));
        }
        let coded = compress(&text, 19, WORDS).ok_or_else(|| invalid!("", "metadata: zstd failed"))?;
        Ok((coded, length))
    }

    /// Decodes the bytes in the file.
    ///
    /// # Errors
    /// [`crate::Error::Invalid`].
    pub fn decode(bytes: &[u8], text_bytes: usize) -> Result<Self> {
        let text = expand(bytes, text_bytes, WORDS)?;
        let meta: Self = serde_json::from_slice(&text).map_err(|e| invalid!("", "metadata: {e}"))?;
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_specification_states_the_words() {
        let specification = include_str!("../../schema/ltgs.md");
        let stated = |words: &[u8]| {
            let hash = twox_hash::XxHash3_64::oneshot(words);
            let bytes = format!("the {},{:03} bytes", words.len() / 1000, words.len() % 1000);
            specification.contains(&bytes) && specification.contains(&format!("xxh3-64 `{hash:016x}`"))
        };
        assert!(stated(WORDS), "{} bytes", WORDS.len());
        assert!(!stated(&WORDS[1..]), "negative control");
    }
}
