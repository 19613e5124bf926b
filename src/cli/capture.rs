//! The only place of the application layer that touches the loader of captures: opening one and making
//! the state that training starts from.

use litetex_gs::dataset::{InitOptions, initial_model};
use litetex_gs::train::{TrainConfig, TrainState};
use litetex_gs::{Report, Result};
use std::path::Path;

pub use litetex_gs::dataset::{Capture, CaptureFormat, InitSource, LoadOptions};

/// Opens a capture; nothing is decoded yet.
///
/// # Errors
/// What the loader found.
pub fn open(path: &Path, options: &LoadOptions) -> Result<Capture> {
    Capture::load(path, options)
}

/// The state before the first step, and what was left out on the way.
///
/// # Errors
/// What reading the start found.
pub fn fresh_state(
    capture: &Capture,
    source: &InitSource,
    config: &TrainConfig,
) -> Result<(TrainState, Report)> {
    let options = InitOptions {
        source: source.clone(),
        sh_degree: config.sh_degree,
        texture: config.texture,
        seed: config.seed,
        ..InitOptions::default()
    };
    let (model, report) = initial_model(capture, &options)?;
    Ok((TrainState::fresh(model), report))
}
