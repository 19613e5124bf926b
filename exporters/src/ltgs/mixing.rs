//! Probabilities of bits: each context learns its own, and a mixer that learns how far to trust each context makes one of
//! them, in integers only.

use super::arithmetic::PROBABILITY_BITS;

/// A probability of 1.
const WHOLE: i32 = 1 << PROBABILITY_BITS;

/// Probabilities move by at least 2^-RATE of what is missing.
const RATE: u32 = 6;

/// Probabilities stay this far from 0 and 1, so that a byte holds at most [`super::numbers::NUMBERS_PER_BYTE`] numbers.
pub const LEAST: i32 = 32;

/// Contexts of a bit at most.
pub const MODELS_MAX: usize = 3;

/// A weight of 1.
const WEIGHT_ONE: i32 = 1 << 16;

/// Largest absolute weight.
const WEIGHT_MAX: i32 = 1 << 20;

/// Weights move by 2^-WEIGHT_RATE of the error times the input. Measured on four captures: 12 and 14 code within 0.6 %.
const WEIGHT_RATE: u32 = 13;

/// Largest absolute log odds, in 1/256.
pub const LOG_ODDS_MAX: i32 = 2047;

/// Probabilities at log odds of -8 to 8 in steps of 1/2: 2^15 / (1 + e^-x), rounded.
const PROBABILITIES: [i32; 33] = [
    11, 18, 30, 49, 81, 133, 219, 360, 589, 961, 1554, 2486, 3906, 5978, 8813, 12371, 16384, 20397, 23955,
    26790, 28862, 30282, 31214, 31807, 32179, 32408, 32549, 32635, 32687, 32719, 32738, 32750, 32757,
];

/// The probability with these log odds, interpolated.
pub const fn squash(log_odds: i32) -> i32 {
    let (part, place) = (log_odds & 127, (log_odds >> 7) + 16);
    let (below, above) = (PROBABILITIES[place as usize], PROBABILITIES[place as usize + 1]);
    (below * (128 - part) + above * part + 64) >> 7
}

/// Log odds by the upper 12 bits of a probability: the smallest whose probability is not below the middle of those with
/// these bits.
pub static LOG_ODDS: [i16; 4096] = {
    let mut table = [0; 4096];
    let (mut log_odds, mut place) = (-LOG_ODDS_MAX, 0);
    while place < table.len() {
        while log_odds < LOG_ODDS_MAX && squash(log_odds) < 8 * place as i32 + 4 {
            log_odds += 1;
        }
        table[place] = log_odds as i16;
        place += 1;
    }
    table
};

/// A probability that adapts.
#[derive(Clone, Copy)]
pub struct Bit {
    /// Probability of a 0, in 2^-15.
    zero: u16,
    /// Bits seen; saturates.
    seen: u16,
}

impl Default for Bit {
    fn default() -> Self {
        Self { zero: WHOLE as u16 / 2, seen: 0 }
    }
}

impl Bit {
    /// Moves towards the bit: at first by a mean of all bits seen, later by 2^-[`RATE`].
    #[inline]
    pub fn learn(&mut self, bit: bool) {
        let shift = (u32::from(self.seen) + 2).ilog2().min(RATE);
        let zero = i32::from(self.zero);
        let moved = if bit { zero - (zero >> shift) } else { zero + ((WHOLE - zero) >> shift) };
        self.zero = moved.clamp(LEAST, WHOLE - LEAST) as u16;
        self.seen = (self.seen + 1).min(255);
    }
}

/// Weights of the contexts of a bit.
#[derive(Clone, Copy)]
pub struct Mixer {
    weights: [i32; MODELS_MAX],
}

impl Mixer {
    /// Trusts all contexts alike.
    pub fn new(models: usize) -> Self {
        Self { weights: [WEIGHT_ONE / models as i32; MODELS_MAX] }
    }

    /// The probability of a 0 from those of the contexts, and what [`Self::learn`] needs.
    #[inline]
    pub fn mix<const M: usize>(&self, bits: &[Bit; M]) -> (i32, [i32; M]) {
        if let [bit] = bits.as_slice() {
            return (i32::from(bit.zero), [0; M]);
        }
        let inputs = bits.map(|bit| i32::from(LOG_ODDS[usize::from(bit.zero >> 3)]));
        let products = inputs.iter().zip(&self.weights).map(|(&x, &w)| i64::from(x) * i64::from(w));
        let log_odds = (products.sum::<i64>() >> 16).clamp(-i64::from(LOG_ODDS_MAX), LOG_ODDS_MAX.into());
        (squash(log_odds as i32).clamp(LEAST, WHOLE - LEAST), inputs)
    }

    /// Moves the weights towards the contexts that were right.
    #[inline]
    pub fn learn<const M: usize>(&mut self, (zero, inputs): (i32, [i32; M]), bit: bool) {
        if M == 1 {
            return;
        }
        let error = if bit { -zero } else { WHOLE - zero };
        for (weight, input) in self.weights.iter_mut().zip(inputs) {
            *weight = (*weight + ((input * error) >> WEIGHT_RATE)).clamp(-WEIGHT_MAX, WEIGHT_MAX);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tables_follow_the_logistic_function() {
        for (place, &probability) in PROBABILITIES.iter().enumerate() {
            let exact = f64::from(WHOLE) / (1.0 + (-(place as f64 - 16.0) / 2.0).exp());
            assert_eq!(probability, exact.round() as i32, "{place}");
        }
        for (place, &log_odds) in LOG_ODDS.iter().enumerate() {
            let probability = (8.0 * place as f64 + 4.0) / f64::from(WHOLE);
            let exact = (probability / (1.0 - probability)).ln().clamp(-8.0, 8.0);
            // The interpolation needs 0.03, and 0.08 where a probability has few steps.
            let tolerance = if exact.abs() < 6.0 { 0.04 } else { 0.1 };
            assert!((f64::from(log_odds) / 256.0 - exact).abs() < tolerance, "{place}: {log_odds}, {exact}");
        }
        let spec = include_str!("../../schema/ltgs.md");
        let listed: Vec<String> = PROBABILITIES.iter().map(ToString::to_string).collect();
        let words: Vec<&str> =
            spec.split_whitespace().map(|word| word.trim_end_matches([',', '.'])).collect();
        assert!(words.windows(33).any(|window| window == listed), "the specification lists the table");
    }

    #[test]
    fn a_mixer_learns_which_context_to_trust() {
        let (mut mixer, mut contexts) = (Mixer::new(2), [[Bit::default(); 2]; 2]);
        let mut right = 0;
        let mut state = 1_u32;
        for _ in 0..2000 {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            let (told, noise) = ((state >> 31) as usize, (state >> 30 & 1) as usize);
            let mixed = mixer.mix(&[contexts[0][told], contexts[1][noise]]);
            let bit = told == 1;
            right += u32::from((mixed.0 < WHOLE / 2) == bit);
            mixer.learn(mixed, bit);
            contexts[0][told].learn(bit);
            contexts[1][noise].learn(bit);
        }
        assert!(right > 1950, "{right}");
        assert!(mixer.weights[0] > 2 * mixer.weights[1].abs(), "{:?}", mixer.weights);
    }
}
