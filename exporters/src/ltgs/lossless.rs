//! Chunks of a lossless file: the bytes of f32 numbers sorted by their significance, because high bytes are similar
//! and low bytes are noise. Splats keep the order of the asset.

use super::bands::{bands, put_degrees, take_degrees};
use super::integers::{alone, put_bytes, put_numbers, take_bytes, take_exactly, zigzag};
use super::maps::{put_shifts, take_shifts};
use super::tally::Tally;
use crate::files::limits::filled;
use crate::{AssetMap, Error, Result, SplatAsset, num_sh_coefficients};
use std::ops::Range;

/// Step of the means that stand for maps where texels are not read.
const MEAN_STEP: f64 = 1.0 / 255.0;

/// Appends the bytes of numbers in `N` planes; within a plane, component by component. `values`: `[count, width]`
fn put_planes<const N: usize>(block: &mut Vec<u8>, values: &[[u8; N]], width: usize, level: i32) {
    for plane in 0..N {
        let component = |c: usize| values.iter().skip(c).step_by(width.max(1)).map(move |v| v[plane]);
        let bytes: Vec<u8> = (0..width).flat_map(component).collect();
        put_bytes(block, &bytes, level_for(&bytes, level));
    }
}

/// The fastest level for bytes that no level makes smaller.
fn level_for(bytes: &[u8], level: i32) -> i32 {
    let sample = &bytes[..bytes.len().min(1 << 16)];
    let mut counts = [0_u32; 256];
    sample.iter().for_each(|&b| counts[usize::from(b)] += 1);
    let total = sample.len() as f64;
    let entropy: f64 =
        counts.iter().filter(|&&n| n > 0).map(|&n| f64::from(n) * (total / f64::from(n)).log2()).sum();
    if entropy > 7.9 * total { 1 } else { level }
}

fn put_floats(block: &mut Vec<u8>, values: &[f32], width: usize, level: i32) {
    let bytes: Vec<[u8; 4]> = values.iter().map(|v| v.to_le_bytes()).collect();
    put_planes(block, &bytes, width, level);
}

/// Numbers whose bytes stand in `N` planes, least significant first; see [`put_planes`]. `[count, width]`
fn take_planes<const N: usize>(block: &mut &[u8], count: usize, width: usize) -> Result<Vec<u32>> {
    let mut values = filled(count * width, 0_u32)?;
    for plane in 0..N {
        let bytes = take_bytes(block, count * width)?;
        for (component, bytes) in bytes.chunks_exact(count.max(1)).enumerate() {
            for (value, &byte) in values.iter_mut().skip(component).step_by(width.max(1)).zip(bytes) {
                *value |= u32::from(byte) << (8 * plane);
            }
        }
    }
    Ok(values)
}

fn take_floats(block: &mut &[u8], count: usize, width: usize) -> Result<Vec<f32>> {
    // In place: both are of 32 bits.
    Ok(take_planes::<4>(block, count, width)?.into_iter().map(f32::from_bits).collect())
}

fn take_arrays<const W: usize>(block: &mut &[u8], count: usize) -> Result<Vec<[f32; W]>> {
    Ok(take_floats(block, count, W)?.as_chunks::<W>().0.to_vec())
}

/// Encodes the geometry of a chunk.
pub fn encode_geometry(asset: &SplatAsset, splats: Range<usize>, level: i32) -> Vec<u8> {
    let mut block = Vec::new();
    let maps = &asset.maps[splats.clone()];
    for side in [|m: &AssetMap| m.rows, |m: &AssetMap| m.cols] {
        let bytes: Vec<[u8; 2]> = maps.iter().map(|m| side(m).to_le_bytes()).collect();
        put_planes(&mut block, &bytes, 1, level);
    }
    let sizes = |axis: usize| maps.iter().map(move |m| m.texel_sizes[axis].to_bits());
    put_planes(&mut block, &sizes(0).map(u32::to_le_bytes).collect::<Vec<_>>(), 1, level);
    // Equal sizes leave zeros, and ratios that are powers of two mostly so.
    let ratios: Vec<[u8; 4]> = sizes(0).zip(sizes(1)).map(|(u, v)| (u ^ v).to_le_bytes()).collect();
    put_planes(&mut block, &ratios, 1, level);
    let shifts: Vec<[i16; 2]> = maps.iter().filter(|m| m.num_texels() > 0).map(|m| m.shift).collect();
    put_shifts(&mut block, &shifts, [alone; 2]);
    put_floats(&mut block, asset.positions[splats.clone()].as_flattened(), 3, level);
    put_floats(&mut block, asset.rotations[splats.clone()].as_flattened(), 4, level);
    put_floats(&mut block, asset.scales[splats.clone()].as_flattened(), 2, level);
    put_floats(&mut block, &asset.opacities[splats.clone()], 1, level);
    let sh0: Vec<f32> = splats.clone().flat_map(|s| &asset.sh_of(s)[..3]).copied().collect();
    put_floats(&mut block, &sh0, 3, level);
    let means: Vec<[i32; 3]> =
        splats.map(|s| asset.mean_residual(s).map(|m| (m / MEAN_STEP).round() as i32)).collect();
    for channel in 0..3 {
        let numbers: Vec<u32> = means.iter().map(|m| zigzag(m[channel])).collect();
        put_numbers(&mut block, &numbers, alone);
    }
    block
}

