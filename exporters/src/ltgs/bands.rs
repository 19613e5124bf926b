//! SH above degree 0: degrees of the splats of a chunk, and the bands of coefficients that degrees add. Streams of a band
//! hold only the splats that have it.

use super::integers::{put_numbers, take_exactly, take_numbers, unzigzag, zigzag};
use super::splats::SplatCodes;
use super::tally::Tally;
use crate::{Error, Result, num_sh_coefficients};
use std::ops::Range;

/// Degrees above 0 up to one, and the coefficients that each adds.
pub fn bands(sh_degree: u32) -> impl Iterator<Item = (u8, Range<usize>)> {
    (1..=sh_degree).map(|degree| (degree as u8, num_sh_coefficients(degree - 1)..num_sh_coefficients(degree)))
}

/// Appends the degrees of splats; none if all are `most`, the largest of the file.
pub fn put_degrees(block: &mut Vec<u8>, degrees: &[u8], most: u32) {
    let is_uniform = degrees.iter().all(|&degree| u32::from(degree) == most);
    let numbers = if is_uniform { Vec::new() } else { degrees.iter().map(|&degree| degree.into()).collect() };
    put_numbers(block, &numbers);
}

/// Takes the degrees of `n` splats off the front.
///
/// # Errors
/// As [`take_numbers`]; [`Error::Invalid`] for degrees above `most`.
pub fn take_degrees(block: &mut &[u8], n: usize, most: u32) -> Result<Vec<u8>> {
    let numbers = take_numbers(block, n)?;
    if numbers.is_empty() {
        return crate::limits::filled(n, most as u8);
    }
    if numbers.len() != n {
        return Err(Error::invalid(
            "",
            format!("SH degrees: {} numbers, expected {n} or none", numbers.len()),
        ));
    }
    match numbers.iter().find(|&&degree| degree > most) {
        Some(degree) => Err(Error::invalid("", format!("SH degree {degree} of a splat, at most {most}"))),
        None => Ok(numbers.iter().map(|&degree| degree as u8).collect()),
    }
}

impl SplatCodes {
    /// Encodes the block of SH above degree 0.
    pub fn encode_sh(&self, sh_degree: u32) -> Vec<u8> {
        let mut block = Vec::new();
        if sh_degree > 0 {
            put_degrees(&mut block, &self.degrees, sh_degree);
        }
        bands(sh_degree).for_each(|band| self.put_band(&mut block, sh_degree, band));
        block
    }

    /// Appends the coefficients that a degree adds: a stream for each channel, coefficient by coefficient, of the splats
    /// that have them.
    pub fn put_band(&self, block: &mut Vec<u8>, sh_degree: u32, band: (u8, Range<usize>)) {
        for channel in 0..3 {
            let places = places(&self.degrees, sh_degree, &band, channel);
            let numbers: Vec<u32> = places.map(|place| zigzag(self.sh[place])).collect();
            put_numbers(block, &numbers);
        }
    }

    /// The inverse of [`Self::encode_sh`] for splats with geometry.
    ///
    /// # Errors
    /// [`Error::Invalid`] or [`Error::Unsupported`].
    pub fn take_sh(&mut self, mut block: &[u8], sh_degree: u32, tally: &mut Tally) -> Result<()> {
        let before = block.len();
        if sh_degree > 0 {
            self.degrees = take_degrees(&mut block, self.degrees.len(), sh_degree)?;
        }
        let before = tally.add("sh_degrees", before, block.len());
        for band in bands(sh_degree) {
            self.take_band(&mut block, sh_degree, band)?;
        }
        tally.add("sh_rest", before, block.len());
        if block.is_empty() {
            Ok(())
        } else {
            Err(Error::invalid("", format!("SH: {} bytes too many", block.len())))
        }
    }

    /// The inverse of [`Self::put_band`].
    ///
    /// # Errors
    /// As [`take_exactly`].
    pub fn take_band(&mut self, block: &mut &[u8], sh_degree: u32, band: (u8, Range<usize>)) -> Result<()> {
        for channel in 0..3 {
            let places = || places(&self.degrees, sh_degree, &band, channel);
            let numbers = take_exactly(block, places().count())?;
            for (place, number) in places().zip(numbers) {
                self.sh[place] = unzigzag(number);
            }
        }
        Ok(())
    }
}

/// Places of a band's numbers among [`SplatCodes::sh`], in the order of a stream.
fn places<'a>(
    degrees: &'a [u8],
    sh_degree: u32,
    (degree, band): &(u8, Range<usize>),
    channel: usize,
) -> impl Iterator<Item = usize> + use<'a> {
    let (width, degree) = (3 * num_sh_coefficients(sh_degree), *degree);
    band.clone().flat_map(move |k| {
        let with_band = degrees.iter().enumerate().filter(move |(_, own)| **own >= degree);
        with_band.map(move |(splat, _)| splat * width + 3 * k + channel)
    })
}
