//! `scripts/device-kit` on a software driver, and on a device that does not exist.
#![cfg(all(feature = "gpu", unix))]
#![allow(clippy::unwrap_used, reason = "a failing test may panic")]

mod common;

use common::{lab, litetex};
use litetex_gs::gpu::Adapters;
use serde_json::Value;
use std::path::{Path, PathBuf};
use std::process::Command;

/// Runs the kit; exit code, standard output, what it wrote.
fn kit(capture: &Path, out: &Path, device: &str) -> (i32, String, Value) {
    let output = Command::new(Path::new(env!("CARGO_MANIFEST_DIR")).join("../scripts/device-kit"))
        .args(["--tiny", "--long", "--seconds", "2"])
        .args([litetex(), capture, out])
        .arg(device)
        .output()
        .unwrap();
    let json = std::fs::read(out.join("device-kit.json")).unwrap();
    print!("{}", String::from_utf8_lossy(&output.stdout));
    let stdout = String::from_utf8(output.stdout).unwrap();
    (output.status.code().unwrap(), stdout, serde_json::from_slice(&json).unwrap())
}

/// A small capture in a folder of its own; `None` without the interpreter of the kit.
fn capture() -> Option<(tempfile::TempDir, PathBuf)> {
    if Command::new("python3").arg("--version").output().is_err() {
        assert!(std::env::var_os("LITETEX_REQUIRE_GPU").is_none(), "python3 is required");
        println!("skipped: python3 is not installed");
        return None;
    }
    let dir = tempfile::tempdir().unwrap();
    let capture = dir.path().join("capture");
    let made = Command::new(litetex())
        .args(["sample", "--views", "9", "--size", "64x48", "--points", "300", "--no-truth", "-q"])
        .arg(&capture)
        .status();
    assert!(made.unwrap().success());
    Some((dir, capture))
}

fn names(kit: &Value, passed: bool) -> Vec<&str> {
    let parts = kit["parts"].as_array().unwrap();
    parts.iter().filter(|p| p["passed"] == passed).map(|p| p["name"].as_str().unwrap()).collect()
}

