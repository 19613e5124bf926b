//! Rasters of pixels: the target image of training, resampling, colour ramps, and PNG and EXR writers.
//! Measuring images is up to `eval`, reading photos to `capture`.

mod colouring;
pub(crate) mod glyphs;
mod legend;
mod ramp;
pub(crate) mod resample;
mod target;
mod write;

pub use colouring::{depth_range, grey_from_depth, rgb_from_normal};
pub use legend::legend;
pub use ramp::magma;
pub use target::{ALPHA_LEVELS, TargetImage, is_background};
pub use write::{Channels, JPEG_QUALITY, encode_jpeg, write_exr, write_jpeg, write_png};
