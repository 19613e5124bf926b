//! Texels of a lossy file: luma and chroma, predicted from the texels to the left and above, rounded by steps that grow
//! where the Gaussian is small, in one stream with contexts that tell how large the rounded numbers are likely to be.

use super::colour::{luma_chroma, rgb};
use super::contexts::size;
use super::integers::{put_coded, take_coded, unzigzag, zigzag};
use super::math::{exp2, two_to};
use super::numbers::{NumberReader, NumberWriter, length};
use super::shape::Shape;
use super::steps::Steps;
use crate::{Error, Result};
use std::f64::consts::{LN_2, TAU};

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

    /// Visits all texels in order. `symbol` gets texel and channel, the contexts, prediction and step, and returns the number
    /// of steps from the prediction; texels are appended to `out` as RGB in [-1, 1].
    fn walk(
        &self,
        steps: &Steps,
        out: &mut Vec<f32>,
        mut symbol: impl FnMut([usize; 2], [u16; 2], f64, f64) -> i32,
    ) {
        let (of_rows, of_cols) = (self.squares(0), self.squares(1));
        let mut above = vec![Neighbour::default(); of_cols.len()];
        for (row, of_row) in of_rows.iter().enumerate() {
            let mut left = Neighbour::default();
            for (col, (of_col, above)) in of_cols.iter().zip(&mut above).enumerate() {
                let exponent =
                    (self.shape.exponent + falloff_exponent(of_row + of_col)).clamp(EXPONENTS.0, EXPONENTS.1);
                let luma_step = steps.texel * two_to(exponent);
                let mut here = Neighbour::default();
                let mut lengths = [0; 3];
                for channel in 0..3 {
                    let step = if channel == 0 { luma_step } else { luma_step * steps.chroma };
                    let predicted = PREDICTION * (left.values[channel] + above.values[channel]);
                    let contexts =
                        contexts(channel, exponent, left.sizes[channel] + above.sizes[channel], lengths);
                    let number = symbol([row * of_cols.len() + col, channel], contexts, predicted, step);
                    here.values[channel] = predicted + f64::from(number) * step;
                    here.sizes[channel] = number.unsigned_abs().min(1 << 16);
                    lengths[channel] = size(number);
                }
                out.extend(rgb(here.values).map(|v| v.clamp(-1.0, 1.0) as f32));
                left = here;
                *above = here;
            }
        }
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

/// Contexts of a number, for each channel its own: the step with the sizes of the neighbours to the left and above, and with the
/// lengths of the channels before.
fn contexts(channel: usize, exponent: i32, sizes: u32, lengths: [u32; 3]) -> [u16; 2] {
    let [luma, green] = [0, 1].map(|c| if c < channel { lengths[c].min(9) } else { 0 });
    let near = 400 * channel as u32 + 20 * (exponent + 8).clamp(0, 19) as u32 + length(sizes).min(19);
    let same = 100 * channel as u32 + 300 * exponent.clamp(0, 3) as u32 + 10 * luma + green;
    [near, same].map(|context| context as u16)
}

/// Collects the numbers of a chunk for a file, with their contexts.
#[derive(Default)]
pub struct TexelWriter {
    numbers: Vec<(u32, [u16; 2])>,
}

impl TexelWriter {
    /// Appends a map; its texels as readers will decode them are appended to `out`. `texels`: `[rows, cols, 3]`
    pub fn push(&mut self, steps: &Steps, map: &Map, texels: &[f32], out: &mut Vec<f32>) {
        let wanted: Vec<[f64; 3]> =
            texels.as_chunks::<3>().0.iter().map(|t| luma_chroma(t.map(f64::from))).collect();
        map.walk(steps, out, |[texel, channel], contexts, predicted, step| {
            let off = (wanted[texel][channel] - predicted) / step;
            let size = (off.abs() + ROUNDING).floor() as i32;
            let number = if off < 0.0 { -size } else { size };
            self.numbers.push((zigzag(number), contexts));
            number
        });
    }

    /// Encodes the block of texels.
    pub fn encode(&self) -> Vec<u8> {
        let mut writer = NumberWriter::new(2);
        self.numbers.iter().for_each(|(number, contexts)| writer.put(*number, &contexts.map(u32::from)));
        let mut block = Vec::new();
        put_coded(&mut block, writer);
        block
    }
}

/// Hands out the numbers of a chunk of a file.
pub struct TexelReader<'a> {
    reader: NumberReader<'a>,
}

impl<'a> TexelReader<'a> {
    /// Begins a block of `num_texels` texels.
    ///
    /// # Errors
    /// [`Error::Invalid`] or [`Error::Unsupported`] for a damaged block.
    pub fn new(mut block: &'a [u8], num_texels: usize) -> Result<Self> {
        let expected = num_texels.saturating_mul(3);
        let (found, reader) = take_coded(&mut block, expected, 2)?;
        if found != expected || !block.is_empty() {
            let what =
                format!("texel block: {found} numbers, expected {expected}; {} bytes too many", block.len());
            return Err(Error::invalid("", what));
        }
        Ok(Self { reader })
    }

    /// Appends the texels of the next map to `out`. `[rows, cols, 3]`
    pub fn next(&mut self, steps: &Steps, map: &Map, out: &mut Vec<f32>) {
        map.walk(steps, out, |_, contexts, _, _| unzigzag(self.reader.take(&contexts.map(u32::from))));
    }

    /// Checks that the block is spent.
    ///
    /// # Errors
    /// [`Error::Invalid`].
    pub fn finish(self) -> Result<()> {
        self.reader.finish()
    }
}
