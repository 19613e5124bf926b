//! The wgpu backend: the optimisation on any GPU. Kernels stand in `shaders/`, one entry point per file; here
//! is who hands them which buffers, in which order, and what comes back.

mod adapter;
mod device;
mod encode;
#[cfg(test)]
mod harness;
mod kernels;
mod layout;
#[cfg(test)]
mod loss_tests;
mod resources;
mod shader;
#[cfg(test)]
mod shader_tests;

pub use adapter::{AdapterChoice, list_adapters};
pub use device::{GpuDevice, Limits};
