//! `litetex-lab` as users meet it: help, exit codes, messages, refusal to overwrite.

#![allow(clippy::unwrap_used, reason = "helpers of tests are tests")]

mod common;

use common::{lab, run};
use std::path::Path;
use std::process::Command;

/// Exit code, standard output, standard error.
fn run_lab(arguments: &[&str]) -> (i32, String, String) {
    let output = Command::new(lab()).args(arguments).output().unwrap();
    let text = |bytes: Vec<u8>| String::from_utf8(bytes).unwrap();
    (output.status.code().unwrap(), text(output.stdout), text(output.stderr))
}

#[test]
fn the_documentation_lists_the_commands_as_the_help_does() {
    let (code, help, _) = run_lab(&["--help"]);
    assert_eq!(code, 0);
    let rows = help.lines().skip_while(|l| *l != "Commands:").skip(1).take_while(|l| !l.is_empty());
    let commands: Vec<(&str, &str)> = rows
        .filter_map(|row| row.trim().split_once("  "))
        .map(|(name, about)| (name, about.trim()))
        .filter(|(name, _)| *name != "help")
        .collect();
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/commands.md");
    let text = std::fs::read_to_string(file).unwrap();
    let section = text.split("## `litetex-lab`\n").nth(1).unwrap().split("## ").next().unwrap();
    let listed: Vec<(&str, &str)> = section
        .lines()
        .filter_map(|l| l.strip_prefix("| `")?.strip_suffix(" |")?.split_once("` | "))
        .collect();
    assert_eq!(listed, commands);
    assert_eq!(commands.len(), 5, "{commands:?}");
    for (name, about) in commands {
        let (code, help, stderr) = run_lab(&[name, "--help"]);
        assert_eq!((code, stderr.as_str()), (0, ""), "{name}");
        assert!(help.starts_with(about), "{name}: {help}");
    }
}

#[test]
fn wrong_arguments_exit_with_2_and_name_what_is_expected() {
    let dir = tempfile::tempdir().unwrap();
    let here = dir.path().to_str().unwrap();
    let bench = ["bench", "-o", "x", "--scene", here];
    for (arguments, part) in [
        (vec![], "Usage"),
        (vec!["bench", "-o", "x"], "--scene"),
        (vec!["--seeds", "1,x"], "5-8"),
        (vec!["--shard", "3/2"], "1/3"),
        (vec!["--variant", "a: --colour red"], "--colour"),
        (vec!["--variant", "a: --policy fixed:1"], "fixed:R"),
        (vec!["--variant", "a: other/capture"], "other/capture"),
        (vec!["--variant", "a: --seed 3"], "--seeds"),
        (vec!["--binary", "/nowhere/litetex"], "--binary"),
        (vec!["figures", here], "--regions"),
    ] {
        let is_option = arguments.first().is_some_and(|word| word.starts_with("--"));
        let words = if is_option { [&bench[..], &arguments].concat() } else { arguments };
        let output = Command::new(lab()).current_dir(dir.path()).args(&words).output().unwrap();
        let stderr = String::from_utf8(output.stderr).unwrap();
        assert!(output.status.code() == Some(2) && stderr.contains(part), "{words:?}: {stderr}");
        assert!(output.stdout.is_empty(), "{words:?}");
    }
    assert_eq!(std::fs::read_dir(dir.path()).unwrap().count(), 0, "nothing was made");
}

#[test]
fn wrong_input_exits_with_3() {
    let dir = tempfile::tempdir().unwrap();
    let path = |name: &str| dir.path().join(name).to_str().unwrap().to_owned();
    std::fs::write(path("broken.ply"), "plyish").unwrap();
    std::fs::write(path("empty.jsonl"), "").unwrap();
    std::fs::write(path("bad.toml"), "[train]\nstps = 3\n").unwrap();
    let out = path("out");
    for (arguments, parts) in [
        (["chart", &path("nowhere"), "-o", &out], vec!["nowhere"]),
        (["chart", &path("broken.ply"), "-o", &out], vec!["broken.ply", "litetex-lab bench"]),
        (["chart", &path("empty.jsonl"), "-o", &out], vec!["empty.jsonl", "it is empty"]),
        (["bench", "-o", &out, &format!("--config={}", path("bad.toml"))], vec!["bad.toml", "train"]),
        (["figures", &path("nowhere"), "--sequence", "-q"], vec!["nowhere: no such file or folder"]),
    ] {
        let (code, stdout, stderr) = run(&arguments);
        assert_eq!(code, 3, "{arguments:?}: {stderr}");
        assert!(stdout.is_empty() && stderr.starts_with("error["), "{stderr}");
        parts.iter().for_each(|part| assert!(stderr.contains(part), "{arguments:?}: {stderr}"));
    }
    assert!(!Path::new(&out).exists());
}

#[test]
fn foreign_folders_and_files_are_refused_before_anything_is_read() {
    let dir = tempfile::tempdir().unwrap();
    let note = dir.path().join("note.txt");
    std::fs::write(&note, "mine").unwrap();
    let here = dir.path().to_str().unwrap();
    for arguments in [&["bench", "--scene", "/nowhere", "-o", here][..], &["chart", "/nowhere", "-o", here]] {
        let (code, _, stderr) = run(arguments);
        assert!(code == 2 && stderr.contains("not empty"), "{arguments:?}: {stderr}");
    }
    assert_eq!(std::fs::read_to_string(&note).unwrap(), "mine");
    assert_eq!(std::fs::read_dir(dir.path()).unwrap().count(), 1);
}

#[test]
fn errors_are_json_with_log_format_json() {
    let (code, _, stderr) = run(&["chart", "/nowhere", "-o", "/nowhere/charts", "--log-format", "json"]);
    let value: serde_json::Value = serde_json::from_str(stderr.trim()).unwrap();
    assert!(code == 3 && value["event"] == "error", "{value}");
    assert!(value["message"].as_str().unwrap().contains("/nowhere"), "{value}");
}
