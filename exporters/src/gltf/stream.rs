//! A whole `.ltgs` file in a buffer view, in place of exact attributes and atlas pages: what quality `tiny` is in glTF. The
//! attributes are small then, and only for viewers without our extension.

use super::extension::{EXTENSION, Stream, TextureExtension, VERSION};
use super::loaded::Loaded;
use crate::asset::meta::Meta;
use crate::{Contents, Describes, Error, Quality, Result, Section, ltgs, quoted};

/// Whether files of this quality hold an embedded file in place of arrays and pages.
pub fn embeds_file(quality: Quality) -> bool {
    matches!(quality, Quality::Tiny | Quality::Custom)
}

/// The only codec.
pub const MIME_LTGS: &str = "application/vnd.litetex.ltgs";

impl Stream {
    /// Bytes of the stream.
    ///
    /// # Errors
    /// [`Error::Unsupported`] for another codec, [`Error::Invalid`] if it does not lie in its buffer.
    pub fn bytes<'a>(&self, loaded: &'a Loaded<'_>) -> Result<&'a [u8]> {
        if self.mime_type != MIME_LTGS {
            let what =
                format!("{EXTENSION}: stream of {}, supported: \"{MIME_LTGS}\"", quoted(&self.mime_type));
            return Err(Error::unsupported(loaded.path, what));
        }
        Ok(loaded.view(self.buffer_view, "stream")?.1)
    }

    /// Decodes the stream of a file whose attributes are of `num_splats`.
    ///
    /// # Errors
    /// As [`Self::bytes`] and [`ltgs::decode`]; [`Error::Invalid`] if it has another number of splats, quality or hash than the
    /// extension says.
    pub fn read(
        &self,
        loaded: &Loaded<'_>,
        extension: &TextureExtension,
        num_splats: usize,
    ) -> Result<Contents> {
        let bytes = self.bytes(loaded)?;
        let offence = |what: String| invalid!(loaded.path, "{EXTENSION}: stream {what}");
        let reader = ltgs::Reader::open(bytes, loaded.path, &loaded.limits)?;
        if reader.num_splats() != num_splats {
            return Err(offence(format!("of {} splats, attributes of {num_splats}", reader.num_splats())));
        }
        if extension.quality != reader.quality().name() {
            let (found, stated) = (reader.quality().name(), quoted(&extension.quality));
            return Err(offence(format!("of quality {found:?}, the extension says quality {stated}")));
        }
        let mut contents = reader.decode()?;
        if contents.hash.is_some_and(|hash| extension.hash() != Some(hash)) {
            return Err(offence(format!("with another hash than {}", quoted(&extension.hash))));
        }
        let rest = loaded.num_bytes.get().saturating_sub(bytes.len() as u64);
        Section::add(&mut contents.sections, "fallback", Describes::Other, rest);
        contents.format = format!("{EXTENSION} {VERSION}, {}", contents.format);
        Ok(contents)
    }

    /// The metadata of the stream.
    ///
    /// # Errors
    /// As [`Self::read`], but blocks are not read.
    pub fn meta(&self, loaded: &Loaded<'_>) -> Result<Meta> {
        Ok(ltgs::Reader::open(self.bytes(loaded)?, loaded.path, &loaded.limits)?.meta().clone())
    }
}
