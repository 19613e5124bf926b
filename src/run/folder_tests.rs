//! Folders of runs: what is found in them, kept and refused.

use super::folder::*;
use crate::run::recorder_tests::files_below;
use crate::run::view_files::PER_VIEW;
use std::fs;
use std::path::Path;

/// Of one view, `a/0001.jpg`.
const TABLE: &str =
    "name,psnr,grad_psnr,ssim_3dgs,ssim_valid,flip,psnr_corrected,uncovered\na/0001.jpg,1,1,1,1,1,,\n";

/// A folder with files of these names.
fn folder_with(names: &[&str]) -> tempfile::TempDir {
    let dir = tempfile::tempdir().unwrap();
    for name in names {
        let path = dir.path().join(name);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        let text = match path.file_name().and_then(|name| name.to_str()) {
            Some("config.toml") => "version = \"0.1.0\"\n[train]\n",
            Some(PER_VIEW) => TABLE,
            _ => "x",
        };
        fs::write(path, text).unwrap();
    }
    dir
}

#[test]
fn force_replaces_a_run_and_nothing_else() {
    let foreign = ["checkpoints/best.pt", "eval/notes.txt", "summary.json"];
    let dir = folder_with(&foreign);
    for force in [false, true] {
        let error = RunFolder::create(dir.path(), force).unwrap_err();
        assert!(error.exit_code() == 2 && error.to_string().contains("not empty"), "{error}");
    }
    assert_eq!(files_below(dir.path()), foreign);

    let dir = folder_with(&[
        "config.toml",
        "metrics.jsonl",
        "summary.json",
        PREVIEW,
        "checkpoints/step-000010.safetensors",
        "checkpoints/step-000010.history.json",
        "checkpoints/.step-000020.safetensors.7.part",
        "checkpoints/step-final.safetensors",
        "eval/000010/a/0001.png",
        "eval/000010/error/a/0001.png",
        "eval/000010/per_view.csv",
        "eval/000010/comparison.png",
        "eval/000010/notes.txt",
        "eval/2024/trip.png",
        "eval/20240101/trip/beach.png",
        "thesis.doc",
    ]);
    let error = RunFolder::create(dir.path(), false).unwrap_err();
    assert!(error.exit_code() == 2 && error.to_string().contains("--force"), "{error}");
    drop(RunFolder::create(dir.path(), true).unwrap());
    let left = [
        LOCK,
        "checkpoints/step-final.safetensors",
        "eval/000010/comparison.png",
        "eval/000010/notes.txt",
        "eval/2024/trip.png",
        "eval/20240101/trip/beach.png",
        "thesis.doc",
    ];
    assert_eq!(files_below(dir.path()), left);
}

#[test]
fn settings_of_another_program_make_no_run() {
    for (settings, is_ours) in [
        ("version = \"1.0\"\n[train]\nlearning_rate = 0.1\n", false),
        ("version = \"1.0\"\n[package]\n", false),
        ("[train]\nsteps = 3\n", false),
        ("version = \"1.0\"\n", false),
        ("version = \"0.1.0\"\n[train]\nsteps = 3\n", true),
    ] {
        let dir = folder_with(&["config.toml", "metrics.jsonl"]);
        fs::write(dir.path().join("config.toml"), settings).unwrap();
        let outcome = RunFolder::create(dir.path(), true);
        assert_eq!(outcome.is_ok(), is_ours, "{settings}: {outcome:?}");
        assert_eq!(dir.path().join("metrics.jsonl").exists(), !is_ours);
    }
}

#[test]
fn a_folder_without_a_name_is_refused() {
    let error = RunFolder::check_free(Path::new(""), true).unwrap_err();
    assert!(error.exit_code() == 2 && error.to_string().contains("is empty"), "{error}");
}

