//! Checked access to a checkpoint's tensors: every name, type and shape is checked before use, sizes are
//! bounded by the length of the file, and the checksum covers all that was read.

use super::header::{CHECKSUM, Checksum, FORMAT, Header, METADATA_KEY};
use crate::model::TexturePool;
use crate::train::TrainState;
use crate::{Error, Result};
use safetensors::tensor::TensorView;
use safetensors::{Dtype, SafeTensors};
use std::collections::BTreeMap;
use std::path::Path;

/// The tensors of one file.
pub struct Reader<'a> {
    path: &'a Path,
    header_text: String,
    header: Header,
    tensors: BTreeMap<String, TensorView<'a>>,
    taken: std::collections::BTreeSet<String>,
}

impl<'a> Reader<'a> {
    /// Parses the header.
    pub fn open(path: &'a Path, bytes: &'a [u8]) -> Result<Self> {
        let damaged = |e| {
            let remedy = "the file is damaged or not a checkpoint; use an earlier one from checkpoints/";
            Error::invalid(path, format!("not a valid safetensors file ({e}): {remedy}"))
        };
        let (_, metadata) = SafeTensors::read_metadata(bytes).map_err(damaged)?;
        let entry = metadata.metadata().as_ref().and_then(|m| m.get(METADATA_KEY));
        let Some(header_text) = entry.cloned() else {
            let what = format!(
                "no metadata entry {METADATA_KEY:?}: a safetensors file, but not a litetex checkpoint"
            );
            return Err(Error::invalid(path, what));
        };
        let header: Header = serde_json::from_str(&header_text).map_err(|e| {
            Error::invalid(path, format!("metadata entry {METADATA_KEY:?} is not readable: {e}"))
        })?;
        if header.format != FORMAT {
            let what = format!(
                "layout {:?} (written by litetex {}), this program reads {FORMAT:?}",
                header.format, header.version
            );
            return Err(Error::unsupported(path, what));
        }
        let tensors = SafeTensors::deserialize(bytes).map_err(damaged)?;
        Ok(Self {
            path,
            header_text,
            header,
            tensors: tensors.tensors().into_iter().collect(),
            taken: std::collections::BTreeSet::new(),
        })
    }

    /// An error that names the file.
    pub fn invalid(&self, what: String) -> Error {
        Error::invalid(self.path, what)
    }

    /// Shape of a tensor.
    pub fn shape(&self, name: &str) -> Result<&[usize]> {
        self.view(name).map(TensorView::shape)
    }

    /// First dimension of a tensor that must have one.
    pub fn first_dimension(&self, name: &str) -> Result<usize> {
        self.shape(name)?
            .first()
            .copied()
            .ok_or_else(|| self.invalid(format!("tensor {name:?}: found a single number, expected an array")))
    }

    /// Whether there is a tensor of this name.
    pub fn has(&self, name: &str) -> bool {
        self.tensors.contains_key(name)
    }

    /// Bytes of a tensor of exactly this type and shape.
    pub fn take(&mut self, name: &str, dtype: Dtype, shape: &[usize]) -> Result<&'a [u8]> {
        let view = self.view(name)?;
        if view.dtype() != dtype || view.shape() != shape {
            return Err(self.invalid(format!(
                "tensor {name:?}: found {:?} {:?}, expected {dtype:?} {shape:?}",
                view.dtype(),
                view.shape()
            )));
        }
        let data = view.data();
        self.taken.insert(name.to_owned());
        Ok(data)
    }

    /// Checks that no tensor is left over and that the checksum matches; returns the caller's strings.
    pub fn finish(mut self) -> Result<BTreeMap<String, String>> {
        let stated = u32s(self.take(CHECKSUM, Dtype::U32, &[1])?)[0];
        if let Some(unknown) = self.tensors.keys().find(|name| !self.taken.contains(*name)) {
            return Err(self.invalid(format!("tensor {unknown:?} is not part of {FORMAT:?}")));
        }
        let mut crc = Checksum::new(&self.header_text);
        for (name, view) in self.tensors.iter().filter(|(name, _)| *name != CHECKSUM) {
            crc.add(name, view.dtype(), view.shape(), view.data());
        }
        let computed = crc.finish();
        if computed != stated {
            return Err(self.invalid(format!(
                "the checksum is {computed:08x}, the file states {stated:08x}: the file is damaged; \
                 use an earlier one from checkpoints/"
            )));
        }
        Ok(self.header.strings)
    }

    fn view(&self, name: &str) -> Result<&TensorView<'a>> {
        self.tensors.get(name).ok_or_else(|| self.invalid(format!("tensor {name:?} is missing")))
    }
}

