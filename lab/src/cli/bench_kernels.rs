//! `litetex-lab bench-kernels`: what a training step costs on a GPU. `gpu::bench` measures; this module chooses the scene
//! and reports the figures. JSON: `lab/bench-kernels-schema.md`.

use litetex_gs::console::Log;
use litetex_gs::console::values::{parse_duration_secs, whole};
#[cfg(not(feature = "gpu"))]
use litetex_gs::{Result, console::Output};
use std::path::PathBuf;

/// Profile training steps on a GPU: kernel times, pairs, memory traffic, waits
///
/// Steps on the views of a capture, from its initial model, or on a random scene. The first pass over the views is a
/// warm-up and does not count. --max-time limits how much is measured.
#[derive(clap::Args)]
pub struct BenchKernelsArgs {
    /// Folder of a capture [default: a random scene]
    capture: Option<PathBuf>,
    /// GPU to measure
    #[arg(long, value_name = "NAME", default_value = "gpu", help_heading = "Device")]
    device: String,
    /// Bound of the images' longer side in pixels
    #[arg(long, value_name = "N", default_value_t = 480, value_parser = whole::<u32>(16..=u64::MAX))]
    max_resolution: u32,
    /// Splats of the random scene
    #[arg(long, value_name = "N", default_value_t = 10_000, conflicts_with = "capture", value_parser = whole::<u32>(1..=10_000_000))]
    splats: u32,
    /// Steps to measure
    #[arg(long, value_name = "N", default_value_t = 16, value_parser = whole::<u32>(1..=10_000))]
    steps: u32,
    /// Also sort 100,000 and 1,000,000 keys
    #[arg(long)]
    sort: bool,
    /// Finish in about this time, including loading, but always do at least one step: 90s, 2m [default: no limit]
    #[arg(long, value_name = "TIME", value_parser = parse_duration_secs)]
    max_time: Option<f64>,
}

/// Refuses: only GPUs have kernels to measure.
#[cfg(not(feature = "gpu"))]
pub fn run(args: &BenchKernelsArgs, _log: &Log) -> Result<Output> {
    let BenchKernelsArgs { capture: _, device, max_resolution: _, splats: _, steps: _, sort: _, max_time: _ } =
        args;
    let what = format!("{device:?}: this build has no GPU support; build it with the feature \"gpu\"");
    Err(litetex_gs::Error::unsupported("bench-kernels", what))
}

#[cfg(feature = "gpu")]
pub use with_gpu::run;

#[cfg(feature = "gpu")]
mod with_gpu {
    use super::{BenchKernelsArgs, Log};
    use litetex_gs::backend::{RenderOptions, StepRequest, TargetImage};
    use litetex_gs::camera::{Camera, RigidTransform};
    use litetex_gs::capture::{Capture, LoadOptions};
    use litetex_gs::console::{Output, Table, device};
    use litetex_gs::gpu::GpuBackend;
    use litetex_gs::gpu::bench::{
        CountFigures, Deadline, DeviceFigures, KernelFigures, SortThroughput, StepFigures, measure,
        sort_throughput,
    };
    use litetex_gs::model::Model;
    use litetex_gs::run::{InitSource, fresh_model};
    use litetex_gs::selftest::{SceneOptions, random_scene};
    use litetex_gs::text::format_count;
    use litetex_gs::train::{Control, Policy, Schedule, TrainConfig, evaluate};
    use litetex_gs::views::{Split, ViewSource};
    use litetex_gs::{Error, Result};
    use serde::Serialize;
    use serde_json::json;
    use std::sync::Arc;
    use std::time::{Duration, Instant};

    /// Share of the time that steps may take; the rest is for an evaluation and for what the estimates miss.
    const STEPS_SHARE: f64 = 0.85;
    /// Numbers of keys to sort.
    const SORTED_KEYS: [usize; 2] = [100_000, 1_000_000];
    /// Sorts of a measurement.
    const SORTS: f64 = 5.0;
    /// Views at most: their photos stay in memory, and each is seen once before anything is measured.
    const VIEWS_MAX: usize = 16;
    /// Schema of the JSON.
    const SCHEMA: &str = "litetex-bench-kernels/1";

    /// Model and views.
    struct Scene {
        name: String,
        model: Model,
        views: Vec<(Camera, Arc<TargetImage>)>,
        background: [f32; 3],
        capture: Option<Capture>,
    }

    /// What it takes to render held-out views and compare them with their photos.
    #[derive(Serialize)]
    struct EvaluationFigures {
        /// Held-out views of the capture.
        views: usize,
        /// Time of one, if there was time for it.
        secs_per_view: Option<f64>,
    }

    /// Everything that is written.
    #[derive(Serialize)]
    struct Figures {
        version: &'static str,
        scene: String,
        device: DeviceFigures,
        #[serde(flatten)]
        kernels: KernelFigures,
        sort: Vec<SortThroughput>,
        load_secs: f64,
        evaluation: Option<EvaluationFigures>,
        /// Why nothing was measured of steps.
        skipped: Option<String>,
    }

