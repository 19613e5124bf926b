//! Pictures on their way to people and files. Nothing here judges a picture (`eval` does) or reads
//! photos (`dataset` does).

mod ramp;

pub use ramp::{magma, turbo};
