//! A run folder filled by scripted events.

use super::config::{RunConfig, SaveImages};
use super::evaluations::{entries, name_of};
use super::folder::{RunFolder, RunLock, find_checkpoint};
use super::recorder::Recorder;
use super::view_files::image_name;
use crate::Result;
use crate::backend::{DeviceInfo, LossValues, RenderedImage, StepReport, TargetImage};
use crate::camera::{Camera, Pinhole, RigidTransform, Similarity};
use crate::eval::{Evaluation, quality_of};
use crate::model::{Model, SplatArrays, TextureMap, TexturePool};
use crate::train::checkpoint;
use crate::train::{CurvePoint, SizeFigures, StopReason, TrainConfig, TrainEvent, TrainState};
use crate::views::{Split, TestViews, ViewSource as _};
use serde_json::Value;
use std::path::Path;
use std::sync::Arc;

fn test_views(names: &[&'static str]) -> TestViews {
    let pinhole = Pinhole { width_px: 12, height_px: 12, fx_px: 8.0, fy_px: 8.0, cx_px: 6.0, cy_px: 6.0 };
    let camera = Camera { pinhole, camera_from_local: RigidTransform::IDENTITY };
    let photo = Arc::new(TargetImage::opaque(12, 12, vec![100; 12 * 12 * 3]));
    TestViews(Split::Test, names.iter().map(|name| (*name, camera, Arc::clone(&photo))).collect())
}

fn state(step: u32) -> TrainState {
    let model = Model {
        splats: SplatArrays::zeros(1, 0),
        textures: TexturePool::neutral([TextureMap::square(2, 2, 0.1)]).unwrap(),
        near: 0.04,
        filter: crate::model::Filter::Ewa,
        capture_from_local: Similarity::IDENTITY,
    };
    TrainState { step, ..TrainState::fresh(model) }
}

const SIZE: SizeFigures = SizeFigures { splats: 1, texels: 4, params: 27 };

/// A step of the trainer, one second after the one before.
fn step_event(step: u32, report: &StepReport) -> TrainEvent<'_> {
    TrainEvent::Step {
        step,
        view: 0,
        loss: LossValues::default(),
        report,
        size: SIZE,
        train_wall_secs: f64::from(step),
        train_cpu_secs: f64::from(step),
        remaining_secs: 0.0,
    }
}

/// Emits what the trainer would for steps after `done`, with an evaluation and a checkpoint every 10 steps.
fn play(recorder: &mut Recorder<'_>, views: &TestViews, done: u32, steps: u32) -> Result<()> {
    let report = StepReport::default();
    let image = RenderedImage {
        width_px: 12,
        height_px: 12,
        rgb: vec![0.4; 12 * 12 * 3],
        alpha: vec![1.0; 144],
        depth: vec![],
        normal: vec![],
    };
    recorder.record(&TrainEvent::Started {
        device: DeviceInfo { name: "test".to_owned(), description: "scripted".to_owned() },
        step: done,
        steps,
        train_views: 3,
        test_views: views.num_views(),
    })?;
    for step in done + 1..=steps {
        recorder.record(&step_event(step, &report))?;
        if step % 10 != 0 {
            continue;
        }
        let mut per_view = Vec::new();
        for view in 0..views.num_views() {
            recorder.record(&TrainEvent::EvalView { step, view, image: &image })?;
            per_view.push(quality_of(views.name(view), &image.rgb, &*views.target(view)?));
        }
        let evaluation = Evaluation::from_views(per_view).unwrap();
        let point = CurvePoint {
            step,
            wall_secs: 1.0,
            cpu_secs: 1.0,
            psnr_test: evaluation.psnr,
            grad_psnr_test: evaluation.grad_psnr,
            size: SIZE,
        };
        let last = step == steps;
        recorder.record(&TrainEvent::Evaluated { step, evaluation: &evaluation, point: &point, last })?;
        recorder.record(&TrainEvent::Checkpoint { state: &state(step), is_interim: false })?;
    }
    recorder.record(&TrainEvent::Finished { reason: StopReason::Steps })
}

