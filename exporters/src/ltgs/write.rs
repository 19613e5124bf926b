//! The writer: encodes chunks in parallel, then assembles the file.

use super::header::{Block, Entry, HEADER_BYTES, Header, MINOR, blocks_in_order};
use super::layers::{PlannedChunk, chunks};
use super::lossless;
use super::orient::{as_given, oriented};
use super::plan::{PerSplat, Plan};
use super::splats::SplatCodes;
use super::stand_in::StandIn;
use super::steps::{Quantiser, Steps};
use super::tables::{FileMeta, Order};
use super::texels::{Map, TexelWriter};
use crate::asset::hash::text_from_hash;
use crate::asset::meta::Meta;
use crate::files::limits::with_room;
use crate::math::sh::SH_0;
use crate::{Error, Quality, Result, SplatAsset, num_sh_coefficients};
use rayon::prelude::*;
use twox_hash::XxHash3_64;

/// How long to look for a smaller lossless file. Lossy files take the same time either way.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Effort {
    /// For files that are written once and read often.
    #[default]
    Full,
    /// For files that are read once, on the same machine: 1 to 2 % larger (measured: 16.7 million texels in 0.75 s instead of 10 s).
    Quick,
}

impl Effort {
    /// Level of zstd.
    fn zstd_level(self) -> i32 {
        match self {
            Self::Full => 19,
            Self::Quick => 1,
        }
    }
}

/// How to write a file.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LtgsOptions<'a> {
    /// Quality that the file states.
    pub quality: Quality,
    /// Quantisation steps, for lossy files only; `None` takes [`Steps::balanced`] or [`Steps::tiny`].
    pub steps: Option<Steps>,
    /// What is known of the splats, for lossy files only.
    pub per_splat: PerSplat<'a>,
    /// How long lossless files may take.
    pub effort: Effort,
    /// A small scene that is shown first.
    pub stand_in: Option<StandIn<'a>>,
}

/// Encodes a file. The same asset and options give the same bytes.
///
/// Lossless files keep every bit and the order of splats. Others round by the steps and put splats in layers, and in Morton
/// order within a layer: [`quantised`] returns what a reader gets.
///
/// # Errors
/// [`Error::Invalid`] or [`Error::TooLarge`] if the asset, its metadata or the steps break a rule.
pub fn encode(asset: &SplatAsset, options: &LtgsOptions<'_>) -> Result<Vec<u8>> {
    asset.validate()?;
    let steps = match (options.quality, options.steps) {
        (Quality::Lossless, _) => {
            let meta = file_meta(asset, options.quality, asset.hash(), None);
            let chunks = lossless_chunks(asset, options.effort);
            return assemble(asset, options.quality, meta, options.stand_in, &chunks);
        }
        (_, Some(steps)) => steps,
        (Quality::Balanced | Quality::Custom, None) => Steps::balanced(),
        (Quality::Tiny, None) => Steps::tiny(),
    };
    steps.validate()?;
    let asset = &oriented(asset);
    encode_planned(asset, options, &Plan::new(asset, &steps, options.per_splat))
}

/// Encodes a lossy file of an oriented asset as planned.
///
/// # Errors
/// As [`encode`].
pub fn encode_planned(asset: &SplatAsset, options: &LtgsOptions<'_>, plan: &Plan) -> Result<Vec<u8>> {
    let coded = map_chunks(&plan.layers, |chunk| {
        let coded = CodedChunk::new(asset, plan, chunk)?;
        Ok((coded.encode(plan, asset.sh_degree)?, coded.decoded))
    })?;
    let (chunks, decoded): (Vec<_>, Vec<_>) = coded.into_iter().unzip();
    let hash = SplatAsset::hash_of(asset, &decoded);
    drop(decoded);
    let meta = file_meta(asset, options.quality, hash, Some(plan.quantiser));
    assemble(asset, options.quality, meta, options.stand_in, &chunks)
}

fn file_meta(asset: &SplatAsset, quality: Quality, hash: u64, quantiser: Option<Quantiser>) -> FileMeta {
    FileMeta {
        quality: quality.name().to_owned(),
        order: if quantiser.is_some() { Order::Morton } else { Order::Given },
        hash: text_from_hash(hash),
        quantiser,
        stand_in: None,
        meta: if quantiser.is_some() { Meta::with_short_cameras(asset) } else { Meta::of(asset) },
    }
}

/// An asset rounded as a lossy file rounds it.
#[derive(Clone, Debug)]
pub struct Rounded {
    /// What a reader gets, bit for bit.
    pub asset: SplatAsset,
    /// For each of its splats the index before. `[n]`
    pub order: Vec<u32>,
}

/// Rounds an [`oriented`] asset with these steps, without encoding a file.
///
/// # Errors
/// As [`encode`].
pub fn rounded(asset: &SplatAsset, steps: &Steps, per_splat: PerSplat<'_>) -> Result<Rounded> {
    asset.validate()?;
    rounded_valid(asset, steps, per_splat)
}

