//! Numbers as bits, each with a probability that adapts: a number u is written as the length L of u + 1 in bits, less one, in
//! unary, then as the L bits behind the leading one. Each bit has up to three contexts, mixed: the lengths of the two numbers
//! before it in the stream, and what the caller knows about the number. Bits after the second one behind the leading one are
//! taken to be equally likely.

use super::arithmetic::{BitCoder, Decoder, Encoder, PROBABILITY_BITS};
use super::mixing::{Bit, MODELS_MAX, Mixer};
use crate::{Error, Result};

/// Most numbers that a byte can hold, rounded up: 8 bits over `-log2(1 - LEAST / 2^15)` are 5,675.
pub const NUMBERS_PER_BYTE: usize = 1 << 13;

/// Longest numbers, in bits.
const LENGTHS: usize = 33;

/// Bits with a probability: for each length, that of the unary part, and three for the first two bits behind the leading one.
const NODES: usize = 4 * LENGTHS;

/// Mixers: one for each bit of the unary part, one for those behind the leading one.
const MIXERS: usize = LENGTHS + 1;

/// Sum of the lengths of the two numbers before from which they are not told apart.
const LENGTHS_BEFORE_MAX: u32 = 11;

/// Length of a number's binary form plus one, less one.
pub fn length(number: u32) -> u32 {
    (u64::from(number) + 1).ilog2()
}

/// What a stream has learned.
struct Model<const M: usize> {
    /// By context and node; grows with the contexts met.
    bits: [Vec<[Bit; NODES]>; M],
    mixers: [Mixer; MIXERS],
    /// Lengths of the two numbers before.
    before: [u32; 2],
    /// Whether a number did not fit into 32 bits.
    overflown: bool,
}

impl<const M: usize> Model<M> {
    fn new() -> Self {
        const { assert!(M <= MODELS_MAX) };
        Self {
            bits: std::array::from_fn(|_| Vec::new()),
            mixers: [Mixer::new(M); MIXERS],
            before: [0; 2],
            overflown: false,
        }
    }

    /// Codes a number; the decoder ignores `number` and returns what it found. The first context is filled in here.
    fn number(&mut self, coder: &mut impl BitCoder, number: u32, mut contexts: [u32; M]) -> u32 {
        contexts[0] = (self.before[0] + self.before[1]).min(LENGTHS_BEFORE_MAX);
        let mut context = contexts.iter();
        let mut learners = self.bits.each_mut().map(|bits| {
            let context = context.next().map_or(0, |&context| context as usize);
            if bits.len() <= context {
                bits.resize(context + 1, [Bit::default(); NODES]);
            }
            &mut bits[context]
        });
        let mut learned = |coder: &mut _, bit: bool, node: usize, mixer: usize| -> bool {
            let mixer = &mut self.mixers[mixer];
            let mixed = mixer.mix(&learners.each_ref().map(|bits| bits[node]));
            let bit = BitCoder::bit(coder, bit, mixed.0 as u32);
            mixer.learn(mixed, bit);
            learners.iter_mut().for_each(|bits| bits[node].learn(bit));
            bit
        };
        let (value, wanted) = (u64::from(number) + 1, length(number));
        let mut length = 0;
        while length < 32 && learned(coder, length < wanted, 4 * length as usize, length as usize) {
            length += 1;
        }
        let mut found = 1_u64;
        for left in (0..length).rev() {
            let bit = value >> left & 1 == 1;
            let first = 4 * length as usize + 1;
            let bit = match length - 1 - left {
                0 => learned(coder, bit, first, MIXERS - 1),
                1 => learned(coder, bit, first + 1 + (found & 1) as usize, MIXERS - 1),
                _ => coder.bit(bit, 1 << (PROBABILITY_BITS - 1)),
            };
            found = found << 1 | u64::from(bit);
        }
        self.before = [length, self.before[0]];
        self.overflown |= found - 1 > u64::from(u32::MAX);
        (found - 1) as u32
    }
}

/// A model for as many contexts as a stream has.
enum AnyModel {
    One(Box<Model<1>>),
    Two(Box<Model<2>>),
    Three(Box<Model<3>>),
}

impl AnyModel {
    fn new(contexts: usize) -> Self {
        match contexts {
            0 => Self::One(Box::new(Model::new())),
            1 => Self::Two(Box::new(Model::new())),
            _ => Self::Three(Box::new(Model::new())),
        }
    }

    fn number(&mut self, coder: &mut impl BitCoder, number: u32, contexts: &[u32]) -> u32 {
        match (self, contexts) {
            (Self::Three(model), &[a, b]) => model.number(coder, number, [0, a, b]),
            (Self::Two(model), &[a, ..]) => model.number(coder, number, [0, a]),
            (Self::One(model), _) => model.number(coder, number, [0]),
            _ => 0,
        }
    }

    fn is_overflown(&self) -> bool {
        match self {
            Self::Three(model) => model.overflown,
            Self::Two(model) => model.overflown,
            Self::One(model) => model.overflown,
        }
    }
}

/// Writes the numbers of a stream.
pub struct NumberWriter {
    encoder: Encoder,
    model: AnyModel,
    count: usize,
}

impl NumberWriter {
    /// A stream without numbers, which will have this many contexts each, at most two.
    pub fn new(contexts: usize) -> Self {
        Self { encoder: Encoder::new(), model: AnyModel::new(contexts), count: 0 }
    }

    /// Appends a number.
    pub fn put(&mut self, number: u32, contexts: &[u32]) {
        self.model.number(&mut self.encoder, number, contexts);
        self.count += 1;
    }

    /// How many numbers there are, and their bytes.
    pub fn finish(self) -> (usize, Vec<u8>) {
        (self.count, if self.count == 0 { Vec::new() } else { self.encoder.finish() })
    }
}

