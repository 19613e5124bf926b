//! The reader: tables first, then any chunk by itself, all of them in parallel, or what has arrived of a download.

use super::header::{Block, ENTRY_BYTES, Entry, HEADER_BYTES, Header, MAJOR, MINOR};
use super::lossless;
use super::shape::Shape;
use super::splats::SplatCodes;
use super::tables::FileMeta;
use super::tally::Tally;
use super::texels::{Map, TexelReader};
use super::write::{joined, mean_of, take_means};
use crate::limits::splat_bytes;
use crate::{AssetMap, Contents, Error, Quality, ReadLimits, Result, SplatAsset};
use rayon::prelude::*;
use std::path::{Path, PathBuf};
use xxhash_rust::xxh3::xxh3_64;

/// A beginning of a file is believed to be at least this share of it when its size decides on memory.
const PREFIX_SHARE: u64 = 1000;

/// A file whose tables were read and checked; chunks are decoded on demand.
pub struct Reader<'a> {
    bytes: &'a [u8],
    path: PathBuf,
    pub(super) header: Header,
    pub(super) meta: FileMeta,
    pub(super) entries: Vec<Entry>,
}

/// What [`decode_prefix`] found.
#[derive(Clone, Debug, PartialEq)]
pub struct Prefix {
    /// The splats that have arrived. Those whose texels are missing have no map; its mean is part of their colour.
    pub asset: SplatAsset,
    /// Bytes that are missing.
    pub missing_bytes: u64,
    /// Splats that are missing.
    pub missing_splats: usize,
    /// Texels that are missing, of splats that are there or not.
    pub missing_texels: u64,
}

/// Decodes a whole file, chunks in parallel; `path` is only for messages.
///
/// # Errors
/// [`Error::Invalid`] for a file that is damaged or cut, [`Error::Unsupported`] for a higher major version or a codec or
/// feature of a later one, [`Error::TooLarge`] for more than the limits allow.
pub fn decode(bytes: &[u8], path: &Path, limits: &ReadLimits) -> Result<Contents> {
    let reader = Reader::open(bytes, path, limits)?;
    reader.decode()
}

/// Decodes as much as the beginning of a file allows; the header and the tables must be there.
///
/// # Errors
/// As [`decode`], but for what is missing at the end.
pub fn decode_prefix(bytes: &[u8], path: &Path, limits: &ReadLimits) -> Result<Prefix> {
    let reader = Reader::new(bytes, path, limits)?;
    reader.decode_prefix().map_err(|e| e.at(path))
}

impl<'a> Reader<'a> {
    /// Reads the tables of a whole file; `path` is only for messages.
    ///
    /// # Errors
    /// As [`decode`]; damage within chunks shows when they are decoded.
    pub fn open(bytes: &'a [u8], path: &Path, limits: &ReadLimits) -> Result<Self> {
        let reader = Self::new(bytes, path, limits)?;
        if reader.header.file_bytes == bytes.len() as u64 {
            return Ok(reader);
        }
        let stated = reader.header.file_bytes;
        Err(Error::invalid(path, format!("{} bytes, the header says {stated}: cut or damaged", bytes.len())))
    }

    /// Reads the tables of a file that may be cut behind them.
    fn new(bytes: &'a [u8], path: &Path, limits: &ReadLimits) -> Result<Self> {
        let header = Header::decode(bytes, path)?;
        // What has not arrived of a download counts too; only the file's own word is known of it.
        let file_bytes = header.file_bytes.min((bytes.len() as u64).saturating_mul(PREFIX_SHARE));
        limits.of_file(file_bytes).check(decoded_bytes(&header), "splats and texels", path)?;
        let invalid = |what: String| Error::invalid(path, what);
        let tables = bytes.get(HEADER_BYTES..).and_then(|rest| rest.get(..header.tables_bytes()));
        let tables = tables.ok_or_else(|| invalid("metadata and table of contents are cut".to_owned()))?;
        if xxh3_64(tables) != header.tables_checksum {
            return Err(invalid("metadata and table of contents: wrong checksum, damaged".to_owned()));
        }
        let (meta, entries) = tables.split_at(header.meta_bytes as usize);
        let meta = FileMeta::decode(meta, header.meta_is_compressed, header.meta_text_bytes as usize)
            .map_err(|e| e.at(path))?;
        if meta.quality != header.quality.name()
            || meta.quantiser.is_none() != (header.quality == Quality::Lossless)
        {
            return Err(invalid(format!(
                "metadata: quality {:?} with quantiser {:?}, the header says {:?}",
                meta.quality,
                meta.quantiser,
                header.quality.name()
            )));
        }
        let entries: Vec<Entry> = entries.as_chunks::<ENTRY_BYTES>().0.iter().map(Entry::decode).collect();
        check_entries(&header, &entries).map_err(invalid)?;
        Ok(Self { bytes, path: path.to_owned(), header, meta, entries })
    }

