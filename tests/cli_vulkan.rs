//! Commands that open no GPU do not load the graphics loader, which takes time and prints complaints of drivers. What
//! glibc looks for is seen in its debug output, with and without a loader on the machine.
#![cfg(all(feature = "gpu", target_os = "linux", target_env = "gnu"))]
#![allow(clippy::unwrap_used, reason = "a failing test may panic")]

use assert_cmd::Command;
use std::path::Path;

/// Whether a command, which must succeed, and its processes look for the Vulkan loader.
fn looks_for_vulkan(folder: &Path, command: &str) -> bool {
    let traces = tempfile::tempdir().unwrap();
    let output = Command::cargo_bin("litetex")
        .unwrap()
        .args(command.split(' '))
        .current_dir(folder)
        .env("LD_DEBUG", "libs")
        .env("LD_DEBUG_OUTPUT", traces.path().join("trace"))
        .output()
        .unwrap();
    assert!(output.status.success(), "{command}: {}", String::from_utf8_lossy(&output.stderr));
    let traces = std::fs::read_dir(traces.path())
        .unwrap()
        .map(|t| std::fs::read_to_string(t.unwrap().path()).unwrap());
    let traces: String = traces.collect();
    assert!(
        traces.contains("find library=libc.so"),
        "{command}: glibc traces the libraries that it looks for"
    );
    traces.contains("find library=libvulkan")
}

#[test]
fn commands_that_open_no_gpu_look_for_no_vulkan() {
    let folder = tempfile::tempdir().unwrap();
    for command in [
        "--help",
        "completions bash",
        "sample capture --views 9 --size 64x48 --points 300 --no-truth",
        "schedule capture",
        "train capture -o run --steps 3 --device cpu",
        "eval run --device cpu",
        "render run --test -o images --device cpu",
        "inspect run",
        "export run -o model.ltgs --device cpu",
        "export run -o model.ply --no-verify",
        "convert model.ltgs model.glb --device cpu",
        "inspect model.glb",
        "validate model.glb",
        "compare model.ltgs model.glb --device cpu",
        "verify model.glb --against run --device cpu",
        "selftest --device cpu",
    ] {
        assert!(!looks_for_vulkan(folder.path(), command), "{command}");
    }
    // Negative control.
    assert!(looks_for_vulkan(folder.path(), "devices"));
}

#[test]
fn where_no_desktop_runs_messages_are_our_own() {
    let folder = tempfile::tempdir().unwrap();
    let stderr = |args: &[&str], keep: &[(&str, &str)]| {
        let mut command = Command::cargo_bin("litetex").unwrap();
        for name in [
            "XDG_RUNTIME_DIR",
            "WAYLAND_DISPLAY",
            "WAYLAND_SOCKET",
            "NODEVICE_SELECT",
            "MESA_VK_DEVICE_SELECT",
        ] {
            command.env_remove(name);
        }
        command.args(args).current_dir(folder.path()).envs(keep.iter().copied());
        let output = command.output().unwrap();
        assert!(output.status.success(), "{args:?}: {}", String::from_utf8_lossy(&output.stderr));
        String::from_utf8(output.stderr).unwrap()
    };
    stderr(&["sample", "capture", "--views", "9", "--size", "64x48", "--points", "300", "--no-truth"], &[]);
    let train = ["--log-format", "json", "train", "capture", "-o", "run", "--steps", "3"];
    let said = stderr(&train, &[]);
    assert!(said.lines().count() > 3, "{said}");
    for line in said.lines() {
        assert!(serde_json::from_str::<serde_json::Value>(line).is_ok(), "not JSON: {line}");
    }
    assert_eq!(stderr(&["devices"], &[]), "");
    // Negative control, on machines with the layer: whoever sets its variables keeps it, and what it writes.
    let layer = Path::new("/usr/share/vulkan/implicit_layer.d/VkLayer_MESA_device_select.json");
    let kept = stderr(&["devices"], &[("MESA_VK_DEVICE_SELECT", "0:0")]);
    if kept.is_empty() {
        eprintln!("not shown to be able to fail: the layer wrote nothing (installed: {})", layer.is_file());
    }
}
