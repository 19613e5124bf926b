//! SH of degree 0: three streams of differences from predictions, luma first.

use super::contexts::{of_exponent, of_exponent_and};
use super::integers::{put_numbers, take_exactly, unzigzag, zigzag};
use super::splats::SplatCodes;
use crate::files::limits::filled;
use crate::{Result, num_sh_coefficients};

impl SplatCodes {
    /// Contexts of green or red: the differences of the channels before.
    fn contexts<'a>(
        &'a self,
        offs: &'a [[i32; 3]],
        channel: usize,
    ) -> impl Fn(usize, &[u32]) -> [u32; 2] + 'a {
        move |splat, _| {
            let exponent = self.exponents[splat];
            let of = |channel: usize| of_exponent_and(exponent, offs[splat][channel]);
            if channel == 1 { [of(0), of_exponent(exponent)] } else { [of(0), of(1)] }
        }
    }

    /// Appends the colours; `corners` as in [`Self::predicted_colour`].
    pub fn put_colours(&self, block: &mut Vec<u8>, corners: &[[u32; 3]], sh_degree: u32) {
        let width = 3 * num_sh_coefficients(sh_degree);
        let off = |splat: usize| {
            let predicted = self.predicted_colour(corners, sh_degree, splat);
            std::array::from_fn(|c| self.sh[splat * width + c].wrapping_sub(predicted[c]))
        };
        let offs: Vec<[i32; 3]> = (0..corners.len()).map(off).collect();
        let numbers = |channel: usize| offs.iter().map(move |off| zigzag(off[channel])).collect::<Vec<_>>();
        put_numbers(block, &numbers(0), |splat, _| [self.exponent_context(splat)]);
        put_numbers(block, &numbers(1), self.contexts(&offs, 1));
        put_numbers(block, &numbers(2), self.contexts(&offs, 2));
    }

    /// The inverse of [`Self::put_colours`], for splats whose positions are known and whose SH have room.
    ///
    /// # Errors
    /// As [`take_exactly`].
    pub fn take_colours(&mut self, block: &mut &[u8], sh_degree: u32) -> Result<()> {
        let (n, width) = (self.positions.len(), 3 * num_sh_coefficients(sh_degree));
        let mut offs = filled(n, [0; 3])?;
        for channel in 0..3 {
            let numbers = if channel == 0 {
                take_exactly(block, n, |splat, _| [self.exponent_context(splat)])?
            } else {
                take_exactly(block, n, self.contexts(&offs, channel))?
            };
            for (off, number) in offs.iter_mut().zip(numbers) {
                off[channel] = unzigzag(number);
            }
        }
        for (splat, off) in offs.iter().enumerate() {
            let predicted = self.predicted_colour(&self.positions, sh_degree, splat);
            for c in 0..3 {
                self.sh[splat * width + c] = predicted[c].wrapping_add(off[c]);
            }
        }
        Ok(())
    }
}
