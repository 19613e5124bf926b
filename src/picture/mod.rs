//! Pictures on their way to people and files. Nothing here judges a picture (`eval` does) or reads
//! photos (`dataset` does).

mod colouring;
mod ramp;
mod write;

pub use colouring::{depth_range, grey_from_depth, rgb_from_normal, turbo_from_depth};
pub use ramp::{magma, turbo};
pub use write::{Channels, write_exr, write_png};
pub(crate) mod resample;