#[test]
fn the_kit_tests_and_measures_a_device() {
    // Lavapipe where it is installed: it is the quickest.
    let software: Vec<_> = Adapters::enumerate().usable.into_iter().filter(|a| !a.hardware).collect();
    let Some(driver) = software.iter().find(|a| a.name == "lavapipe").or(software.first()) else {
        assert!(std::env::var_os("LITETEX_REQUIRE_GPU").is_none(), "a software Vulkan driver is required");
        println!("skipped: no software Vulkan driver is installed");
        return;
    };
    let Some((dir, capture)) = capture() else { return };
    let (code, stdout, json) = kit(&capture, &dir.path().join("out"), &driver.name);
    assert_eq!(names(&json, false), Vec::<&str>::new(), "{json:#}");
    let sizes = ["32", "48", "full"];
    let all =
        ["devices", "selftest", "bench-32", "bench-48", "bench-full", "train-32", "train-48", "train-full"];
    let long = ["train-long-48", "train-long-full"];
    assert_eq!(names(&json, true), [&all[..], &long].concat());
    assert!(code == 0 && json["passed"] == true, "{stdout}");
    assert_eq!(
        (&json["device"]["name"], &json["selftest"]["passed"]),
        (&driver.name.as_str().into(), &true.into())
    );
    assert_eq!(
        (&json["schema"], &json["version"]),
        (&"litetex-device-kit/3".into(), &env!("CARGO_PKG_VERSION").into())
    );
    assert!(json["devices"].as_array().unwrap().iter().any(|d| d["name"] == driver.name), "{json:#}");
    let positive = |v: &Value, what: &str| assert!(v.as_f64().is_some_and(|x| x > 0.0), "{what}: {v}");
    for size in sizes {
        let bench = &json["bench"][size];
        assert_eq!(bench["repeatable"], true, "{size}");
        for key in ["steps_per_sec", "wall_secs_per_step", "splats", "texels"] {
            positive(&bench[key], key);
        }
        for key in ["dispatches", "submissions", "host_waits"] {
            positive(&bench["per_step"][key], key);
        }
        positive(&bench["first_wall_secs_per_step"], "a step that sends its photo");
        let pairs = &bench["pairs"];
        let order = ["visited", "evaluated", "inside", "blended"].map(|key| pairs[key].as_f64().unwrap());
        assert!(order.is_sorted_by(|a, b| a >= b) && order[3] > 0.0, "{pairs}");
        positive(&bench["texel_atomics"]["per_blended_pair"], "atomics");
        let items = bench["traffic"]["items"].as_array().unwrap();
        items.iter().for_each(|item| positive(&item["bytes"], "bytes"));
        let kernels = bench["kernel_secs"].as_array().map_or(0, Vec::len);
        let known = bench["traffic"]["kernels"].as_array().unwrap().len();
        assert!(
            kernels == known || bench["device"]["timestamps"] == false,
            "{kernels} of {known} were timed"
        );
        for (form, hardware) in bench["variants"].as_array().unwrap().iter().zip([false, true]) {
            assert_eq!(form["hardware_kernels"], hardware);
            let items = form["counts"]["traffic"]["items"].as_array().unwrap();
            positive(&items.last().unwrap()["ratio"], "bytes over the floor");
            positive(&form["counts"]["texel_atomics"]["per_blended_pair"], "atomics");
            // The flat fields are those of the form that the device gets, which is one for software.
            assert_eq!(form["counts"]["traffic"] == bench["traffic"], !hardware);
        }
        assert_eq!(bench["variants"].as_array().unwrap().len(), 2);
        let train = &json["train"][size];
        positive(&train["steps"], "steps");
        positive(&train["curve"][0]["psnr_test"], "PSNR");
        assert_eq!(train["policy"], "litetex");
    }
    for (size, steps, points) in [("long-48", 40, 4), ("long-full", 60, 3)] {
        let train = &json["train"][size];
        assert_eq!((&train["steps"], &train["stopped_by"]), (&steps.into(), &"steps".into()));
        assert_eq!(train["curve"].as_array().unwrap().len(), points, "{train}");
        // Density control took part of the time.
        let time = &train["time"];
        positive(&time["density_control_wall_secs"], "density control");
        assert!(time["density_control_wall_secs"].as_f64() < time["train_wall_secs"].as_f64());
    }
    assert!(stdout.contains("density control") && stdout.contains("texels"), "{stdout}");
    // A batch is one submission with its status, read once. How long batches are follows from the speed, and a slow device
    // measures fewer steps, one by one.
    let bench = &json["bench"]["32"];
    let [steps, batch_steps] = ["steps", "batch_steps"].map(|key| bench[key].as_u64().unwrap());
    let fewest = steps.div_ceil(batch_steps) as f64 / steps as f64;
    let [waits, submissions] = ["host_waits", "submissions"].map(|k| bench["per_step"][k].as_f64().unwrap());
    assert!(waits == submissions && (fewest..=1.0).contains(&waits), "{:#}", bench["per_step"]);
    assert!(json["bench"]["full"]["size_px"] == serde_json::json!([64, 48]));
    for (sort, keys) in bench["sort"].as_array().unwrap().iter().zip([100_000, 1_000_000]) {
        assert!(sort["keys"] == keys && sort["sorted"] == true);
        positive(&sort["keys_per_sec"], "keys per second");
    }

    a_part_without_time_says_so(&capture, &driver.name);
}

#[test]
fn the_kit_continues_after_failed_parts_and_names_them() {
    let Some((dir, capture)) = capture() else { return };
    let (code, stdout, json) = kit(&capture, &dir.path().join("out"), "no-such-device");
    assert_eq!((code, &json["passed"]), (1, &Value::Bool(false)));
    assert_eq!(names(&json, true), ["devices"]);
    assert!(json["parts"][1]["message"].as_str().unwrap().contains("no-such-device"), "{json:#}");
    assert!(stdout.contains("FAILED") && stdout.contains("9 of 10 parts failed"), "{stdout}");
    assert!(json["bench"]["32"].is_null() && json["train"]["long-full"].is_null(), "{json:#}");
    assert_eq!(json["device"]["name"], "no-such-device", "{}", json["device"]);
}

/// Measuring within a time that does not suffice for a step next to the first is no failure.
fn a_part_without_time_says_so(capture: &Path, device: &str) {
    let output = Command::new(lab())
        .args(["bench-kernels", "--device", device, "--max-resolution", "32", "--max-time", "0.01", "--json"])
        .arg(capture)
        .output()
        .unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let figures: Value = serde_json::from_slice(&output.stdout).unwrap();
    let why = figures["skipped"].as_str().unwrap();
    assert!(why.starts_with("one step takes") && figures["steps_per_sec"].is_null(), "{figures:#}");
    assert!(figures["first_step_secs"].as_f64().unwrap() > 0.0 && figures["device"]["name"] == device);
}
