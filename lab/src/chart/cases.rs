//! What a chart shows besides results: the checks of scenes, and images.

use crate::checks::Check;

/// The checks of a scene.
#[derive(Clone, Debug, PartialEq)]
pub struct Case {
    /// Name of the scene.
    pub scene: String,
    /// What is expected of its runs.
    pub checks: Vec<Check>,
}

/// An image of the worst test view of a run, as a data URI.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct WorstView {
    /// Scene of the run.
    pub scene: String,
    /// Variant of the run.
    pub variant: String,
    /// The image.
    pub uri: String,
}
