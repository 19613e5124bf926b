//! Textured Gaussian splats: 2D Gaussians, each with its own small RGB texture map, trained from photos with poses.
//!
//! `ARCHITECTURE.md` describes modules and data flow, `docs/glossary.md` the terms. "method 6.2" in a comment
//! cites that section of `docs/method.md`.

#[macro_use]
mod error;

pub mod backend;
pub mod bake;
pub mod camera;
pub mod capture;
pub mod clock;
pub mod console;
pub mod constants;
pub mod cpu;
pub mod eval;
mod fragments;
pub mod frequency;
#[cfg(feature = "gpu")]
pub mod gpu;
pub mod image;
pub mod init;
pub mod input_file;
mod knn;
pub mod memory;
pub mod model;
pub mod reference;
mod report;
pub mod report_page;
pub mod rounding;
pub mod run;
pub mod sample;
pub mod selftest;
pub mod stand_in;
pub mod structure_from_motion;
pub mod text;
pub mod train;
pub mod verify;
pub mod views;

pub use error::{Error, NoRoom, Result};
pub use fragments::rasterised_fragments;
/// Files that appear whole or not at all.
pub use litetex_exporters::atomic_file;
pub use report::{Report, Warning};
