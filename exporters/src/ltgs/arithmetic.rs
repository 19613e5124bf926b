//! An adaptive binary arithmetic coder for streams of numbers, in integers only. A number u is written as the length L of u + 1 in
//! bits, less one, in unary, then as the L bits behind the leading one. Each bit has a probability that adapts to the bits before it
//! in the same context: for the unary part, the lengths of the two numbers before it in the stream; for the first two bits behind the
//! leading one, L and the bits before. Further bits are taken to be equally likely. `schema/ltgs.md` specifies it.

use crate::limits::with_room;
use crate::{Error, Result};

/// Bits of a probability.
const PROBABILITY_BITS: u32 = 15;

/// Probabilities move by at least 2^-RATE of what is missing.
const RATE: u32 = 6;

/// Probabilities stay this far from 0 and 1, so that a byte holds at most [`NUMBERS_PER_BYTE`] numbers.
const LEAST: u32 = 32;

/// Most numbers that a byte can hold, rounded up: 8 bits over `-log2(1 - LEAST / 2^15)` are 5,675.
pub const NUMBERS_PER_BYTE: usize = 1 << 13;

/// Below this range, a byte is shifted out.
const SHIFT_BELOW: u32 = 1 << 24;

/// Bytes that the decoder reads ahead. Zeros among the last ones are left out.
const LOOKAHEAD: usize = 4;

/// Longest numbers, in bits.
const LENGTHS: usize = 33;

/// Contexts of the numbers before.
const NEIGHBOURHOODS: usize = 12;

/// A probability that adapts.
#[derive(Clone, Copy)]
struct Bit {
    /// Probability of a zero, in 2^-15.
    zero: u16,
    /// Bits seen; saturates.
    seen: u8,
}

impl Default for Bit {
    fn default() -> Self {
        Self { zero: 1 << (PROBABILITY_BITS - 1), seen: 0 }
    }
}

impl Bit {
    /// Moves towards the bit: at first by a mean of all bits seen, later by 2^-[`RATE`].
    fn learn(&mut self, bit: bool) {
        let shift = (u32::from(self.seen) + 2).ilog2().min(RATE);
        let zero = u32::from(self.zero);
        let whole = 1 << PROBABILITY_BITS;
        let moved = if bit { zero - (zero >> shift) } else { zero + ((whole - zero) >> shift) };
        self.zero = moved.clamp(LEAST, whole - LEAST) as u16;
        self.seen = self.seen.saturating_add(1);
    }
}

/// The contexts of a stream.
struct Contexts {
    /// By neighbourhood and place in the unary part.
    lengths: Vec<[Bit; LENGTHS]>,
    /// By length and the leading bits.
    leading: [[Bit; 4]; LENGTHS],
    /// Lengths of the two numbers before.
    before: [u32; 2],
}

/// Codes a bit with a context, or one that is equally likely to be either.
trait BitCoder {
    fn bit(&mut self, bit: bool, context: Option<&mut Bit>) -> bool;
}

impl Contexts {
    fn new() -> Self {
        Self {
            lengths: vec![[Bit::default(); LENGTHS]; NEIGHBOURHOODS],
            leading: [[Bit::default(); 4]; LENGTHS],
            before: [0; 2],
        }
    }

    /// Codes a number; the decoder ignores `number` and returns what it found.
    fn number(&mut self, coder: &mut impl BitCoder, number: u32) -> u32 {
        let value = u64::from(number) + 1;
        let wanted = value.ilog2();
        let place = (self.before[0] + self.before[1]).min(NEIGHBOURHOODS as u32 - 1) as usize;
        let contexts = &mut self.lengths[place];
        let mut length = 0;
        while length < 32 && coder.bit(length < wanted, Some(&mut contexts[length as usize])) {
            length += 1;
        }
        let mut found = 1_u64;
        for left in (0..length).rev() {
            let context = match length - 1 - left {
                0 => Some(&mut self.leading[length as usize][1]),
                1 => Some(&mut self.leading[length as usize][2 + (found & 1) as usize]),
                _ => None,
            };
            found = found << 1 | u64::from(coder.bit(value >> left & 1 == 1, context));
        }
        self.before = [length, self.before[0]];
        (found - 1) as u32
    }
}

/// Writes bits.
struct Encoder {
    low: u64,
    range: u32,
    cached: u8,
    /// Bytes not yet written: the cached one and 0xff that follow it; a carry would change them.
    pending: usize,
    bytes: Vec<u8>,
}

impl Encoder {
    fn shift(&mut self) {
        if self.low < 0xff00_0000 || self.low > 0xffff_ffff {
            let carry = (self.low >> 32) as u8;
            self.bytes.push(self.cached.wrapping_add(carry));
            self.bytes.extend(std::iter::repeat_n(0xff_u8.wrapping_add(carry), self.pending - 1));
            (self.cached, self.pending) = ((self.low >> 24) as u8, 0);
        }
        self.pending += 1;
        self.low = (self.low & 0x00ff_ffff) << 8;
    }
}

