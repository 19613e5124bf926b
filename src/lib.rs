//! Textured Gaussian splats: 2D Gaussian primitives, each with its own small RGB texture, optimised
//! from photos with poses. See `ARCHITECTURE.md` for the map of modules and the data flow;
//! "method section N" in the code refers to `docs/method.md`.

pub mod atomic_file;
pub mod backend;
pub mod bake;
pub mod camera;
pub mod chart;
pub mod clock;
pub mod constants;
pub mod cpu;
pub mod dataset;
mod error;
pub mod eval;
#[cfg(feature = "gpu")]
pub mod gpu;
pub mod image;
pub mod init;
pub mod input_file;
pub mod model;
pub mod reference;
mod report;
pub mod results;
pub mod sample;
pub mod frequency;
pub mod selftest;
pub mod train;
pub mod views;

pub use error::{Error, Result};
pub use report::{Report, Warning};
