//! Files on the disk: read up to a limit, written whole or not at all, several as one asset.

pub mod atomic_file;
pub mod limits;
pub mod read;
pub mod sidecars;
pub mod staging;
pub mod written;
