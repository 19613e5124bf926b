//! `litetex bench-kernels`: what a training step costs on a GPU. The measuring is `gpu::bench`'s business;
//! here a scene is chosen and figures are printed. JSON: `docs/bench-kernels-schema.md`.

use super::device_kit;
use super::log::Log;
use std::path::PathBuf;

/// Measure what a training step does on a GPU: times, pairs, traffic, waits
///
/// Steps on views of a capture, from the model that training starts with, or on a random scene. The first run
/// over the views does not count.
#[derive(clap::Args)]
pub struct BenchKernelsArgs {
    /// Folder of a capture [default: a random scene]
    #[cfg_attr(not(feature = "gpu"), allow(dead_code, reason = "there is nothing to measure"))]
    capture: Option<PathBuf>,
    /// Which GPU
    #[arg(long, value_name = "NAME", default_value = "gpu", help_heading = "Device")]
    device: String,
    /// Bound of the pictures' longer side in pixels
    #[arg(long, value_name = "N", default_value_t = 480, value_parser = clap::value_parser!(u32).range(16..))]
    max_resolution: u32,
    /// Steps to measure
    #[arg(long, value_name = "N", default_value_t = 16, value_parser = clap::value_parser!(u32).range(1..=10_000))]
    steps: u32,
    /// Also sort 100,000 and 1,000,000 keys
    #[arg(long)]
    sort: bool,
    /// Write the figures here
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    /// Put together what scripts/device-kit has left in a folder
    #[arg(long, value_name = "DIR", hide = true)]
    collect: Option<PathBuf>,
}

/// Measures and prints a table.
pub fn run(args: &BenchKernelsArgs, log: &Log) -> anyhow::Result<()> {
    match &args.collect {
        Some(folder) => device_kit::collect(folder),
        None => measured(args, log),
    }
}

#[cfg(not(feature = "gpu"))]
fn measured(args: &BenchKernelsArgs, _log: &Log) -> anyhow::Result<()> {
    let _ = (&args.capture, args.max_resolution, args.steps, args.sort, &args.json);
    let what = format!("{:?}: this build has no GPUs; build it with the feature \"gpu\"", args.device);
    Err(litetex_gs::Error::unsupported("bench-kernels", what).into())
}

#[cfg(feature = "gpu")]
use with_gpu::measured;