fn rounded_valid(asset: &SplatAsset, steps: &Steps, per_splat: PerSplat<'_>) -> Result<Rounded> {
    steps.validate()?;
    let plan = Plan::new(asset, steps, per_splat);
    let chunks = map_chunks(&plan.layers, |chunk| Ok(CodedChunk::new(asset, &plan, chunk)?.decoded))?;
    let mut whole = SplatAsset::default();
    Meta::with_short_cameras(asset).store(&mut whole);
    Ok(Rounded { asset: joined(whole, asset.sh_degree, chunks)?, order: plan.order })
}

/// The asset that a reader gets from a lossy file with these steps, bit for bit, without encoding the file.
///
/// # Errors
/// As [`encode`].
pub fn quantised(asset: &SplatAsset, steps: &Steps, per_splat: PerSplat<'_>) -> Result<SplatAsset> {
    asset.validate()?;
    Ok(rounded_valid(&oriented(asset), steps, per_splat)?.asset)
}

/// An asset whose numbers are those that a reader of a lossy file with these steps gets, with its splats as they are.
///
/// # Errors
/// As [`encode`].
pub fn rounded_in_place(asset: &SplatAsset, steps: &Steps, per_splat: PerSplat<'_>) -> Result<SplatAsset> {
    asset.validate()?;
    let rounded = rounded_valid(&oriented(asset), steps, per_splat)?;
    Ok(as_given(asset, (&rounded.asset, &rounded.order)))
}

/// Calls `of_chunk` with each chunk of layers with these numbers of splats, in parallel; returns the results in order.
fn map_chunks<T: Send>(
    layers: &[usize],
    of_chunk: impl Fn(PlannedChunk) -> Result<T> + Sync,
) -> Result<Vec<T>> {
    chunks(layers).into_par_iter().map(&of_chunk).collect()
}

/// Appends chunks to an asset without splats.
///
/// # Errors
/// [`Error::TooLarge`] for more than 2^32 - 1 texels.
pub fn joined(mut whole: SplatAsset, sh_degree: u32, chunks: Vec<SplatAsset>) -> Result<SplatAsset> {
    whole.sh_degree = sh_degree;
    // Memory is committed as it is written, while that of the chunks is freed.
    whole.texels = with_room(chunks.iter().map(|c| c.texels.len()).sum())?;
    whole.sh = with_room(chunks.iter().map(|c| c.sh.len()).sum())?;
    for chunk in chunks {
        let first = u32::try_from(whole.num_texels()).ok();
        for map in chunk.maps {
            let offset = first.and_then(|first| first.checked_add(map.offset_texels));
            let offset_texels = offset.ok_or_else(|| Error::too_large("", "more than 2^32 - 1 texels"))?;
            whole.maps.push(crate::AssetMap { offset_texels, ..map });
        }
        whole.positions.extend(chunk.positions);
        whole.rotations.extend(chunk.rotations);
        whole.scales.extend(chunk.scales);
        whole.opacities.extend(chunk.opacities);
        whole.sh_degrees.extend(chunk.sh_degrees);
        whole.sh.extend(chunk.sh);
        whole.texels.extend(chunk.texels);
    }
    Ok(whole)
}

/// The blocks of a chunk, geometry, SH and texels, with its entry of the table of contents, offsets still missing.
pub struct Chunk {
    blocks: [Vec<u8>; 3],
    entry: Entry,
}

impl Chunk {
    fn new(blocks: [Vec<u8>; 3], layer: u32, positions: &[[f32; 3]], num_texels: usize) -> Self {
        let mut bounds = [[f32::INFINITY; 3], [f32::NEG_INFINITY; 3]];
        for position in positions {
            for axis in 0..3 {
                bounds[0][axis] = bounds[0][axis].min(position[axis]);
                bounds[1][axis] = bounds[1][axis].max(position[axis]);
            }
        }
        let block = |bytes: &[u8]| Block {
            offset: 0,
            bytes: bytes.len() as u64,
            checksum: XxHash3_64::oneshot(bytes),
        };
        let entry = Entry {
            geometry: block(&blocks[0]),
            sh: block(&blocks[1]),
            texels: block(&blocks[2]),
            num_splats: positions.len() as u32,
            layer,
            num_texels: num_texels as u64,
            bounds,
        };
        Self { blocks, entry }
    }
}

