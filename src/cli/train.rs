//! `litetex train`: from a job to a filled run folder.

use super::asset_args::AssetArgs;
use super::capture::{self, Capture};
use super::interrupt::Interrupt;
use super::live_view::LiveView;
use super::log::Log;
use super::memory::machine_bytes;
use super::resource_estimate::{ResourceEstimate, Workload};
use super::session::{Session, UNCOVERED_MIN_STEPS};
use super::sources::{load_scene, render_options};
use super::summary::Summary;
use super::train_args::TrainArgs;
use super::train_job::TrainJob;
use super::train_summary::{self, Outcome};
use super::values::format_count;
use super::{devices, export, orphan, outputs, uncovered};
use litetex_gs::backend::Backend;
use litetex_gs::model::ModelSize;
use litetex_gs::train::density::Budget;
use litetex_gs::train::{Schedule, StopReason, TrainConfig, TrainState, check_limits, train};
use litetex_gs::views::{Split, ViewSource as _};
use litetex_gs::{Error, Report, Result};
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Instant;

/// Trains and prints the result.
pub fn run(args: TrainArgs, log: &Log) -> anyhow::Result<()> {
    if args.end_with_stdin {
        orphan::end_with_stdin();
    }
    let asset = AssetArgs { force: args.force, ..AssetArgs::default() };
    // Before hours of training, not after.
    outputs::check(None, &args.export, &asset)?;
    let Trained { summary, run, live } = train_run(&args, log)?;
    train_summary::print(&summary)?;
    if !args.export.is_empty() {
        let (scene, trained) = load_scene(&run, log)?;
        export::write_all((scene, trained.as_ref()), &args.export, &asset, &args.device, log)?.print()?;
    }
    if let Some(live) = live {
        live.stay(&run, log)?;
    }
    Ok(())
}

/// A run that is done.
pub struct Trained {
    pub summary: Summary,
    /// Its folder.
    pub run: PathBuf,
    /// The page that showed it, if there is one.
    live: Option<LiveView>,
}

/// Trains and writes the summary.
///
/// # Errors
/// [`Error::Interrupted`] after everything was saved; whatever else goes wrong.
pub fn train_run(args: &TrainArgs, log: &Log) -> Result<Trained> {
    let started = Instant::now();
    let mut job = TrainJob::plan(args)?;
    let mut capture = capture::open(job.config.data()?, &job.config.capture)?;
    log.report(&capture.report);
    let mut report = std::mem::take(&mut capture.report);
    let capture = Arc::new(capture);
    let resumed = job.resume.as_ref().map(|resume| resume.summary());
    let state = first_state(&mut job, &capture, &mut report, log)?;
    let earlier_secs = state.history.total_wall_secs;
    let mut backend = devices::open(&job.device, log)?;
    check_memory(&job, backend.as_ref(), &capture, &state, &mut report, log)?;
    // Before the folder is made: a run that cannot be made leaves nothing behind.
    check_limits(&job.config.train, backend.as_ref(), &*capture, &state.model)?;
    log.info(&format!("checking {} photos", capture.num_views()));
    let photos = capture.check_photos()?;
    log.report(&photos);
    report.merge(photos);

    let schedule = Schedule::new(&job.config.train, capture.indices(Split::Train).len());
    for part in schedule.inactive(&job.config.train) {
        log.info(&format!("without effect in this run: {part}"));
    }
    let live = args.view.then(|| LiveView::start(args.view_port)).transpose()?;
    let folder = job.open_folder(state.step)?;
    let total_secs = move || earlier_secs + started.elapsed().as_secs_f64();
    let interrupt = Interrupt::listen(log, "saving the run")?;
    let mut session = Session::new(&folder, &*capture, &job.config, log, interrupt, state.step, total_secs)?;
    let follow = |live: &LiveView| live.follow(&folder, &capture, &job.config, args.no_open, log);
    session.preview = live.as_ref().map(follow).transpose()?;
    let outcome =
        train(&job.config.train, backend.as_mut(), &*capture, state, &mut |event| session.handle(event));
    session.preview = None;
    let (state, reason) = outcome.inspect_err(|_| session.report_how_to_continue())?;
    let is_trained = reason != StopReason::Consumer && state.step >= UNCOVERED_MIN_STEPS;
    if is_trained && capture.indices(Split::Test).is_empty() {
        let options = render_options(&state.model, job.config.train.background, false);
        let share = uncovered::of_training_views(backend.as_mut(), &capture, &options)?;
        session.warn_of_uncovered_pixels("training", share, "more steps may close the gaps")?;
    }
    report.merge(std::mem::take(&mut session.report));
    if let Some(what) = over_budget(&job.config.train, state.model.num_params()) {
        log.warn("budget-exceeded", &what, 1);
        report.warn("budget-exceeded", 1, what);
    }

    let outcome = Outcome {
        config: &job.config,
        capture: &capture,
        state: &state,
        reason,
        evaluation: session.evaluation.as_ref(),
        resumed,
        outlying_views: session.outlying_views(),
        warnings: report.warnings,
    };
    let mut summary = outcome.summarise(backend.as_mut())?;
    summary.time.total_wall_secs = total_secs();
    summary.write(&folder.summary())?;
    if reason == StopReason::Consumer {
        let saved = session.checkpoint.as_deref().unwrap_or(folder.root());
        log.info(&format!(
            "saved {}; continue with: litetex train --resume {}",
            saved.display(),
            folder.root().display()
        ));
        return Err(Error::Interrupted);
    }
    Ok(Trained { summary, run: job.out, live })
}

