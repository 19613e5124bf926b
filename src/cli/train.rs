//! `litetex train`: from what was typed to a plan, from the plan to a run folder.

use super::asset_args::AssetArgs;
use super::capture::{self, Capture};
use super::config_file::RunConfig;
use super::frozen::Frozen;
use super::identity::Identity;
use super::interrupt::Interrupt;
use super::log::Log;
use super::memory::{machine_bytes, process_bytes};
use super::resource_estimate::{ResourceEstimate, Workload};
use super::run_folder::{RunFolder, checkpoints_after, find_checkpoint, run_of_checkpoint};
use super::session::{Session, reason_name};
use super::summary::{CaptureFigures, Fps, Quality, Resumed, SCHEMA, Size, Summary, Times};
use super::table::Table;
use super::train_args::TrainArgs;
use super::values::{format_bytes, format_count, format_duration};
use super::{devices, eval, export, outputs};
use litetex_gs::backend::Backend;
use litetex_gs::model::{Model, TextureMap};
use litetex_gs::train::checkpoint;
use litetex_gs::train::{Schedule, StopReason, TrainState, check_limits, train};
use litetex_gs::views::{Split, ViewSource};
use litetex_gs::{Error, Report, Result};
use std::path::{Path, PathBuf};
use std::time::Instant;

/// What will be done.
struct Plan {
    config: RunConfig,
    out: PathBuf,
    force: bool,
    device: String,
    resume: Option<Resume>,
}

/// Where a run is picked up.
struct Resume {
    checkpoint: PathBuf,
    state: TrainState,
    changed: Vec<String>,
    /// Views of the run; older checkpoints do not tell.
    identity: Option<Identity>,
    /// What is amiss with the checkpoint.
    report: Report,
}

/// Trains and prints the result.
pub fn run(args: TrainArgs, log: &Log) -> anyhow::Result<()> {
    let asset = AssetArgs { force: args.force, ..AssetArgs::default() };
    // Before hours of training, not after.
    outputs::check(None, &args.export, &asset)?;
    let (summary, run) = train_run(&args, log)?;
    print(&summary)?;
    if !args.export.is_empty() {
        let frozen = Frozen::load(&run, log)?;
        export::write_all(frozen, &args.export, &asset, &args.device, log)?.print()?;
    }
    Ok(())
}

