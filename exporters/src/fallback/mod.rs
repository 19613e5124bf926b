//! What programs without texture support show of an asset, and what they write: splats with mean colours, ellipsoids,
//! textured rectangles, cameras.

pub mod baked;
pub mod broken;
pub mod check;
pub mod depth_order;
pub mod ellipsoid;
pub mod plain;
pub mod quads;
pub mod shown_cameras;
pub mod spacing;
