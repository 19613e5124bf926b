//! Benchmarks of training: the [`matrix`] of runs to make, their [`results`], and the [`chart`]s and tables made
//! of them. Nothing here trains, starts a process or prints; the command line does.

#![forbid(unsafe_code)]

pub mod chart;
pub mod checks;
mod error;
mod input_file;
pub mod machine;
pub mod matrix;
mod report;
pub mod results;
pub mod words;

pub use error::{Error, Result};
pub use report::{Report, Warning};
