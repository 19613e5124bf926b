//! Scalar types of PLY properties, also for PLY files of points.

/// The type of a scalar property.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Scalar {
    /// `char`: a signed integer of 8 bits.
    I8,
    /// `uchar`: an unsigned integer of 8 bits.
    U8,
    /// `short`: a signed integer of 16 bits.
    I16,
    /// `ushort`: an unsigned integer of 16 bits.
    U16,
    /// `int`: a signed integer of 32 bits.
    I32,
    /// `uint`: an unsigned integer of 32 bits.
    U32,
    /// `float`: 32 bits.
    F32,
    /// `double`: 64 bits.
    F64,
}

impl Scalar {
    /// The type with a name, old (`uchar`) or new (`uint8`).
    pub fn parse(name: &str) -> Option<Self> {
        Some(match name {
            "char" | "int8" => Self::I8,
            "uchar" | "uint8" => Self::U8,
            "short" | "int16" => Self::I16,
            "ushort" | "uint16" => Self::U16,
            "int" | "int32" => Self::I32,
            "uint" | "uint32" => Self::U32,
            "float" | "float32" => Self::F32,
            "double" | "float64" => Self::F64,
            _ => return None,
        })
    }

    /// Bytes of a value in binary files.
    pub const fn num_bytes(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::I32 | Self::U32 | Self::F32 => 4,
            Self::F64 => 8,
        }
    }

    /// Reads the value at the front of little-endian `bytes`; `None` if there are too few.
    pub fn read(self, bytes: &[u8]) -> Option<f64> {
        Some(match self {
            Self::I8 => f64::from(i8::from_le_bytes(*bytes.first_chunk()?)),
            Self::U8 => f64::from(u8::from_le_bytes(*bytes.first_chunk()?)),
            Self::I16 => f64::from(i16::from_le_bytes(*bytes.first_chunk()?)),
            Self::U16 => f64::from(u16::from_le_bytes(*bytes.first_chunk()?)),
            Self::I32 => f64::from(i32::from_le_bytes(*bytes.first_chunk()?)),
            Self::U32 => f64::from(u32::from_le_bytes(*bytes.first_chunk()?)),
            Self::F32 => f64::from(f32::from_le_bytes(*bytes.first_chunk()?)),
            Self::F64 => f64::from_le_bytes(*bytes.first_chunk()?),
        })
    }
}
