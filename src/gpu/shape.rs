//! What the host keeps of the model on the device.

use crate::camera::Similarity;
use crate::model::{
    AdamState, Filter, LearningRates, Model, SplatArrays, SplatGroup, TextureMap, TexturePool,
};

/// Floats of a splat's parameters.
pub(super) fn splat_floats(sh_degree: u32) -> usize {
    SplatGroup::ALL.iter().map(|g| g.width(sh_degree)).sum()
}

/// A model without its parameters.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Shape {
    /// SH degree of each splat. `[n]`
    pub sh_degrees: Vec<u8>,
    /// Texture map of each splat, in the order of their texels, without gaps. `[n]`
    pub maps: Vec<TextureMap>,
    pub near: f32,
    pub filter: Filter,
    pub capture_from_local: Similarity,
}

impl Shape {
    /// The shape of no splats.
    pub fn empty() -> Self {
        Self {
            sh_degrees: Vec::new(),
            maps: Vec::new(),
            near: 0.01,
            filter: Filter::None,
            capture_from_local: Similarity::IDENTITY,
        }
    }

    pub fn of(model: &Model) -> Self {
        let Model { splats, textures, near, filter, capture_from_local } = model;
        Self {
            sh_degrees: splats.sh_degrees().to_vec(),
            maps: textures.maps.clone(),
            near: *near,
            filter: *filter,
            capture_from_local: *capture_from_local,
        }
    }

    /// The model of this shape with these parameters.
    pub fn with(&self, splats: SplatArrays, texels: Vec<f32>) -> Model {
        let Self { near, filter, capture_from_local, .. } = *self;
        Model {
            splats,
            textures: TexturePool { maps: self.maps.clone(), texels },
            near,
            filter,
            capture_from_local,
        }
    }

    pub fn num_splats(&self) -> usize {
        self.sh_degrees.len()
    }

    pub fn num_texels(&self) -> usize {
        self.maps.last().map_or(0, |map| map.offset_texels as usize + map.num_texels())
    }

    /// Floats of the parameters of all splats, without texels.
    pub fn num_splat_floats(&self) -> usize {
        self.sh_degrees.iter().map(|&degree| splat_floats(degree.into())).sum()
    }

    /// Numbers of splats, of their floats and of texels: the sizes of all buffers of the model.
    pub fn sizes(&self) -> [usize; 3] {
        [self.num_splats(), self.num_splat_floats(), self.num_texels()]
    }
}

/// Where the optimiser is; its moments are on the device.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Clock {
    /// Steps done.
    pub step: u32,
    /// Rates of the last step.
    pub rates: LearningRates,
}

impl Clock {
    pub fn of(adam: &AdamState) -> Self {
        Self { step: adam.step, rates: adam.rates }
    }
}
