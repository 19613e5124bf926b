//! The model that a run starts from.

use super::config::RunConfig;
use super::init_source::InitSource;
use super::trained::file_frame;
use crate::capture::Capture;
use crate::init::{InitInput, InitOptions, InitialModel, initial_model};
use crate::model::{ModelSize, splat_params};
use crate::text::{counted, format_bytes};
use crate::train::density::{Bound, Budget};
use crate::train::{Backdrop, Schedule, TrainConfig, TrainState};
use crate::verify::bytes_for_splats;
use crate::views::{Split, ViewSource as _};
use crate::{Report, Result};

/// Bytes for splats in the file of a run with a wanted size.
///
/// # Errors
/// [`crate::Error::Usage`] if the size is too small.
pub fn splat_bytes(capture: &Capture, config: &RunConfig) -> Result<Option<f64>> {
    let bytes = |max_bytes| bytes_for_splats(&file_frame(capture, config), max_bytes);
    Ok(config.scene_max_bytes().map(bytes).transpose()?.map(|bytes| bytes as f64))
}

/// The model before the first step, and what was left out on the way. `splat_bytes` is what the file of a run with a wanted size
/// has for splats.
///
/// # Errors
/// What reading the start found.
pub fn fresh_model(
    capture: &Capture,
    source: &InitSource,
    max_points: Option<usize>,
    config: &TrainConfig,
    splat_bytes: Option<f64>,
) -> Result<InitialModel> {
    let texels_each = config.policy.first_texels_each();
    let schedule = Schedule::new(config, capture.indices(Split::Train).len());
    let bound = schedule.bound(config, 0, splat_bytes);
    let most = bound.most_splats(texels_each, config.least_sh_degree()).min(max_points.unwrap_or(usize::MAX));
    if most == 0 {
        return Err(usage!(
            "the budget leaves no room for a splat: each has {} parameters and, with the policy {}, {texels_each} \
             initial texels; raise budget.max-splats, budget.max-texels, --budget-params or max-points",
            splat_params(config.least_sh_degree()),
            config.policy
        ));
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
    let degree = config.first_sh_degree(first.model.size(), &bound);
    first.model.splats.set_sh_degrees(&vec![degree as u8; first.model.num_splats()]);
    Ok(first)
}

/// The state before the first step of a run; the settings then say whether its points are random. `report` gets what was left
/// out, and what bounds the model.
///
/// # Errors
/// As [`fresh_model`].
pub fn fresh_state(capture: &Capture, config: &RunConfig, report: &mut Report) -> Result<TrainState> {
    let splat_bytes = splat_bytes(capture, config)?;
    let first = fresh_model(capture, &config.init, config.max_points, &config.train, splat_bytes)?;
    report.merge(first.report);
    let schedule = Schedule::new(&config.train, capture.indices(Split::Train).len());
    let bound = schedule.bound(&config.train, 0, splat_bytes);
    if let Some(what) = bounded_start(&config.train, &bound, first.model.num_splats()) {
        report.warn("start-bounded-by-budget", 1, what);
    }
    Ok(TrainState::fresh(first.model))
}

/// A warning if the budget of texels or parameters, or the wanted size, and not the budget of splats, bounds how many splats a new
/// model has: users who set several budgets do not expect it. `bound` is what bounds it, which may exceed that of the user.
fn bounded_start(config: &TrainConfig, bound: &Bound, num_splats: usize) -> Option<String> {
    let texels_each = config.policy.first_texels_each();
    let params_each = ModelSize::uniform(1, texels_each, config.least_sh_degree()).params();
    let room = |most: Option<usize>, each: usize| most.map_or(usize::MAX, |most| most / each.max(1));
    let Budget { max_splats, max_texels, max_params } = bound.budget;
    let by_texels = if texels_each == 0 { usize::MAX } else { room(max_texels, texels_each) };
    let by_params = room(max_params, params_each);
    let bytes_each = bound.charge.of(config.least_sh_degree() as u8, texels_each);
    let by_bytes = (bound.most_charge / bytes_each) as usize;
    let most = by_texels.min(by_params).min(by_bytes);
    if most > num_splats || max_splats.is_some_and(|max| max <= most) {
        return None;
    }
    let (flag, each) = if by_bytes <= most {
        let size = format_bytes(config.max_bytes.unwrap_or_default());
        (format!("--max-size {size}"), format!("about {bytes_each:.0} bytes"))
    } else if by_texels <= by_params {
        (format!("budget.max-texels {}", max_texels.unwrap_or_default()), format!("{texels_each} texels"))
    } else {
        let most = config.most_params().unwrap_or_default();
        (config.named_bound(most), format!("{params_each} parameters"))
    };
    let splats = counted(num_splats, "splat");
    Some(format!(
        "{flag} leaves room for {splats} at the start, since each begins with {each} (policy {}); raise it to start \
         with more",
        config.policy
    ))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::train::Policy;
    use crate::train::charge::Charge;

    #[test]
    fn the_budget_that_limits_the_initial_model_is_named() {
        let within = |budget, most_charge| Bound { budget, charge: Charge::UNPRUNED_BYTES, most_charge };
        let warning = |policy, max_splats, max_texels, max_params, splats| {
            let budget = Budget { max_splats, max_texels, max_params };
            let bound = Budget { max_params: max_params.map(|most| 4 * most), ..budget };
            let config = TrainConfig { policy, budget, ..TrainConfig::default() };
            bounded_start(&config, &within(bound, f64::INFINITY), splats)
        };
        let texels = warning(Policy::Fixed(2), Some(10), Some(5), None, 1).unwrap();
        assert!(texels.contains("budget.max-texels 5") && texels.contains("4 texels"), "{texels}");
        let params = warning(Policy::Litetex, Some(90), None, Some(300), 54).unwrap();
        assert!(params.contains("--budget-params 300") && params.contains("22 parameters"), "{params}");
        // Bounded by the splats or by the points, and a policy without texels.
        assert_eq!(warning(Policy::Fixed(2), Some(10), Some(40), None, 10), None);
        assert_eq!(warning(Policy::Fixed(2), None, Some(5000), None, 300), None);
        assert_eq!(warning(Policy::Plain, Some(10), Some(5), None, 10), None);
        assert_eq!(warning(Policy::Litetex, None, None, None, 300), None);
        // There was room for more.
        assert_eq!(warning(Policy::Litetex, None, None, Some(300), 8), None);
        // Bounded by the bytes of the file.
        let sized = TrainConfig { max_bytes: Some(12_000), ..TrainConfig::default() };
        let warning = |splats| bounded_start(&sized, &within(Budget::default(), 9_000.0), splats);
        let bytes = warning(825).unwrap();
        assert!(bytes.contains("--max-size 11.7 KiB") && bytes.contains("about 11 bytes"), "{bytes}");
        assert_eq!(warning(824), None, "there was room for more");
    }
}
