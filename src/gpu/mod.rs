//! The wgpu backend: the optimisation on any GPU. Kernels stand in `shaders/`, one entry point per file; here
//! is who hands them which buffers, in which order, and what comes back.

mod adapter;
#[cfg(test)]
mod compile_tests;
mod device;
mod encode;
#[cfg(test)]
mod harness;
mod kernels;
mod layout;
mod resources;
mod shader;

pub use adapter::{AdapterChoice, list_adapters};
pub use device::{GpuDevice, Limits};
