//! The reader: tables first, then a single chunk, or all chunks in parallel.

use super::header::{
    Block, BlockKind, CHUNK_SPLATS, ENTRY_BYTES, Entry, HEADER_BYTES, Header, MAJOR, MINOR, blocks_in_order,
};
use super::lossless;
use super::shape::Shape;
use super::splats::SplatCodes;
use super::steps::Quantiser;
use super::tables::FileMeta;
use super::tally::Tally;
use super::texels::{Map, TexelReader};
use super::write::{joined, mean_of, take_means};
use crate::asset::meta::Meta;
use crate::files::limits::{splat_bytes, with_room};
use crate::{AssetMap, Contents, Error, LayerSize, Quality, ReadLimits, Result, SplatAsset, quoted};
use rayon::prelude::*;
use std::ops::Range;
use std::path::{Path, PathBuf};
use twox_hash::XxHash3_64;

/// A file whose tables have been read and checked; chunks are decoded on demand.
pub struct Reader<'a> {
    pub(super) bytes: &'a [u8],
    pub(super) path: PathBuf,
    pub(super) header: Header,
    pub(super) meta: FileMeta,
    pub(super) entries: Vec<Entry>,
    /// Chunks of the layers that the limits allow.
    num_wanted: usize,
    limits: ReadLimits,
}

/// Decodes a file, or the layers of it that the limits allow, chunks in parallel; `path` is only for messages.
///
/// # Errors
/// [`Error::Invalid`] for a file that is damaged or truncated, [`Error::Unsupported`] for another major version or an
/// unknown codec or feature, [`Error::TooLarge`] beyond the limits.
pub fn decode(bytes: &[u8], path: &Path, limits: &ReadLimits) -> Result<Contents> {
    let reader = Reader::open(bytes, path, limits)?;
    reader.decode()
}

impl<'a> Reader<'a> {
    /// Reads the tables of a file; `path` is only for messages. Where the limits leave layers out, the file may be cut off behind
    /// the others.
    ///
    /// # Errors
    /// As [`decode`]; damage inside chunks is found when they are decoded.
    pub fn open(bytes: &'a [u8], path: &Path, limits: &ReadLimits) -> Result<Self> {
        let header = Header::decode(bytes, path)?;
        let found = bytes.len() as u64;
        if found > header.file_bytes || found < header.file_bytes && limits.layers.is_none() {
            let what = format!("{found} bytes, the header says {}: truncated or damaged", header.file_bytes);
            return Err(Error::invalid(path, what));
        }
        let limits_of_file = limits.of_file(found);
        if limits.layers.is_none() {
            // Before anything else is read.
            let all = decoded_bytes(&header, header.num_splats.into(), header.num_texels);
            limits_of_file.check(all, "splats and texels", path)?;
        }
        let invalid = |what: String| Error::invalid(path, what);
        let tables = bytes.get(HEADER_BYTES..).and_then(|rest| rest.get(..header.tables_bytes()));
        let tables =
            tables.ok_or_else(|| invalid("metadata and table of contents are truncated".to_owned()))?;
        if XxHash3_64::oneshot(tables) != header.tables_checksum {
            return Err(invalid("metadata and table of contents: wrong checksum, damaged".to_owned()));
        }
        let (meta, entries) = tables.split_at(header.meta_bytes as usize);
        let meta = FileMeta::decode(meta, header.meta_text_bytes as usize).map_err(|e| e.at(path))?;
        let is_lossless = header.quality == Quality::Lossless;
        if meta.quality != header.quality.name() || meta.quantiser.is_none() != is_lossless {
            let (found, stated) = (quoted(&meta.quality), header.quality.name());
            let steps = if meta.quantiser.is_some() { "steps" } else { "no steps" };
            return Err(invalid(format!(
                "metadata: quality {found} with {steps}, the header says {stated:?}"
            )));
        }
        let entries: Vec<Entry> = entries.as_chunks::<ENTRY_BYTES>().0.iter().map(Entry::decode).collect();
        check_entries(&header, &meta, &entries).map_err(invalid)?;
        let layers = limits.layers.unwrap_or(u32::MAX);
        let wanted = &entries[..entries.partition_point(|e| e.layer < layers)];
        let splats = wanted.iter().map(|e| u64::from(e.num_splats)).sum();
        let texels = wanted.iter().map(|e| e.num_texels).sum();
        limits_of_file.check(decoded_bytes(&header, splats, texels), "splats and texels", path)?;
        let num_wanted = wanted.len();
        Ok(Self { bytes, path: path.to_owned(), header, meta, entries, num_wanted, limits: *limits })
    }

