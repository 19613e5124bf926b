//! Reads the elements of an accessor, floats or integers at a stride. `buffer.rs` writes accessors.

use super::document::{Accessor, BufferView};
use crate::{SPLATS_MAX, quoted};

/// The type of a number (`componentType`).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Component {
    I8,
    U8,
    I16,
    U16,
    U32,
    F32,
}

impl Component {
    fn from_kind(kind: u32) -> Option<Self> {
        Some(match kind {
            5120 => Self::I8,
            5121 => Self::U8,
            5122 => Self::I16,
            5123 => Self::U16,
            5125 => Self::U32,
            5126 => Self::F32,
            _ => return None,
        })
    }

    /// Bytes of a number.
    pub fn num_bytes(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::U32 | Self::F32 => 4,
        }
    }

    /// Value of the number at the front of `bytes`; 0 if they are too short.
    fn read(self, bytes: &[u8]) -> f32 {
        match (self, bytes) {
            (Self::I8, &[a, ..]) => f32::from(a as i8),
            (Self::U8, &[a, ..]) => f32::from(a),
            (Self::I16, &[a, b, ..]) => f32::from(i16::from_le_bytes([a, b])),
            (Self::U16, &[a, b, ..]) => f32::from(u16::from_le_bytes([a, b])),
            (Self::U32, &[a, b, c, d, ..]) => u32::from_le_bytes([a, b, c, d]) as f32,
            (Self::F32, &[a, b, c, d, ..]) => f32::from_le_bytes([a, b, c, d]),
            _ => 0.0,
        }
    }

    /// The integer that stands for 1 in normalised data.
    fn largest(self) -> f32 {
        match self {
            Self::I8 => 127.0,
            Self::U8 => 255.0,
            Self::I16 => 32_767.0,
            Self::U16 => 65_535.0,
            Self::U32 | Self::F32 => 1.0,
        }
    }
}

/// The elements of an accessor.
#[derive(Clone, Debug)]
pub struct View<'a> {
    pub component: Component,
    pub normalised: bool,
    /// Numbers of an element.
    pub width: usize,
    /// Number of elements.
    pub count: usize,
    /// From the first byte of the first element to the last byte of the last.
    bytes: &'a [u8],
    stride: usize,
}

impl<'a> View<'a> {
    /// The elements of an accessor whose buffer view has these bytes. The error says what does not fit.
    pub fn new(accessor: &Accessor, view: &BufferView, bytes: &'a [u8]) -> Result<Self, String> {
        let component = Component::from_kind(accessor.component_type)
            .ok_or_else(|| format!("unknown componentType {}", accessor.component_type))?;
        let width = match accessor.shape.as_str() {
            "SCALAR" => 1,
            "VEC2" => 2,
            "VEC3" => 3,
            "VEC4" => 4,
            other => {
                let shown = quoted(other);
                return Err(format!("type {shown}, expected SCALAR or VEC2 to VEC4"));
            }
        };
        let size = width * component.num_bytes();
        let stride = view.byte_stride.unwrap_or(size as u64);
        let count = accessor.count;
        if !(size as u64..=252.max(size as u64)).contains(&stride) {
            return Err(format!("byteStride {stride} for elements of {size} bytes"));
        }
        if !(1..=SPLATS_MAX as u64).contains(&count) {
            return Err(format!("count {count}, expected 1 to {SPLATS_MAX}"));
        }
        // At most 2^24 elements of 252 bytes: no overflow.
        let length = stride * (count - 1) + size as u64;
        let data = usize::try_from(accessor.byte_offset)
            .ok()
            .and_then(|first| bytes.get(first..)?.get(..length as usize));
        let bytes = data.ok_or_else(|| {
            let (first, there) = (accessor.byte_offset, bytes.len());
            format!("{length} bytes from byte {first} of a view of {there}: data are missing")
        })?;
        Ok(Self {
            component,
            normalised: accessor.normalized,
            width,
            count: count as usize,
            bytes,
            stride: stride as usize,
        })
    }

