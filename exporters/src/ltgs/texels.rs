//! Texels of a lossy file: luma and chroma, predicted from the texels to the left and above, rounded by steps that grow
//! where the Gaussian is small, and sorted into streams by how large the rounded numbers are likely to be.

use super::colour::{luma_chroma, rgb};
use super::integers::{put_numbers, take_numbers, unzigzag, zigzag};
use super::math::{exp2, two_to};
use super::shape::Shape;
use super::steps::Steps;
use crate::{Error, Result};
use std::f64::consts::{LN_2, TAU};

/// Streams of a chunk: luma or chroma, times four classes of steps, times three of neighbours.
pub const NUM_STREAMS: usize = 24;

/// Share of each of the neighbours to the left and above in a texel's prediction. Trained residuals are nearly white, and
/// rounding adds noise: 0.5 measured 0.1 bits per texel more.
const PREDICTION: f64 = 0.35;

/// Offset before rounding down: 0.5 rounds to the nearest. Less saves more bits than a finer step costs (measured: 0.15
/// bits per texel at equal error).
const ROUNDING: f64 = 0.4;

/// Smallest and largest exponent of the steps of texels.
const EXPONENTS: (i32, i32) = (-16, 16);

/// The shape of a splat and the sides of its map.
#[derive(Clone, Copy)]
pub struct Map {
    /// The decoded splat.
    pub shape: Shape,
    /// Texels along the tangent u.
    pub rows: u16,
    /// Texels along the tangent v.
    pub cols: u16,
    /// The map's centre from the splat's along u and v, half texels.
    pub shift: [i16; 2],
}

impl Map {
    /// Squared distances of texels from the splat's centre along an axis, u (0) or v (1), in standard deviations.
    fn squares(&self, axis: usize) -> Vec<f64> {
        let count = [self.rows, self.cols][axis];
        let middle = 0.5 * (f64::from(count) - 1.0 - f64::from(self.shift[axis]));
        let (texel, scale) = (f64::from(self.shape.texel_sizes[axis]), f64::from(self.shape.scales[axis]));
        let square = |i: u16| {
            let d = (f64::from(i) - middle) * texel / scale;
            d * d
        };
        (0..count).map(square).collect()
    }

    /// Exponents by which the steps of texels grow towards the rim, row by row. `[rows * cols]`
    pub fn falloff_exponents(&self) -> impl Iterator<Item = i32> {
        let (of_rows, of_cols) = (self.squares(0), self.squares(1));
        of_rows.into_iter().flat_map(move |of_row| {
            let of_cols = of_cols.clone();
            of_cols.into_iter().map(move |of_col| falloff_exponent(of_row + of_col))
        })
    }

    /// Visits all texels in order. `symbol` gets texel, channel, stream, prediction and step, and returns the number of
    /// steps from the prediction; texels are appended to `out` as RGB in [-1, 1].
    fn walk(
        &self,
        steps: &Steps,
        out: &mut Vec<f32>,
        mut symbol: impl FnMut(usize, usize, usize, f64, f64) -> Result<i32>,
    ) -> Result<()> {
        let (of_rows, of_cols) = (self.squares(0), self.squares(1));
        let mut above = vec![Neighbour::default(); of_cols.len()];
        for (row, of_row) in of_rows.iter().enumerate() {
            let mut left = Neighbour::default();
            for (col, (of_col, above)) in of_cols.iter().zip(&mut above).enumerate() {
                let exponent =
                    (self.shape.exponent + falloff_exponent(of_row + of_col)).clamp(EXPONENTS.0, EXPONENTS.1);
                let luma_step = steps.texel * two_to(exponent);
                let class = 3 * exponent.clamp(0, 3) as usize;
                let mut here = Neighbour::default();
                for channel in 0..3 {
                    let step = if channel == 0 { luma_step } else { luma_step * steps.chroma };
                    let context = class + activity(left.sizes[channel] + above.sizes[channel]);
                    let stream = if channel == 0 { context } else { 12 + context };
                    let predicted = PREDICTION * (left.values[channel] + above.values[channel]);
                    let number = symbol(row * of_cols.len() + col, channel, stream, predicted, step)?;
                    here.values[channel] = predicted + f64::from(number) * step;
                    here.sizes[channel] = number.unsigned_abs().min(1 << 16);
                }
                out.extend(rgb(here.values).map(|v| v.clamp(-1.0, 1.0) as f32));
                left = here;
                *above = here;
            }
        }
        Ok(())
    }

