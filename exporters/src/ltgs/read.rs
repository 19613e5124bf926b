//! The reader: tables first, then a single chunk, or all chunks in parallel.

use super::header::{Block, ENTRY_BYTES, Entry, HEADER_BYTES, Header, MAJOR, MINOR};
use super::lossless;
use super::shape::Shape;
use super::splats::SplatCodes;
use super::steps::Quantiser;
use super::tables::FileMeta;
use super::tally::Tally;
use super::texels::{Map, TexelReader};
use super::write::{joined, mean_of, take_means};
use crate::limits::{splat_bytes, with_room};
use crate::{AssetMap, Contents, Error, Quality, ReadLimits, Result, SplatAsset, quoted};
use rayon::prelude::*;
use std::path::{Path, PathBuf};
use twox_hash::XxHash3_64;

/// A file whose tables have been read and checked; chunks are decoded on demand.
pub struct Reader<'a> {
    bytes: &'a [u8],
    path: PathBuf,
    pub(super) header: Header,
    pub(super) meta: FileMeta,
    pub(super) entries: Vec<Entry>,
}

/// Decodes a whole file, chunks in parallel; `path` is only for messages.
///
/// # Errors
/// [`Error::Invalid`] for a file that is damaged or truncated, [`Error::Unsupported`] for another major version or an
/// unknown codec or feature, [`Error::TooLarge`] beyond the limits.
pub fn decode(bytes: &[u8], path: &Path, limits: &ReadLimits) -> Result<Contents> {
    let reader = Reader::open(bytes, path, limits)?;
    reader.decode()
}

impl<'a> Reader<'a> {
    /// Reads the tables of a file; `path` is only for messages.
    ///
    /// # Errors
    /// As [`decode`]; damage inside chunks is found when they are decoded.
    pub fn open(bytes: &'a [u8], path: &Path, limits: &ReadLimits) -> Result<Self> {
        let header = Header::decode(bytes, path)?;
        if header.file_bytes != bytes.len() as u64 {
            let what =
                format!("{} bytes, the header says {}: truncated or damaged", bytes.len(), header.file_bytes);
            return Err(Error::invalid(path, what));
        }
        limits.of_file(header.file_bytes).check(decoded_bytes(&header), "splats and texels", path)?;
        let invalid = |what: String| Error::invalid(path, what);
        let tables = bytes.get(HEADER_BYTES..).and_then(|rest| rest.get(..header.tables_bytes()));
        let tables =
            tables.ok_or_else(|| invalid("metadata and table of contents are truncated".to_owned()))?;
        if XxHash3_64::oneshot(tables) != header.tables_checksum {
            return Err(invalid("metadata and table of contents: wrong checksum, damaged".to_owned()));
        }
        let (meta, entries) = tables.split_at(header.meta_bytes as usize);
        let meta = FileMeta::decode(meta, header.meta_is_compressed, header.meta_text_bytes as usize)
            .map_err(|e| e.at(path))?;
        let is_lossless = header.quality == Quality::Lossless;
        if meta.quality != header.quality.name() || meta.quantiser.is_none() != is_lossless {
            let (found, stated) = (quoted(&meta.quality), header.quality.name());
            let steps = if meta.quantiser.is_some() { "steps" } else { "no steps" };
            return Err(invalid(format!(
                "metadata: quality {found} with {steps}, the header says {stated:?}"
            )));
        }
        let entries: Vec<Entry> = entries.as_chunks::<ENTRY_BYTES>().0.iter().map(Entry::decode).collect();
        check_entries(&header, &entries).map_err(invalid)?;
        Ok(Self { bytes, path: path.to_owned(), header, meta, entries })
    }

    /// Chunks of the file.
    pub fn num_chunks(&self) -> usize {
        self.entries.len()
    }

    /// Quality that the file states.
    pub fn quality(&self) -> Quality {
        self.header.quality
    }

    /// Splats of all chunks.
    pub fn num_splats(&self) -> usize {
        self.header.num_splats as usize
    }

    /// Texels of all chunks.
    pub fn num_texels(&self) -> u64 {
        self.header.num_texels
    }

    /// Smallest and largest coordinates of the centres of a chunk, local frame; `None` if there is no such chunk.
    pub fn bounds(&self, chunk: usize) -> Option<[[f32; 3]; 2]> {
        self.entries.get(chunk).map(|e| e.bounds)
    }