/// Checks the values that types and shapes do not constrain.
pub fn check_values(path: &Path, state: &TrainState) -> Result<()> {
    let invalid = |what: String| Err(Error::invalid(path, what));
    let model = &state.model;
    if !(model.near.is_finite() && model.near > 0.0) {
        return invalid(format!("tensor \"frame.near\": found {}, expected a positive number", model.near));
    }
    let frame = model.capture_from_local;
    if !(frame.scale.is_finite() && frame.scale > 0.0 && frame.translation.is_finite()) {
        return invalid(format!(
            "tensor \"frame.capture_from_local\": found scale {} and translation {}, expected finite \
             numbers and a positive scale",
            frame.scale, frame.translation
        ));
    }
    if state.epoch_used as usize > state.epoch_order.len() {
        return invalid(format!(
            "tensor \"state.counters\": {} views used of {} in \"state.epoch_order\"",
            state.epoch_used,
            state.epoch_order.len()
        ));
    }
    if let Some(late) = state.adam.last_step.iter().find(|&&s| s > state.step) {
        return invalid(format!(
            "tensor \"adam.last_step\": found step {late}, expected at most {}",
            state.step
        ));
    }
    let window = state.window.seen.len();
    if window != 0 && window != model.num_splats() {
        return invalid(format!(
            "tensor \"window.counts\": {window} entries for {} splats",
            model.num_splats()
        ));
    }
    check_maps(path, &model.textures)
}

fn check_maps(path: &Path, textures: &TexturePool) -> Result<()> {
    let mut texels = 0_u64;
    for (i, map) in textures.maps.iter().enumerate() {
        let what = if u64::from(map.offset_texels) != texels {
            format!("offset {}, expected {texels}", map.offset_texels)
        } else if (map.rows == 0) != (map.cols == 0) {
            format!("{} x {} texels, expected both or none to be zero", map.rows, map.cols)
        } else if map.texel_sizes.iter().any(|size| !size.is_finite() || (map.rows > 0 && *size <= 0.0)) {
            format!("texel sizes {:?}, expected positive numbers", map.texel_sizes)
        } else {
            texels += map.num_texels() as u64;
            continue;
        };
        return Err(Error::invalid(path, format!("texture map {i}: found {what}")));
    }
    if texels != textures.num_texels() as u64 {
        let found = textures.num_texels();
        return Err(Error::invalid(
            path,
            format!("tensor \"textures.texels\": found {found} texels, the maps need {texels}"),
        ));
    }
    Ok(())
}

macro_rules! from_le_bytes {
    ($name:ident, $number:ty) => {
        /// Numbers from their little-endian bytes.
        pub fn $name(bytes: &[u8]) -> Vec<$number> {
            let (numbers, _) = bytes.as_chunks::<{ size_of::<$number>() }>();
            numbers.iter().map(|b| <$number>::from_le_bytes(*b)).collect()
        }
    };
}
from_le_bytes!(f32s, f32);
from_le_bytes!(f64s, f64);
from_le_bytes!(i16s, i16);
from_le_bytes!(u16s, u16);
from_le_bytes!(u32s, u32);
