//! Time and error of training on the CPU backend:
//!
//! `cargo bench --bench bench_scene -- CAPTURE [--max-resolution 480] [--steps 300] [--policy fixed:4]`
//!
//! Prints quality figures of the test views over CPU time, CPU seconds per step, the number of busy cores, time
//! by pass, and pixel-splat pairs per pixel.

use litetex_gs::backend::{Backend as _, RasterCounters};
use litetex_gs::capture::{Capture, LoadOptions};
use litetex_gs::clock::process_cpu_secs;
use litetex_gs::cpu::CpuBackend;
use litetex_gs::init::{InitInput, InitOptions, InitPoints, initial_model};
use litetex_gs::train::{Control, TrainConfig, TrainEvent, TrainState, train};
use std::collections::BTreeMap;
use std::path::PathBuf;
use std::time::{Duration, Instant};

struct Options {
    capture: PathBuf,
    load: LoadOptions,
    config: TrainConfig,
    threads: Option<usize>,
}

fn options() -> Option<Options> {
    let mut args = std::env::args().skip(1).filter(|a| a != "--bench");
    let mut options = Options {
        capture: PathBuf::from(args.next()?),
        load: LoadOptions { max_resolution: 480, ..LoadOptions::default() },
        config: TrainConfig { steps: 300, eval_every: 100, ..TrainConfig::default() },
        threads: None,
    };
    while let Some(flag) = args.next() {
        let value = args.next()?;
        match flag.as_str() {
            "--max-resolution" => options.load.max_resolution = value.parse().ok()?,
            "--steps" => options.config.steps = value.parse().ok()?,
            "--eval-every" => options.config.eval_every = value.parse().ok()?,
            "--policy" => options.config.policy = value.parse().ok()?,
            "--seed" => options.config.seed = value.parse().ok()?,
            "--threads" => options.threads = Some(value.parse().ok()?),
            // Any setting of config.toml, as in rates.NAME=VALUE.
            "--set" => options.config = toml_set(&options.config, &value)?,
            _ => return None,
        }
    }
    Some(options)
}

fn toml_set(config: &TrainConfig, assignment: &str) -> Option<TrainConfig> {
    let (path, value) = assignment.split_once('=')?;
    let mut root = toml::Table::try_from(config).ok()?;
    let mut table = &mut root;
    let mut parts = path.split('.').peekable();
    while let Some(part) = parts.next() {
        if parts.peek().is_none() {
            let value: toml::Table = format!("v = {value}").parse().ok()?;
            table.insert(part.to_owned(), value["v"].clone());
            break;
        }
        table = table.get_mut(part)?.as_table_mut()?;
    }
    root.try_into().ok()
}

fn main() {
    let Some(options) = options() else {
        println!("usage: cargo bench --bench bench_scene -- CAPTURE [--max-resolution N] [--steps N] ...");
        return;
    };
    let start = Instant::now();
    let capture = Capture::load(&options.capture, &options.load).expect("capture loads");
    let init = InitOptions {
        policy: options.config.policy,
        sh_degree: options.config.sh_degree,
        seed: options.config.seed,
        filter: options.config.filter,
        ..InitOptions::default()
    };
    let input = InitInput {
        views: &capture,
        points: InitPoints::Sparse(&capture.points),
        points_file: &capture.poses,
        capture_from_local: capture.capture_from_local,
        near: capture.near,
    };
    let model = initial_model(&input, &init).expect("points").model;
    println!(
        "{} splats, {} texels, loaded in {:.1} s",
        model.num_splats(),
        model.num_texels(),
        start.elapsed().as_secs_f64()
    );
    let mut backend = CpuBackend::new(options.threads).expect("threads");
    println!("{}", backend.device().description);
    backend.count_pairs(true);
    let mut stages: BTreeMap<(usize, &'static str), Duration> = BTreeMap::new();
    let mut counters = RasterCounters::default();
    let mut steps = 0_u64;
    let started = process_cpu_secs();
    let mut sink = |event: TrainEvent<'_>| {
        match event {
            TrainEvent::Step { report, .. } => {
                steps += 1;
                for (order, (name, time)) in report.stages.iter().enumerate() {
                    *stages.entry((order, name)).or_default() += *time;
                }
                let c = &report.counters;
                counters.pixels += c.pixels;
                counters.visible_splats += c.visible_splats;
                counters.tile_pairs += c.tile_pairs;
                counters.evaluated_pairs += c.evaluated_pairs;
                counters.inside_pairs += c.inside_pairs;
                counters.blended_pairs += c.blended_pairs;
            }
            TrainEvent::Evaluated { point, evaluation, .. } => println!(
                "step {:>6}  {:>8.2} CPU s  {:>8.2} s  {:.4} CPU s/step  busy {:.2}  PSNR {:.3}  gradient-PSNR {:.3}  SSIM {:.4}  FLIP {:.4}",
                point.step,
                point.cpu_secs,
                point.wall_secs,
                point.cpu_secs / f64::from(point.step),
                point.cpu_secs / point.wall_secs,
                point.psnr_test,
                point.grad_psnr_test,
                evaluation.ssim_3dgs,
                evaluation.flip,
            ),
            _ => {}
        }
        Ok(Control::Continue)
    };
    let state = TrainState::fresh(model);
    train(&options.config, &mut backend, &capture, state, &mut sink).expect("training");
    print(&stages, &counters, steps);
    println!("  CPU in all: {:.1} s", process_cpu_secs() - started);
}

fn print(stages: &BTreeMap<(usize, &'static str), Duration>, counters: &RasterCounters, steps: u64) {
    let per_step = |d: &Duration| d.as_secs_f64() * 1e3 / steps as f64;
    for ((_, name), time) in stages {
        println!("  {name:<16} {:>8.2} ms/step", per_step(time));
    }
    let per_pixel = |n: u64| n as f64 / counters.pixels as f64;
    println!(
        "  pairs per pixel: evaluated {:.1}, inside {:.1}, blended {:.1}; per step: {} visible splats, {} tile pairs",
        per_pixel(counters.evaluated_pairs),
        per_pixel(counters.inside_pairs),
        per_pixel(counters.blended_pairs),
        counters.visible_splats / steps,
        counters.tile_pairs / steps,
    );
}
