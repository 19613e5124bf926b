//! Rotations, spherical harmonics and the frames of an asset.

pub mod frame;
pub mod quaternion;
pub mod sh;
pub mod yup;
