//! Opens captures and creates the initial training state. The only file of the command line that uses the capture loader.

use litetex_gs::init::{InitInput, InitOptions, InitialModel, initial_model};
use litetex_gs::model::splat_params;
use litetex_gs::train::{Backdrop, Schedule, TrainConfig};
use litetex_gs::views::{Split, ViewSource as _};
use litetex_gs::{Error, Result};
use std::path::Path;

pub use super::init_source::InitSource;
pub use litetex_gs::dataset::{Capture, CaptureFormat, LoadOptions};

/// Opens a capture; nothing is decoded yet.
///
/// # Errors
/// What the loader found.
pub fn open(path: &Path, options: &LoadOptions) -> Result<Capture> {
    Capture::load(path, options)
}

/// The model before the first step, and what was left out on the way.
///
/// # Errors
/// What reading the start found.
pub fn fresh_model(
    capture: &Capture,
    source: &InitSource,
    max_points: Option<usize>,
    config: &TrainConfig,
) -> Result<InitialModel> {
    let texels_each = config.policy.first_texels_each();
    let schedule = Schedule::new(config, capture.indices(Split::Train).len());
    let budget = schedule.budget(config, 0);
    let most =
        budget.most_splats(texels_each, config.least_sh_degree()).min(max_points.unwrap_or(usize::MAX));
    if most == 0 {
        return Err(Error::Usage(format!(
            "the budget leaves no room for a splat: each has {} parameters and, with the policy {}, {texels_each} \
             initial texels; raise --max-splats, --max-texels, --budget-params or --max-points",
            splat_params(config.least_sh_degree()),
            config.policy
        )));
    }
    let points = source.resolve(capture)?;
    let input = InitInput {
        views: capture,
        points: points.as_input(),
        points_file: points.file,
        capture_from_local: capture.capture_from_local,
        near: capture.near,
    };
    let wants_backdrop = config.backdrop == Backdrop::Auto;
    // Behind an object cut out by alpha there is nothing.
    let is_cut_out = wants_backdrop && capture.has_alpha();
    let options = InitOptions {
        filter: config.filter,
        max_points: InitOptions::default().max_points.min(most),
        sh_degree: config.sh_degree,
        policy: config.policy,
        seed: config.seed,
        backdrop_on: (wants_backdrop && !is_cut_out).then_some(config.background),
        sweep_on: (config.sweep && *source == InitSource::Auto).then_some(config.background),
    };
    let mut first = initial_model(&input, &options)?;
    if is_cut_out {
        first.report.warn(
            "no-backdrop",
            1,
            "the photos have transparent pixels, behind which nothing is expected, so there is no backdrop; for one, \
             remove their alpha",
        );
    }
    let degree = config.first_sh_degree(first.model.size(), &budget);
    first.model.splats.set_sh_degrees(&vec![degree as u8; first.model.num_splats()]);
    Ok(first)
}