    /// Measures and reports.
    pub fn run(args: &BenchKernelsArgs, log: &Log) -> Result<Output> {
        let start = Instant::now();
        let deadline_after = |secs: f64| Deadline::new(Some(start + Duration::from_secs_f64(secs)));
        let deadline = args.max_time.map_or(Deadline::new(None), deadline_after);
        let scene = match &args.capture {
            Some(_) => of_capture(args, log)?,
            None => at_random(args.max_resolution, args.splats),
        };
        let mut backend = device::open_gpu_backend(&args.device)?;
        log.info(&format!("{} views of {}, {} steps", scene.views.len(), scene.name, args.steps));
        let config = TrainConfig::default();
        // Rates of the middle of a run, when everything moves.
        let rates = Schedule::new(&config, scene.views.len()).rates(&config, config.steps / 2);
        let request = |step: u32| {
            let photo = (step as usize - 1) % scene.views.len();
            let (camera, target) = &scene.views[photo];
            StepRequest {
                step,
                camera: *camera,
                photo: Some(photo as u32),
                target,
                background: scene.background,
                sh_degree: scene.model.splats.sh_degree(),
                loss: config.loss,
                rates,
                accumulate_statistics: false,
                exposure: None,
            }
        };
        let num_views = scene.views.len() as u32;
        let load_secs = start.elapsed().as_secs_f64();
        let sort = if args.sort { sorts(&backend, deadline)? } else { Vec::new() };
        let for_steps = match deadline.left() {
            Some(left) => deadline_after(start.elapsed().as_secs_f64() + STEPS_SHARE * left.as_secs_f64()),
            None => deadline,
        };
        let kernels = measure(&mut backend, &scene.model, args.steps, num_views, for_steps, &request)?;
        let skipped = kernels.steps.is_none().then(|| {
            let (secs, limit) = (kernels.first_step_secs, args.max_time.unwrap_or_default());
            format!("one step takes {secs:.1} s: a second one does not fit into {limit:.0} s")
        });
        let step_secs = kernels.steps.as_ref().map_or(kernels.first_step_secs, |s| s.wall_secs_per_step);
        let evaluation = match &scene.capture {
            Some(capture) => Some(evaluation(&mut backend, capture, &scene, deadline.allows(step_secs))?),
            None => None,
        };
        let figures = Figures {
            version: env!("CARGO_PKG_VERSION"),
            device: DeviceFigures::of(backend.gpu()),
            kernels,
            sort,
            load_secs,
            evaluation,
            skipped,
            scene: scene.name,
        };
        let failure = wrong_results(&figures);
        Ok(Output::new(SCHEMA, json!(figures), table_of(&figures)).failing(failure))
    }

    fn wrong_results(figures: &Figures) -> Option<Error> {
        let unsorted = figures.sort.iter().any(|s| !s.sorted);
        let repeatable = figures.kernels.steps.as_ref().and_then(|s| s.repeatable);
        let what =
            "the device or its driver gives wrong results: keys are out of order, or repeated steps differ";
        (unsorted || repeatable == Some(false)).then(|| Error::CheckFailed(what.to_owned()))
    }

    /// Sorts, the larger one if there is time for it after the smaller.
    fn sorts(backend: &GpuBackend, deadline: Deadline) -> Result<Vec<SortThroughput>> {
        let mut out: Vec<SortThroughput> = Vec::new();
        for keys in SORTED_KEYS {
            let secs_per_key = out.last().map_or(0.0, |s| s.secs / s.keys as f64);
            if deadline.allows(SORTS * secs_per_key * keys as f64 / STEPS_SHARE) {
                out.push(sort_throughput(backend.gpu(), keys)?);
            }
        }
        Ok(out)
    }

    /// Renders and compares one held-out view, if there is one, and time for it.
    fn evaluation(
        backend: &mut GpuBackend,
        capture: &Capture,
        scene: &Scene,
        has_time: bool,
    ) -> Result<EvaluationFigures> {
        let test = capture.indices(Split::Test);
        let secs_per_view = match test.first() {
            Some(first) if has_time => {
                let (background, sh_degree) = (scene.background, scene.model.splats.sh_degree());
                let options = RenderOptions { background, sh_degree, geometry: false };
                let start = Instant::now();
                evaluate(backend, capture, &[*first], &options, &mut |_, _| Ok(Control::Continue))?;
                Some(start.elapsed().as_secs_f64())
            }
            _ => None,
        };
        Ok(EvaluationFigures { views: test.len(), secs_per_view })
    }

