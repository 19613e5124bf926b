//! Rasters of pixels: the photo that training sees, resampling, and images on their way to people and
//! files. Nothing here judges an image (`eval` does) or reads photos (`dataset` does).

mod colouring;
pub(crate) mod glyphs;
mod legend;
mod ramp;
pub(crate) mod resample;
mod target;
mod write;

pub use colouring::{depth_range, grey_from_depth, rgb_from_normal, turbo_from_depth};
pub use legend::legend;
pub use ramp::{magma, turbo};
pub use target::TargetImage;
pub use write::{Channels, write_exr, write_png};