    /// Number of chunks.
    pub fn num_chunks(&self) -> usize {
        self.entries.len()
    }

    /// What the file promises.
    pub fn quality(&self) -> Quality {
        self.header.quality
    }

    /// Splats of the whole file.
    pub fn num_splats(&self) -> usize {
        self.header.num_splats as usize
    }

    /// Texels of the whole file.
    pub fn num_texels(&self) -> u64 {
        self.header.num_texels
    }

    /// Smallest and largest coordinates of the centres of a chunk, local frame; `None` if there is no such chunk.
    pub fn bounds(&self, chunk: usize) -> Option<[[f32; 3]; 2]> {
        self.entries.get(chunk).map(|e| e.bounds)
    }

    /// One chunk as an asset of its own: splats `4096 * chunk` and on. Reads nothing else of the file.
    ///
    /// # Errors
    /// As [`decode`].
    pub fn chunk(&self, chunk: usize) -> Result<SplatAsset> {
        let of_chunk = || {
            let (splats, _) = self.decode_chunk(chunk, true)?;
            joined(self.empty(), self.header.sh_degree, vec![splats])
        };
        let asset = of_chunk().map_err(|e| e.at(&self.path))?;
        asset.validate().map_err(|e| e.at(&self.path))?;
        Ok(asset)
    }

    /// The whole file.
    ///
    /// # Errors
    /// As [`decode`].
    pub fn decode(&self) -> Result<Contents> {
        let of_chunk = |chunk: usize| self.decode_chunk(chunk, true).map_err(|e| in_chunk(e, chunk));
        let chunks = (0..self.num_chunks()).into_par_iter().map(of_chunk).collect::<Result<Vec<_>>>();
        let (chunks, tallies): (Vec<_>, Vec<_>) = chunks.map_err(|e| e.at(&self.path))?.into_iter().unzip();
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
        let text = format!("version {MAJOR}.{minor} is newer than {MAJOR}.{MINOR}: what it added is ignored");
        is_newer.then_some(text).into_iter().collect()
    }

    /// An asset without splats, but with all else.
    fn empty(&self) -> SplatAsset {
        let mut asset = SplatAsset::default();
        self.meta.meta.clone().store(&mut asset);
        asset
    }

    fn decode_prefix(&self) -> Result<Prefix> {
        let mut missing_texels = self.header.num_texels;
        let present = self.entries.iter().take_while(|e| self.block(&e.splats).is_ok()).count();
        let chunks = (0..present).into_par_iter().map(|chunk| {
            let with_texels = self.block(&self.entries[chunk].texels).is_ok();
            self.decode_chunk(chunk, with_texels).map_err(|e| in_chunk(e, chunk))
        });
        let chunks = chunks.collect::<Result<Vec<_>>>()?;
        missing_texels -= chunks.iter().map(|(c, _)| c.num_texels() as u64).sum::<u64>();
        let chunks = chunks.into_iter().map(|(splats, _)| splats).collect();
        let asset = joined(self.empty(), self.header.sh_degree, chunks)?;
        asset.validate()?;
        Ok(Prefix {
            missing_bytes: self.header.file_bytes.saturating_sub(self.bytes.len() as u64),
            missing_splats: self.num_splats() - asset.num_splats(),
            missing_texels,
            asset,
        })
    }

