//! The wgpu backend: the optimisation on any GPU. Kernels stand in `shaders/`, one entry point per file; here
//! is who hands them which buffers, in which order, and what comes back.

mod adapter;
mod device;
mod encode;
#[cfg(test)]
mod harness;
mod kernels;
mod layout;
mod resources;
mod shader;
mod sort;
#[cfg(test)]
mod sort_tests;
#[cfg(test)]
mod tile_list_tests;
#[cfg(test)]
mod tile_list_twin;

pub use adapter::{AdapterChoice, list_adapters};
pub use device::{GpuDevice, Limits};
