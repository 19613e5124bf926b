//! `litetex train`: from a job to a filled run folder.

use super::asset_args::AssetArgs;
use super::live_view::LiveView;
use super::progress::Progress;
use super::session::Session;
use super::sources::load_scene;
use super::train_args::TrainArgs;
use super::train_job::TrainJob;
use super::train_job::{self, Finished};
use super::train_summary;
use super::{batch, export, orphan, outputs};
use litetex_exporters::ORIGIN_OPTION;
use litetex_gs::capture::Capture;
use litetex_gs::console::{Interrupt, Log, Output, device};
use litetex_gs::memory::machine_bytes;
use litetex_gs::run::{
    Plan, Recorder, ResourceEstimate, Situation, Summary, Workload, expected_secs, fresh_state, measure,
};
use litetex_gs::text::{format_count, format_duration};
use litetex_gs::train::{Schedule, StepCosts, StopReason, Timing, TrainState, check_limits, train_by};
use litetex_gs::views::{Split, ViewSource as _};
use litetex_gs::{Error, Report, Result};
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Instant;

/// Time of a run for which nothing is said, without a GPU and with one.
const FREE_CPU_SECS: f64 = 15.0 * 60.0;
const FREE_GPU_SECS: f64 = 5.0 * 60.0;

/// Where nothing is said, a run sees no photo more often than this on average. Measured with 300,000 parameters: fox, 270 x 480,
/// gains 2.2 dB from 23 to 116 passes and 1.0 dB up to 698, flower 1.5 dB from 48 to 238, bonsai 0.15 dB from 53 to 263.
const ENOUGH_PASSES: u32 = 200;

/// Time from the last step to the exit where nothing was measured.
const END_SECS: f64 = 2.0;

/// Trains and prints the result. `nth` is the capture of a batch that this process trains.
pub fn run(mut args: TrainArgs, nth: Option<usize>, log: &Log) -> Result<Output> {
    if args.end_with_stdin {
        orphan::end_with_stdin();
    }
    match nth {
        Some(index) => {
            orphan::stop_with_stdin();
            batch::narrow(&mut args, index)?;
        }
        None if batch::is_batch(&args) => return batch::run(&args, log),
        None => {}
    }
    let mut exports = batch::exports_of(&args)?;
    let finished = finished_run(&args, log)?;
    if finished.is_some() {
        exports.retain(|file| !file.exists());
    }
    let asset = AssetArgs { force: args.force, ..AssetArgs::default() };
    // Before hours of training, not after.
    outputs::check(None, &exports, &asset)?;
    let FinishedRun { summary, run, live } = finished.map_or_else(|| train_run(&args, log), Ok)?;
    let mut output = train_summary::output(&summary);
    if !exports.is_empty() {
        let (scene, trained) = load_scene(&run, log)?;
        let written = export::write_all((scene, trained.as_ref()), &exports, &asset, &args.device, log)?;
        for file in written.files_for_origin(&exports) {
            let what = format!(
                "{}: train has no --origin; write it with: litetex export {} {} {ORIGIN_OPTION} --force",
                file.display(),
                run.display(),
                file.display()
            );
            log.warn("needs-origin", &what, 1);
        }
        output = output.with("exports", written.output());
    }
    let Some(live) = live else { return Ok(output) };
    // The page stays until the user closes it.
    log.print(output)?;
    live.stay(&run, log)?;
    Ok(Output::default())
}

/// The run that `--resume-or-start` finds finished, if it does.
fn finished_run(args: &TrainArgs, log: &Log) -> Result<Option<FinishedRun>> {
    let (Some(out), Some(Finished { summary, changed })) = (&args.out, train_job::finished(args)?) else {
        return Ok(None);
    };
    log.info(&format!("{}: finished already, and left as it is", out.display()));
    if !changed.is_empty() {
        let what = format!(
            "{}: {} differ from the settings of the finished run, which is left as it is; --force replaces it",
            out.display(),
            changed.join(", ")
        );
        log.warn("finished-with-other-settings", &what, changed.len());
    }
    Ok(Some(FinishedRun { summary, run: out.clone(), live: None }))
}