/// Reads what [`NumberWriter`] wrote.
pub struct NumberReader<'a> {
    decoder: Decoder<'a>,
    model: AnyModel,
}

impl<'a> NumberReader<'a> {
    /// Begins at the first byte; `contexts` as for [`NumberWriter::new`].
    ///
    /// # Errors
    /// [`Error::Invalid`] if the bytes cannot hold `count` numbers.
    pub fn new(bytes: &'a [u8], count: usize, contexts: usize) -> Result<Self> {
        if count / NUMBERS_PER_BYTE > bytes.len() {
            return Err(invalid!("", "stream: {} bytes do not hold {count} numbers", bytes.len()));
        }
        Ok(Self { decoder: Decoder::new(bytes), model: AnyModel::new(contexts) })
    }

    /// The next number.
    pub fn take(&mut self, contexts: &[u32]) -> u32 {
        self.model.number(&mut self.decoder, 0, contexts)
    }

    /// Checks that the numbers taken need all of the bytes, and have 32 bits.
    ///
    /// # Errors
    /// [`Error::Invalid`].
    pub fn finish(self) -> Result<()> {
        if self.model.is_overflown() {
            Err(Error::invalid("", "stream: a number of more than 32 bits: damaged"))
        } else if self.decoder.is_spent() {
            Ok(())
        } else {
            Err(Error::invalid("", "stream: its numbers need more or fewer bytes than it has: damaged"))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn encode<const C: usize>(numbers: &[u32], contexts: impl Fn(usize) -> [u32; C]) -> Vec<u8> {
        let mut writer = NumberWriter::new(C);
        numbers.iter().enumerate().for_each(|(i, &number)| writer.put(number, &contexts(i)));
        let (count, bytes) = writer.finish();
        assert_eq!(count, numbers.len());
        bytes
    }

    fn decode<const C: usize>(
        bytes: &[u8],
        count: usize,
        contexts: impl Fn(usize) -> [u32; C],
    ) -> Result<Vec<u32>> {
        let mut reader = NumberReader::new(bytes, count, C)?;
        let numbers = (0..count).map(|i| reader.take(&contexts(i))).collect();
        reader.finish()?;
        Ok(numbers)
    }

    #[test]
    fn the_examples_of_the_specification_hold() {
        let numbers = [0, 1, 2, 300, 70_000, 0, 0, 5];
        let hex = |bytes: Vec<u8>| bytes.iter().map(|byte| format!("{byte:02x}")).collect::<String>();
        let alone = hex(encode(&numbers, |_| []));
        let two = hex(encode(&numbers, |i| [i as u32 % 2, 7]));
        let spec = include_str!("../../schema/ltgs.md").split_whitespace().collect::<Vec<_>>().join(" ");
        assert!(spec.contains(&format!("are coded as `{alone}`")), "{alone}");
        assert!(spec.contains(&format!("and as `{two}`")), "{two}");
    }

    #[test]
    fn numbers_round_trip_near_their_entropy() {
        let mut random = crate::asset::tests::random(1);
        // Geometric numbers with p(u) = 2^-(u + 1): two bits each.
        let mut numbers: Vec<u32> =
            (0..20_000).map(|_| (random(1 << 24) as u32).leading_zeros() - 8).collect();
        let bits = |numbers: &[u32]| 8.0 * encode(numbers, |_| []).len() as f64 / numbers.len() as f64;
        assert!((1.98..2.05).contains(&bits(&numbers)), "{}", bits(&numbers));
        assert!(bits(&[0; 20_000]) < 0.01);
        numbers.extend([u32::MAX, 0, 1 << 31, 7, 8, u32::MAX - 1]);
        numbers.extend((0..1000).map(|_| random(1 << 24) as u32));
        let bytes = encode(&numbers, |_| []);
        assert_eq!(decode(&bytes, numbers.len(), |_| []).unwrap(), numbers);
        assert!(encode(&[], |_| []).is_empty() && decode(&[], 0, |_| []).unwrap().is_empty());
        // Negative controls: bytes too many, a changed byte, more numbers than bytes can hold.
        assert!(decode(&[&bytes[..], &[1; 8]].concat(), numbers.len(), |_| []).is_err());
        let mut changed = bytes.clone();
        changed[100] ^= 1;
        assert_ne!(decode(&changed, numbers.len(), |_| []).ok(), Some(numbers));
        assert!(decode(&[1, 2], 1 << 30, |_| []).is_err());
        // Every bit is a 1.
        let overflown = decode(&[0xff; 9], 1, |_| []).unwrap_err();
        assert!(overflown.to_string().contains("more than 32 bits"), "{overflown}");
    }

    #[test]
    fn contexts_tell_what_numbers_to_expect() {
        let mut random = crate::asset::tests::random(1);
        let numbers: Vec<u32> = (0..8000_u32).map(|i| (i * i % 7) << (i % 3) | random(2) as u32).collect();
        let contexts = |i: usize| [i as u32 % 7, i as u32 % 3];
        let bytes = encode(&numbers, contexts);
        assert_eq!(decode(&bytes, numbers.len(), contexts).unwrap(), numbers);
        let alone = encode(&numbers, |_| []);
        // Negative control: contexts that tell nothing cost a little.
        let noise = encode(&numbers, |i| [(i as u32).wrapping_mul(2_654_435_761) >> 28]);
        assert!(bytes.len() * 4 < alone.len() * 3, "{} of {}", bytes.len(), alone.len());
        assert!(
            (alone.len()..alone.len() * 21 / 20).contains(&noise.len()),
            "{} of {}",
            noise.len(),
            alone.len()
        );
        assert_ne!(decode(&bytes, numbers.len(), |_| [0, 0]).ok(), Some(numbers));
    }
}
