//! Comparison of a production backend with the reference, for tests and for users whose driver may be
//! broken.

mod run;
mod scene;

pub use run::{Check, run};
pub use scene::{Scene, SceneOptions, random_scene};