    /// Where the table of contents ends: the stand-in is there, or the first block.
    pub(super) fn blocks_start(&self) -> usize {
        HEADER_BYTES + self.header.tables_bytes()
    }

    /// Layers of the file: 0 without splats.
    pub fn num_layers(&self) -> usize {
        self.entries.last().map_or(0, |e| e.layer as usize + 1)
    }

    /// Layer of a chunk; `None` if there is no such chunk.
    pub fn layer(&self, chunk: usize) -> Option<u32> {
        self.entries.get(chunk).map(|e| e.layer)
    }

    /// Splats of a chunk, as indices in the whole; `None` if there is no such chunk.
    pub fn splats(&self, chunk: usize) -> Option<Range<usize>> {
        let count = self.entries.get(chunk)?.num_splats as usize;
        let first = self.entries[..chunk].iter().map(|e| e.num_splats as usize).sum();
        Some(first..first + count)
    }

    /// Kind, splats and bytes of each block, in the order of the file.
    pub fn blocks(&self) -> impl Iterator<Item = (BlockKind, usize, u64)> {
        blocks_in_order(&self.entries).into_iter().map(|(chunk, kind)| {
            let entry = &self.entries[chunk];
            (BlockKind::ALL[kind], entry.num_splats as usize, entry.block(kind).bytes)
        })
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

    /// The metadata that all formats share.
    pub(crate) fn meta(&self) -> &Meta {
        &self.meta.meta
    }

    /// Smallest and largest coordinates of the centres of a chunk, local frame; `None` if there is no such chunk.
    pub fn bounds(&self, chunk: usize) -> Option<[[f32; 3]; 2]> {
        self.entries.get(chunk).map(|e| e.bounds)
    }

    /// Decodes one chunk as an asset of its own, with the splats of [`Self::splats`], and nothing else of the file.
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

    /// Decodes the layers that the limits allow.
    ///
    /// # Errors
    /// As [`decode`].
    pub fn decode(&self) -> Result<Contents> {
        let of_chunk =
            |chunk: usize| self.decode_chunk(chunk).map_err(|e| e.within(&format!("chunk {chunk}")));
        let chunks = (0..self.num_wanted).into_par_iter().map(of_chunk).collect::<Result<Vec<_>>>();
        self.assemble(chunks.map_err(|e| e.at(&self.path))?)
    }

    /// Joins all decoded chunks.
    ///
    /// # Errors
    /// [`Error::Invalid`] if they do not make a valid asset, [`Error::TooLarge`].
    pub(super) fn assemble(&self, chunks: Vec<(SplatAsset, Tally)>) -> Result<Contents> {
        let (chunks, tallies): (Vec<_>, Vec<_>) = chunks.into_iter().unzip();
        let mut asset = joined(self.empty(), self.header.sh_degree, chunks).map_err(|e| e.at(&self.path))?;
        asset.validate().map_err(|e| e.at(&self.path))?;
        if self.limits.layers == Some(0)
            && let Some(stand_in) = self.stand_in(&self.limits)?
        {
            asset = stand_in;
        }
        let stand_in = self.stand_in_size();
        let mut tally = Tally::default();
        tallies.iter().for_each(|t| tally.merge(t));
        tally.count("header", HEADER_BYTES as u64);
        tally.count("metadata", self.header.meta_bytes.into());
        tally.count("contents", (self.entries.len() * ENTRY_BYTES) as u64);
        tally.count("stand_in", stand_in.map_or(0, |size| size.bytes));
        let unread = self.entries[self.num_wanted..].iter();
        tally.count("unread", unread.flat_map(|e| (0..3).map(|kind| e.block(kind).bytes)).sum());
        tally.count("other", self.header.file_bytes.saturating_sub(tally.total()));
        let is_whole = self.num_wanted == self.entries.len();
        Ok(Contents {
            asset,
            format: format!("ltgs {MAJOR}.{}", self.header.minor),
            quality: Some(self.header.quality),
            hash: self.meta.hash().filter(|_| is_whole),
            sections: tally.sections(),
            layers: self.layer_sizes(),
            stand_in,
            warnings: self.warnings(),
        })
    }

    fn layer_sizes(&self) -> Vec<LayerSize> {
        let size = |entries: &[Entry]| {
            let mut size = LayerSize::default();
            for entry in entries {
                size.splats += u64::from(entry.num_splats);
                size.texels += entry.num_texels;
                size.geometry_bytes += entry.geometry.bytes;
                size.sh_bytes += entry.sh.bytes;
                size.texel_bytes += entry.texels.bytes;
            }
            size
        };
        self.entries.chunk_by(|a, b| a.layer == b.layer).map(size).collect()
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
        let bytes = bytes.ok_or_else(|| {
            let (end, found) = (block.offset.saturating_add(block.bytes), self.bytes.len());
            invalid!("", "a block ends at byte {end}, the file has {found}: truncated")
        })?;
        let found = XxHash3_64::oneshot(bytes);
        if found == block.checksum {
            return Ok(bytes);
        }
        Err(invalid!("", "checksum {found:016x}, stated {:016x}: damaged", block.checksum))
    }

    /// A chunk without the file's metadata, and its bytes by attribute.
    pub(super) fn decode_chunk(&self, chunk: usize) -> Result<(SplatAsset, Tally)> {
        let entry =
            self.entries.get(chunk).ok_or_else(|| invalid!("", "chunk {chunk} of {}", self.entries.len()))?;
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
    Err(invalid!("", "maps of {found} texels, the table of contents says {}", entry.num_texels))
}

/// Bytes of the arrays to which this many splats and texels of a file decode.
fn decoded_bytes(header: &Header, splats: u64, texels: u64) -> u64 {
    // Both are bounded by the header.
    splat_bytes(header.sh_degree) * splats + 12 * texels
}

/// Checks that layers are in order and their chunks full, that blocks lie in order and without overlap within the file, and that
/// counts agree with the header.
fn check_entries(header: &Header, meta: &FileMeta, entries: &[Entry]) -> Result<(), String> {
    check_layers(header, entries)?;
    let stand_in = meta.stand_in.as_ref().map_or(0, |stand_in| stand_in.bytes);
    let mut end = stand_in.saturating_add((HEADER_BYTES + header.tables_bytes()) as u64);
    if end > header.file_bytes {
        return Err(format!("stand-in: {stand_in} bytes, the file has {}", header.file_bytes));
    }
    for (chunk, kind) in blocks_in_order(entries) {
        let block = entries[chunk].block(kind);
        if block.offset < end {
            return Err(format!("chunk {chunk}: block at {}, but {end} bytes come before it", block.offset));
        }
        end = block.offset.checked_add(block.bytes).filter(|&end| end <= header.file_bytes).ok_or_else(
            || format!("chunk {chunk}: {block:?} ends behind the file of {} bytes", header.file_bytes),
        )?;
    }
    let num_texels = entries.iter().fold(0_u64, |sum, e| sum.saturating_add(e.num_texels));
    if num_texels != header.num_texels {
        return Err(format!("table of contents: {num_texels} texels, the header says {}", header.num_texels));
    }
    let num_splats: u64 = entries.iter().map(|e| u64::from(e.num_splats)).sum();
    if num_splats != u64::from(header.num_splats) {
        return Err(format!("table of contents: {num_splats} splats, the header says {}", header.num_splats));
    }
    Ok(())
}

fn check_layers(header: &Header, entries: &[Entry]) -> Result<(), String> {
    let is_lossless = header.quality == Quality::Lossless;
    for (chunk, entry) in entries.iter().enumerate() {
        let before = chunk.checked_sub(1).map(|before| entries[before].layer);
        let [same, above] = before.map_or([0; 2], |layer: u32| [layer, layer.saturating_add(1)]);
        if entry.layer != same && (entry.layer != above || is_lossless) {
            let is_alone = is_lossless || same == above;
            let expected = if is_alone { same.to_string() } else { format!("{same} or {above}") };
            return Err(format!("chunk {chunk}: layer {}, expected {expected}", entry.layer));
        }
        let next = entries.get(chunk + 1);
        let is_last = next.is_none_or(|next| next.layer != entry.layer);
        let fewest = if is_last { 1 } else { CHUNK_SPLATS };
        if !(fewest..=CHUNK_SPLATS).contains(&(entry.num_splats as usize)) {
            let (layer, splats) = (entry.layer, entry.num_splats);
            return Err(format!(
                "chunk {chunk} of layer {layer}: {splats} splats, expected {fewest} to {CHUNK_SPLATS}"
            ));
        }
    }
    Ok(())
}