fn config(steps: u32, save_images: SaveImages) -> RunConfig {
    RunConfig {
        data: Some("/captures/a".into()),
        save_images,
        train: TrainConfig { steps, ..TrainConfig::default() },
        ..RunConfig::default()
    }
}

fn run(folder: &RunFolder, save_images: SaveImages, done: u32, steps: u32) {
    let views = test_views(&["a/0001.jpg", "a/0002.jpg"]);
    let config = config(steps, save_images);
    let mut recorder = Recorder::new(folder, &views, &config, done, || 1.5).unwrap();
    play(&mut recorder, &views, done, steps).unwrap();
}

fn metrics(folder: &RunFolder) -> Vec<(String, u64)> {
    let text = std::fs::read_to_string(folder.metrics()).unwrap();
    let event = |line: &str| {
        let value: Value = serde_json::from_str(line).unwrap();
        (value["event"].as_str().unwrap().to_owned(), value["step"].as_u64().unwrap_or(0))
    };
    text.lines().map(event).collect()
}

/// The paths of all files below a folder.
pub(super) fn files_below(folder: &Path) -> Vec<String> {
    let mut found = Vec::new();
    for entry in entries(folder).unwrap() {
        let name = name_of(&entry).unwrap().to_owned();
        match entry.is_dir() {
            true => found.extend(files_below(&entry).into_iter().map(|n| format!("{name}/{n}"))),
            false => found.push(name),
        }
    }
    found.sort();
    found
}

#[test]
fn non_finite_gradients_are_reported_at_any_step() {
    for (non_finite, told) in [([0, 0], None), ([2, 5], Some(7))] {
        let dir = tempfile::tempdir().unwrap();
        let folder = RunFolder::create(dir.path(), false).unwrap();
        let (views, config) = (test_views(&["a.jpg"]), config(20, SaveImages::None));
        let mut recorder = Recorder::new(&folder, &views, &config, 0, || 1.5).unwrap();
        // Neither step has a line in the metrics.
        for (step, non_finite_gradients) in [3, 17].into_iter().zip(non_finite) {
            let report = StepReport { non_finite_gradients, ..StepReport::default() };
            recorder.record(&step_event(step, &report)).unwrap();
        }
        recorder.record(&TrainEvent::Finished { reason: StopReason::Steps }).unwrap();
        let warnings = recorder.take_warnings();
        let warning = warnings.iter().find(|w| w.code == "gradients-not-finite");
        assert_eq!(warning.map(|w| w.count), told);
    }
}

#[test]
fn events_fill_the_run_folder() {
    let dir = tempfile::tempdir().unwrap();
    let folder = RunFolder::create(dir.path(), false).unwrap();
    run(&folder, SaveImages::Last, 0, 20);
    assert_eq!(
        files_below(dir.path()),
        [
            ".litetex-train.lock",
            "checkpoints/step-000010.history.json",
            "checkpoints/step-000010.safetensors",
            "checkpoints/step-000020.history.json",
            "checkpoints/step-000020.safetensors",
            "config.toml",
            "eval/000010/per_view.csv",
            "eval/000020/a/0001.png",
            "eval/000020/a/0002.png",
            "eval/000020/error/a/0001.png",
            "eval/000020/error/a/0002.png",
            "eval/000020/per_view.csv",
            "metrics.jsonl",
        ]
    );
    let csv = std::fs::read_to_string(dir.path().join("eval/000020/per_view.csv")).unwrap();
    assert!(
        csv.starts_with(
            "name,psnr,grad_psnr,ssim_3dgs,ssim_valid,flip,psnr_corrected,uncovered\na/0001.jpg,"
        ),
        "{csv}"
    );
    let (loaded, strings) = checkpoint::load(&find_checkpoint(dir.path()).unwrap()).unwrap();
    let mut expected = state(20);
    expected.history.total_wall_secs = 1.5;
    assert_eq!(loaded, expected);
    let config_file = std::fs::read_to_string(folder.config()).unwrap();
    assert_eq!(strings["config"], config_file);
    let views: Value = serde_json::from_str(&strings["views"]).unwrap();
    assert_eq!(views["test"], serde_json::json!(["a/0001.jpg", "a/0002.jpg"]));
    assert_eq!(views["capture_from_local"]["scale"], "3ff0000000000000");
    let mut read = RunConfig::read(&folder.config()).unwrap();
    read.version.clear();
    assert_eq!(read, config(20, SaveImages::Last));
}