    /// Decodes one chunk as an asset of its own, with splats from `4096 * chunk` on, and nothing else of the file.
    ///
    /// # Errors
    /// As [`decode`].
    pub fn chunk(&self, chunk: usize) -> Result<SplatAsset> {
        let of_chunk = || {
            let (splats, _) = self.decode_chunk(chunk)?;
            joined(self.empty(), self.header.sh_degree, vec![splats])
        };
        let mut asset = of_chunk().map_err(|e| e.at(&self.path))?;
        asset.fit_sh_degree();
        asset.validate().map_err(|e| e.at(&self.path))?;
        Ok(asset)
    }

    /// Decodes the whole file.
    ///
    /// # Errors
    /// As [`decode`].
    pub fn decode(&self) -> Result<Contents> {
        let of_chunk =
            |chunk: usize| self.decode_chunk(chunk).map_err(|e| e.within(&format!("chunk {chunk}")));
        let chunks = (0..self.num_chunks()).into_par_iter().map(of_chunk).collect::<Result<Vec<_>>>();
        self.assemble(chunks.map_err(|e| e.at(&self.path))?)
    }

    /// Joins all decoded chunks.
    ///
    /// # Errors
    /// [`Error::Invalid`] if they do not make a valid asset, [`Error::TooLarge`].
    pub(super) fn assemble(&self, chunks: Vec<(SplatAsset, Tally)>) -> Result<Contents> {
        let (chunks, tallies): (Vec<_>, Vec<_>) = chunks.into_iter().unzip();
        let asset = joined(self.empty(), self.header.sh_degree, chunks).map_err(|e| e.at(&self.path))?;
        asset.validate().map_err(|e| e.at(&self.path))?;
        let mut tally = Tally::default();
        tallies.iter().for_each(|t| tally.merge(t));
        tally.count("header", HEADER_BYTES as u64);
        tally.count("metadata", self.header.meta_bytes.into());
        tally.count("contents", (self.entries.len() * ENTRY_BYTES) as u64);
        tally.count("other", self.header.file_bytes.saturating_sub(tally.total()));
        Ok(Contents {
            asset,
            format: format!("ltgs {MAJOR}.{}", self.header.minor),
            quality: Some(self.header.quality),
            hash: self.meta.hash(),
            sections: tally.sections(),
            warnings: self.warnings(),
        })
    }

    fn warnings(&self) -> Vec<String> {
        let minor = self.header.minor;
        let is_newer = minor > MINOR;
        let text =
            format!("version {MAJOR}.{minor} is newer than {MAJOR}.{MINOR}: its additions are ignored");
        is_newer.then_some(text).into_iter().collect()
    }

    /// The asset without its splats.
    fn empty(&self) -> SplatAsset {
        let mut asset = SplatAsset::default();
        self.meta.meta.clone().store(&mut asset);
        asset
    }

