//! What is stored of maps besides their sides: texel sizes and shifts.

use super::contexts::of_side;
use super::integers::{alone, put_numbers, take_exactly, take_or_zeros, unless_zeros, unzigzag, zigzag};
use super::shape::TexelSizeCodes;
use super::splats::SplatCodes;
use crate::Result;

/// Appends the shifts of maps: two streams, along u and v, without numbers where all are 0. `contexts` of both.
pub fn put_shifts<const C: usize>(
    block: &mut Vec<u8>,
    shifts: &[[i16; 2]],
    contexts: [impl Fn(usize, &[u32]) -> [u32; C]; 2],
) {
    for (axis, contexts) in contexts.into_iter().enumerate() {
        let numbers = shifts.iter().map(|shift| zigzag(shift[axis].into())).collect();
        put_numbers(block, &unless_zeros(numbers), contexts);
    }
}

/// Takes the shifts of `n` maps off the front.
///
/// # Errors
/// As [`take_or_zeros`]; [`crate::Error::Invalid`] beyond 16 bits.
pub fn take_shifts<const C: usize>(
    block: &mut &[u8],
    n: usize,
    contexts: [impl Fn(usize, &[u32]) -> [u32; C]; 2],
) -> Result<Vec<[i16; 2]>> {
    let mut shifts = crate::files::limits::filled(n, [0; 2])?;
    for (axis, contexts) in contexts.into_iter().enumerate() {
        for (shift, number) in shifts.iter_mut().zip(take_or_zeros(block, n, contexts)?) {
            let number = unzigzag(number);
            let beyond = |_| invalid!("", "shift {number} of a map, beyond 16 bits");
            shift[axis] = i16::try_from(number).map_err(beyond)?;
        }
    }
    Ok(shifts)
}

/// Contexts of the streams of maps: both sides, for texel sizes, and one side, for the shift along it.
struct MapContexts {
    sides: Vec<u32>,
    side: [Vec<u32>; 2],
}

impl MapContexts {
    fn of(codes: &SplatCodes) -> Self {
        let textured = codes.textured();
        let column = |of: &dyn Fn(usize) -> u32| textured.iter().map(|&splat| of(splat)).collect();
        Self {
            sides: column(&|splat| codes.sides_context(splat)),
            side: [0, 1].map(|axis| column(&|splat| of_side(codes.sides[splat][axis]))),
        }
    }

    fn of_sizes(&self) -> impl Fn(usize, &[u32]) -> [u32; 1] + Copy {
        |map, _| [self.sides[map]]
    }

    fn of_shifts(&self) -> [impl Fn(usize, &[u32]) -> [u32; 1]; 2] {
        self.side.each_ref().map(|side| move |map: usize, _: &[u32]| [side[map]])
    }
}

impl SplatCodes {
    /// Appends the texel sizes and shifts of maps.
    pub fn put_texel_sizes(&self, block: &mut Vec<u8>) {
        let contexts = MapContexts::of(self);
        let column = |of: fn(&TexelSizeCodes) -> i32| -> Vec<u32> {
            self.texel_sizes.iter().map(of).map(zigzag).collect()
        };
        put_numbers(block, &column(|c| c.mean), contexts.of_sizes());
        put_numbers(block, &unless_zeros(column(|c| c.octaves)), contexts.of_sizes());
        put_numbers(block, &unless_zeros(column(|c| c.rest)), alone);
        put_shifts(block, &self.shifts, contexts.of_shifts());
    }

    /// The inverse of [`Self::put_texel_sizes`], for splats whose sides are known.
    ///
    /// # Errors
    /// [`crate::Error::Invalid`] or [`crate::Error::Unsupported`].
    pub fn take_texel_sizes(&mut self, block: &mut &[u8]) -> Result<()> {
        let contexts = MapContexts::of(self);
        let textured = contexts.sides.len();
        let mean = take_exactly(block, textured, contexts.of_sizes())?;
        let octaves = take_or_zeros(block, textured, contexts.of_sizes())?;
        let rest = take_or_zeros(block, textured, alone)?;
        let codes = mean.into_iter().zip(octaves).zip(rest).map(|((mean, octaves), rest)| TexelSizeCodes {
            mean: unzigzag(mean),
            octaves: unzigzag(octaves),
            rest: unzigzag(rest),
        });
        self.texel_sizes = codes.collect();
        self.shifts = take_shifts(block, textured, contexts.of_shifts())?;
        Ok(())
    }
}
