//! What can be done to a splat: pure changes of one planned splat, each with its cost in parameters.

pub mod band;
pub mod coarse;
pub mod map;
pub mod regrid;
pub mod split;