    /// A block's bytes; that they lie in the file was checked with the tables.
    fn block(&self, block: &Block) -> Result<&'a [u8]> {
        let range = usize::try_from(block.offset).ok().zip(usize::try_from(block.bytes).ok());
        let bytes = range.and_then(|(first, length)| self.bytes.get(first..first.checked_add(length)?));
        let bytes = bytes.ok_or_else(|| Error::invalid("", format!("{block:?}: truncated")))?;
        let found = XxHash3_64::oneshot(bytes);
        if found == block.checksum {
            return Ok(bytes);
        }
        Err(Error::invalid("", format!("checksum {found:016x}, stated {:016x}: damaged", block.checksum)))
    }

    /// A chunk without the file's metadata, and its bytes by attribute.
    pub(super) fn decode_chunk(&self, chunk: usize) -> Result<(SplatAsset, Tally)> {
        let entry = self
            .entries
            .get(chunk)
            .ok_or_else(|| Error::invalid("", format!("chunk {chunk} of {}", self.entries.len())))?;
        let blocks = [self.block(&entry.geometry)?, self.block(&entry.sh)?, self.block(&entry.texels)?];
        let mut tally = Tally::default();
        tally.count("texels", blocks[2].len() as u64);
        let asset = match &self.meta.quantiser {
            None => self.lossless_chunk(entry, blocks, &mut tally)?,
            Some(quantiser) => self.lossy_chunk(entry, blocks, quantiser, &mut tally)?,
        };
        Ok((asset, tally))
    }

    fn lossless_chunk(
        &self,
        entry: &Entry,
        [geometry, sh, texels]: [&[u8]; 3],
        tally: &mut Tally,
    ) -> Result<SplatAsset> {
        let mut asset = lossless::decode_geometry(geometry, entry.num_splats as usize, tally)?;
        lossless::decode_sh(sh, self.header.sh_degree, &mut asset, tally)?;
        check_texels(&asset, entry)?;
        asset.texels = lossless::decode_texels(texels, entry.num_texels as usize)?;
        Ok(asset)
    }

    fn lossy_chunk(
        &self,
        entry: &Entry,
        [geometry, sh, texels]: [&[u8]; 3],
        quantiser: &Quantiser,
        tally: &mut Tally,
    ) -> Result<SplatAsset> {
        let (n, sh_degree) = (entry.num_splats as usize, self.header.sh_degree);
        let codes = SplatCodes::decode([geometry, sh], n, quantiser, sh_degree, tally)?;
        let mut asset = codes.values(quantiser, sh_degree)?;
        check_texels(&asset, entry)?;
        let mut reader = TexelReader::new(texels, entry.num_texels as usize)?;
        let mut values = with_room(3 * entry.num_texels as usize)?;
        let mut means = Vec::with_capacity(n);
        for splat in 0..n {
            let map = map_of(&asset, &codes.exponents, splat);
            let first = values.len();
            reader.next(&quantiser.steps, &map, &mut values);
            means.push(mean_of(&map, &values[first..]));
        }
        reader.finish()?;
        asset.texels = values;
        take_means(&mut asset, &means);
        Ok(asset)
    }
}

/// The shape of a decoded splat and the sides of its map.
fn map_of(asset: &SplatAsset, exponents: &[i32], splat: usize) -> Map {
    let AssetMap { rows, cols, texel_sizes, shift, .. } = asset.maps[splat];
    let shape = Shape { exponent: exponents[splat], scales: asset.scales[splat], texel_sizes };
    Map { shape, rows, cols, shift }
}

/// Checks that the sides of maps add up to the texels that the table of contents states, before any is decoded.
fn check_texels(asset: &SplatAsset, entry: &Entry) -> Result<()> {
    let found: u64 = asset.maps.iter().map(|m| m.num_texels() as u64).sum();
    if found == entry.num_texels {
        return Ok(());
    }
    let what = format!("maps of {found} texels, the table of contents says {}", entry.num_texels);
    Err(Error::invalid("", what))
}

/// Bytes of the arrays to which a file decodes.
fn decoded_bytes(header: &Header) -> u64 {
    splat_bytes(header.sh_degree) * u64::from(header.num_splats) + 12 * header.num_texels
}

/// Checks that blocks lie in order and without overlap within the file, kind by kind, and that counts agree with the header.
fn check_entries(header: &Header, entries: &[Entry]) -> Result<(), String> {
    let mut end = (HEADER_BYTES + header.tables_bytes()) as u64;
    let kinds: [fn(&Entry) -> &Block; 3] = [|e| &e.geometry, |e| &e.sh, |e| &e.texels];
    let blocks = kinds.iter().flat_map(|kind| entries.iter().map(kind));
    for (i, block) in blocks.enumerate() {
        let chunk = i % entries.len();
        if block.offset < end {
            return Err(format!("chunk {chunk}: block at {}, but {end} bytes come before it", block.offset));
        }
        end = block.offset.checked_add(block.bytes).filter(|&end| end <= header.file_bytes).ok_or_else(
            || format!("chunk {chunk}: {block:?} ends behind the file of {} bytes", header.file_bytes),
        )?;
    }
    let mut num_texels = 0_u64;
    for (chunk, entry) in entries.iter().enumerate() {
        let expected = header.splats_of(chunk);
        if entry.num_splats as usize != expected {
            return Err(format!("chunk {chunk}: {} splats, expected {expected}", entry.num_splats));
        }
        num_texels = num_texels.saturating_add(entry.num_texels);
    }
    if num_texels == header.num_texels {
        return Ok(());
    }
    Err(format!("table of contents: {num_texels} texels, the header says {}", header.num_texels))
}