/// A warning if a run ended before its model was brought down to the budget.
fn over_budget(config: &TrainConfig, params: usize) -> Option<String> {
    let most = config.budget.max_params.filter(|&most| params > most)?;
    Some(format!(
        "the model has {} parameters, more than --budget-params {}: the run ended before its last round of giving \
         back; give it more time, or fewer --steps",
        format_count(params as u64),
        format_count(most as u64)
    ))
}

/// The state to train from: that of a checkpoint, or a new one.
fn first_state(job: &mut TrainJob, capture: &Capture, report: &mut Report, log: &Log) -> Result<TrainState> {
    if let Some(mut resume) = job.resume.take() {
        resume.check(&job.config, capture)?;
        resume.announce(report, log);
        return Ok(resume.state);
    }
    let config = &job.config;
    let first = capture::fresh_model(capture, &config.init, config.max_points, &config.train)?;
    log.report(&first.report);
    report.merge(first.report);
    let budget = Schedule::new(&config.train, capture.indices(Split::Train).len()).budget(&config.train, 0);
    if let Some(what) = bounded_start(&config.train, &budget, first.model.num_splats()) {
        log.warn("initial-model-bounded-by-budget", &what, 1);
        report.warn("start-bounded-by-budget", 1, what);
    }
    job.config.train.random_start = first.is_random;
    Ok(TrainState::fresh(first.model))
}

/// A warning if the budget of texels or parameters, and not that of splats, bounds how many splats a new model has:
/// users who set several budgets do not expect it. `budget` is what bounds it, which may exceed that of the user.
fn bounded_start(config: &TrainConfig, budget: &Budget, num_splats: usize) -> Option<String> {
    let texels_each = config.policy.first_texels_each();
    let params_each = ModelSize::uniform(1, texels_each, config.least_sh_degree()).params();
    let room = |most: Option<usize>, each: usize| most.map_or(usize::MAX, |most| most / each.max(1));
    let &Budget { max_splats, max_texels, max_params } = budget;
    let by_texels = if texels_each == 0 { usize::MAX } else { room(max_texels, texels_each) };
    let by_params = room(max_params, params_each);
    let most = by_texels.min(by_params);
    if most > num_splats || max_splats.is_some_and(|max| max <= most) {
        return None;
    }
    let (flag, each) = match by_texels <= by_params {
        true => (format!("--max-texels {}", max_texels.unwrap_or_default()), format!("{texels_each} texels")),
        false => (
            format!("--budget-params {}", config.budget.max_params.unwrap_or_default()),
            format!("{params_each} parameters"),
        ),
    };
    let splats = if num_splats == 1 { "1 splat".to_owned() } else { format!("{num_splats} splats") };
    Some(format!(
        "{flag} leaves room for {splats} at the start, since each begins with {each} (policy {}); raise it to start \
         with more",
        config.policy
    ))
}

/// Reports the memory and time that training is estimated to take; refuses what the machine cannot hold.
fn check_memory(
    job: &TrainJob,
    backend: &dyn Backend,
    capture: &Capture,
    state: &TrainState,
    report: &mut Report,
    log: &Log,
) -> Result<()> {
    let steps_left = job.config.train.steps.saturating_sub(state.step);
    let on_cpu = backend.device().name == "cpu";
    let workload = Workload::new(&state.model, capture, &job.config.train, steps_left, on_cpu);
    let estimate = ResourceEstimate::new(&workload, &job.config.train);
    log.event("resource-estimate", &estimate.describe(), serde_json::json!({ "estimate": estimate }));
    estimate.start.check(machine_bytes())?;
    if let Some(doubt) = estimate.doubt(machine_bytes()) {
        log.warn("memory-may-not-suffice", &doubt, 1);
        report.warn("memory-may-not-suffice", 1, doubt);
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use litetex_gs::train::Policy;

    #[test]
    fn a_model_above_its_budget_is_told() {
        let of = |max_params| {
            let budget = Budget { max_params, ..Budget::default() };
            over_budget(&TrainConfig { budget, ..TrainConfig::default() }, 5001)
        };
        let found = of(Some(5000)).unwrap();
        assert!(found.contains("5,001 parameters") && found.contains("--budget-params 5,000"), "{found}");
        assert_eq!([of(Some(5001)), of(None)], [None, None]);
    }

    #[test]
    fn the_budget_that_limits_the_initial_model_is_named() {
        let warning = |policy, max_splats, max_texels, max_params, splats| {
            let budget = Budget { max_splats, max_texels, max_params };
            let bound = Budget { max_params: max_params.map(|most| 4 * most), ..budget };
            bounded_start(&TrainConfig { policy, budget, ..TrainConfig::default() }, &bound, splats)
        };
        let texels = warning(Policy::Litetex, Some(10), Some(5), None, 1).unwrap();
        assert!(texels.contains("--max-texels 5") && texels.contains("4 texels"), "{texels}");
        let params = warning(Policy::Litetex, Some(90), None, Some(300), 33).unwrap();
        assert!(params.contains("--budget-params 300") && params.contains("36 parameters"), "{params}");
        // Bounded by the splats or by the points, and a policy without texels.
        assert_eq!(warning(Policy::Litetex, Some(10), Some(40), None, 10), None);
        assert_eq!(warning(Policy::Litetex, None, Some(5000), None, 300), None);
        assert_eq!(warning(Policy::Plain, Some(10), Some(5), None, 10), None);
        assert_eq!(warning(Policy::Litetex, None, None, None, 300), None);
        // There was room for more.
        assert_eq!(warning(Policy::Litetex, None, None, Some(300), 8), None);
    }
}
