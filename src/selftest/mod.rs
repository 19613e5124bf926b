//! Comparison of a production backend with the reference, for tests and for users whose driver may be
//! broken.

mod scene;

pub use scene::{Scene, SceneOptions, random_scene};