/// Trains; the summary is written and handed back, with the folder of the run.
///
/// # Errors
/// [`Error::Interrupted`] after everything was saved; whatever else goes wrong.
pub fn train_run(args: &TrainArgs, log: &Log) -> Result<(Summary, PathBuf)> {
    let started = Instant::now();
    let mut plan = plan(args)?;
    let mut capture = capture::open(plan.config.data()?, &plan.config.capture)?;
    log.report(&capture.report);
    let mut report = std::mem::take(&mut capture.report);
    let earlier_secs = plan.resume.as_ref().map_or(0.0, |r| r.state.history.total_wall_secs);
    let resumed = plan.resume.as_ref().map(|r| Resumed {
        from_step: r.state.step,
        new_schedule: !r.changed.is_empty(),
        changed: r.changed.clone(),
    });
    let resumes_in_place = plan
        .resume
        .as_ref()
        .is_some_and(|r| run_of_checkpoint(&r.checkpoint).is_some_and(|run| same_folder(run, &plan.out)));
    plan.config.train.random_start = plan.config.init.is_random(&capture);
    let state = match plan.resume {
        Some(resume) => {
            check_resumable(&resume, &plan.config, &capture)?;
            log.report(&resume.report);
            report.merge(resume.report);
            log.info(&format!("continuing {} after step {}", resume.checkpoint.display(), resume.state.step));
            if !resume.changed.is_empty() {
                log.warn(
                    "resumed-with-other-settings",
                    &format!(
                        "{} differ from the checkpoint: this is a new schedule, not the continuation of the old run",
                        resume.changed.join(", ")
                    ),
                    resume.changed.len(),
                );
            }
            resume.state
        }
        None => {
            let (state, left_out) = capture::fresh_state(
                &capture,
                &plan.config.init,
                plan.config.max_points,
                &plan.config.train,
            )?;
            log.report(&left_out);
            report.merge(left_out);
            state
        }
    };

    let steps_left = plan.config.train.steps.saturating_sub(state.step);
    let mut backend = devices::open(&plan.device, log)?;
    let on_cpu = backend.device().name == "cpu";
    let workload = Workload::new(&state.model, &capture, &plan.config.train, steps_left, on_cpu);
    let estimate = ResourceEstimate::new(&workload, &plan.config.train);
    log.event("resource-estimate", &estimate.describe(), serde_json::json!({ "estimate": estimate }));
    estimate.start.check(machine_bytes())?;
    if let Some(doubt) = estimate.doubt(machine_bytes()) {
        log.warn("memory-may-not-suffice", &doubt, 1);
        report.warn("memory-may-not-suffice", 1, doubt);
    }
    // Before the folder is made: a run that cannot be made leaves nothing behind.
    check_limits(&plan.config.train, backend.as_ref(), &capture, &state.model)?;
    let photos = capture.check_photos()?;
    log.report(&photos);
    report.merge(photos);

    let folder = if resumes_in_place {
        let folder = RunFolder::reopen(&plan.out)?;
        if plan.force {
            folder.remove_after(state.step)?;
        }
        folder
    } else {
        RunFolder::create(&plan.out, plan.force)?
    };
    let total_secs = move || earlier_secs + started.elapsed().as_secs_f64();
    let interrupt = Interrupt::listen()?;
    let mut session = Session::new(&folder, &capture, &plan.config, log, interrupt, state.step, total_secs)?;
    let outcome =
        train(&plan.config.train, backend.as_mut(), &capture, state, &mut |event| session.handle(event));
    let (state, reason) = outcome.inspect_err(|_| session.say_how_to_continue())?;
    report.merge(std::mem::take(&mut session.report));

    let summary = Summary {
        schema: SCHEMA.to_owned(),
        version: env!("CARGO_PKG_VERSION").to_owned(),
        scene: capture.name.clone(),
        capture: capture_figures(&capture),
        resample: "area".to_owned(),
        background: plan.config.train.background,
        device: backend.device(),
        seed: plan.config.train.seed,
        steps: state.step,
        steps_planned: plan.config.train.steps,
        profile: plan.config.profile,
        policy: plan.config.train.policy,
        components: plan.config.train.active_components(),
        inactive: Schedule::new(&plan.config.train, capture.indices(Split::Train).len())
            .inactive(&plan.config.train),
        map_sides: map_sides(&state.model),
        stopped_by: reason_name(reason).to_owned(),
        quality: session.evaluation.as_ref().map(Quality::from),
        size: Size {
            primitives: state.model.num_splats(),
            texels: state.model.num_texels(),
            params: state.model.num_params(),
            checkpoint_bytes: session.checkpoint.as_deref().map_or(0, file_bytes),
        },
        fps: match reason {
            StopReason::Consumer => None,
            _ => measure_fps(backend.as_mut(), &capture, &state, plan.config.train.background)?,
        },
        curve: state.history.curve.clone(),
        resumed,
        memory_peak_bytes: process_bytes().map(|(_, peak)| peak),
        warnings: report.warnings,
        time: Times {
            train_wall_secs: state.history.train_wall_secs,
            train_cpu_secs: state.history.train_cpu_secs,
            density_control_wall_secs: state.history.density_control_wall_secs,
            analysis_wall_secs: state.history.analysis_wall_secs,
            total_wall_secs: total_secs(),
        },
    };
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
    Ok((summary, plan.out))
}