    /// The elements as floats, normalised integers as -1 to 1 or 0 to 1. Missing numbers are 0.
    pub fn rows<const N: usize>(&self) -> impl Iterator<Item = [f32; N]> + use<'_, N> {
        let (component, size) = (self.component, self.component.num_bytes());
        let unit = if self.normalised { component.largest() } else { 1.0 };
        let (width, normalised) = (self.width, self.normalised && component != Component::F32);
        self.bytes.chunks(self.stride).map(move |element| {
            std::array::from_fn(|i| {
                if i >= width {
                    return 0.0;
                }
                let v = component.read(element.get(i * size..).unwrap_or_default());
                // Floats pass bit for bit.
                if normalised { (v / unit).max(-1.0) } else { v }
            })
        })
    }

    /// Bytes of the elements, without gaps between them.
    pub fn num_bytes(&self) -> u64 {
        (self.count * self.width * self.component.num_bytes()) as u64
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn accessor(component_type: u32, shape: &str, count: u64) -> Accessor {
        Accessor { component_type, shape: shape.to_owned(), count, ..Accessor::default() }
    }

    #[test]
    fn reads_every_component_type_at_any_stride() {
        let bytes = [0x81, 0x80, 0x7f, 9, 0x00, 0x80, 0xff, 0x7f, 1, 2];
        let view = BufferView { byte_stride: Some(4), ..BufferView::default() };
        let mut signed = accessor(5120, "VEC2", 2);
        signed.normalized = true;
        let found: Vec<[f32; 2]> = View::new(&signed, &view, &bytes).unwrap().rows().collect();
        assert_eq!(found, [[-1.0, -1.0], [0.0, -1.0]]);
        let mut words = accessor(5122, "VEC2", 1);
        (words.normalized, words.byte_offset) = (true, 4);
        let found: Vec<[f32; 3]> = View::new(&words, &view, &bytes).unwrap().rows().collect();
        assert_eq!(found, [[-1.0, 1.0, 0.0]], "missing numbers are 0");
        let plain = accessor(5123, "SCALAR", 3);
        let found: Vec<[f32; 1]> = View::new(&plain, &view, &bytes).unwrap().rows().collect();
        assert_eq!(found, [[32_897.0], [32_768.0], [513.0]]);
    }

    #[test]
    fn floats_keep_their_bits() {
        let bits = [0x8000_0000_u32, 1, 0x7f7f_ffff, 0x3f80_0001];
        let bytes: Vec<u8> = bits.iter().flat_map(|b| b.to_le_bytes()).collect();
        let view = View::new(&accessor(5126, "SCALAR", 4), &BufferView::default(), &bytes).unwrap();
        assert!(view.rows::<1>().map(|[v]| v.to_bits()).eq(bits));
    }

    #[test]
    fn accessors_that_exceed_their_view_are_refused() {
        let bytes = [0; 48];
        let plain = BufferView::default();
        assert!(View::new(&accessor(5126, "VEC3", 4), &plain, &bytes).is_ok());
        assert!(View::new(&accessor(5126, "VEC3", 5), &plain, &bytes).is_err());
        assert!(View::new(&accessor(5126, "VEC3", 0), &plain, &bytes).is_err());
        assert!(View::new(&accessor(5126, "VEC3", u64::MAX), &plain, &bytes).is_err());
        assert!(View::new(&accessor(5124, "VEC3", 4), &plain, &bytes).is_err());
        assert!(View::new(&accessor(5126, "MAT4", 1), &plain, &bytes).is_err());
        for stride in [0, 4, 300, u64::MAX] {
            let strided = BufferView { byte_stride: Some(stride), ..plain.clone() };
            assert!(View::new(&accessor(5126, "VEC3", 1), &strided, &bytes).is_err(), "{stride}");
        }
        for offset in [4, u64::MAX] {
            let moved = Accessor { byte_offset: offset, ..accessor(5126, "VEC3", 4) };
            assert!(View::new(&moved, &plain, &bytes).is_err());
        }
    }
}