#[cfg(feature = "gpu")]
mod with_gpu {
    use super::super::capture::{self, InitSource, LoadOptions};
    use super::super::devices::open_gpu_backend;
    use super::super::table::Table;
    use super::super::values::{format_bytes, format_count};
    use super::{BenchKernelsArgs, Log};
    use litetex_gs::backend::{StepRequest, TargetImage};
    use litetex_gs::camera::{Camera, RigidTransform};
    use litetex_gs::gpu::bench::{DeviceFigures, KernelFigures, SortThroughput, measure, sort_throughput};
    use litetex_gs::model::Model;
    use litetex_gs::selftest::{SceneOptions, random_scene};
    use litetex_gs::train::{Schedule, TrainConfig};
    use litetex_gs::views::{Split, ViewSource};
    use litetex_gs::{Error, Result, atomic_file};
    use serde::Serialize;
    use std::sync::Arc;

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
    }

    /// Everything that is written.
    #[derive(Serialize)]
    struct Figures {
        schema: &'static str,
        version: &'static str,
        scene: String,
        device: DeviceFigures,
        #[serde(flatten)]
        kernels: KernelFigures,
        sort: Vec<SortThroughput>,
    }

    pub fn measured(args: &BenchKernelsArgs, log: &Log) -> anyhow::Result<()> {
        let mut backend = open_gpu_backend(&args.device)?;
        let scene = match &args.capture {
            Some(_) => of_capture(args, log)?,
            None => at_random(args.max_resolution),
        };
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
                photo: photo as u32,
                target,
                background: scene.background,
                sh_degree: scene.model.splats.sh_degree,
                loss: config.loss,
                rates,
                accumulate_statistics: false,
            }
        };
        let num_views = scene.views.len() as u32;
        let kernels = measure(&mut backend, &scene.model, args.steps, num_views, &request)?;
        let counts: &[usize] = if args.sort { &[100_000, 1_000_000] } else { &[] };
        let sort = counts.iter().map(|&n| sort_throughput(backend.gpu(), n)).collect::<Result<_>>()?;
        let figures = Figures {
            schema: SCHEMA,
            version: env!("CARGO_PKG_VERSION"),
            device: DeviceFigures::of(backend.gpu()),
            kernels,
            sort,
            scene: scene.name,
        };
        if let Some(path) = &args.json {
            let json = serde_json::to_vec_pretty(&figures)?;
            atomic_file::write(path, &json)?;
        }
        print(&figures)?;
        let unsorted = figures.sort.iter().any(|s| !s.sorted);
        if unsorted || !figures.kernels.repeatable {
            let what = "the device or its driver computes wrongly: a sort went wrong, or equal steps differ";
            return Err(Error::CheckFailed(what.to_owned()).into());
        }
        Ok(())
    }

    fn of_capture(args: &BenchKernelsArgs, log: &Log) -> Result<Scene> {
        let path = args.capture.clone().unwrap_or_default();
        let options = LoadOptions { max_resolution: args.max_resolution, ..LoadOptions::default() };
        let capture = capture::open(&path, &options)?;
        log.report(&capture.report);
        let config = TrainConfig::default();
        let (state, left_out) = capture::fresh_state(&capture, &InitSource::Auto, None, &config)?;
        log.report(&left_out);
        let train = capture.indices(Split::Train);
        // Spread over the capture.
        let count = train.len().min(VIEWS_MAX).min(args.steps as usize);
        let chosen = (0..count).map(|k| train[k * train.len() / count]);
        let views =
            chosen.map(|v| Ok((capture.camera(v), capture.target(v)?))).collect::<Result<Vec<_>>>()?;
        if views.is_empty() {
            return Err(Error::invalid(&path, "no view to train on"));
        }
        Ok(Scene { name: capture.name.clone(), model: state.model, views, background: config.background })
    }

    /// Small splats in a random scene, from a few sides.
    fn at_random(max_resolution: u32) -> Scene {
        let width_px = max_resolution.min(1600);
        let scene = random_scene(&SceneOptions {
            num_splats: 10_000,
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
        Scene { name, views: views.collect(), model: scene.model, background: [0.0; 3] }
    }

    fn print(f: &Figures) -> std::io::Result<()> {
        let k = &f.kernels;
        let mut table = Table::default();
        let [w, h] = k.size_px;
        table.row("device", format!("{} ({})", f.device.name, f.device.description));
        table.row("scene", format!("{}, {} views of up to {w} x {h}", f.scene, k.views));
        table.row("splats, texels", [k.splats, k.texels].map(|n| format_count(n as u64)).join(", "));
        let (ms, cpu_ms) = (1e3 * k.wall_secs_per_step, 1e3 * k.cpu_secs_per_step);
        table.row("a step", format!("{ms:.3} ms, CPU {cpu_ms:.3} ms; {:.1} steps/s", k.steps_per_sec));
        let work = &k.per_step;
        table.row(
            "per step",
            format!(
                "{:.1} dispatches, {:.3} submissions, {:.3} waits",
                work.dispatches, work.submissions, work.host_waits
            ),
        );
        match &k.kernel_secs {
            None => {
                table.row("kernels", "not timed: no device clock");
            }
            Some(times) => times.iter().for_each(|(name, secs)| {
                let (_, bytes) = k.traffic.kernels.iter().find(|(n, _)| n == name).unwrap_or(&("", 0.0));
                let rate = bytes / secs.max(1e-12) / 1e9;
                table.row(&format!("  {name}"), format!("{:.4} ms, {rate:.2} GB/s", 1e3 * secs));
            }),
        }
        let p = &k.pairs;
        table.row(
            "pairs per pixel",
            format!(
                "{:.1} visited, {:.1} evaluated, {:.1} inside, {:.1} blended ({} tile pairs)",
                p.visited,
                p.evaluated,
                p.inside,
                p.blended,
                format_count(p.tile_pairs as u64)
            ),
        );
        table.row("evaluated / blended", format!("{:.2}", p.evaluated_per_blended));
        table.row("visited / evaluated", format!("{:.2}", p.visited_per_evaluated));
        table.row("atomics per blended pair", format!("{:.3}", k.texel_atomics.per_blended_pair));
        for share in &k.traffic.items {
            let item = share.item.map_or("in all".to_owned(), |i| format!("{i:?}").to_lowercase());
            let ratio = share.ratio.map_or(String::new(), |r| format!(", {r:.2} times"));
            let [ours, floor] = [share.bytes, share.floor_bytes].map(|b| format_bytes(b as u64));
            table.row(&format!("traffic, {item}"), format!("{ours}, floor {floor}{ratio}"));
        }
        for v in &k.variants {
            let ms = |secs: Option<f64>| secs.map_or("-".to_owned(), |s| format!("{:.4} ms", 1e3 * s));
            let name = if v.hardware_kernels { "rasterisation for hardware" } else { "for software" };
            let times = format!("forward {}, backward {}", ms(v.raster_fwd_secs), ms(v.raster_bwd_secs));
            table.row(name, times);
        }
        for s in &f.sort {
            let verdict = if s.sorted { "" } else { ", WRONG ORDER" };
            let rate = s.keys_per_sec / 1e6;
            table.row(&format!("sort of {}", s.keys), format!("{rate:.2} million keys/s{verdict}"));
        }
        let verdict = if k.repeatable { "yes" } else { "NO" };
        table.row("equal steps, equal bytes", format!("{verdict} ({})", k.state_hash));
        table.print()
    }
}
