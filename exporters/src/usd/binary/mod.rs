//! The binary format of layers (`.usdc`, "crate" files), as far as our scene description needs it.
//!
//! A header, values, and six tables behind a table of contents. Specs (prims, properties, variants) name a path and a
//! set of fields; a field is a token and a value; a value is a word of 64 bits that holds it or says where it lies.
//! Tables and arrays of integers are compressed, arrays of floats are raw: every bit comes back.

mod codec;
mod read;
mod read_tables;
mod read_values;
mod tables;
mod write;

pub(super) use read::{BinaryLayer, layer_from_binary};
pub(super) use write::binary_from_layer;

use super::value::Form;

/// First bytes of a binary file.
const MAGIC: &[u8; 8] = b"PXR-USDC";

/// Version that is written and read: the oldest that holds all we need, so that most programs read our files.
const VERSION: [u8; 3] = [0, 8, 0];

/// Length of the header: magic, version, offset of the table of contents, reserved words.
const HEADER_BYTES: usize = 88;

/// Names of the tables, in the order in which they are written.
const SECTIONS: [&str; 6] = ["TOKENS", "STRINGS", "FIELDS", "FIELDSETS", "PATHS", "SPECS"];

/// End of a set of fields.
const END_OF_SET: u32 = u32::MAX;

/// Integer arrays at least this long are compressed.
const COMPRESSED_LENGTH_MIN: usize = 16;

mod spec {
    pub(super) const ATTRIBUTE: u32 = 1;
    pub(super) const PRIM: u32 = 6;
    pub(super) const PSEUDO_ROOT: u32 = 7;
    pub(super) const RELATIONSHIP: u32 = 8;
    pub(super) const VARIANT: u32 = 10;
    pub(super) const VARIANT_SET: u32 = 11;
}

mod types {
    pub(super) const BOOL: u8 = 1;
    pub(super) const INT: u8 = 3;
    pub(super) const FLOAT: u8 = 8;
    pub(super) const DOUBLE: u8 = 9;
    pub(super) const STRING: u8 = 10;
    pub(super) const TOKEN: u8 = 11;
    pub(super) const ASSET: u8 = 12;
    pub(super) const DICTIONARY: u8 = 31;
    pub(super) const TOKEN_LIST_OP: u8 = 32;
    pub(super) const STRING_LIST_OP: u8 = 33;
    pub(super) const PATH_LIST_OP: u8 = 34;
    /// Not an array of tokens: Pixar's reader shows no prims if the lists of children are that.
    pub(super) const TOKEN_VECTOR: u8 = 41;
    pub(super) const SPECIFIER: u8 = 42;
    pub(super) const VARIABILITY: u8 = 44;
    pub(super) const VARIANT_SELECTION: u8 = 45;
}

/// Specifiers: prims are defined, variants are not.
mod specifier {
    pub(super) const DEF: u32 = 0;
    pub(super) const OVER: u32 = 1;
}

/// Types of vectors by scalar: `[int, float, double]`; 0: there is none.
const FORM_TYPES: [(Form, [u8; 3]); 5] = [
    (Form::One, [types::INT, types::FLOAT, types::DOUBLE]),
    (Form::Vec2, [22, 20, 19]),
    (Form::Vec3, [26, 24, 23]),
    (Form::Vec4, [30, 28, 27]),
    (Form::Quaternion, [0, 17, 16]),
];

/// First byte of a list edit: which lists follow.
mod list_op {
    /// One list that replaces those of weaker layers.
    pub(super) const EXPLICIT: u8 = 1 | 1 << 1;
    /// One list that is put before those of weaker layers.
    pub(super) const PREPENDED: u8 = 1 << 5;
}

/// The word of a value: type, flags and what it holds or where the value lies.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
struct Rep(u64);

impl Rep {
    const ARRAY: u64 = 1 << 63;
    const INLINED: u64 = 1 << 62;
    const COMPRESSED: u64 = 1 << 61;
    const FLAGS: u64 = 0xff << 56;
    const PAYLOAD: u64 = (1 << 48) - 1;

    fn new(value_type: u8, flags: u64, payload: u64) -> Self {
        Self(flags | u64::from(value_type) << 48 | payload & Self::PAYLOAD)
    }

    fn inlined(value_type: u8, payload: u32) -> Self {
        Self::new(value_type, Self::INLINED, payload.into())
    }

    fn value_type(self) -> u8 {
        (self.0 >> 48) as u8
    }

    fn flags(self) -> u64 {
        self.0 & Self::FLAGS
    }

    fn payload(self) -> u64 {
        self.0 & Self::PAYLOAD
    }

    /// The lower half of the payload: what an inlined value holds.
    fn word(self) -> u32 {
        self.0 as u32
    }
}

#[cfg(test)]
mod tests;