impl BitCoder for Encoder {
    fn bit(&mut self, bit: bool, context: Option<&mut Bit>) -> bool {
        let bound = (self.range >> PROBABILITY_BITS)
            * context.as_ref().map_or(1 << (PROBABILITY_BITS - 1), |context| context.zero.into());
        if bit {
            (self.low, self.range) = (self.low + u64::from(bound), self.range - bound);
        } else {
            self.range = bound;
        }
        if let Some(context) = context {
            context.learn(bit);
        }
        while self.range < SHIFT_BELOW {
            self.range <<= 8;
            self.shift();
        }
        bit
    }
}

/// Reads bits; behind the last byte there are zeros.
struct Decoder<'a> {
    code: u32,
    range: u32,
    bytes: &'a [u8],
    place: usize,
}

impl Decoder<'_> {
    fn shift(&mut self) {
        let byte = self.bytes.get(self.place).copied().unwrap_or(0);
        self.place += 1;
        self.code = self.code << 8 | u32::from(byte);
    }
}

impl BitCoder for Decoder<'_> {
    fn bit(&mut self, _: bool, context: Option<&mut Bit>) -> bool {
        let bound = (self.range >> PROBABILITY_BITS)
            * context.as_ref().map_or(1 << (PROBABILITY_BITS - 1), |context| context.zero.into());
        let bit = self.code >= bound;
        if bit {
            (self.code, self.range) = (self.code - bound, self.range - bound);
        } else {
            self.range = bound;
        }
        if let Some(context) = context {
            context.learn(bit);
        }
        while self.range < SHIFT_BELOW {
            self.range <<= 8;
            self.shift();
        }
        bit
    }
}

/// Encodes numbers.
pub fn encode(numbers: &[u32]) -> Vec<u8> {
    let mut encoder = Encoder { low: 0, range: u32::MAX, cached: 0, pending: 1, bytes: Vec::new() };
    let mut contexts = Contexts::new();
    for &number in numbers {
        contexts.number(&mut encoder, number);
    }
    (0..=LOOKAHEAD).for_each(|_| encoder.shift());
    // The first byte comes before the first number, and is 0.
    let mut bytes = encoder.bytes.split_off(1);
    for _ in 0..LOOKAHEAD {
        if bytes.last() == Some(&0) {
            bytes.pop();
        }
    }
    bytes
}

/// Decodes `count` numbers.
///
/// # Errors
/// [`Error::Invalid`] unless they need all of the bytes, [`Error::TooLarge`] if there is no memory for them.
pub fn decode(bytes: &[u8], count: usize) -> Result<Vec<u32>> {
    let invalid = || Error::invalid("", format!("stream: {} bytes do not hold {count} numbers", bytes.len()));
    if count / NUMBERS_PER_BYTE > bytes.len() {
        return Err(invalid());
    }
    let mut numbers = with_room(count)?;
    let mut decoder = Decoder { code: 0, range: u32::MAX, bytes, place: 0 };
    (0..LOOKAHEAD).for_each(|_| decoder.shift());
    let mut contexts = Contexts::new();
    numbers.extend((0..count).map(|_| contexts.number(&mut decoder, 0)));
    let needed = decoder.place - LOOKAHEAD;
    let is_spent = bytes.len() == needed || bytes.last() != Some(&0);
    if (needed..=decoder.place).contains(&bytes.len()) && is_spent { Ok(numbers) } else { Err(invalid()) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_example_of_the_specification_holds() {
        let bytes = encode(&[0, 1, 2, 300, 70_000, 0, 0, 5]);
        let hex: String = bytes.iter().map(|byte| format!("{byte:02x}")).collect();
        assert!(include_str!("../../schema/ltgs.md").contains(&format!("are coded as `{hex}`")), "{hex}");
    }

    #[test]
    fn numbers_round_trip_near_their_entropy() {
        let mut state = 1_u64;
        let mut random = move || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 40) as u32
        };
        // Geometric numbers with p(u) = 2^-(u + 1): two bits each.
        let mut numbers: Vec<u32> = (0..20_000).map(|_| random().trailing_zeros()).collect();
        let bits = |numbers: &[u32]| 8.0 * encode(numbers).len() as f64 / numbers.len() as f64;
        assert!((1.98..2.05).contains(&bits(&numbers)), "{}", bits(&numbers));
        assert!(bits(&[0; 20_000]) < 0.01);
        numbers.extend([u32::MAX, 0, 1 << 31, 7, 8, u32::MAX - 1]);
        numbers.extend((0..1000).map(|_| random()));
        let bytes = encode(&numbers);
        assert_eq!(decode(&bytes, numbers.len()).unwrap(), numbers);
        assert!(encode(&[]).is_empty() && decode(&[], 0).unwrap().is_empty());
        // Negative controls: bytes too many, a changed byte, more numbers than bytes can hold.
        assert!(decode(&[&bytes[..], &[1; 8]].concat(), numbers.len()).is_err());
        let mut changed = bytes.clone();
        changed[100] ^= 1;
        assert_ne!(decode(&changed, numbers.len()).ok(), Some(numbers));
        assert!(decode(&[1, 2], 1 << 30).is_err());
    }
}