fn plan(args: &TrainArgs) -> Result<Plan> {
    let resume_from = match &args.resume {
        None => None,
        Some(None) => Some(
            args.out
                .clone()
                .ok_or_else(|| Error::Usage("--resume: name the run here or with --out".to_owned()))?,
        ),
        Some(Some(path)) => Some(path.clone()),
    };
    let mut resume = resume_from.as_deref().map(load_resume).transpose()?;
    let mut config = match (&args.config, &resume) {
        (Some(file), before) => {
            let mut config = RunConfig::read(file)?;
            if let (None, Some((_, before))) = (&config.data, before) {
                config.data.clone_from(&before.data);
            }
            config
        }
        (None, Some((_, config))) => config.clone(),
        (None, None) => RunConfig::default(),
    };
    args.apply(&mut config)?;
    config.version.clear();
    if let Some(data) = &config.data {
        // The run must be repeatable from anywhere.
        config.data = Some(std::path::absolute(data).map_err(|e| Error::io(data, e))?);
    }
    config.data()?;
    let out = match (&args.out, &resume) {
        (Some(out), _) => out.clone(),
        (None, Some((resume, _))) => run_of_checkpoint(&resume.checkpoint)
            .map(Path::to_owned)
            .ok_or_else(|| Error::Usage("--out: name the folder of the run".to_owned()))?,
        (None, None) => {
            return Err(Error::Usage("no output folder given: litetex train <CAPTURE> -o <RUN>".to_owned()));
        }
    };
    let in_place = resume
        .as_ref()
        .is_some_and(|(r, _)| run_of_checkpoint(&r.checkpoint).is_some_and(|run| same_folder(run, &out)));
    match &resume {
        Some((resume, _)) if in_place => {
            if !args.force {
                check_latest(&resume.state, &out)?;
            }
        }
        _ => RunFolder::check_free(&out, args.force)?,
    }
    if let Some((resume, before)) = &mut resume {
        resume.changed = changed_settings(before, &config);
    }
    Ok(Plan {
        config,
        out,
        force: args.force,
        device: args.device.clone(),
        resume: resume.map(|(resume, _)| resume),
    })
}

fn load_resume(path: &Path) -> Result<(Resume, RunConfig)> {
    let file = find_checkpoint(path)?;
    let (state, strings) = checkpoint::load(&file)?;
    let config = eval::config_of(&file, &strings)?;
    let identity = Identity::from_strings(&file, &strings)?;
    let mut report = Report::default();
    let history = checkpoint::history_path(&file);
    if !history.exists() {
        let what = format!("{}: missing; times and curve until then are lost", history.display());
        report.warn("history-missing", 1, what);
    }
    Ok((Resume { checkpoint: file, state, changed: Vec::new(), identity, report }, config))
}

/// Refuses to continue amid a run: what came later would be mixed with what comes now.
fn check_latest(state: &TrainState, run: &Path) -> Result<()> {
    match checkpoints_after(run, state.step)?.last() {
        None => Ok(()),
        Some(last) => Err(Error::Usage(format!(
            "the run has checkpoints after step {}, up to {}; continue it elsewhere with -o <RUN>, or add \
             --force to delete the later checkpoints and evaluations",
            state.step,
            last.display()
        ))),
    }
}

/// Settings that shape the result and differ; when to evaluate, save or stop is not among them.
fn changed_settings(before: &RunConfig, now: &RunConfig) -> Vec<String> {
    let (b, n) = (&before.train, &now.train);
    let (cb, cn) = (&before.capture, &now.capture);
    let name = |config: &RunConfig| config.data.as_ref().and_then(|d| d.file_name()).map(ToOwned::to_owned);
    let differing = [
        ("data", name(before) != name(now)),
        ("format", cb.format != cn.format),
        ("init", before.init != now.init),
        ("steps", b.steps != n.steps),
        ("seed", b.seed != n.seed),
        ("sh-degree", b.sh_degree != n.sh_degree),
        ("policy", b.policy != n.policy),
        ("components", b.components != n.components),
        ("density", b.density != n.density),
        ("scheduler", b.scheduler != n.scheduler),
        ("budget", b.budget != n.budget),
        ("max-points", before.max_points != now.max_points),
        ("background", b.background != n.background),
        ("loss", b.loss != n.loss),
        ("rates", b.rates != n.rates),
        ("max-resolution", cb.max_resolution != cn.max_resolution),
        ("images", cb.images != cn.images),
        ("masks", cb.masks != cn.masks || cb.mask_invert != cn.mask_invert),
        ("split", cb.test_every != cn.test_every || cb.test_list != cn.test_list),
    ];
    differing.into_iter().filter(|(_, differs)| *differs).map(|(name, _)| name.to_owned()).collect()
}

fn check_resumable(resume: &Resume, config: &RunConfig, capture: &Capture) -> Result<()> {
    let fixed = ["sh-degree", "policy", "seed", "init", "max-points"];
    if let Some(name) = resume.changed.iter().find(|name| fixed.contains(&name.as_str())) {
        return Err(Error::Usage(format!(
            "--{name}: a resumed run keeps the value of its checkpoint; start a new run to change it"
        )));
    }
    if resume.state.step > config.train.steps {
        return Err(Error::Usage(format!(
            "--steps {}: the checkpoint is already at step {}",
            config.train.steps, resume.state.step
        )));
    }
    if let Some(identity) = &resume.identity {
        identity.check_resumable(&Identity::of(capture))?;
    }
    if let Some(view) = resume.state.epoch_order.iter().find(|&&v| v as usize >= capture.num_views()) {
        return Err(Error::invalid(
            &resume.checkpoint,
            format!(
                "view {view} of its epoch is not one of the capture's {}: the capture has changed since",
                capture.num_views()
            ),
        ));
    }
    Ok(())
}

