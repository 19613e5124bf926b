//! The size of a model, as events tell it.

use crate::model::ModelSize;
use serde::{Deserialize, Serialize};

/// Size of a model, as events tell it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct SizeFigures {
    /// Number of splats.
    pub splats: usize,
    /// Number of texels over all maps.
    pub texels: usize,
    /// Floats that the model holds ([`ModelSize::params`]).
    pub params: usize,
}

impl From<ModelSize> for SizeFigures {
    fn from(size: ModelSize) -> Self {
        Self { splats: size.splats, texels: size.texels, params: size.params() }
    }
}
