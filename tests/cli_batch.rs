//! Several captures in one command: failures, names, kills and interrupts, parts at once, what is written.

#![allow(clippy::unwrap_used, reason = "tests")]

use serde_json::Value;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};

/// Flags that make a run quick.
const QUICK: [&str; 9] = [
    "--device",
    "cpu",
    "--threads",
    "1",
    "--init=sfm",
    "--set=backdrop=none",
    "--set=save-images=none",
    "--test-every=4",
    "--seed=1",
];
/// Steps that no test waits for.
const ENDLESS: &str = "--steps=1000000";
/// Time within which something must happen on a busy machine.
const PATIENCE: Duration = Duration::from_secs(120);

/// A folder with the captures `a`, `b` and `other/a`, and `broken`, whose poses are damaged.
struct Place(tempfile::TempDir);

impl Place {
    fn new() -> Self {
        let place = Self(tempfile::tempdir().unwrap());
        let size = ["--views", "6", "--size", "32x32", "--points", "60", "--text", "--no-truth", "-q"];
        let made = place.litetex(&[&["sample", "a"][..], &size].concat());
        assert!(made.status.success(), "{}", said(&made));
        for copy in ["b", "other/a", "broken"] {
            copy_folder(&place.path("a"), &place.path(copy));
        }
        fs::write(place.path("broken/sparse/0/images.bin"), [9; 20]).unwrap();
        place
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    fn command(&self, args: &[&str]) -> Command {
        let mut command = Command::new(assert_cmd::cargo::cargo_bin("litetex"));
        command.current_dir(self.0.path()).args(args).stdin(Stdio::null());
        command
    }

    fn litetex(&self, args: &[&str]) -> Output {
        self.command(args).output().unwrap()
    }

    /// Trains captures into `runs`.
    fn train(&self, captures: &[&str], more: &[&str]) -> Output {
        self.litetex(&batch(captures, more))
    }

    /// The same in the background, its messages in the file `log`.
    fn start(&self, captures: &[&str], more: &[&str]) -> Child {
        let log = fs::File::create(self.path("log")).unwrap();
        self.command(&batch(captures, more)).stdout(Stdio::null()).stderr(log).spawn().unwrap()
    }

    /// Rows of the table: run and status.
    fn table(&self) -> Vec<(String, String)> {
        let table: Value = serde_json::from_slice(&fs::read(self.path("runs/table.json")).unwrap()).unwrap();
        assert_eq!(table["schema"], "litetex-runs/1");
        let text = fs::read_to_string(self.path("runs/table.md")).unwrap();
        let rows = table["runs"].as_array().unwrap().iter().map(|row| {
            let [run, status] = ["run", "status"].map(|key| row[key].as_str().unwrap().to_owned());
            assert!(text.contains(&format!("| {run} | {status} |")), "{text}");
            (run, status)
        });
        rows.collect()
    }

    fn summary(&self, run: &str) -> Option<Value> {
        let file = self.path("runs").join(run).join("summary.json");
        Some(serde_json::from_slice(&fs::read(file).ok()?).unwrap())
    }

    /// Checkpoints of a run.
    fn checkpoints(&self, run: &str) -> Vec<PathBuf> {
        let entries = fs::read_dir(self.path("runs").join(run).join("checkpoints"));
        let paths = entries.into_iter().flatten().flatten().map(|entry| entry.path());
        let mut paths: Vec<PathBuf> =
            paths.filter(|path| path.extension().is_some_and(|e| e == "safetensors")).collect();
        paths.sort();
        paths
    }
}

/// Arguments of a batch into `runs`.
fn batch<'a>(captures: &[&'a str], more: &[&'a str]) -> Vec<&'a str> {
    [&["train"][..], captures, &["-o", "runs"], &QUICK, more].concat()
}

fn said(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

fn copy_folder(from: &Path, to: &Path) {
    fs::create_dir_all(to).unwrap();
    for entry in fs::read_dir(from).unwrap() {
        let (path, name) = entry.map(|entry| (entry.path(), entry.file_name())).unwrap();
        if path.is_dir() {
            copy_folder(&path, &to.join(name));
        } else {
            fs::copy(&path, to.join(name)).unwrap();
        }
    }
}

fn wait_for(what: &str, is_so: impl Fn() -> bool) {
    let started = Instant::now();
    while !is_so() {
        assert!(started.elapsed() < PATIENCE, "{what}: not within {PATIENCE:?}");
        std::thread::sleep(Duration::from_millis(20));
    }
}

fn rows(rows: &[(&str, &str)]) -> Vec<(String, String)> {
    rows.iter().map(|(run, status)| ((*run).to_owned(), (*status).to_owned())).collect()
}

#[test]
fn a_broken_capture_stops_no_other_and_names_are_unique() {
    let place = Place::new();
    let output = place.train(&["a", "broken", "other/a"], &["--steps=3", "--json"]);
    let text = said(&output);
    assert_eq!(output.status.code(), Some(1), "{text}");
    let expected = rows(&[("a", "done"), ("broken", "failed"), ("a-2", "done")]);
    assert_eq!(place.table(), expected);
    // The report is the table, and nothing else is on standard output.
    let printed: Value = serde_json::from_slice(&output.stdout).unwrap();
    let kept: Value = serde_json::from_slice(&fs::read(place.path("runs/table.json")).unwrap()).unwrap();
    assert_eq!(printed["runs"], kept["runs"]);
    let [done, broken] = [&kept["runs"][0], &kept["runs"][1]];
    assert!(broken["exit_code"] == 3 && broken["psnr"].is_null(), "{broken}");
    assert!(broken["error"].as_str().unwrap().contains("images.bin"), "{broken}");
    assert!(done["psnr"].as_f64().unwrap() > 1.0 && done["steps"] == 3 && done["error"].is_null(), "{done}");
    assert!(text.contains("error[check-failed]: 1 of 3 runs failed: broken;"), "{text}");
    // Messages name their run; in a file there are neither colours nor bars.
    assert!(text.lines().any(|line| line.starts_with("[broken] error[invalid-input]: ")), "{text}");
    assert!(!text.contains(['\u{1b}', '\r', '\u{8}']), "{text:?}");
    // Without the broken one.
    fs::remove_dir_all(place.path("runs")).unwrap();
    let output = place.train(&["a", "b"], &["--steps=3"]);
    assert_eq!(output.status.code(), Some(0), "{}", said(&output));
    assert_eq!(place.table(), rows(&[("a", "done"), ("b", "done")]));
    let table = String::from_utf8(output.stdout).unwrap();
    assert!(table.contains("PSNR") && !table.contains('\u{1b}'), "{table:?}");
}

#[test]
fn what_cannot_be_meant_is_refused_before_the_first_run() {
    let place = Place::new();
    for (more, part) in [
        (vec!["--resume"], "--resume-or-start"),
        (vec!["--export", "scene.ltgs"], "{name}"),
        (vec!["--shard", "4/3"], "4/3"),
        (vec!["--set", "no-such=1"], "no-such"),
    ] {
        let output = place.train(&["a", "b"], &more);
        assert!(
            output.status.code() == Some(2) && said(&output).contains(part),
            "{more:?}: {}",
            said(&output)
        );
        assert!(!place.path("runs/a").exists(), "{more:?}");
    }
}

#[test]
fn archives_are_trained_and_assets_lie_in_their_runs() {
    let place = Place::new();
    let mut zip = zip::ZipWriter::new(fs::File::create(place.path("packed.zip")).unwrap());
    for file in files_below(&place.path("b")) {
        let name = file.strip_prefix(place.path("b")).unwrap().to_str().unwrap().replace('\\', "/");
        zip.start_file(name, zip::write::SimpleFileOptions::default()).unwrap();
        std::io::Write::write_all(&mut zip, &fs::read(&file).unwrap()).unwrap();
    }
    zip.finish().unwrap();
    let arguments = ["--steps=3", "--resume-or-start", "--export", "{run}/{name}.ltgs"];
    let output = place.train(&["a", "packed.zip"], &arguments);
    assert_eq!(output.status.code(), Some(0), "{}", said(&output));
    assert_eq!(place.table(), rows(&[("a", "done"), ("packed", "done")]));
    let assets = ["runs/a/a.ltgs", "runs/packed/packed.ltgs"].map(|name| place.path(name));
    for asset in &assets {
        assert!(fs::metadata(asset).unwrap().len() > 100, "{}", asset.display());
    }
    // Again: nothing is trained, an asset that is gone is made, the other is left.
    fs::remove_file(&assets[0]).unwrap();
    let before = [fs::metadata(place.path("runs/a/summary.json")), fs::metadata(&assets[1])];
    let output = place.train(&["a", "packed.zip"], &arguments);
    assert_eq!(output.status.code(), Some(0), "{}", said(&output));
    assert!(assets[0].exists());
    let after = [fs::metadata(place.path("runs/a/summary.json")), fs::metadata(&assets[1])];
    for (before, after) in before.into_iter().zip(after) {
        assert_eq!(before.unwrap().modified().unwrap(), after.unwrap().modified().unwrap());
    }
    // Negative control: without --resume-or-start the folders are taken.
    let taken = place.train(&["a", "packed.zip"], &["--steps=3"]);
    let text = said(&taken);
    assert_eq!(taken.status.code(), Some(2), "{text}");
    // What it advises is what the test has done.
    assert!(text.contains("; --resume-or-start continues it") && !text.contains("--resume "), "{text}");
}

fn files_below(folder: &Path) -> Vec<PathBuf> {
    let paths = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    paths.flat_map(|path| if path.is_dir() { files_below(&path) } else { vec![path] }).collect()
}

#[test]
fn parts_at_once_make_one_table() {
    let place = Place::new();
    let captures = ["a", "b", "other/a", "broken"];
    let mut first = place.start(&captures, &["--steps=3", "--shard", "1/2"]);
    let second = place.train(&captures, &["--steps=3", "--shard", "2/2"]);
    assert_eq!(first.wait().unwrap().code(), Some(0));
    assert_eq!(second.status.code(), Some(1), "{}", said(&second));
    let expected = rows(&[("a", "done"), ("b", "done"), ("a-2", "done"), ("broken", "failed")]);
    assert_eq!(place.table(), expected);
    // Each part prints its own rows.
    let printed = String::from_utf8(second.stdout).unwrap();
    assert!(printed.contains("broken") && !printed.contains("a-2"), "{printed}");
}

#[cfg(target_os = "linux")]
mod signals {
    use super::*;

    const LONG: [&str; 3] = [ENDLESS, "--set=save-every=2", "--set=eval-every=0"];

    /// Sends a signal.
    fn signal(name: &str, id: u32) {
        assert!(Command::new("kill").args([name, &id.to_string()]).status().unwrap().success());
    }

    /// The processes that a process has started.
    fn children(parent: u32) -> Vec<u32> {
        let entries = fs::read_dir("/proc").unwrap().flatten();
        let ids = entries.filter_map(|entry| entry.file_name().to_str()?.parse().ok());
        let is_child = |id: &u32| {
            let stat = fs::read_to_string(format!("/proc/{id}/stat")).unwrap_or_default();
            // The name in parentheses may hold anything.
            let after = stat.rsplit_once(") ").map_or("", |(_, after)| after);
            after.split(' ').nth(1) == Some(&parent.to_string())
        };
        ids.filter(is_child).collect()
    }

    /// Whether a process runs, not counting one that has ended and is not yet waited for.
    fn runs(id: u32) -> bool {
        let stat = fs::read_to_string(format!("/proc/{id}/stat")).unwrap_or_default();
        stat.rsplit_once(") ").is_some_and(|(_, after)| !after.starts_with('Z'))
    }

    /// A batch whose first run has saved a checkpoint, and the process of that run.
    fn started(place: &Place) -> (Child, u32) {
        let parent = place.start(&["a", "b"], &LONG);
        wait_for("a checkpoint", || !place.checkpoints("a").is_empty());
        let runs = children(parent.id());
        assert_eq!(runs.len(), 1);
        (parent, runs[0])
    }

    #[test]
    fn a_killed_run_fails_and_the_next_one_begins() {
        let place = Place::new();
        let (mut parent, run) = started(&place);
        signal("-KILL", run);
        wait_for("the next run", || !place.checkpoints("b").is_empty());
        assert_eq!(place.table(), rows(&[("a", "failed"), ("b", "started")]));
        let table = fs::read_to_string(place.path("runs/table.md")).unwrap();
        assert!(table.contains("killed by the system"), "{table}");
        signal("-INT", parent.id());
        assert_eq!(parent.wait().unwrap().code(), Some(130));
    }

    #[test]
    fn an_interrupt_saves_the_run_and_begins_no_other() {
        let place = Place::new();
        let (mut parent, run) = started(&place);
        signal("-INT", parent.id());
        assert_eq!(parent.wait().unwrap().code(), Some(130));
        assert!(!runs(run) && !place.path("runs/b").exists());
        assert_eq!(place.table(), rows(&[("a", "interrupted"), ("b", "not-started")]));
        let summary = place.summary("a").unwrap();
        assert_eq!(summary["stopped_by"], "interrupted");
        let text = fs::read_to_string(place.path("log")).unwrap();
        assert!(text.contains("--resume-or-start continues"), "{text}");
        // It goes on where it was, to a nearer end, and then to the other.
        let done = summary["steps"].as_u64().unwrap();
        let steps = format!("--steps={}", done + 2);
        let output = place.train(&["a", "b"], &[&steps, "--resume-or-start"]);
        assert_eq!(output.status.code(), Some(0), "{}", said(&output));
        assert_eq!(place.table(), rows(&[("a", "done"), ("b", "done")]));
        let resumed = [place.summary("a"), place.summary("b")].map(|s| s.unwrap()["resumed"].clone());
        assert!(resumed[0]["from_step"] == done && resumed[1].is_null(), "{resumed:?}");
    }

    #[test]
    fn killing_the_batch_ends_its_run_which_continues() {
        let place = Place::new();
        let (mut parent, run) = started(&place);
        parent.kill().unwrap();
        parent.wait().unwrap();
        wait_for("the end of the run", || !runs(run));
        assert_eq!(place.table(), rows(&[("a", "started"), ("b", "not-started")]));
        let last = place.checkpoints("a").pop().unwrap();
        let name = last.file_stem().unwrap().to_str().unwrap();
        let done: u32 = name.strip_prefix("step-").unwrap().parse().unwrap();
        let steps = format!("--steps={}", done + 2);
        let output = place.train(&["a", "b"], &[&steps, "--resume-or-start"]);
        assert_eq!(output.status.code(), Some(0), "{}", said(&output));
        assert_eq!(place.table(), rows(&[("a", "done"), ("b", "done")]));
        assert_eq!(place.summary("a").unwrap()["resumed"]["from_step"], done);
        // Negative control: a finished run is left, with a warning if other settings are asked for.
        let others = format!("--steps={}", done + 3);
        let output = place.train(&["a", "b"], &[&others, "--resume-or-start"]);
        assert_eq!(output.status.code(), Some(0));
        assert!(said(&output).contains("[a] warning[finished-with-other-settings]: "), "{}", said(&output));
        assert_eq!(place.summary("a").unwrap()["steps"], done + 2);
    }
}
