//! `litetex train`: from a job to a filled run folder.

use super::asset_args::AssetArgs;
use super::exported::Exports;
use super::live_view::LiveView;
use super::progress::Progress;
use super::session::Session;
use super::sources::load_scene;
use super::train_args::TrainArgs;
use super::train_job::{self, Finished, TrainJob};
use super::train_plan::{self, Start};
use super::train_summary;
use super::{batch, export_files, orphan, outputs};
use litetex_exporters::ORIGIN_OPTION;
use litetex_gs::backend::Backend;
use litetex_gs::capture::Capture;
use litetex_gs::console::{Interrupt, Log, Output, device};
use litetex_gs::memory::machine_bytes;
use litetex_gs::rounding::Rounder;
use litetex_gs::run::{
    DeviceEstimate, Recorder, ResourceEstimate, RunConfig, SCENE, Summary, Workload, file_frame, fresh_state,
    splat_bytes,
};
use litetex_gs::text::{counted, shell_word};
use litetex_gs::train::{
    MOST_STEPS, Schedule, StopReason, Timing, TrainState, check_limits, params_for_bytes, photos_ahead,
    train_by,
};
use litetex_gs::verify::FileRounder;
use litetex_gs::views::{Split, ViewSource as _};
use litetex_gs::{Error, Report, Result};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Instant;

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
    if let Some(written) = write_sized(&run, &args.device, log)? {
        output = output.with("file", written.output());
    }
    if !exports.is_empty() {
        let (scene, trained) = load_scene(&run, log)?;
        let asset = AssetArgs { preview: RunConfig::read(&run.join("config.toml"))?.preview, ..asset };
        let written =
            export_files::write_all((scene, trained.as_ref()), &exports, &asset, &args.device, log)?;
        for file in written.files_for_origin(&exports) {
            let what = format!(
                "{}: train has no --origin; write it with: litetex export {} {} {ORIGIN_OPTION} --force",
                file.display(),
                shell_word(&run),
                shell_word(&file)
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

/// Writes the file of a run that has a wanted size, unless it is there.
fn write_sized(run: &Path, device: &str, log: &Log) -> Result<Option<Exports>> {
    let file = run.join(SCENE);
    let config = RunConfig::read(&run.join("config.toml"))?;
    let Some(max_size) = config.train.max_bytes.filter(|_| !file.exists()) else { return Ok(None) };
    let (scene, trained) = load_scene(run, log)?;
    let args = AssetArgs { max_size: Some(max_size), preview: config.preview, ..AssetArgs::default() };
    export_files::write_all((scene, trained.as_ref()), &[file], &args, device, log).map(Some)
}

/// The run that `--resume-or-start` finds finished, if it does.
fn finished_run(args: &TrainArgs, log: &Log) -> Result<Option<FinishedRun>> {
    let (Some(out), Some(Finished { summary, changed })) = (&args.out, train_job::finished(args)?) else {
        return Ok(None);
    };
    log.info(&format!("{}: finished already, and left as it is", out.display()));
    if !changed.is_empty() {
        let what = format!(
            "{}: the finished run has other settings ({}) and is left as it is; --force replaces it",
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
    let statistics = || device::open("cpu", log);
    let params = splat_bytes(&capture, &job.config)?.map(params_for_bytes);
    let budget = &mut job.config.train.budget.max_params;
    *budget = budget.or(params);
    let mut state = first_state(&mut job, &capture, &mut report, log)?;
    let earlier_secs = state.history.total_wall_secs;
    let mut backend = device::open(&job.device, log)?;
    let now = || earlier_secs + started.elapsed().as_secs_f64();
    let planned = train_plan::plan(
        &mut job,
        Start {
            capture: &mut capture,
            state: &mut state,
            loaded_secs,
            is_resumed: resumed.is_some(),
            keeps_size: args.says_size(),
        },
        backend.as_mut(),
        &now,
        log,
    )?;
    let timing = Timing {
        now: &now,
        deadline_secs: job.config.time_secs,
        most_steps: job.config.most_steps.unwrap_or(MOST_STEPS),
        costs: planned.costs,
        end_secs: planned.end_secs,
    };
    check_memory(&job, planned.train_secs, &capture, (&state, backend.as_ref()), &mut report, log)?;
    // Before the folder is made: a run that cannot be made leaves nothing behind.
    check_limits(&job.config.train, backend.as_ref(), &*capture, &state.model)?;
    log.info(&format!("checking {}", counted(capture.num_views(), "photo")));
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
    let go_on = || !interrupt.is_requested();
    let rounder =
        |max_bytes| FileRounder::new(file_frame(&capture, &job.config), max_bytes, &statistics, &go_on);
    let mut rounder = job.config.scene_max_bytes().map(rounder).transpose()?;
    let recorder = Recorder::new(&folder, &*capture, &job.config, state.step, total_secs)?;
    let progress = Progress::new(log, state.step, job.config.train.last_step());
    let mut session = Session::new(recorder, progress, log, interrupt.clone());
    let follow = |live: &LiveView| live.follow(&folder, &capture, &job.config, log);
    session.preview = live.as_ref().map(follow).transpose()?;
    let rounder = rounder.as_mut().map(|rounder| rounder as &mut dyn Rounder);
    let config = &job.config.train;
    let outcome = train_by(&timing, config, backend.as_mut(), rounder, &*capture, state, &mut |event| {
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
            shell_word(folder.root())
        ));
        return Err(Error::Interrupted);
    }
    Ok(FinishedRun { summary, run: job.out, live })
}

/// The state to train from: that of a checkpoint, or a new one.
fn first_state(job: &mut TrainJob, capture: &Capture, report: &mut Report, log: &Log) -> Result<TrainState> {
    if let Some(mut resume) = job.resume.take() {
        resume.check(&job.config, capture)?;
        resume.announce(report, log);
        return Ok(resume.state);
    }
    let mut found = Report::default();
    let state = fresh_state(capture, &job.config, &mut found)?;
    log.report(&found);
    report.merge(found);
    Ok(state)
}

/// Reports the memory and time that training is estimated to take; refuses what the machine cannot hold, and warns of what the
/// device may not.
fn check_memory(
    job: &TrainJob,
    train_secs: Option<f64>,
    capture: &Capture,
    (state, backend): (&TrainState, &dyn Backend),
    report: &mut Report,
    log: &Log,
) -> Result<()> {
    let ahead = photos_ahead(backend.most_batch_steps());
    let workload = Workload::new(&state.model, capture, &job.config.train, ahead, train_secs);
    let estimate = ResourceEstimate::new(&workload, &job.config.train);
    log.event("resource-estimate", &estimate.describe(), serde_json::json!({ "estimate": estimate }));
    estimate.start.check(machine_bytes())?;
    if let Some(doubt) = estimate.doubt(machine_bytes()) {
        log.warn("memory-may-not-suffice", &doubt, 1);
        report.warn("memory-may-not-suffice", 1, doubt);
    }
    let (name, config) = (backend.device().name, &job.config.train);
    if name == "cpu" {
        return Ok(());
    }
    let estimate = DeviceEstimate::new(&workload, config);
    log.event(
        "device-estimate",
        &estimate.describe(&name),
        serde_json::json!({ "device": name, "estimate": estimate }),
    );
    let pinhole = |view| capture.camera(view).pinhole;
    let sides = (0..capture.num_views()).map(|view| pinhole(view).width_px.max(pinhole(view).height_px));
    let limits = backend.limits(DeviceEstimate::shape(config));
    if let Some(doubt) = estimate.doubts(&name, &limits, sides.max().unwrap_or(0)) {
        log.warn("device-may-not-suffice", &doubt, 1);
        report.warn("device-may-not-suffice", 1, doubt);
    }
    Ok(())
}
