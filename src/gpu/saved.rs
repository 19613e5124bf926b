//! Copies of the state, kept on the device.

use super::model_buffers::{self, NewBuffers, STATE};
use super::state::GpuBackend;
use crate::Result;
use crate::model::{AdamState, Model};

/// A copy of a backend's state.
pub(super) struct Saved {
    buffers: NewBuffers,
    /// The model without its parameters.
    shape: Model,
    /// Step and learning rates.
    clock: AdamState,
}

impl Saved {
    /// Copies the state.
    ///
    /// # Errors
    /// [`crate::Error::Device`] if memory fails.
    pub(super) fn of(backend: &GpuBackend) -> Result<Self> {
        let state = STATE.map(|name| (name, backend.resources.buffer(name).clone())).to_vec();
        Ok(Self {
            buffers: model_buffers::copies(&backend.device, &state)?,
            shape: backend.shape.clone(),
            clock: backend.clock.clone(),
        })
    }

    /// Puts the state back, completely or not at all.
    ///
    /// # Errors
    /// [`crate::Error::Device`] if memory fails.
    pub(super) fn restore(&self, backend: &mut GpuBackend) -> Result<()> {
        let mut made = model_buffers::copies(&backend.device, &self.buffers)?;
        made.extend(model_buffers::derived(
            &backend.device,
            self.shape.num_splats(),
            self.shape.num_texels(),
        )?);
        made.into_iter().for_each(|(name, buffer)| backend.resources.set(name, buffer));
        backend.adopt(self.shape.clone(), self.clock.clone());
        backend.device.check()
    }
}