    fn of_capture(args: &BenchKernelsArgs, log: &Log) -> Result<Scene> {
        let path = args.capture.clone().unwrap_or_default();
        let options = LoadOptions { max_resolution: args.max_resolution, ..LoadOptions::default() };
        let capture = Capture::load(&path, &options)?;
        log.report(&capture.report);
        // Splats of the default policy begin without maps; kernels are measured with those of the published method.
        let config = TrainConfig { policy: Policy::Paper, ..TrainConfig::default() };
        let first = fresh_model(&capture, &InitSource::Auto, None, &config, None)?;
        log.report(&first.report);
        let train = capture.indices(Split::Train);
        // Spread over the capture.
        let count = train.len().min(VIEWS_MAX).min(args.steps as usize);
        let chosen = (0..count).map(|k| train[k * train.len() / count]);
        let views =
            chosen.map(|v| Ok((capture.camera(v), capture.target(v)?))).collect::<Result<Vec<_>>>()?;
        if views.is_empty() {
            return Err(Error::invalid(&path, "no view to train on"));
        }
        let (name, background) = (capture.name.clone(), config.background);
        Ok(Scene { name, model: first.model, views, background, capture: Some(capture) })
    }

    /// Small splats in a random scene, from a few sides.
    fn at_random(max_resolution: u32, splats: u32) -> Scene {
        let width_px = max_resolution.min(1600);
        let scene = random_scene(&SceneOptions {
            num_splats: splats as usize,
            width_px,
            height_px: (width_px * 2 / 3).max(1),
            scales: (0.003, 0.03),
            ..SceneOptions::default()
        });
        let target = Arc::new(scene.target);
        let views = (-2..3).map(|k| {
            let turn = glam::DMat3::from_rotation_y(0.1 * f64::from(k));
            let pose = scene.camera.camera_from_local;
            let turned =
                RigidTransform { rotation: turn * pose.rotation, translation: turn * pose.translation };
            (Camera { camera_from_local: turned, ..scene.camera }, target.clone())
        });
        let name = "a random scene".to_owned();
        Scene { name, views: views.collect(), model: scene.model, background: [0.0; 3], capture: None }
    }

    /// The main figures; the JSON has all.
    fn table_of(f: &Figures) -> Table {
        let k = &f.kernels;
        let mut table = Table::default();
        let [w, h] = k.size_px;
        table.row("device", format!("{} ({})", f.device.name, f.device.description));
        table.row("scene", format!("{}, {} views of up to {w} x {h}", f.scene, k.views));
        table.row("splats, texels", [k.splats, k.texels].map(|n| format_count(n as u64)).join(", "));
        match (&k.steps, &f.skipped) {
            (Some(steps), _) => step_rows(&mut table, steps),
            (None, why) => {
                table.row("skipped", why.as_deref().unwrap_or_default());
            }
        }
        if let Some(EvaluationFigures { views, secs_per_view: Some(secs) }) = &f.evaluation {
            table.row("evaluation", format!("{secs:.3} s for each of {views} views"));
        }
        for s in &f.sort {
            let verdict = if s.sorted { "" } else { ", WRONG ORDER" };
            let rate = s.keys_per_sec / 1e6;
            table.row(&format!("sort of {}", s.keys), format!("{rate:.2} million keys/s{verdict}"));
        }
        table
    }

    fn step_rows(table: &mut Table, k: &StepFigures) {
        let (ms, cpu_ms) = (1e3 * k.wall_secs_per_step, 1e3 * k.cpu_secs_per_step);
        table.row("step", format!("{ms:.3} ms, CPU {cpu_ms:.3} ms; {:.1} steps/s", k.steps_per_sec));
        table.row("step that sends its photo", format!("{:.3} ms", 1e3 * k.first_wall_secs_per_step));
        let work = &k.per_step;
        table.row(
            "per step",
            format!(
                "{:.1} dispatches, {:.3} submissions, {:.3} waits",
                work.dispatches, work.submissions, work.host_waits
            ),
        );
        let bytes_of = |name: &str| {
            let kernels = k.counts.as_ref().map_or(&[][..], |c| &c.traffic.kernels);
            kernels.iter().find(|(n, _)| *n == name).map(|(_, bytes)| *bytes)
        };
        match &k.kernel_secs {
            None => {
                table.row("kernels", "not timed: no device timestamps, or out of time");
            }
            Some(times) => times.iter().for_each(|(name, secs)| {
                let rate = bytes_of(name).map(|bytes| format!(", {:.2} GB/s", bytes / secs.max(1e-12) / 1e9));
                let rate = rate.unwrap_or_default();
                table.row(&format!("  {name}"), format!("{:.4} ms{rate}", 1e3 * secs));
            }),
        }
        if let Some(CountFigures { pairs: p, traffic, .. }) = &k.counts {
            let pairs = [p.visited, p.evaluated, p.inside, p.blended].map(|n| format!("{n:.1}"));
            table
                .row("pairs per pixel", format!("visited, evaluated, inside, blended: {}", pairs.join(", ")));
            if let Some(ratio) = traffic.items.last().and_then(|all| all.ratio) {
                table.row("memory traffic", format!("{ratio:.2} times the floor"));
            }
        }
        let verdict = match (k.repeatable, &k.state_hash) {
            (Some(true), Some(hash)) => format!("yes ({hash})"),
            (Some(false), _) => "NO".to_owned(),
            _ => "not measured: out of time".to_owned(),
        };
        table.row("repeatable", verdict);
    }
}