#[test]
fn an_interim_checkpoint_is_replaced_by_the_next() {
    let dir = tempfile::tempdir().unwrap();
    let (views, config) = (test_views(&["a.jpg"]), config(90, SaveImages::None));
    // Checkpoints of a part of a run, after `done` steps; those in the folder after each.
    let part = |done: u32, saved: &[(u32, bool)]| -> Vec<Vec<u32>> {
        let folder = RunFolder::reopen(dir.path(), RunLock::take(dir.path()).unwrap()).unwrap();
        let mut recorder = Recorder::new(&folder, &views, &config, done, || 1.5).unwrap();
        let save = |&(step, is_interim): &(u32, bool)| {
            recorder.record(&TrainEvent::Checkpoint { state: &state(step), is_interim }).unwrap();
            let names = files_below(&dir.path().join("checkpoints"));
            assert_eq!(names.len() % 2, 0, "each with its history: {names:?}");
            let steps =
                names.iter().filter_map(|name| name.strip_prefix("step-")?.strip_suffix(".safetensors"));
            steps.map(|step| step.parse().unwrap()).collect()
        };
        saved.iter().map(save).collect()
    };
    assert_eq!(part(0, &[(10, false), (20, true), (30, true)]), [vec![10], vec![10, 20], vec![10, 30]]);
    // Resumed after a kill; one that is saved again for good stays.
    let expected = [vec![10, 40], vec![10, 40], vec![10, 40, 50], vec![10, 40, 60], vec![10, 40, 60]];
    assert_eq!(part(30, &[(40, true), (40, false), (50, true), (60, false), (60, false)]), expected);
}

#[test]
fn save_images_keeps_all_images_or_none() {
    for (save_images, images) in [(SaveImages::None, 0), (SaveImages::Last, 4), (SaveImages::All, 8)] {
        let dir = tempfile::tempdir().unwrap();
        run(&RunFolder::create(dir.path(), false).unwrap(), save_images, 0, 20);
        let found = files_below(dir.path()).iter().filter(|f| f.ends_with(".png")).count();
        assert_eq!(found, images, "{save_images:?}");
    }
}

#[test]
fn a_resumed_run_keeps_only_the_metrics_before_its_checkpoint() {
    let dir = tempfile::tempdir().unwrap();
    let folder = RunFolder::create(dir.path(), false).unwrap();
    run(&folder, SaveImages::None, 0, 40);
    drop(folder);
    let folder = RunFolder::reopen(dir.path(), RunLock::take(dir.path()).unwrap()).unwrap();
    run(&folder, SaveImages::None, 20, 40);
    let steps: Vec<u64> = metrics(&folder).into_iter().filter(|(e, _)| e == "step").map(|(_, s)| s).collect();
    assert_eq!(steps, [1, 10, 20, 30, 40]);
    let text = std::fs::read_to_string(folder.metrics()).unwrap();
    let step: Value = serde_json::from_str(text.lines().find(|l| l.contains("counters")).unwrap()).unwrap();
    // Counters that were not counted are null, not zero.
    assert!(step["counters"]["blended_pairs"].is_null() && step["counters"]["pixels"].is_u64(), "{step}");
    assert_eq!(metrics(&folder).iter().filter(|(e, _)| e == "started").count(), 2);
    assert_eq!(metrics(&folder).iter().filter(|(e, _)| e == "finished").count(), 1);
}

#[test]
fn image_names_follow_the_photos_and_stay_in_their_folder() {
    let views = test_views(&["x/1.jpg", "1.jpg", "1.png", "../../etc/passwd", "/abs.png"]);
    let names: Vec<String> =
        (0..5).map(|v| image_name(&views, v).display().to_string().replace('\\', "/")).collect();
    assert_eq!(names, ["x/1.png", "1.jpg.png", "1.png.png", "etc/passwd.png", "abs.png"]);
}
