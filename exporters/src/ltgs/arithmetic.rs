//! A binary arithmetic coder in integers only. Probabilities come from [`super::numbers`]; `schema/ltgs.md` specifies both.

/// Bits of a probability.
pub const PROBABILITY_BITS: u32 = 15;

/// Below this range, a byte is shifted out.
const SHIFT_BELOW: u32 = 1 << 24;

/// Bytes that the decoder reads ahead. Zeros among the last ones are left out.
const LOOKAHEAD: usize = 4;

/// Writes or reads bits.
pub trait BitCoder {
    /// Codes a bit whose probability to be 0 is `zero`, in 2^-15; the decoder ignores `bit` and returns what it found.
    fn bit(&mut self, bit: bool, zero: u32) -> bool;
}

/// Writes bits.
pub struct Encoder {
    low: u64,
    range: u32,
    cached: u8,
    /// Bytes not yet written: the cached one and 0xff that follow it; a carry would change them.
    pending: usize,
    bytes: Vec<u8>,
}

impl Encoder {
    /// An encoder without bits.
    pub fn new() -> Self {
        Self { low: 0, range: u32::MAX, cached: 0, pending: 1, bytes: Vec::new() }
    }

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

    /// The bytes, without zeros among the last ones.
    pub fn finish(mut self) -> Vec<u8> {
        (0..=LOOKAHEAD).for_each(|_| self.shift());
        // The first byte comes before the first bit, and is 0.
        let mut bytes = self.bytes.split_off(1);
        for _ in 0..LOOKAHEAD {
            if bytes.last() == Some(&0) {
                bytes.pop();
            }
        }
        bytes
    }
}

impl BitCoder for Encoder {
    #[inline]
    fn bit(&mut self, bit: bool, zero: u32) -> bool {
        let bound = (self.range >> PROBABILITY_BITS) * zero;
        if bit {
            (self.low, self.range) = (self.low + u64::from(bound), self.range - bound);
        } else {
            self.range = bound;
        }
        while self.range < SHIFT_BELOW {
            self.range <<= 8;
            self.shift();
        }
        bit
    }
}

/// Reads bits; behind the last byte there are zeros.
pub struct Decoder<'a> {
    code: u32,
    range: u32,
    bytes: &'a [u8],
    place: usize,
}

impl<'a> Decoder<'a> {
    /// Begins at the first byte.
    pub fn new(bytes: &'a [u8]) -> Self {
        let mut decoder = Self { code: 0, range: u32::MAX, bytes, place: 0 };
        (0..LOOKAHEAD).for_each(|_| decoder.shift());
        decoder
    }

    fn shift(&mut self) {
        let byte = self.bytes.get(self.place).copied().unwrap_or(0);
        self.place += 1;
        self.code = self.code << 8 | u32::from(byte);
    }

    /// Whether the bits so far need all of the bytes.
    pub fn is_spent(&self) -> bool {
        let needed = self.place - LOOKAHEAD;
        let ends_well = self.bytes.len() == needed || self.bytes.last() != Some(&0);
        ends_well && (needed..=self.place).contains(&self.bytes.len())
    }
}

impl BitCoder for Decoder<'_> {
    #[inline]
    fn bit(&mut self, _: bool, zero: u32) -> bool {
        let bound = (self.range >> PROBABILITY_BITS) * zero;
        let bit = self.code >= bound;
        if bit {
            (self.code, self.range) = (self.code - bound, self.range - bound);
        } else {
            self.range = bound;
        }
        while self.range < SHIFT_BELOW {
            self.range <<= 8;
            self.shift();
        }
        bit
    }
}
