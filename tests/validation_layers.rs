//! The Khronos validation layer, with synchronisation validation, reports nothing about a run with steps, statistics,
//! images, timestamps, counted atomics and a density-control step.
#![cfg(feature = "gpu")]
#![allow(clippy::unwrap_used, reason = "a failing test may panic")]

mod common;

use common::gpu::{drivers, open};
use common::steps::{plan, requests, scene, views};
use litetex_gs::backend::{Backend as _, RenderOptions};
use litetex_gs::gpu::{GpuOptions, LimitChoice};
use litetex_gs::model::AdamState;
use std::path::Path;
use std::process::Command;

/// Folders in which the loader on Linux searches for the layer's manifest.
const MANIFESTS: [&str; 3] = ["/usr/share", "/usr/local/share", "/etc"];

/// Checks for hazards within a submission, and between submissions. Layers that do not know the second flag
/// ignore it, or do both checks with the first.
const SYNCHRONISATION: &str = "VK_VALIDATION_FEATURE_ENABLE_SYNCHRONIZATION_VALIDATION";
const BETWEEN_SUBMISSIONS: &str = "VALIDATION_CHECK_ENABLE_SYNCHRONIZATION_VALIDATION_QUEUE_SUBMIT";

/// Lines of the layer's log that report an error or a warning. Each report starts with a line such as
/// `VUID-...(ERROR / SPEC): msgNum: ...`; there are no known ones to ignore.
fn complaints(log: &str) -> Vec<&str> {
    let marks = ["(ERROR /", "(WARN /", "Validation Error", "Validation Warning", "Validation Performance"];
    log.lines().filter(|line| marks.iter().any(|mark| line.contains(mark))).collect()
}

/// Whether the layer was loaded and checked synchronisation.
fn was_active(log: &str) -> bool {
    let enables = log.lines().find(|line| line.trim_start().starts_with("Current Enables:"));
    log.contains("Khronos Validation Layer Active")
        && enables.is_some_and(|line| line.contains(SYNCHRONISATION))
}

fn is_installed() -> bool {
    let manifest = "vulkan/explicit_layer.d/VkLayer_khronos_validation.json";
    MANIFESTS.iter().any(|folder| Path::new(folder).join(manifest).exists())
}

#[test]
fn the_validation_layer_reports_nothing() {
    let Some(driver) = drivers().into_iter().next() else { return };
    if !is_installed() {
        assert!(std::env::var_os("LITETEX_REQUIRE_GPU").is_none(), "the validation layer is required");
        println!("skipped: the Khronos validation layer is not installed (vulkan-validationlayers)");
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let log = folder.path().join("log.txt");
    let settings = format!(
        "khronos_validation.debug_action = VK_DBG_LAYER_ACTION_LOG_MSG\n\
         khronos_validation.log_filename = {}\n\
         khronos_validation.report_flags = error,warn,perf,info\n\
         khronos_validation.enables = {SYNCHRONISATION}_EXT,{BETWEEN_SUBMISSIONS}\n\
         khronos_validation.enable_message_limit = false\n",
        log.display()
    );
    std::fs::write(folder.path().join("vk_layer_settings.txt"), settings).unwrap();
    let run = Command::new(std::env::current_exe().unwrap())
        .args(["--ignored", "--exact", "a_run_under_the_layer", "--nocapture"])
        .env("VK_INSTANCE_LAYERS", "VK_LAYER_KHRONOS_validation")
        .env("VK_LAYER_SETTINGS_PATH", folder.path())
        // In debug builds, wgpu names WGSL as the source language of the SPIR-V. Layers of 2023 report it as unknown
        // and do not validate the module any further.
        .env("WGPU_DEBUG", "0")
        .output()
        .unwrap();
    let output = [run.stdout, run.stderr].map(|text| String::from_utf8_lossy(&text).into_owned()).join("\n");
    assert!(run.status.success(), "{}: {output}", driver.name);
    assert!(output.contains("1 passed"), "{output}");
    let log = std::fs::read_to_string(&log).unwrap_or_default();
    assert!(was_active(&log), "the layer was not active: {log:?}\n{output}");
    assert!(complaints(&log).is_empty(), "{log}");
    // Negative control: a report in the same log is found.
    for report in [
        "SYNC-HAZARD-WRITE-AFTER-READ(ERROR / SPEC): msgNum: 929810911 - Validation Error: [ SYNC-HAZARD ]",
        "UNASSIGNED-BestPractices-x(WARN / SPEC): msgNum: 1 - Validation Warning: [ UNASSIGNED ]",
    ] {
        let planted = format!("{log}{report}\n    Objects: 1\n");
        assert_eq!(complaints(&planted), [report]);
    }
    assert!(!was_active(&log.replace(SYNCHRONISATION, "None")) && !was_active(""));
}

/// The run itself, in a separate process, because the layer reads its settings from the environment.
#[test]
#[ignore = "started by the_validation_layer_reports_nothing, under the layer"]
fn a_run_under_the_layer() {
    let Some(driver) = drivers().into_iter().next() else { return };
    let scene = scene(11);
    let views = views(&scene);
    let images = RenderOptions { background: [0.0; 3], sh_degree: 3, geometry: false };
    for (hardware_kernels, pair_capacity) in [(false, None), (true, Some(50))] {
        let options = GpuOptions {
            hardware_kernels: Some(hardware_kernels),
            pair_capacity,
            count_pairs: hardware_kernels,
            ..GpuOptions::default()
        };
        let mut backend = open(&driver, LimitChoice::Downlevel, options);
        backend.upload(&scene.model, &AdamState::zeros(&scene.model)).unwrap();
        backend.steps(&requests(&views, 1..=4)).unwrap();
        // With every dispatch in a separate pass between timestamps, and with the variants that count.
        let counting =
            GpuOptions { time_kernels: true, count_texel_atomics: true, count_pairs: true, ..options };
        backend.set_options(counting).unwrap();
        let counted = backend.steps(&requests(&views, 5..=7)).unwrap();
        assert!(
            counted
                .iter()
                .all(|r| r.stages.iter().any(|(name, time)| *name == "raster_bwd" && !time.is_zero()))
        );
        assert!(counted.iter().any(|r| r.counters.texel_atomics > 0));
        backend.set_options(options).unwrap();
        assert_eq!(backend.read_statistics().unwrap().views, 2);
        backend.render(&scene.camera, &images).unwrap();
        backend.apply_plan(&plan(scene.model.num_splats())).unwrap();
        backend.steps(&requests(&views, 8..=10)).unwrap();
        backend.read_flushed().unwrap();
        backend.read_back().unwrap();
        // Terms on depths and normals, and rendered depths and normals.
        let mut geometry = requests(&views, 11..=12);
        geometry.iter_mut().for_each(|r| (r.loss.distortion, r.loss.normal) = (0.1, 0.05));
        backend.steps(&geometry).unwrap();
        backend.render(&scene.camera, &RenderOptions { geometry: true, ..images }).unwrap();
    }
}