fn same_folder(a: &Path, b: &Path) -> bool {
    match (a.canonicalize(), b.canonicalize()) {
        (Ok(a), Ok(b)) => a == b,
        _ => false,
    }
}

fn file_bytes(path: &Path) -> u64 {
    std::fs::metadata(path).map_or(0, |m| m.len())
}

fn capture_figures(capture: &Capture) -> CaptureFigures {
    let sizes = (0..capture.num_views()).map(|v| capture.camera(v).pinhole);
    let (width_px, height_px) = sizes.fold((0, 0), |(w, h), p| (w.max(p.width_px), h.max(p.height_px)));
    CaptureFigures {
        path: capture.root.display().to_string(),
        format: capture.format.to_string(),
        train_views: capture.indices(Split::Train).len(),
        test_views: capture.indices(Split::Test).len(),
        width_px,
        height_px,
        points: capture.points.len(),
    }
}

/// Splats by the longer side of their map: none, 2, up to 4, 8, ... 256 texels.
fn map_sides(model: &Model) -> Vec<usize> {
    let mut counts = vec![0; TextureMap::SIDE_CLASSES + 1];
    model.textures.maps.iter().for_each(|map| counts[map.side_class()] += 1);
    counts
}

/// Renders the test views, at least 8 images, after one that does not count.
fn measure_fps(
    backend: &mut dyn Backend,
    capture: &Capture,
    state: &TrainState,
    background: [f32; 3],
) -> Result<Option<Fps>> {
    let test = capture.indices(Split::Test);
    let Some(&first) = test.first() else {
        return Ok(None);
    };
    let options = eval::render_options(&state.model, background, false);
    backend.render(&capture.camera(first), &options)?;
    let renders = test.len().clamp(8, 64);
    let mut secs = Vec::new();
    for &view in test.iter().cycle().take(renders) {
        let camera = capture.camera(view);
        let start = Instant::now();
        backend.render(&camera, &options)?;
        secs.push(start.elapsed().as_secs_f64().max(1e-9));
    }
    secs.sort_by(f64::total_cmp);
    let figures = capture_figures(capture);
    Ok(Some(Fps {
        median: 1.0 / secs[renders / 2],
        p5: 1.0 / secs[(renders - 1) * 95 / 100],
        renders,
        width_px: figures.width_px,
        height_px: figures.height_px,
    }))
}

/// The result as a short table on standard output.
pub fn print(s: &Summary) -> std::io::Result<()> {
    let mut table = Table::default();
    table.row("scene", &s.scene);
    table.row("steps", format!("{} ({})", format_count(u64::from(s.steps)), s.stopped_by));
    if let Some(q) = &s.quality {
        table.row("test PSNR", format!("{:.2} dB", q.psnr));
        table.row("test gradient-PSNR", format!("{:.2} dB", q.grad_psnr));
        table.row("test SSIM (3DGS / valid)", format!("{:.4} / {:.4}", q.ssim_3dgs, q.ssim_valid));
        table.row("test FLIP", format!("{:.4}", q.flip));
    }
    table.row("primitives", format_count(s.size.primitives as u64));
    table.row("texels", format_count(s.size.texels as u64));
    table.row("parameters", format_count(s.size.params as u64));
    table.row("checkpoint", format_bytes(s.size.checkpoint_bytes));
    table.row(
        "training time (wall / CPU)",
        format!("{} / {}", format_duration(s.time.train_wall_secs), format_duration(s.time.train_cpu_secs)),
    );
    table.row("total time", format_duration(s.time.total_wall_secs));
    if let Some(fps) = &s.fps {
        table.row("rendering", format!("{:.1} fps at {} x {}", fps.median, fps.width_px, fps.height_px));
    }
    table.row("device", format!("{}: {}", s.device.name, s.device.description));
    table.print()
}
