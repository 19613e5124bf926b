//! Counts the bytes of a file by attribute.

use crate::{Describes, Section};

/// Names in the order of reports, and what they describe.
const NAMES: [(&str, Describes); 17] = [
    ("header", Describes::Other),
    ("metadata", Describes::Other),
    ("contents", Describes::Other),
    ("stand_in", Describes::Other),
    ("positions", Describes::Splats),
    ("rotations", Describes::Splats),
    ("scales", Describes::Splats),
    ("opacities", Describes::Splats),
    ("sh0", Describes::Splats),
    ("sh_rest", Describes::Splats),
    ("sh_degrees", Describes::Splats),
    ("maps", Describes::Splats),
    ("exponents", Describes::Splats),
    ("means", Describes::Splats),
    ("texels", Describes::Texels),
    ("unread", Describes::Other),
    ("other", Describes::Other),
];

/// Bytes of a file, summed by name.
#[derive(Clone, Copy, Debug, Default)]
pub struct Tally {
    bytes: [u64; NAMES.len()],
}

impl Tally {
    /// Counts what was taken off a block that had `before` bytes and has `after` left; returns `after`.
    pub fn add(&mut self, name: &str, before: usize, after: usize) -> usize {
        self.count(name, before.saturating_sub(after) as u64);
        after
    }

    /// Adds bytes to a name.
    pub fn count(&mut self, name: &str, bytes: u64) {
        let place = NAMES.iter().position(|(n, _)| *n == name).unwrap_or(NAMES.len() - 1);
        self.bytes[place] += bytes;
    }

    /// Adds the bytes of another tally.
    pub fn merge(&mut self, other: &Self) {
        for (sum, bytes) in self.bytes.iter_mut().zip(other.bytes) {
            *sum += bytes;
        }
    }

    /// All bytes counted.
    pub fn total(&self) -> u64 {
        self.bytes.iter().sum()
    }

    /// The names that have bytes.
    pub fn sections(&self) -> Vec<Section> {
        let with_bytes = NAMES.iter().zip(self.bytes).filter(|(_, bytes)| *bytes > 0);
        with_bytes
            .map(|(&(name, describes), bytes)| Section { name: name.to_owned(), bytes, describes })
            .collect()
    }
}
