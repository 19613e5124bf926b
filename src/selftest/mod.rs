//! Compares a production backend with the reference, for tests and for users whose driver may be broken.

mod random_scene;
mod run;

pub use random_scene::{RandomScene, SceneOptions, random_scene};
pub use run::{Check, run};