    /// [`crate::SplatAsset::mean_residual`] of these texels, in arithmetic that gives the same bits on every machine.
    pub fn mean_residual(&self, texels: &[f32]) -> [f64; 3] {
        let weights = |squares: Vec<f64>| squares.iter().map(|d| exp2(-0.5 * d / LN_2)).collect::<Vec<_>>();
        let (of_rows, of_cols) = (weights(self.squares(0)), weights(self.squares(1)));
        let (mut sum, mut total) = ([0.0; 3], 0.0);
        let mut texels = texels.as_chunks::<3>().0.iter();
        for of_row in of_rows {
            for (of_col, texel) in of_cols.iter().zip(&mut texels) {
                let weight = of_row * of_col;
                total += weight;
                for (s, &t) in sum.iter_mut().zip(texel) {
                    *s += weight * f64::from(t);
                }
            }
        }
        let [scale_u, scale_v] = self.shape.scales.map(f64::from);
        let [texel_u, texel_v] = self.shape.texel_sizes.map(f64::from);
        let whole = TAU * scale_u * scale_v / (texel_u * texel_v);
        let total = if whole > total { whole } else { total };
        if total.is_finite() && total > 0.0 { sum.map(|s| s / total) } else { [0.0; 3] }
    }
}

/// Values of a decoded texel, and sizes of its numbers; zero outside the map.
#[derive(Clone, Copy, Default)]
struct Neighbour {
    values: [f64; 3],
    sizes: [u32; 3],
}

/// `-log2` of the Gaussian at a squared distance, rounded to an integer from 0 to 4.
fn falloff_exponent(square: f64) -> i32 {
    [1.0, 3.0, 5.0, 7.0].iter().map(|odd| i32::from(square > LN_2 * odd)).sum()
}

fn activity(sizes: u32) -> usize {
    match sizes {
        0 => 0,
        1 | 2 => 1,
        _ => 2,
    }
}

/// Collects the numbers of a chunk for a file.
pub struct TexelWriter {
    streams: Vec<Vec<u32>>,
}

impl TexelWriter {
    /// A writer without maps.
    pub fn new() -> Self {
        Self { streams: vec![Vec::new(); NUM_STREAMS] }
    }

    /// Appends a map; its texels as readers will decode them are appended to `out`. `texels`: `[rows, cols, 3]`
    pub fn push(&mut self, steps: &Steps, map: &Map, texels: &[f32], out: &mut Vec<f32>) {
        let wanted: Vec<[f64; 3]> =
            texels.as_chunks::<3>().0.iter().map(|t| luma_chroma(t.map(f64::from))).collect();
        let symbol = |texel: usize, channel: usize, stream: usize, predicted: f64, step: f64| {
            let off = (wanted[texel][channel] - predicted) / step;
            let size = (off.abs() + ROUNDING).floor() as i32;
            let number = if off < 0.0 { -size } else { size };
            self.streams[stream].push(zigzag(number));
            Ok(number)
        };
        // This `symbol` does not fail.
        let _ = map.walk(steps, out, symbol);
    }

    /// Encodes the block of texels.
    pub fn encode(&self) -> Vec<u8> {
        let mut block = Vec::new();
        for stream in &self.streams {
            put_numbers(&mut block, stream);
        }
        block
    }
}

/// Hands out the numbers of a chunk of a file.
pub struct TexelReader {
    streams: Vec<std::vec::IntoIter<u32>>,
}

impl TexelReader {
    /// Decodes the streams of a block of `num_texels` texels.
    ///
    /// # Errors
    /// [`Error::Invalid`] or [`Error::Unsupported`] for a damaged block.
    pub fn new(mut block: &[u8], num_texels: usize) -> Result<Self> {
        let mut left = num_texels.saturating_mul(3);
        let mut streams = Vec::with_capacity(NUM_STREAMS);
        for _ in 0..NUM_STREAMS {
            let numbers = take_numbers(&mut block, left)?;
            left -= numbers.len();
            streams.push(numbers.into_iter());
        }
        if left > 0 || !block.is_empty() {
            let what = format!("texel block: {left} numbers too few, {} bytes too many", block.len());
            return Err(Error::invalid("", what));
        }
        Ok(Self { streams })
    }

    /// Appends the texels of the next map to `out`. `[rows, cols, 3]`
    ///
    /// # Errors
    /// [`Error::Invalid`] if a stream ends too early.
    pub fn next(&mut self, steps: &Steps, map: &Map, out: &mut Vec<f32>) -> Result<()> {
        let streams = &mut self.streams;
        map.walk(steps, out, |_, _, stream, _, _| {
            let number = streams.get_mut(stream).and_then(Iterator::next);
            number
                .map(unzigzag)
                .ok_or_else(|| Error::invalid("", format!("texel stream {stream} ends early")))
        })
    }
}
