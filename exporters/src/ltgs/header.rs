//! The parts of a file at fixed positions: the header of 64 bytes and the entries of the table of contents.

use crate::{Error, Quality, Result, SPLATS_MAX};
use std::path::Path;
use twox_hash::XxHash3_64;

/// The first bytes of a file.
pub const MAGIC: [u8; 4] = *b"LTGS";

/// Major version that is written and read; readers refuse others, but accept any minor version.
pub const MAJOR: u16 = 3;
/// Minor version that this program writes.
pub const MINOR: u16 = 0;

/// Length of the header.
pub const HEADER_BYTES: usize = 64;

/// Length of an entry of the table of contents.
pub const ENTRY_BYTES: usize = 112;

/// Splats of every chunk but the last of its layer.
pub const CHUNK_SPLATS: usize = 4096;

/// The header of a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Header {
    /// Minor version of the file.
    pub minor: u16,
    /// Splats of the file.
    pub num_splats: u32,
    /// Texels of the file.
    pub num_texels: u64,
    /// Chunks of the file.
    pub num_chunks: u32,
    /// Largest SH degree of a splat, 0 to 3.
    pub sh_degree: u32,
    /// Kind of the streams, and what the file guarantees.
    pub quality: Quality,
    /// Bytes of the metadata in the file.
    pub meta_bytes: u32,
    /// Bytes of the metadata's text when decompressed.
    pub meta_text_bytes: u32,
    /// Bytes of the file.
    pub file_bytes: u64,
    /// xxh3-64 of metadata and table of contents.
    pub tables_checksum: u64,
}

impl Header {
    /// Bytes of the metadata and the table of contents, which follow the header.
    pub fn tables_bytes(&self) -> usize {
        self.meta_bytes as usize + self.num_chunks as usize * ENTRY_BYTES
    }

    /// Encodes the header with its checksum.
    pub fn encode(&self) -> Vec<u8> {
        let mut bytes = Vec::with_capacity(HEADER_BYTES);
        bytes.extend(MAGIC);
        bytes.extend(MAJOR.to_le_bytes());
        bytes.extend(self.minor.to_le_bytes());
        bytes.extend(0_u32.to_le_bytes());
        bytes.extend(self.num_splats.to_le_bytes());
        bytes.extend(self.num_texels.to_le_bytes());
        let quality = Quality::ALL.iter().position(|q| *q == self.quality).unwrap_or_default();
        bytes.extend([self.sh_degree as u8, quality as u8, 0, 0]);
        bytes.extend(self.meta_bytes.to_le_bytes());
        bytes.extend(self.meta_text_bytes.to_le_bytes());
        bytes.extend(self.num_chunks.to_le_bytes());
        bytes.extend(self.file_bytes.to_le_bytes());
        bytes.extend(self.tables_checksum.to_le_bytes());
        bytes.extend(XxHash3_64::oneshot(&bytes).to_le_bytes());
        bytes
    }

    /// Reads and checks the first bytes of a file.
    ///
    /// # Errors
    /// [`Error::Invalid`] if it is not a `.ltgs` file or is damaged, [`Error::Unsupported`] for another major version or an
    /// unknown feature, [`Error::TooLarge`].
    pub fn decode(bytes: &[u8], path: &Path) -> Result<Self> {
        let invalid = |what: String| Err(Error::invalid(path, what));
        let Some(head) = bytes.first_chunk::<HEADER_BYTES>() else {
            return invalid(format!("header: {} bytes, expected {HEADER_BYTES}", bytes.len()));
        };
        if head[..4] != MAGIC {
            return invalid(format!("header: begins with {:?}, expected \"LTGS\"", &head[..4]));
        }
        let u16_at = |at: usize| u16::from_le_bytes([head[at], head[at + 1]]);
        let u32_at = |at: usize| u32::from_le_bytes(std::array::from_fn(|i| head[at + i]));
        let u64_at = |at: usize| u64::from_le_bytes(std::array::from_fn(|i| head[at + i]));
        if u16_at(4) != MAJOR {
            let what = format!(
                "version {}.{}; this program reads version {MAJOR}: export the scene again, or use a program of that version",
                u16_at(4),
                u16_at(6)
            );
            return Err(Error::unsupported(path, what));
        }
        let (found, stated) = (XxHash3_64::oneshot(&head[..56]), u64_at(56));
        if found != stated {
            return invalid(format!("header: checksum {found:016x}, stated {stated:016x}: damaged"));
        }
        let flags = u32_at(8);
        if flags != 0 {
            let what = format!("feature bits {flags:#x} are unknown to this program");
            return Err(Error::unsupported(path, what));
        }
        let Some(&quality) = Quality::ALL.get(usize::from(head[25])) else {
            return Err(unsupported!(path, "profile {} is unknown to this program", head[25]));
        };
        let header = Self {
            minor: u16_at(6),
            num_splats: u32_at(12),
            num_texels: u64_at(16),
            num_chunks: u32_at(36),
            sh_degree: head[24].into(),
            quality,
            meta_bytes: u32_at(28),
            meta_text_bytes: u32_at(32),
            file_bytes: u64_at(40),
            tables_checksum: u64_at(48),
        };
        header.check(path)?;
        Ok(header)
    }

