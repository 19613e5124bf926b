//! What the writer decides for the whole scene before it encodes chunks: order, exponents of splats, grid.

use super::layers::layers;
use super::math::floor_log2;
use super::morton::morton;
use super::shape::{EXPONENT_MAX, Shape};
use super::steps::{CELL_COORDINATE_BITS_MAX, GRID_BITS_MAX, Grid, Quantiser, Steps};
use crate::SplatAsset;

/// What is known of each splat of an asset that a lossy file is made of.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PerSplat<'a> {
    /// Exponents of the splats' steps, see [`super::Sensitivities::rounding`]; those that are missing are zero. `[n]`
    pub exponents: &'a [i8],
    /// What the splats contribute to images, in any unit: those that contribute most are in the first layer. If empty, it is
    /// estimated. `[n]`
    pub contributions: &'a [f32],
}

/// Order, exponents and quantiser of a lossy file.
pub struct Plan {
    /// Steps and grid that turn numbers into codes.
    pub quantiser: Quantiser,
    /// Splats in the order of the file: by layer, then along a Morton curve. `[n]`
    pub order: Vec<u32>,
    /// Splats of each layer.
    pub layers: Vec<usize>,
    /// Exponents x of the asset's splats. `[n]`
    pub exponents: Vec<i32>,
}

impl Plan {
    /// Plans for a valid asset and valid steps; missing exponents are zero.
    pub fn new(asset: &SplatAsset, steps: &Steps, per_splat: PerSplat<'_>) -> Self {
        let steps = steps.short();
        let within = |x: i8| i32::from(x).clamp(-EXPONENT_MAX, EXPONENT_MAX);
        let exponent = |splat: usize| per_splat.exponents.get(splat).copied().map_or(0, within);
        let exponents: Vec<i32> = (0..asset.num_splats()).map(exponent).collect();
        let shape = |splat: usize| Shape {
            exponent: exponents[splat],
            scales: asset.scales[splat],
            texel_sizes: asset.maps[splat].texel_sizes,
        };
        let mut grid = Grid {
            origin: [0.0; 3],
            reach: 1.0,
            bits: 0,
            cell_bits: 0,
            log2_scale: snapped(middle(
                asset.scales.iter().flatten().map(|s| f64::from(*s).log2()).collect(),
            )),
            log2_texel_size: snapped(middle_texel_size(asset)),
        };
        // Relative to a reach of 1: the exponent of the splat that needs the finest steps becomes 0.
        let finest = (0..asset.num_splats()).map(|splat| shape(splat).log2_position_step()).collect();
        grid.reach = super::math::two_to(low_quantile(finest));
        place(&mut grid, asset, steps.position);
        let mut quantiser = Quantiser { steps, grid };
        let fine: Vec<[u32; 3]> =
            asset.positions.iter().map(|&p| super::shape::fine_position(&quantiser, p)).collect();
        let coarse = grid.bits.saturating_sub(CELL_COORDINATE_BITS_MAX);
        let mut order: Vec<u32> = (0..asset.num_splats() as u32).collect();
        let keys: Vec<u64> = fine.iter().map(|c| morton(c.map(|c| c >> coarse))).collect();
        let layer_of = layers(asset, &exponents, per_splat.contributions);
        order.sort_by_key(|&splat| (layer_of[splat as usize], keys[splat as usize], splat));
        let by_layer = order.chunk_by(|a, b| layer_of[*a as usize] == layer_of[*b as usize]);
        let layers = by_layer.map(<[u32]>::len).collect();
        quantiser.grid.cell_bits = (coarse..=grid.bits)
            .min_by_key(|&cell_bits| {
                quantiser.grid.cell_bits = cell_bits;
                let place_bits = |splat: u32| {
                    u64::from(3 * (cell_bits - shape(splat as usize).position_exponent(&quantiser)))
                };
                gap_bits(&keys, &order, cell_bits - coarse)
                    + order.iter().map(|&s| place_bits(s)).sum::<u64>()
            })
            .unwrap_or(coarse);
        Self { quantiser, order, layers, exponents }
    }
}

/// Estimated bits of the gaps between cell numbers: the entropy of their lengths, and the bits behind the leading one.
fn gap_bits(keys: &[u64], order: &[u32], shift: u32) -> u64 {
    let mut counts = [0_u32; 65];
    let (mut last, mut open) = (0, 0);
    for &splat in order {
        let cell = keys[splat as usize] >> (3 * shift);
        // A layer begins anew.
        let length = 64 - cell.checked_sub(last).unwrap_or(cell).leading_zeros();
        last = cell;
        counts[length as usize] += 1;
        open += u64::from(length.saturating_sub(1));
    }
    let total = order.len() as f64;
    let entropy: f64 =
        counts.iter().filter(|&&n| n > 0).map(|&n| f64::from(n) * (total / f64::from(n)).log2()).sum();
    open + entropy as u64
}

/// To the nearest eighth: the median of decoded numbers, which differs by rounding, has the same.
fn snapped(log2: f64) -> f64 {
    (8.0 * log2).round() / 8.0
}

/// The origin is a multiple of this many finest steps, so that decoded positions, none of which lie before it, have the same.
const ORIGIN_STEPS: f64 = 4096.0;

/// Sets origin and bits of a cube of finest steps that holds all positions.
fn place(grid: &mut Grid, asset: &SplatAsset, position_step: f64) {
    let (mut low, mut high) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
    for position in &asset.positions {
        for axis in 0..3 {
            low[axis] = low[axis].min(position[axis].into());
            high[axis] = high[axis].max(position[axis].into());
        }
    }
    if asset.positions.is_empty() {
        return;
    }
    let edge = (0..3).map(|axis| high[axis] - low[axis]).fold(0.0, f64::max);
    let needed = |reach: f64| edge / (position_step * reach) + ORIGIN_STEPS;
    // Where 31 bits do not suffice, the finest splats get coarser steps.
    while needed(grid.reach) >= 2.0_f64.powi(GRID_BITS_MAX as i32) {
        grid.reach *= 2.0;
    }
    let unit = ORIGIN_STEPS * position_step * grid.reach;
    // Within what an f32 can be, as readers demand.
    let aligned = |low: f64| Some((low / unit).floor() * unit).filter(|&aligned| aligned >= f32::MIN.into());
    grid.origin = low.map(|low| aligned(low).unwrap_or(low));
    grid.bits = (floor_log2(needed(grid.reach)) as u32 + 1).min(GRID_BITS_MAX);
}

/// The median.
fn middle(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(0.0)
}

/// The first percentile.
fn low_quantile(mut values: Vec<i32>) -> i32 {
    values.sort_unstable();
    values.get(values.len() / 100).copied().unwrap_or(0)
}

/// Median difference between log2 of the geometric means of texel sizes and what standard deviations and texel counts predict.
fn middle_texel_size(asset: &SplatAsset) -> f64 {
    let textured = asset.maps.iter().zip(&asset.scales).filter(|(map, _)| map.num_texels() > 0);
    let off = |(map, scales): (&crate::AssetMap, &[f32; 2])| {
        let area = f64::from(scales[0]) * f64::from(scales[1]) / map.num_texels() as f64;
        let [texel_u, texel_v] = map.texel_sizes.map(f64::from);
        0.5 * (texel_u * texel_v).log2() - 0.5 * area.log2()
    };
    middle(textured.map(off).collect())
}