    /// A block's bytes, if they are all there.
    fn block(&self, block: &Block) -> Result<&'a [u8]> {
        let end = block.offset.checked_add(block.bytes);
        let range = || Some(usize::try_from(block.offset).ok()?..usize::try_from(end?).ok()?);
        let bytes = range().and_then(|range| self.bytes.get(range));
        bytes.ok_or_else(|| Error::invalid("", format!("{block:?}: cut")))
    }

    fn checked_block(&self, block: &Block) -> Result<&'a [u8]> {
        let bytes = self.block(block)?;
        let found = xxh3_64(bytes);
        if found == block.checksum {
            return Ok(bytes);
        }
        Err(Error::invalid("", format!("checksum {found:016x}, stated {:016x}: damaged", block.checksum)))
    }

    /// A chunk without the file's metadata, and its bytes by attribute.
    pub(super) fn decode_chunk(&self, chunk: usize, with_texels: bool) -> Result<(SplatAsset, Tally)> {
        let entry = self
            .entries
            .get(chunk)
            .ok_or_else(|| Error::invalid("", format!("chunk {chunk} of {}", self.entries.len())))?;
        let splats = self.checked_block(&entry.splats)?;
        let texels = if with_texels { Some(self.checked_block(&entry.texels)?) } else { None };
        let (mut tally, n, sh_degree) = (Tally::default(), entry.num_splats as usize, self.header.sh_degree);
        tally.count("texels", texels.map_or(0, |t| t.len() as u64));
        let asset = match &self.meta.quantiser {
            None => {
                let (mut asset, means) = lossless::decode_splats(splats, n, sh_degree, &mut tally)?;
                match texels {
                    Some(texels) => {
                        check_texels(&asset, entry)?;
                        asset.texels = lossless::decode_texels(texels, entry.num_texels as usize)?;
                    }
                    None => {
                        lossless::bake_means(&mut asset, &means);
                        drop_maps(&mut asset);
                    }
                }
                asset
            }
            Some(quantiser) => {
                let codes = SplatCodes::decode(splats, n, quantiser, sh_degree, &mut tally)?;
                let mut asset = codes.values(quantiser, sh_degree)?;
                match texels {
                    Some(texels) => {
                        check_texels(&asset, entry)?;
                        let mut reader = TexelReader::new(texels, entry.num_texels as usize)?;
                        let mut means = Vec::with_capacity(n);
                        let mut values = Vec::new();
                        for splat in 0..n {
                            let map = map_of(&asset, &codes.exponents, splat);
                            let first = values.len();
                            reader.next(&quantiser.steps, &map, &mut values)?;
                            means.push(mean_of(&map, &values[first..]));
                        }
                        asset.texels = values;
                        take_means(&mut asset, &means);
                    }
                    None => drop_maps(&mut asset),
                }
                asset
            }
        };
        Ok((asset, tally))
    }
}

fn in_chunk(error: Error, chunk: usize) -> Error {
    match error {
        Error::Invalid { path, what } => Error::invalid(path, format!("chunk {chunk}: {what}")),
        Error::Unsupported { path, what } => Error::unsupported(path, format!("chunk {chunk}: {what}")),
        Error::TooLarge { path, what } => Error::too_large(path, format!("chunk {chunk}: {what}")),
        other => other,
    }
}

/// A splat with its map, as decoded.
fn map_of(asset: &SplatAsset, exponents: &[i32], splat: usize) -> Map {
    let map = &asset.maps[splat];
    let shape = Shape { exponent: exponents[splat], scales: asset.scales[splat], texel_size: map.texel_size };
    Map { shape, rows: map.rows, cols: map.cols }
}

fn drop_maps(asset: &mut SplatAsset) {
    asset.maps.fill(AssetMap::default());
}

/// The maps' sides must add up to the texels that the table of contents states, before any is decoded.
fn check_texels(asset: &SplatAsset, entry: &Entry) -> Result<()> {
    let found: u64 = asset.maps.iter().map(|m| m.num_texels() as u64).sum();
    if found == entry.num_texels {
        return Ok(());
    }
    let what = format!("maps of {found} texels, the table of contents says {}", entry.num_texels);
    Err(Error::invalid("", what))
}

/// Bytes of the arrays that a file decodes to.
fn decoded_bytes(header: &Header) -> u64 {
    splat_bytes(header.sh_degree) * u64::from(header.num_splats) + 12 * header.num_texels
}

/// Blocks in order, without overlap, within the file; all splats before the first texels; counts as the header says.
fn check_entries(header: &Header, entries: &[Entry]) -> Result<(), String> {
    let mut end = (HEADER_BYTES + header.tables_bytes()) as u64;
    let blocks = entries.iter().map(|e| &e.splats).chain(entries.iter().map(|e| &e.texels));
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
