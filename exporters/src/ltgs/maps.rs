//! What is stored of maps besides their sides: texel sizes and shifts.

use super::integers::{put_numbers, take_exactly, take_or_zeros, unless_zeros, unzigzag, zigzag};
use super::shape::TexelSizeCodes;
use super::splats::SplatCodes;
use crate::{Error, Result};

/// Appends the shifts of maps: two streams, along u and v, without numbers where all are 0.
pub fn put_shifts(block: &mut Vec<u8>, shifts: &[[i16; 2]]) {
    for axis in 0..2 {
        let numbers = shifts.iter().map(|shift| zigzag(shift[axis].into())).collect();
        put_numbers(block, &unless_zeros(numbers));
    }
}

/// Takes the shifts of `n` maps off the front.
///
/// # Errors
/// As [`take_or_zeros`]; [`Error::Invalid`] beyond 16 bits.
pub fn take_shifts(block: &mut &[u8], n: usize) -> Result<Vec<[i16; 2]>> {
    let mut shifts = crate::limits::filled(n, [0; 2])?;
    for axis in 0..2 {
        for (shift, number) in shifts.iter_mut().zip(take_or_zeros(block, n)?) {
            let number = unzigzag(number);
            let beyond = |_| Error::invalid("", format!("shift {number} of a map, beyond 16 bits"));
            shift[axis] = i16::try_from(number).map_err(beyond)?;
        }
    }
    Ok(shifts)
}

impl SplatCodes {
    /// Appends the texel sizes and shifts of maps.
    pub fn put_texel_sizes(&self, block: &mut Vec<u8>) {
        let column = |of: fn(&TexelSizeCodes) -> i32| -> Vec<u32> {
            self.texel_sizes.iter().map(of).map(zigzag).collect()
        };
        put_numbers(block, &column(|c| c.mean));
        put_numbers(block, &unless_zeros(column(|c| c.octaves)));
        put_numbers(block, &unless_zeros(column(|c| c.rest)));
        put_shifts(block, &self.shifts);
    }

    /// The inverse of [`Self::put_texel_sizes`], for splats whose sides are known.
    ///
    /// # Errors
    /// [`Error::Invalid`] or [`Error::Unsupported`].
    pub fn take_texel_sizes(&mut self, block: &mut &[u8]) -> Result<()> {
        let textured = self.sides.iter().filter(|s| s[0] > 0).count();
        self.texel_sizes = vec![TexelSizeCodes::default(); textured];
        for (codes, mean) in self.texel_sizes.iter_mut().zip(take_exactly(block, textured)?) {
            codes.mean = unzigzag(mean);
        }
        for (codes, octaves) in self.texel_sizes.iter_mut().zip(take_or_zeros(block, textured)?) {
            codes.octaves = unzigzag(octaves);
        }
        for (codes, rest) in self.texel_sizes.iter_mut().zip(take_or_zeros(block, textured)?) {
            codes.rest = unzigzag(rest);
        }
        self.shifts = take_shifts(block, textured)?;
        Ok(())
    }
}
