//! Benchmarks of training: the [`matrix`] of runs to make, their [`results`], and the [`chart`]s and tables made
//! of them. Nothing here trains, starts a process or prints; the program `litetex-lab` does.

#![forbid(unsafe_code)]

pub mod chart;
pub mod checks;
pub mod machine;
pub mod matrix;
pub mod results;
mod stats;
pub mod words;