#[test]
fn the_run_of_a_checkpoint_is_found_under_any_name() {
    let dir = folder_with(&["run/checkpoints/step-000010.safetensors", "run/checkpoints/old/x", "other/x"]);
    let at = |name: &str| dir.path().join(name);
    let run = at("run").canonicalize().unwrap();
    for name in ["step-000010.safetensors", "old/../step-000010.safetensors"] {
        let checkpoint = at("run/checkpoints").join(name);
        assert_eq!(run_of_checkpoint(&checkpoint).unwrap().canonicalize().unwrap(), run, "{name}");
        assert!(holds_checkpoint(&run, &checkpoint), "{name}");
        assert!(!holds_checkpoint(&at("other"), &checkpoint), "{name}");
    }
    let here = std::env::current_dir().unwrap();
    assert_eq!(run_of_checkpoint(Path::new("checkpoints/step-000010.safetensors")), Some(here));
    assert_eq!(run_of_checkpoint(&at("other/step-000010.safetensors")), None);
}

#[cfg(unix)]
#[test]
fn pipes_in_the_place_of_files_are_refused_and_stay() {
    let config = "config.toml";
    for name in [LOCK, "metrics.jsonl", "summary.json"] {
        let dir = folder_with(&[config]);
        let pipe = dir.path().join(name);
        assert!(std::process::Command::new("mkfifo").arg(&pipe).status().unwrap().success());
        let error = RunFolder::create(dir.path(), true).unwrap_err();
        let named = error.to_string().contains(name) && error.to_string().contains("pipe");
        assert!(error.exit_code() == 2 && named, "{error}");
        assert!(pipe.exists() && dir.path().join(config).exists());
    }
}

#[test]
fn a_folder_is_locked_as_long_as_a_run_uses_it() {
    let dir = tempfile::tempdir().unwrap();
    let first = RunFolder::create(dir.path(), false).unwrap();
    let error = RunFolder::create(dir.path(), true).unwrap_err();
    let named = error.to_string().contains(&dir.path().display().to_string());
    assert!(error.exit_code() == 2 && named, "{error}");
    drop(first);
    // The file is still there.
    assert_eq!(files_below(dir.path()), [LOCK]);
    RunFolder::create(dir.path(), false).unwrap();
}

#[test]
fn a_folder_without_a_checkpoint_says_what_to_do() {
    let said = |dir: &Path| find_checkpoint(dir).unwrap_err().to_string();
    let dir = tempfile::tempdir().unwrap();
    assert!(said(dir.path()).contains("a capture is to be trained first"), "{}", said(dir.path()));
    let dir = folder_with(&["config.toml", "checkpoints/.step-000020.safetensors.7.part"]);
    let again = format!("--config {} -o", dir.path().join("config.toml").display());
    assert!(said(dir.path()).contains(&again), "{}", said(dir.path()));
    let lock = RunLock::take(dir.path()).unwrap();
    assert!(said(dir.path()).contains("no checkpoint yet"), "{}", said(dir.path()));
    // What a kill while saving has left is gone when the folder is opened again.
    drop(RunFolder::reopen(dir.path(), lock).unwrap());
    assert_eq!(files_below(dir.path()), [LOCK, "config.toml"]);
}

#[test]
fn the_last_checkpoint_is_the_one_with_the_highest_step() {
    let dir = tempfile::tempdir().unwrap();
    assert_eq!(find_checkpoint(dir.path()).unwrap_err().exit_code(), 3);
    let run = RunFolder::create(dir.path(), false).unwrap();
    for step in [999_999, 1_000_000, 300] {
        fs::write(run.checkpoint(step).unwrap(), "").unwrap();
    }
    fs::write(dir.path().join("checkpoints/.step-2000000.safetensors.1.part"), "").unwrap();
    let last = find_checkpoint(dir.path()).unwrap();
    assert!(last.ends_with("checkpoints/step-1000000.safetensors"));
    assert_eq!(run_of_checkpoint(&last).as_deref(), Some(dir.path()));
    assert_eq!(checkpoints_after(dir.path(), 300).unwrap().len(), 2);
    fs::write(dir.path().join("checkpoints/step-999999.history.json"), "").unwrap();
    for step in [300, 999_999] {
        fs::create_dir_all(run.eval(step)).unwrap();
        fs::write(run.eval(step).join(PER_VIEW), TABLE).unwrap();
    }
    run.remove_after(300).unwrap();
    assert!(find_checkpoint(dir.path()).unwrap().ends_with("step-000300.safetensors"));
    assert!(run.eval(300).exists() && !run.eval(999_999).exists());
    assert!(!dir.path().join("checkpoints/step-999999.history.json").exists());
}