/// Encodes the SH of a chunk above degree 0.
pub fn encode_sh(asset: &SplatAsset, splats: Range<usize>, level: i32) -> Vec<u8> {
    let mut block = Vec::new();
    if asset.sh_degree == 0 {
        return block;
    }
    put_degrees(&mut block, &asset.sh_degrees[splats.clone()], asset.sh_degree, alone);
    for (degree, band) in bands(asset.sh_degree) {
        let of_band = splats.clone().filter(|&s| asset.sh_degrees[s] >= degree);
        let values: Vec<f32> =
            of_band.flat_map(|s| &asset.sh_of(s)[3 * band.start..3 * band.end]).copied().collect();
        put_floats(&mut block, &values, 3 * band.len(), level);
    }
    block
}

/// Encodes the texels of a chunk.
pub fn encode_texels(texels: &[f32], level: i32) -> Vec<u8> {
    let mut block = Vec::new();
    put_floats(&mut block, texels, 3, level);
    block
}

/// Decodes the geometry of a chunk. The means of maps, for programs that show splats before texels, are checked and left
/// out.
///
/// # Errors
/// [`Error::Invalid`] or [`Error::Unsupported`].
pub fn decode_geometry(mut block: &[u8], n: usize, tally: &mut Tally) -> Result<SplatAsset> {
    let block = &mut block;
    let mut asset = SplatAsset::default();
    let mut before = block.len();
    let mut count = |name: &str, after: usize| before = tally.add(name, before, after);
    let sides = |block: &mut &[u8]| -> Result<Vec<u16>> {
        Ok(take_planes::<2>(block, n, 1)?.into_iter().map(|side| side as u16).collect())
    };
    let (rows, cols) = (sides(block)?, sides(block)?);
    let (along_u, changed) = (take_planes::<4>(block, n, 1)?, take_planes::<4>(block, n, 1)?);
    let textured = rows.iter().zip(&cols).filter(|(rows, cols)| **rows > 0 && **cols > 0).count();
    let mut shifts = take_shifts(block, textured, [alone; 2])?.into_iter();
    let mut offset_texels = 0_u32;
    for ((rows, cols), (u, change)) in rows.into_iter().zip(cols).zip(along_u.into_iter().zip(changed)) {
        let texel_sizes = [u, u ^ change].map(f32::from_bits);
        let mut map = AssetMap { offset_texels, rows, cols, texel_sizes, shift: [0; 2] };
        if map.num_texels() > 0 {
            map.shift = shifts.next().unwrap_or_default();
        }
        asset.maps.push(map);
        offset_texels = offset_texels
            .checked_add(map.num_texels() as u32)
            .ok_or_else(|| Error::too_large("", "more than 2^32 texels in a chunk"))?;
    }
    count("maps", block.len());
    asset.positions = take_arrays(block, n)?;
    count("positions", block.len());
    asset.rotations = take_arrays(block, n)?;
    count("rotations", block.len());
    asset.scales = take_arrays(block, n)?;
    count("scales", block.len());
    asset.opacities = take_floats(block, n, 1)?;
    count("opacities", block.len());
    asset.sh = take_floats(block, n, 3)?;
    asset.sh_degrees = filled(n, 0)?;
    count("sh0", block.len());
    for _ in 0..3 {
        take_exactly(block, n, alone)?;
    }
    count("means", block.len());
    if block.is_empty() { Ok(asset) } else { Err(invalid!("", "geometry: {} bytes too many", block.len())) }
}

/// Adds the SH above degree 0, up to `sh_degree`, to a chunk with geometry.
///
/// # Errors
/// As [`decode_geometry`].
pub fn decode_sh(mut block: &[u8], sh_degree: u32, asset: &mut SplatAsset, tally: &mut Tally) -> Result<()> {
    let block = &mut block;
    if sh_degree > 0 {
        let (n, width) = (asset.num_splats(), 3 * num_sh_coefficients(sh_degree));
        let before = block.len();
        asset.sh_degrees = take_degrees(block, n, sh_degree, alone)?;
        let before = tally.add("sh_degrees", before, block.len());
        let mut sh = filled(n * width, 0.0)?;
        sh.chunks_exact_mut(width)
            .zip(asset.sh.chunks_exact(3))
            .for_each(|(of, dc)| of[..3].copy_from_slice(dc));
        for (degree, band) in bands(sh_degree) {
            let with_band = || asset.sh_degrees.iter().enumerate().filter(move |(_, own)| **own >= degree);
            let values = take_floats(block, with_band().count(), 3 * band.len())?;
            for ((splat, _), values) in with_band().zip(values.chunks_exact(3 * band.len())) {
                sh[splat * width + 3 * band.start..][..values.len()].copy_from_slice(values);
            }
        }
        tally.add("sh_rest", before, block.len());
        (asset.sh, asset.sh_degree) = (sh, sh_degree);
    }
    if block.is_empty() { Ok(()) } else { Err(invalid!("", "SH: {} bytes too many", block.len())) }
}

/// Decodes the texels of a chunk. `[num_texels, 3]`
///
/// # Errors
/// As [`decode_geometry`].
pub fn decode_texels(mut block: &[u8], num_texels: usize) -> Result<Vec<f32>> {
    let texels = take_floats(&mut block, num_texels, 3)?;
    if block.is_empty() {
        Ok(texels)
    } else {
        Err(invalid!("", "texel block: {} bytes too many", block.len()))
    }
}
