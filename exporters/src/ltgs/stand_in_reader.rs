//! Reads the stand-in of a file.

use super::header::Header;
use super::read::Reader;
use super::stand_in::StandInSize;
use crate::asset::hash::hash_from_text;
use crate::{Error, ReadLimits, Result, SplatAsset};
use std::path::Path;
use twox_hash::XxHash3_64;

impl Reader<'_> {
    /// The bytes of the stand-in, a `.ltgs` file of its own; `None` if there is none.
    ///
    /// # Errors
    /// [`Error::Invalid`] if they are truncated or damaged.
    pub fn stand_in_file(&self) -> Result<Option<&[u8]>> {
        let Some(entry) = &self.meta.stand_in else { return Ok(None) };
        let invalid = |what: String| Error::invalid(&self.path, format!("stand-in: {what}"));
        let end = usize::try_from(entry.bytes).ok().and_then(|bytes| self.blocks_start().checked_add(bytes));
        let bytes = end.and_then(|end| self.bytes.get(self.blocks_start()..end));
        let bytes =
            bytes.ok_or_else(|| invalid(format!("{} bytes, of which some are missing", entry.bytes)))?;
        if hash_from_text(&entry.hash) != Some(XxHash3_64::oneshot(bytes)) {
            return Err(invalid("wrong checksum, damaged".to_owned()));
        }
        Ok(Some(bytes))
    }

    /// What the metadata say of the stand-in; `None` if there is none.
    pub(super) fn stand_in_size(&self) -> Option<StandInSize> {
        let entry = self.meta.stand_in.as_ref()?;
        let file = self.stand_in_file().ok().flatten();
        let header = file.and_then(|file| Header::decode(file, &self.path).ok());
        let splats = header.map(|header| header.num_splats.into());
        Some(StandInSize { bytes: entry.bytes, splats, until_bytes: entry.until_bytes })
    }

    /// The stand-in as a scene with the metadata of this file; `None` if there is none.
    ///
    /// # Errors
    /// As [`super::decode`].
    pub fn stand_in(&self, limits: &ReadLimits) -> Result<Option<SplatAsset>> {
        let Some(bytes) = self.stand_in_file()? else { return Ok(None) };
        let named = |error: Error| error.within("stand-in").at(&self.path);
        let nested =
            Reader::open(bytes, Path::new(""), &ReadLimits { layers: None, ..*limits }).map_err(named)?;
        if nested.meta.stand_in.is_some() || nested.num_splats() == 0 {
            let found = if nested.num_splats() == 0 { "no splats" } else { "a stand-in of its own" };
            return Err(named(invalid!("", "it has {found}")));
        }
        let mut asset = nested.decode().map_err(named)?.asset;
        self.meta.meta.clone().store(&mut asset);
        asset.validate().map_err(named)?;
        Ok(Some(asset))
    }
}
