//! Positions of the splats of a lossy file: gaps between the Morton numbers of their cells, and places within cells.

use super::bits::{BitReader, BitWriter};
use super::integers::{alone, put_bytes, put_numbers, take_bytes, take_exactly};
use super::morton::{coordinates, morton};
use super::splats::SplatCodes;
use super::steps::Quantiser;
use crate::{Error, Result};

/// The lower part of a gap has this many bits.
const GAP_BITS: u32 = 31;

impl SplatCodes {
    /// Appends gaps and places; returns the positions as decoded, in finest steps. `[n, 3]`
    ///
    /// # Errors
    /// None for codes made by the writer.
    pub fn put_positions(&self, block: &mut Vec<u8>, quantiser: &Quantiser) -> Result<Vec<[u32; 3]>> {
        let cell_bits = quantiser.grid.cell_bits;
        let (mut gaps, mut places, mut last) = (Vec::new(), BitWriter::default(), 0);
        let mut corners = Vec::new();
        for (shape, position) in self.shapes(quantiser)?.iter().zip(&self.positions) {
            let cell = morton(position.map(|c| c.checked_shr(cell_bits).unwrap_or(0)));
            gaps.push(cell.wrapping_sub(last));
            last = cell;
            let bits = shape.position_exponent(quantiser);
            for c in position {
                places.put(c >> bits, cell_bits - bits);
            }
            corners.push(position.map(|c| c >> bits << bits));
        }
        let high: Vec<u32> = gaps.iter().map(|gap| (gap >> GAP_BITS) as u32).collect();
        let low: Vec<u32> = gaps.iter().map(|gap| (gap & ((1 << GAP_BITS) - 1)) as u32).collect();
        put_numbers(block, &high, alone);
        put_numbers(block, &low, |splat, _| [self.exponent_context(splat)]);
        put_bytes(block, &places.finish(), 1);
        Ok(corners)
    }

    /// The inverse of [`Self::put_positions`]; leaves the positions as decoded.
    ///
    /// # Errors
    /// [`Error::Invalid`] or [`Error::Unsupported`].
    pub fn take_positions(&mut self, block: &mut &[u8], quantiser: &Quantiser) -> Result<()> {
        let n = self.exponents.len();
        let high = take_exactly(block, n, alone)?;
        let low = take_exactly(block, n, |splat, _| [self.exponent_context(splat)])?;
        let grid = &quantiser.grid;
        let exponents: Vec<u32> =
            self.shapes(quantiser)?.iter().map(|s| s.position_exponent(quantiser)).collect();
        let num_bits: u64 = exponents.iter().map(|&e| 3 * u64::from(grid.cell_bits - e)).sum();
        let places = take_bytes(block, num_bits.div_ceil(8) as usize)?;
        let mut places = BitReader::new(&places);
        let mut cell = 0_u64;
        let limit = 1_u64 << (3 * (grid.bits - grid.cell_bits));
        for (splat, &exponent) in exponents.iter().enumerate() {
            let gap = (u64::from(high[splat]) << GAP_BITS) + u64::from(low[splat]);
            cell = cell
                .checked_add(gap)
                .filter(|&cell| cell < limit)
                .ok_or_else(|| invalid!("", "cell of splat {splat} lies outside the grid"))?;
            let mut corner = [0; 3];
            for (corner, of_cell) in corner.iter_mut().zip(coordinates(cell)) {
                let place = places
                    .take(grid.cell_bits - exponent)
                    .ok_or_else(|| Error::invalid("", "positions: too few bits"))?;
                // At most 31 bits, as checked with the grid.
                *corner = of_cell.checked_shl(grid.cell_bits).unwrap_or(0) | place << exponent;
            }
            self.positions.push(corner);
        }
        if places.is_spent() { Ok(()) } else { Err(Error::invalid("", "positions: too many bits")) }
    }
}
