//! The wgpu backend: rendering and training on any GPU. The kernels are in `shaders/`, one entry point per file;
//! this module allocates their buffers, orders their dispatches and reads back the results.

mod adapter;
mod apply_plan;
mod backend;
pub mod bench;
#[cfg(test)]
mod compile_tests;
mod device;
mod encode;
#[cfg(test)]
mod fault_tests;
#[cfg(test)]
mod fixed_tests;
mod form;
mod geometry;
#[cfg(test)]
mod harness;
mod in_flight;
#[cfg(test)]
mod in_flight_tests;
mod kernels;
mod layout;
mod limits;
#[cfg(test)]
mod loss_tests;
mod model_buffers;
mod pace;
mod photos;
#[cfg(test)]
mod plain_path_tests;
mod probing;
mod queue;
mod reading;
mod resources;
mod saved;
mod segments;
#[cfg(test)]
mod segments_tests;
mod shader;
#[cfg(test)]
mod shader_tests;
mod shape;
mod sort;
#[cfg(test)]
mod sort_tests;
mod state;
mod submission;
#[cfg(test)]
mod tile_list_tests;
#[cfg(test)]
mod tile_list_twin;
mod timing;
mod uniform;
#[cfg(test)]
mod upload_tests;
mod view_buffers;
#[cfg(test)]
mod visible_tests;
mod web;
mod writing;

pub use adapter::{AdapterChoice, Adapters, UnfitAdapter};
pub use device::{DeviceWork, GpuDevice, LimitChoice};
pub use form::GpuOptions;
pub use shader::ExpandedShader;
pub use state::GpuBackend;
pub use web::{WebShader, all_shaders, web_shaders};
