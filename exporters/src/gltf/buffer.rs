//! Writes arrays into one buffer, each with its own buffer view and accessor. `accessor.rs` reads accessors.

use super::document::{Accessor, BufferView, TARGET_ATTRIBUTES};

/// `componentType` of numbers.
pub const U8: u32 = 5121;
pub const I16: u32 = 5122;
pub const U16: u32 = 5123;
pub const U32: u32 = 5125;
pub const F32: u32 = 5126;

/// A buffer with its views and accessors.
#[derive(Default)]
pub struct Arrays {
    pub bytes: Vec<u8>,
    pub views: Vec<BufferView>,
    pub accessors: Vec<Accessor>,
}

/// A type of number that can be stored.
pub trait Number: Copy {
    /// Its `componentType`.
    const KIND: u32;
    /// Appends the bytes of a number, little-endian.
    fn push(self, bytes: &mut Vec<u8>);
}

macro_rules! component {
    ($type:ty, $kind:expr) => {
        impl Number for $type {
            const KIND: u32 = $kind;
            fn push(self, bytes: &mut Vec<u8>) {
                bytes.extend(self.to_le_bytes());
            }
        }
    };
}
component!(u8, U8);
component!(i16, I16);
component!(u16, U16);
component!(u32, U32);
component!(f32, F32);

/// What an array is used for.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum Use {
    /// An attribute of vertices.
    Attribute,
    /// An attribute of integers that stand for 0 to 1, signed ones for -1 to 1.
    NormalisedAttribute,
    /// Anything else, with the target of its buffer view.
    Other(Option<u32>),
}

impl Arrays {
    /// Begins a view at a multiple of four bytes and returns its index.
    pub fn begin_view(&mut self, target: Option<u32>) -> u32 {
        self.bytes.resize(self.bytes.len().next_multiple_of(4), 0);
        self.views.push(BufferView { byte_offset: self.bytes.len() as u64, target, ..BufferView::default() });
        (self.views.len() - 1) as u32
    }

    /// Ends the view that was begun last, with all bytes appended since.
    pub fn end_view(&mut self) {
        if let Some(view) = self.views.last_mut() {
            view.byte_length = self.bytes.len() as u64 - view.byte_offset;
        }
    }

    /// Adds bytes as a view and returns its index.
    pub fn push_bytes(&mut self, bytes: &[u8]) -> u32 {
        let view = self.begin_view(None);
        self.bytes.extend_from_slice(bytes);
        self.end_view();
        view
    }

    /// Adds an array as a view with one accessor and returns the accessor's index.
    pub fn push<T: Number, const N: usize>(&mut self, rows: impl Iterator<Item = [T; N]>, used: Use) -> u32 {
        let target = match used {
            Use::Attribute | Use::NormalisedAttribute => Some(TARGET_ATTRIBUTES),
            Use::Other(target) => target,
        };
        let view = self.begin_view(target);
        let mut count = 0;
        for row in rows {
            row.into_iter().for_each(|v| v.push(&mut self.bytes));
            count += 1;
        }
        self.end_view();
        self.accessors.push(Accessor {
            buffer_view: Some(view),
            component_type: T::KIND,
            normalized: used == Use::NormalisedAttribute,
            count,
            shape: ["SCALAR", "VEC2", "VEC3", "VEC4"][N - 1].to_owned(),
            ..Accessor::default()
        });
        (self.accessors.len() - 1) as u32
    }

    /// Adds points as an attribute with bounds and returns the accessor's index.
    pub fn push_positions(&mut self, points: impl Iterator<Item = [f32; 3]> + Clone) -> u32 {
        let (low, high) = bounds(points.clone());
        let accessor = self.push(points, Use::Attribute);
        let last = &mut self.accessors[accessor as usize];
        // No negative zeros, which some JSON libraries lose.
        last.min = Some(low.map(|v| f64::from(v) + 0.0).to_vec());
        last.max = Some(high.map(|v| f64::from(v) + 0.0).to_vec());
        accessor
    }
}

/// Smallest and largest coordinates.
pub fn bounds(points: impl Iterator<Item = [f32; 3]>) -> ([f32; 3], [f32; 3]) {
    let start = ([f32::INFINITY; 3], [f32::NEG_INFINITY; 3]);
    points.fold(start, |(low, high), p| {
        (std::array::from_fn(|i| low[i].min(p[i])), std::array::from_fn(|i| high[i].max(p[i])))
    })
}
