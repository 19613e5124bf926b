//! Copies of the state, kept on the device.

use super::device::GpuDevice;
use super::kernels::Buf;
use super::model_buffers::{self, NewBuffers, STATE};
use super::shape::{Clock, Shape};
use super::state::GpuBackend;
use crate::{Error, Result};

/// A copy of a backend's state.
pub(super) struct Saved {
    buffers: NewBuffers,
    shape: Shape,
    clock: Clock,
    /// Identity of the device.
    device: usize,
}

impl Saved {
    /// Copies the state.
    ///
    /// # Errors
    /// [`Error::DeviceFull`] if memory does not suffice.
    pub(super) fn of(backend: &GpuBackend) -> Result<Self> {
        let state = STATE.map(|name| (name, backend.resources.buffer(name).clone())).to_vec();
        Ok(Self {
            buffers: model_buffers::copies(&backend.device, &state)?,
            shape: backend.shape.clone(),
            clock: backend.clock,
            device: backend.device.id(),
        })
    }

    /// Copies of the buffers, and those derived from them.
    ///
    /// # Errors
    /// [`Error::DeviceFull`] if memory does not suffice.
    fn copied(&self, device: &GpuDevice) -> Result<NewBuffers> {
        let mut made = model_buffers::copies(device, &self.buffers)?;
        made.extend(model_buffers::derived(device, self.shape.num_splats(), self.shape.num_texels())?);
        Ok(made)
    }

    /// Whether a model has the same splats and maps, so that its buffers can be filled.
    fn has_shape_of(&self, other: &Shape) -> bool {
        self.shape.sh_degrees == other.sh_degrees && self.shape.maps == other.maps
    }

    /// Puts the state back. Where memory does not even suffice in place of the present state, no model is left.
    ///
    /// # Errors
    /// [`Error::Usage`] if another backend saved it, [`Error::DeviceFull`] if memory does not suffice, [`Error::Device`] if the device
    /// fails.
    pub(super) fn restore(&self, backend: &mut GpuBackend) -> Result<()> {
        if backend.device.id() != self.device {
            return Err(usage!("{}: another backend saved this state", backend.device.choice.name));
        }
        if backend.resources.has(Buf::SplatP) && self.has_shape_of(&backend.shape) {
            let pairs = self.buffers.iter().map(|(name, saved)| (saved, backend.resources.buffer(*name)));
            backend.device.copy_all(pairs);
            backend.device.clear(backend.resources.buffer(Buf::Statistics));
            backend.adopt(self.shape.clone(), self.clock);
            return backend.device.check();
        }
        let made = match self.copied(&backend.device) {
            Err(Error::DeviceFull(_)) => {
                model_buffers::forget(&backend.device, &mut backend.resources)?;
                self.copied(&backend.device)?
            }
            outcome => outcome?,
        };
        made.into_iter().for_each(|(name, buffer)| backend.resources.set(name, buffer));
        backend.adopt(self.shape.clone(), self.clock);
        backend.device.check()
    }
}
