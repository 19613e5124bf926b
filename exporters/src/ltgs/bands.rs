//! SH above degree 0: degrees of the splats of a chunk, and the bands of coefficients that degrees add. Streams of a band
//! hold only the splats that have it.

use super::contexts::{of_exponent, size};
use super::integers::{put_numbers, take_exactly, take_numbers, unzigzag, zigzag};
use super::numbers::length;
use super::splats::SplatCodes;
use super::tally::Tally;
use crate::{Result, num_sh_coefficients};
use std::ops::Range;

/// Halves of the mean length, and lengths, from which they are not told apart.
const MEAN_LENGTH_MAX: u32 = 19;
const LENGTH_MAX: u32 = 9;

/// Degrees above 0 up to one, and the coefficients that each adds.
pub fn bands(sh_degree: u32) -> impl Iterator<Item = (u8, Range<usize>)> {
    (1..=sh_degree).map(|degree| (degree as u8, num_sh_coefficients(degree - 1)..num_sh_coefficients(degree)))
}

/// Appends the degrees of splats; none if all are `most`, the largest of the file.
pub fn put_degrees<const C: usize>(
    block: &mut Vec<u8>,
    degrees: &[u8],
    most: u32,
    contexts: impl Fn(usize, &[u32]) -> [u32; C],
) {
    let is_uniform = degrees.iter().all(|&degree| u32::from(degree) == most);
    let numbers = if is_uniform { Vec::new() } else { degrees.iter().map(|&degree| degree.into()).collect() };
    put_numbers(block, &numbers, contexts);
}

/// Takes the degrees of `n` splats off the front.
///
/// # Errors
/// As [`take_numbers`]; [`crate::Error::Invalid`] for degrees above `most`.
pub fn take_degrees<const C: usize>(
    block: &mut &[u8],
    n: usize,
    most: u32,
    contexts: impl Fn(usize, &[u32]) -> [u32; C],
) -> Result<Vec<u8>> {
    let numbers = take_numbers(block, n, contexts)?;
    if numbers.is_empty() {
        return crate::files::limits::filled(n, most as u8);
    }
    if numbers.len() != n {
        return Err(invalid!("", "SH degrees: {} numbers, expected {n} or none", numbers.len()));
    }
    match numbers.iter().find(|&&degree| degree > most) {
        Some(degree) => Err(invalid!("", "SH degree {degree} of a splat, at most {most}")),
        None => Ok(numbers.iter().map(|&degree| degree as u8).collect()),
    }
}

impl SplatCodes {
    /// Encodes the block of SH above degree 0.
    pub fn encode_sh(&self, sh_degree: u32) -> Vec<u8> {
        let mut block = Vec::new();
        if sh_degree > 0 {
            put_degrees(&mut block, &self.degrees, sh_degree, |splat, _| [self.exponent_context(splat)]);
        }
        for band in bands(sh_degree) {
            let band = Band::new(self, sh_degree, band);
            for channel in 0..3 {
                let numbers: Vec<u32> = band.places(channel).map(|place| zigzag(self.sh[place])).collect();
                put_numbers(&mut block, &numbers, band.contexts(self, channel));
            }
        }
        block
    }

    /// The inverse of [`Self::encode_sh`] for splats with geometry.
    ///
    /// # Errors
    /// [`crate::Error::Invalid`] or [`crate::Error::Unsupported`].
    pub fn take_sh(&mut self, mut block: &[u8], sh_degree: u32, tally: &mut Tally) -> Result<()> {
        let before = block.len();
        if sh_degree > 0 {
            let contexts = |splat: usize, _: &[u32]| [self.exponent_context(splat)];
            self.degrees = take_degrees(&mut block, self.degrees.len(), sh_degree, contexts)?;
        }
        let before = tally.add("sh_degrees", before, block.len());
        for band in bands(sh_degree) {
            let band = Band::new(self, sh_degree, band);
            for channel in 0..3 {
                let count = band.splats.len() * band.coefficients.len();
                let numbers = take_exactly(&mut block, count, band.contexts(self, channel))?;
                for (place, number) in band.places(channel).zip(numbers) {
                    self.sh[place] = unzigzag(number);
                }
            }
        }
        tally.add("sh_rest", before, block.len());
        if block.is_empty() { Ok(()) } else { Err(invalid!("", "SH: {} bytes too many", block.len())) }
    }
}

/// A band: streams of its channels run through its coefficients, and for each through the splats that have it.
struct Band {
    coefficients: Range<usize>,
    splats: Vec<usize>,
    /// Numbers of a splat among [`SplatCodes::sh`].
    width: usize,
}

impl Band {
    fn new(codes: &SplatCodes, sh_degree: u32, (degree, coefficients): (u8, Range<usize>)) -> Self {
        let with_band = (0..codes.degrees.len()).filter(|&splat| codes.degrees[splat] >= degree);
        Self { coefficients, splats: with_band.collect(), width: 3 * num_sh_coefficients(sh_degree) }
    }

    /// Places of a channel's numbers among [`SplatCodes::sh`], in the order of its stream.
    fn places(&self, channel: usize) -> impl Iterator<Item = usize> {
        let of_splats = move |k| self.splats.iter().map(move |splat| splat * self.width + 3 * k + channel);
        self.coefficients.clone().flat_map(of_splats)
    }

    /// Contexts of a channel's numbers: the exponent with the mean length of the splat's lower coefficients, and the lengths of
    /// the channels before.
    fn contexts<'a>(
        &'a self,
        codes: &'a SplatCodes,
        channel: usize,
    ) -> impl Fn(usize, &[u32]) -> [u32; 2] + 'a {
        let at = move |splat: usize, k: usize, channel: usize| {
            size(codes.sh[splat * self.width + 3 * k + channel])
        };
        let of_lower_bands =
            move |&splat: &usize| (1..self.coefficients.start).map(|k| at(splat, k, channel)).sum();
        let of_lower_bands: Vec<u32> = self.splats.iter().map(of_lower_bands).collect();
        move |i, before| {
            let n = self.splats.len();
            let (place, splat) = (i % n, self.splats[i % n]);
            let k = self.coefficients.start + i / n;
            let in_band: u32 = before[place..].iter().step_by(n).map(|&number| length(number)).sum();
            let lengths = of_lower_bands[place] + in_band;
            let mean = if k > 1 { (2 * lengths / (k as u32 - 1)).min(MEAN_LENGTH_MAX) } else { 0 };
            let of_channel = |c: usize| if c < channel { at(splat, k, c).min(LENGTH_MAX) } else { 0 };
            [
                (MEAN_LENGTH_MAX + 1) * of_exponent(codes.exponents[splat]) + mean,
                (LENGTH_MAX + 1) * of_channel(0) + of_channel(1),
            ]
        }
    }
}