    fn check(&self, path: &Path) -> Result<()> {
        if self.num_splats as usize > SPLATS_MAX {
            return Err(too_large!(path, "header: {} splats, at most {SPLATS_MAX}", self.num_splats));
        }
        if self.num_texels > u32::MAX.into() {
            return Err(too_large!(path, "header: {} texels, at most 2^32 - 1", self.num_texels));
        }
        if self.meta_text_bytes as usize > crate::asset::meta::META_BYTES_MAX {
            return Err(too_large!(path, "metadata: {} bytes, at most 16 MiB", self.meta_text_bytes));
        }
        if self.sh_degree > 3 {
            return Err(invalid!(path, "header: SH degree {}, at most 3", self.sh_degree));
        }
        let fewest = self.num_splats.div_ceil(CHUNK_SPLATS as u32);
        if !(fewest..=self.num_splats).contains(&self.num_chunks) {
            let [found, splats] = [self.num_chunks, self.num_splats];
            return Err(invalid!(path, "header: {found} chunks, {splats} splats need {fewest} to {splats}"));
        }
        Ok(())
    }
}

/// A part of the file with a checksum.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Block {
    /// Position from the beginning of the file.
    pub offset: u64,
    pub bytes: u64,
    /// xxh3-64 of the bytes.
    pub checksum: u64,
}

/// An entry of the table of contents: what it says about a chunk.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Entry {
    /// Block of geometry, with SH of degree 0, which contains the means of maps.
    pub geometry: Block,
    /// Block of the other SH.
    pub sh: Block,
    /// Block of texels.
    pub texels: Block,
    /// Splats of the chunk.
    pub num_splats: u32,
    /// Layer of the chunk, from 0.
    pub layer: u32,
    /// Texels of the chunk.
    pub num_texels: u64,
    /// Smallest and largest coordinates of centres, local frame.
    pub bounds: [[f32; 3]; 2],
}

impl Entry {
    /// Appends the encoded entry.
    pub fn encode(&self, bytes: &mut Vec<u8>) {
        for block in [self.geometry, self.sh, self.texels] {
            for number in [block.offset, block.bytes, block.checksum] {
                bytes.extend(number.to_le_bytes());
            }
        }
        bytes.extend(self.num_texels.to_le_bytes());
        bytes.extend(self.num_splats.to_le_bytes());
        bytes.extend(self.layer.to_le_bytes());
        for value in self.bounds.as_flattened() {
            bytes.extend(value.to_le_bytes());
        }
    }

    /// A block by its kind: geometry (0), SH (1), texels (2).
    pub fn block(&self, kind: usize) -> &Block {
        [&self.geometry, &self.sh, &self.texels][kind]
    }

    /// [`Self::block`], to be changed.
    pub fn block_mut(&mut self, kind: usize) -> &mut Block {
        match kind {
            0 => &mut self.geometry,
            1 => &mut self.sh,
            _ => &mut self.texels,
        }
    }

    pub fn decode(bytes: &[u8; ENTRY_BYTES]) -> Self {
        let u64_at = |at: usize| u64::from_le_bytes(std::array::from_fn(|i| bytes[at + i]));
        let u32_at = |at: usize| u32::from_le_bytes(std::array::from_fn(|i| bytes[at + i]));
        let block =
            |at: usize| Block { offset: u64_at(at), bytes: u64_at(at + 8), checksum: u64_at(at + 16) };
        let bounds: [[f32; 3]; 2] =
            std::array::from_fn(|k| std::array::from_fn(|i| f32::from_bits(u32_at(88 + 12 * k + 4 * i))));
        Self {
            geometry: block(0),
            sh: block(24),
            texels: block(48),
            num_texels: u64_at(72),
            num_splats: u32_at(80),
            layer: u32_at(84),
            bounds,
        }
    }
}

/// What a block holds of its chunk.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BlockKind {
    /// Geometry and SH of degree 0.
    Geometry,
    /// The other SH.
    Sh,
    /// Texels.
    Texels,
}

impl BlockKind {
    /// In the order of their numbers.
    pub(super) const ALL: [Self; 3] = [Self::Geometry, Self::Sh, Self::Texels];
}

/// Chunks and kinds of all blocks in the order of the file: by layer, then by kind, then by chunk. A file that is cut off shows a
/// coarser scene, and of the layer that is cut the splats before their view-dependent colours, and these before their texels.
pub fn blocks_in_order(entries: &[Entry]) -> Vec<(usize, usize)> {
    let mut blocks = Vec::with_capacity(3 * entries.len());
    let mut first = 0;
    for layer in entries.chunk_by(|a, b| a.layer == b.layer) {
        let chunks = first..first + layer.len();
        first = chunks.end;
        blocks.extend((0..3).flat_map(|kind| chunks.clone().map(move |chunk| (chunk, kind))));
    }
    blocks
}