/// A run that is done.
pub struct FinishedRun {
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
pub fn train_run(args: &TrainArgs, log: &Log) -> Result<FinishedRun> {
    let started = Instant::now();
    let mut job = TrainJob::plan(args)?;
    let mut capture = Capture::load(job.config.data()?, &job.config.capture)?;
    log.report(&capture.report);
    log.info(&capture.held_out());
    log.info(&format!("up is {}", capture.up.words()));
    let mut report = std::mem::take(&mut capture.report);
    let mut capture = Arc::new(capture);
    let resumed = job.resume.as_ref().map(|resume| resume.summary());
    let loaded_secs = started.elapsed().as_secs_f64();
    let mut state = first_state(&mut job, &capture, &mut report, log)?;
    let earlier_secs = state.history.total_wall_secs;
    let mut backend = device::open(&job.device, log)?;
    let now = || earlier_secs + started.elapsed().as_secs_f64();
    let is_hardware = device::is_hardware(&backend.device().name);
    if job.is_free {
        job.config.time_secs = Some(if is_hardware { FREE_GPU_SECS } else { FREE_CPU_SECS });
    }
    let threads = rayon::current_num_threads();
    let costs = if is_hardware { StepCosts::GPU } else { StepCosts::CPU.scaled(1.0 / threads as f64) };
    let mut planned_secs = None;
    let mut timing = Timing { now: &now, deadline_secs: job.config.time_secs, costs, end_secs: END_SECS };
    if let Some(time_secs) = job.config.time_secs.filter(|_| state.step == 0 && resumed.is_none()) {
        let trial = measure(backend.as_mut(), &*capture, &state.model, &job.config.train, &now)?;
        let train_views = capture.indices(Split::Train);
        let sizes: Vec<_> = train_views.iter().map(|&view| capture.camera(view).pinhole).collect();
        let views = train_views.len();
        let situation = Situation {
            time_secs,
            gone_secs: now(),
            reload_secs: loaded_secs,
            trial,
            splats: state.model.num_splats(),
            views: [views, capture.num_views() - views],
            side_px: sizes.iter().map(|size| size.width_px.max(size.height_px)).max().unwrap_or(1),
            pixels: sizes.iter().map(|size| size.num_pixels() as f64).sum::<f64>() / views.max(1) as f64,
            keeps_size: args.capture_args.max_resolution.is_some(),
            threads: threads as f64,
            enough_steps: job.is_free.then(|| ENOUGH_PASSES.saturating_mul(views as u32)),
        };
        let plan = situation.plan(&job.config.train)?;
        (timing.costs, timing.end_secs) = (trial.costs, plan.end_secs);
        job.config.train.steps = plan.steps;
        if situation.enough_steps.is_some_and(|enough| enough <= plan.steps) {
            // Otherwise the run would stretch to the time.
            job.config.time_secs = Some(plan.done_secs);
            timing.deadline_secs = job.config.time_secs;
        }
        planned_secs = Some(plan.done_secs - plan.end_secs);
        if let Some(side) = plan.max_resolution {
            job.config.capture.max_resolution = side;
            capture = Arc::new(Capture::load(job.config.data()?, &job.config.capture)?);
        }
        // The budget follows from the steps, the model from both.
        state = fresh_state(&capture, &mut job.config, &mut Report::default())?;
        say_plan(&job, &situation, plan, log);
    }
    let train_secs = match planned_secs {
        Some(until) => Some(until - now()),
        // Of the speed of GPUs nothing is known.
        None if is_hardware => None,
        None => {
            let found = (state.step, state.model.num_splats());
            Some(expected_secs(costs, &job.config.train, &*capture, found))
        }
    };
    check_memory(&job, train_secs, &capture, &state, &mut report, log)?;
    // Before the folder is made: a run that cannot be made leaves nothing behind.
    check_limits(&job.config.train, backend.as_ref(), &*capture, &state.model)?;
    log.info(&format!("checking {} photos", capture.num_views()));
    let photos = capture.check_photos()?;
    log.report(&photos);
    report.merge(photos);

    let schedule = Schedule::new(&job.config.train, capture.indices(Split::Train).len());
    for part in job.config.inactive(&schedule) {
        log.info(&format!("without effect in this run: {part}"));
    }
    let live = args.view.map(LiveView::start).transpose()?;
    let folder = job.open_folder(state.step)?;
    let total_secs = move || earlier_secs + started.elapsed().as_secs_f64();
    let interrupt = Interrupt::listen(log, "saving the run")?;
    let recorder = Recorder::new(&folder, &*capture, &job.config, state.step, total_secs)?;
    let progress = Progress::new(log, state.step, job.config.train.last_step());
    let mut session = Session::new(recorder, progress, log, interrupt);
    let follow = |live: &LiveView| live.follow(&folder, &capture, &job.config, log);
    session.preview = live.as_ref().map(follow).transpose()?;
    let outcome = train_by(&timing, &job.config.train, backend.as_mut(), &*capture, state, &mut |event| {
        session.handle(event)
    });
    session.preview = None;
    let (state, reason) = outcome.inspect_err(|_| session.report_how_to_continue(folder.root()))?;
    let summary = session.recorder.finish(backend.as_mut(), &capture, (&state, reason), resumed, report)?;
    session.say_warnings();
    if reason == StopReason::Consumer {
        let saved = session.recorder.checkpoint().unwrap_or(folder.root());
        log.info(&format!(
            "saved {}; continue with: litetex train --resume {}",
            saved.display(),
            folder.root().display()
        ));
        return Err(Error::Interrupted);
    }
    Ok(FinishedRun { summary, run: job.out, live })
}

/// Says what was chosen for the time, and how to get more.
fn say_plan(job: &TrainJob, situation: &Situation, plan: Plan, log: &Log) {
    let side_px = plan.max_resolution.unwrap_or(situation.side_px);
    let budget = job.config.train.budget.max_params;
    let budget =
        budget.map_or(String::new(), |most| format!(", at most {} parameters", format_count(most as u64)));
    let more = match job.is_free {
        true => "; for more: --time 1h, or --steps and --max-resolution",
        false => "",
    };
    log.event(
        "plan",
        &format!(
            "planned for {}: about {} steps at {side_px} px{budget}, done in about {}{more}",
            format_duration(situation.time_secs),
            format_count(plan.steps.into()),
            format_duration(plan.done_secs - situation.gone_secs)
        ),
        serde_json::json!({ "time_secs": situation.time_secs, "gone_secs": situation.gone_secs, "steps": plan.steps,
            "side_px": side_px, "done_secs": plan.done_secs, "end_secs": plan.end_secs, "budget_params":
            job.config.train.budget.max_params }),
    );
}

/// The state to train from: that of a checkpoint, or a new one.
fn first_state(job: &mut TrainJob, capture: &Capture, report: &mut Report, log: &Log) -> Result<TrainState> {
    if let Some(mut resume) = job.resume.take() {
        resume.check(&job.config, capture)?;
        resume.announce(report, log);
        return Ok(resume.state);
    }
    let mut found = Report::default();
    let state = fresh_state(capture, &mut job.config, &mut found)?;
    log.report(&found);
    report.merge(found);
    Ok(state)
}

/// Reports the memory and time that training is estimated to take; refuses what the machine cannot hold.
fn check_memory(
    job: &TrainJob,
    train_secs: Option<f64>,
    capture: &Capture,
    state: &TrainState,
    report: &mut Report,
    log: &Log,
) -> Result<()> {
    let workload = Workload::new(&state.model, capture, &job.config.train, train_secs);
    let estimate = ResourceEstimate::new(&workload, &job.config.train);
    log.event("resource-estimate", &estimate.describe(), serde_json::json!({ "estimate": estimate }));
    estimate.start.check(machine_bytes())?;
    if let Some(doubt) = estimate.doubt(machine_bytes()) {
        log.warn("memory-may-not-suffice", &doubt, 1);
        report.warn("memory-may-not-suffice", 1, doubt);
    }
    Ok(())
}
