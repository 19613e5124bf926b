//! Runs of the two programs.

#![allow(dead_code, clippy::unwrap_used, reason = "each test uses a part, and helpers of tests are tests")]

use assert_cmd::cargo::cargo_bin;
use std::ffi::OsStr;
use std::path::PathBuf;
use std::process::Command;
use std::sync::OnceLock;

/// The program `litetex`, built if need be: `cargo test --package litetex-lab` builds no binary of another package. It is built for
/// its test `imports`, with the features that all tests of the workspace have in common: those of `cargo build` are others, and
/// the tests of the workspace would build it twice.
pub fn litetex() -> &'static PathBuf {
    static BUILT: OnceLock<PathBuf> = OnceLock::new();
    BUILT.get_or_init(|| {
        let mut build = Command::new(env!("CARGO"));
        build.args(["test", "--quiet", "--workspace", "--no-run", "--test", "imports"]);
        if !cfg!(feature = "gpu") {
            build.arg("--no-default-features");
        }
        let workspace = concat!(env!("CARGO_MANIFEST_DIR"), "/..");
        assert!(build.current_dir(workspace).status().unwrap().success(), "cannot build litetex");
        cargo_bin("litetex")
    })
}

/// The program `litetex-lab`.
pub fn lab() -> PathBuf {
    litetex();
    cargo_bin("litetex-lab")
}

/// Exit code, standard output, standard error of `litetex-lab`, or of `litetex` for its own commands.
pub fn run(arguments: &[impl AsRef<OsStr>]) -> (i32, String, String) {
    let own = ["bench", "chart", "figures", "schedule-chart", "bench-kernels"];
    let is_own = arguments.first().is_some_and(|command| own.iter().any(|own| command.as_ref() == *own));
    let program = if is_own { lab() } else { litetex().clone() };
    let output = Command::new(program).args(arguments).output().unwrap();
    let text = |bytes: Vec<u8>| String::from_utf8(bytes).unwrap();
    (output.status.code().unwrap_or(-1), text(output.stdout), text(output.stderr))
}

/// What a run that succeeds prints.
pub fn ok(arguments: &[&str]) -> String {
    let (code, stdout, stderr) = run(arguments);
    assert_eq!(code, 0, "{arguments:?}\n{stdout}{stderr}");
    stdout
}
