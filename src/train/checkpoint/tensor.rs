//! An array of a checkpoint as it is written, and the arrays of splats, written and read side by side.

use super::reader::{Reader, f32s};
use crate::Result;
use crate::model::{SplatArrays, SplatGroup};
use safetensors::{Dtype, View};
use std::borrow::Cow;

/// An array to be written.
pub struct Tensor<'a> {
    /// Its shape.
    pub shape: Vec<usize>,
    data: Data<'a>,
}

/// Its numbers.
pub enum Data<'a> {
    F32(Cow<'a, [f32]>),
    F64(Vec<f64>),
    U16(Vec<u16>),
    I16(Vec<i16>),
    U32(Cow<'a, [u32]>),
}

impl<'a> Tensor<'a> {
    pub fn f32(shape: &[usize], data: impl Into<Cow<'a, [f32]>>) -> Self {
        Self::new(shape, Data::F32(data.into()))
    }

    pub fn u32(shape: &[usize], data: impl Into<Cow<'a, [u32]>>) -> Self {
        Self::new(shape, Data::U32(data.into()))
    }

    pub fn new(shape: &[usize], data: Data<'a>) -> Self {
        Self { shape: shape.to_vec(), data }
    }

    pub fn scalar_u32(value: u32) -> Self {
        Self::u32(&[1], vec![value])
    }

    pub fn dtype(&self) -> Dtype {
        match self.data {
            Data::F32(_) => Dtype::F32,
            Data::F64(_) => Dtype::F64,
            Data::U16(_) => Dtype::U16,
            Data::I16(_) => Dtype::I16,
            Data::U32(_) => Dtype::U32,
        }
    }

    pub fn bytes(&self) -> Vec<u8> {
        match &self.data {
            Data::F32(d) => d.iter().flat_map(|x| x.to_le_bytes()).collect(),
            Data::F64(d) => d.iter().flat_map(|x| x.to_le_bytes()).collect(),
            Data::U16(d) => d.iter().flat_map(|x| x.to_le_bytes()).collect(),
            Data::I16(d) => d.iter().flat_map(|x| x.to_le_bytes()).collect(),
            Data::U32(d) => d.iter().flat_map(|x| x.to_le_bytes()).collect(),
        }
    }
}

impl View for &Tensor<'_> {
    fn dtype(&self) -> Dtype {
        Tensor::dtype(self)
    }

    fn shape(&self) -> &[usize] {
        &self.shape
    }

    fn data(&self) -> Cow<'_, [u8]> {
        Cow::Owned(self.bytes())
    }

    fn data_len(&self) -> usize {
        self.shape.iter().product::<usize>() * self.dtype().bitsize() / 8
    }
}

/// Adds the arrays of splats under the names `PREFIX.GROUP`.
pub fn put_arrays<'a>(prefix: &str, arrays: &'a SplatArrays, put: &mut dyn FnMut(&str, Tensor<'a>)) {
    for group in SplatGroup::ALL {
        let shape = group_shape(group, arrays);
        put(&group_name(prefix, group), Tensor::f32(&shape, arrays.group(group)));
    }
}

/// Reads what [`put_arrays`] added, of splats of these SH degrees.
pub fn arrays(reader: &mut Reader<'_>, prefix: &str, degrees: &[u8]) -> Result<SplatArrays> {
    let mut arrays = SplatArrays::zeros_of(degrees.to_vec());
    for group in SplatGroup::ALL {
        let shape = group_shape(group, &arrays);
        *arrays.group_mut(group) = f32s(reader.take(&group_name(prefix, group), Dtype::F32, &shape)?);
    }
    Ok(arrays)
}

fn group_name(prefix: &str, group: SplatGroup) -> String {
    let name = match group {
        SplatGroup::Position => "positions",
        SplatGroup::Quaternion => "quaternions",
        SplatGroup::LogScale => "log_scales",
        SplatGroup::Opacity => "opacity_logits",
        SplatGroup::Sh => "sh",
    };
    format!("{prefix}.{name}")
}

fn group_shape(group: SplatGroup, arrays: &SplatArrays) -> Vec<usize> {
    match group {
        SplatGroup::Opacity => vec![arrays.len()],
        SplatGroup::Sh => vec![arrays.sh.len() / 3, 3],
        _ => vec![arrays.len(), group.width(0)],
    }
}