fn lossless_chunks(asset: &SplatAsset, effort: Effort) -> Vec<Chunk> {
    let level = effort.zstd_level();
    let of_chunk = |PlannedChunk { layer, splats: range }| {
        let first = asset.maps.get(range.start).map_or(0, |m| m.offset_texels as usize);
        let last = asset.maps.get(range.end).map_or(asset.num_texels(), |m| m.offset_texels as usize);
        let blocks = [
            lossless::encode_geometry(asset, range.clone(), level),
            lossless::encode_sh(asset, range.clone(), level),
            lossless::encode_texels(&asset.texels[3 * first..3 * last], level),
        ];
        Ok(Chunk::new(blocks, layer, &asset.positions[range], last - first))
    };
    // This `of_chunk` does not fail.
    map_chunks(&[asset.num_splats()], of_chunk).unwrap_or_default()
}

/// A chunk of a lossy file before its streams are coded.
struct CodedChunk {
    layer: u32,
    splats: SplatCodes,
    texels: TexelWriter,
    decoded: SplatAsset,
}

impl CodedChunk {
    fn new(asset: &SplatAsset, plan: &Plan, chunk: PlannedChunk) -> Result<Self> {
        let quantiser = &plan.quantiser;
        let (mut splats, mut texels) = (SplatCodes::default(), TexelWriter::default());
        let (mut decoded_texels, mut means) = (Vec::new(), Vec::new());
        for &splat in &plan.order[chunk.splats] {
            let splat = splat as usize;
            let exponent = plan.exponents[splat];
            let map = splats.push(quantiser, asset, splat, exponent);
            let first = decoded_texels.len();
            texels.push(&quantiser.steps, &map, asset.texels_of(splat), &mut decoded_texels);
            let mean = mean_of(&map, &decoded_texels[first..]);
            splats.push_colours(quantiser, asset.sh_of(splat), exponent, mean);
            means.push(mean);
        }
        let mut decoded = splats.values(quantiser, asset.sh_degree)?;
        decoded.texels = decoded_texels;
        take_means(&mut decoded, &means);
        Ok(Self { layer: chunk.layer, splats, texels, decoded })
    }

    fn encode(&self, plan: &Plan, sh_degree: u32) -> Result<Chunk> {
        let blocks = [
            self.splats.encode_geometry(&plan.quantiser, sh_degree)?,
            self.splats.encode_sh(sh_degree),
            self.texels.encode(),
        ];
        Ok(Chunk::new(blocks, self.layer, &self.decoded.positions, self.decoded.num_texels()))
    }
}

/// Mean residual of a decoded map; zero without a map.
pub fn mean_of(map: &Map, texels: &[f32]) -> [f64; 3] {
    if texels.is_empty() { [0.0; 3] } else { map.mean_residual(texels) }
}

/// Subtracts the means of maps from colours that contain them.
pub fn take_means(asset: &mut SplatAsset, means: &[[f64; 3]]) {
    let width = 3 * num_sh_coefficients(asset.sh_degree);
    for (sh, mean) in asset.sh.chunks_exact_mut(width).zip(means) {
        for (c, m) in sh.iter_mut().zip(mean) {
            *c = (f64::from(*c) - m / SH_0) as f32;
        }
    }
}

fn assemble(
    asset: &SplatAsset,
    quality: Quality,
    mut meta: FileMeta,
    stand_in: Option<StandIn<'_>>,
    chunks: &[Chunk],
) -> Result<Vec<u8>> {
    meta.stand_in = stand_in.map(|stand_in| stand_in.entry());
    let stand_in = stand_in.map_or(&[][..], |stand_in| stand_in.file);
    let (meta_bytes, meta_text_bytes) = meta.encode()?;
    let blocks_bytes: usize = chunks.iter().flat_map(|c| &c.blocks).map(Vec::len).sum();
    let mut header = Header {
        minor: MINOR,
        num_splats: asset.num_splats() as u32,
        num_texels: asset.num_texels() as u64,
        num_chunks: chunks.len() as u32,
        sh_degree: asset.sh_degree,
        quality,
        meta_bytes: meta_bytes.len() as u32,
        meta_text_bytes: meta_text_bytes as u32,
        file_bytes: 0,
        tables_checksum: 0,
    };
    let mut tables = meta_bytes;
    let first = HEADER_BYTES + header.tables_bytes() + stand_in.len();
    header.file_bytes = (first + blocks_bytes) as u64;
    let mut offset = first as u64;
    let mut entries: Vec<Entry> = chunks.iter().map(|c| c.entry).collect();
    let blocks = blocks_in_order(&entries);
    for &(chunk, kind) in &blocks {
        let block = entries[chunk].block_mut(kind);
        block.offset = offset;
        offset += block.bytes;
    }
    entries.iter().for_each(|e| e.encode(&mut tables));
    header.tables_checksum = XxHash3_64::oneshot(&tables);
    let mut bytes = Vec::with_capacity(first + blocks_bytes);
    bytes.extend(header.encode());
    bytes.extend(tables);
    bytes.extend(stand_in);
    blocks.iter().for_each(|&(chunk, kind)| bytes.extend_from_slice(&chunks[chunk].blocks[kind]));
    Ok(bytes)
}
