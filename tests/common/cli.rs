//! Runs of the program.

use assert_cmd::Command;
use std::path::Path;
use std::process::Output;

/// A path as an argument.
pub fn text(path: &Path) -> &str {
    path.to_str().unwrap()
}

/// Runs the program.
pub fn litetex(args: &[&str]) -> Output {
    Command::cargo_bin("litetex").unwrap().args(args).output().unwrap()
}

/// What a run that succeeds prints.
pub fn good(args: &[&str]) -> String {
    let output = litetex(args);
    let message = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.success(), "{args:?}: {message}");
    String::from_utf8(output.stdout).unwrap()
}

/// Exit code and message.
pub fn bad(args: &[&str]) -> (i32, String) {
    let output = litetex(args);
    (output.status.code().unwrap(), String::from_utf8_lossy(&output.stderr).into_owned())
}

/// The same with `--json`.
pub fn json(args: &[&str]) -> serde_json::Value {
    serde_json::from_str(&good(&[args, &["--json"]].concat())).unwrap()
}
