//! `litetex-lab bench` and `chart` on a tiny sample capture: interrupted, killed and continued, in parts and merged,
//! with failing runs; and `chart` with damaged results and foreign folders.

#![allow(clippy::unwrap_used, reason = "helpers of tests are tests")]

mod common;

use common::{lab, ok, run};
use serde_json::Value;
use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

/// A folder with a capture of 9 photos, 2 of them held out.
struct Place {
    dir: tempfile::TempDir,
}

impl Place {
    fn new() -> Self {
        let place = Self { dir: tempfile::tempdir().unwrap() };
        let capture = place.path("capture");
        ok(&["sample", &capture, "--views", "9", "--size", "48x32", "--points", "150", "--no-truth", "-q"]);
        place
    }

    fn path(&self, name: &str) -> String {
        self.dir.path().join(name).to_str().unwrap().to_owned()
    }

    /// Arguments of a benchmark of two variants and two seeds with this many steps.
    fn bench(&self, out: &str, steps: u32, more: &[&str]) -> Vec<String> {
        let common = format!(
            "--device cpu --set save-images=none --set eval-every={} --steps {steps}",
            steps.div_ceil(3)
        );
        let mut arguments = vec!["bench".to_owned(), "--scene".to_owned(), self.path("capture")];
        for (flag, value) in [
            ("--variant", "plain"),
            ("--variant", "fixed:4"),
            ("--seeds", "1,2"),
            ("--common", &common),
            ("--out", &self.path(out)),
        ] {
            arguments.extend([flag.to_owned(), value.to_owned()]);
        }
        arguments.extend(more.iter().map(|&a| a.to_owned()));
        arguments
    }

    fn run_bench(&self, out: &str, steps: u32, more: &[&str]) -> (i32, String, String) {
        let arguments = self.bench(out, steps, more);
        run(&arguments.iter().map(String::as_str).collect::<Vec<_>>())
    }

    fn results(&self, out: &str) -> Vec<Value> {
        lines(&Path::new(&self.path(out)).join("results.jsonl"))
    }
}

fn lines(file: &Path) -> Vec<Value> {
    fs::read_to_string(file).unwrap().lines().map(|line| serde_json::from_str(line).unwrap()).collect()
}

/// Key and test PSNR of each run.
fn psnr_by_key(results: &[Value]) -> BTreeMap<String, String> {
    let entry =
        |r: &Value| (r["key"].as_str().unwrap().to_owned(), r["summary"]["quality"]["psnr"].to_string());
    results.iter().map(entry).collect()
}

fn names_in(folder: &Path) -> BTreeSet<String> {
    let name = |e: std::io::Result<fs::DirEntry>| e.unwrap().file_name().to_str().unwrap().to_owned();
    fs::read_dir(folder).unwrap().map(name).collect()
}

/// The rows of a table without quoted fields, by the names of its columns.
fn csv_rows(file: PathBuf) -> Vec<BTreeMap<String, String>> {
    let text = fs::read_to_string(file).unwrap();
    let fields = |line: &str| line.split(',').map(ToOwned::to_owned).collect::<Vec<_>>();
    let head = fields(text.lines().next().unwrap());
    text.lines().skip(1).map(|line| head.iter().cloned().zip(fields(line)).collect()).collect()
}

#[test]
fn failed_runs_are_recorded_and_others_continue() {
    let place = Place::new();
    let more = ["--variant", "lost: --init ply:nowhere.ply"];
    let (code, table, stderr) = place.run_bench("b", 3, &more);
    assert_eq!(code, 1, "{stderr}");
    assert!(stderr.contains("2 of 6 runs failed") && stderr.contains("--retry-failed"), "{stderr}");
    assert!(table.contains("fixed:4") && table.contains("0 (2 failed)"), "{table}");
    let results = place.results("b");
    assert_eq!(results.len(), 6);
    for r in &results {
        let failed = r["variant"] == "lost";
        assert_eq!(r["schema"], "litetex-results/2");
        assert_eq!(r["status"], if failed { "failed" } else { "ok" });
        assert_eq!(
            (r["summary"].is_null(), r["exit_code"].as_i64()),
            (failed, Some(if failed { 3 } else { 0 }))
        );
        assert_eq!(r["error"].as_str().is_some_and(|e| e.contains("nowhere.ply")), failed);
        assert!(r["utc"].as_str().unwrap().starts_with("20") && r["cores"].as_u64() > Some(0), "{r}");
        if !failed {
            assert_eq!(r["summary"]["seed"], r["seed"]);
            assert_eq!(r["summary"]["policy"], r["variant"], "bare names are policies");
            assert_eq!(r["summary"]["schema"], "litetex-summary/5");
            // Unlike the other sizes, with header, cameras and the steps that the loss allows.
            assert!(r["summary"]["size"]["disk"]["ltgs_tiny_exported"].as_u64() > Some(1_000));
        }
    }
    // Finished runs keep their result and settings, failed ones their messages.
    let runs = Path::new(&place.path("b")).join("runs");
    for name in names_in(&runs) {
        match name.strip_suffix(".log") {
            Some(name) => assert!(name.contains("lost")),
            None => assert_eq!(
                names_in(&runs.join(&name)).into_iter().collect::<Vec<_>>(),
                ["config.toml", "summary.json"]
            ),
        }
    }
    // Nothing is repeated unless requested.
    let (code, _, stderr) = place.run_bench("b", 3, &more);
    assert!(code == 1 && !stderr.contains("another build"), "{stderr}");
    assert_eq!(place.results("b").len(), 6);
    assert_eq!(place.run_bench("b", 3, &[&more[..], &["--retry-failed"]].concat()).0, 1);
    let again = place.results("b");
    assert_eq!(again.len(), 8);
    assert!(again[6..].iter().all(|r| r["variant"] == "lost"));
    // With --fail-fast the first failure ends the benchmark.
    let first = ["--variant", "lost: --init ply:nowhere.ply", "--fail-fast"];
    assert_eq!(place.run_bench("fast", 3, &first).0, 1);
    assert_eq!(place.results("fast").len(), 3);
}

#[test]
#[cfg(unix)]
fn an_interrupted_benchmark_continues_where_it_was() {
    let place = Place::new();
    let arguments = place.bench("b", 400, &[]);
    let program = lab();
    let mut child = std::process::Command::new(program)
        .args(&arguments)
        .stdout(std::process::Stdio::null())
        .stderr(std::process::Stdio::piped())
        .spawn()
        .unwrap();
    let file = Path::new(&place.path("b")).join("results.jsonl");
    let started = std::time::Instant::now();
    while !file.exists() && started.elapsed().as_secs() < 60 {
        std::thread::sleep(std::time::Duration::from_millis(5));
    }
    let stopped =
        std::process::Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap();
    assert!(stopped.success());
    assert_eq!(child.wait().unwrap().code(), Some(130));
    let before = place.results("b");
    assert!((1..4).contains(&before.len()), "{}", before.len());
    // The run that was stopped leaves no trace.
    assert_eq!(names_in(&Path::new(&place.path("b")).join("runs")).len(), before.len());
    // Half a line, as after a power cut.
    let mut text = fs::read_to_string(&file).unwrap();
    text.push_str("{\"schema\":\"litetex-resu");
    fs::write(&file, text).unwrap();
    let (code, _, stderr) = place.run_bench("b", 400, &[]);
    assert_eq!(code, 0, "{stderr}");
    assert!(stderr.contains("runs are done already") && stderr.contains("skipped"), "{stderr}");
    let text = fs::read_to_string(&file).unwrap();
    let whole: Vec<Value> = text.lines().filter_map(|l| serde_json::from_str(l).ok()).collect();
    assert_eq!((text.lines().count(), whole.len(), psnr_by_key(&whole).len()), (5, 4, 4));
    assert_eq!(whole[..before.len()], before[..]);
}

/// Processes whose arguments mention `text`, as process identifiers.
#[cfg(target_os = "linux")]
fn processes_about(text: &str) -> Vec<String> {
    let mentions = |id: &String| {
        let arguments = fs::read(format!("/proc/{id}/cmdline")).unwrap_or_default();
        String::from_utf8_lossy(&arguments).contains(text)
    };
    names_in(Path::new("/proc")).into_iter().filter(|n| n.parse::<u32>().is_ok()).filter(mentions).collect()
}

#[test]
#[cfg(target_os = "linux")]
fn killing_a_benchmark_ends_its_training() {
    let place = Place::new();
    // Long enough that the training cannot end by itself while this test looks.
    let mut child = std::process::Command::new(lab())
        .args(place.bench("b", 300_000, &[]))
        .stdout(std::process::Stdio::null())
        .stderr(std::process::Stdio::null())
        .spawn()
        .unwrap();
    let runs = place.path("b/runs");
    let within = |secs: u64, done: &dyn Fn() -> bool| {
        let started = std::time::Instant::now();
        while !done() && started.elapsed().as_secs() < secs {
            std::thread::sleep(std::time::Duration::from_millis(20));
        }
        done()
    };
    let trains = || {
        let folders = fs::read_dir(&runs).into_iter().flatten().flatten();
        folders.into_iter().any(|f| f.path().join("metrics.jsonl").exists())
    };
    let began = within(60, &trains);
    child.kill().unwrap();
    child.wait().unwrap();
    let ended = within(10, &|| processes_about(&runs).is_empty());
    for id in processes_about(&runs) {
        let _ = std::process::Command::new("kill").args(["-KILL", &id]).status();
    }
    assert!(began, "no training was started");
    assert!(ended, "the training outlived its benchmark");
    assert!(!Path::new(&place.path("b/results.jsonl")).exists());
}

#[test]
fn a_missing_capture_is_named_once_before_the_first_run() {
    let place = Place::new();
    let (gone, out) = (place.path("gone"), place.path("b"));
    let (code, stdout, stderr) = place.run_bench("b", 3, &["--scene", &gone]);
    assert_eq!((code, stderr.matches(&gone).count()), (3, 1), "{stderr}");
    assert!(stderr.contains("no such capture") && stderr.contains("4 runs") && stdout.is_empty(), "{stderr}");
    assert!(!Path::new(&out).join("runs").exists() && !Path::new(&out).join("results.jsonl").exists());
    // A list says so too: its runs could not be made.
    let (code, _, stderr) = place.run_bench("b", 3, &["--scene", &gone, "--dry-run"]);
    assert!(code == 3 && stderr.contains("no such capture"), "{code} {stderr}");
}

#[test]
fn force_deletes_only_what_a_benchmark_wrote() {
    let place = Place::new();
    assert_eq!(place.run_bench("b", 3, &["--variant", "lost: --init ply:nowhere.ply"]).0, 1);
    let notes = place.path("b/runs/notes.txt");
    fs::write(&notes, "years of work").unwrap();
    let before = place.results("b");
    assert_eq!(place.run_bench("b", 3, &["--force"]).0, 0);
    assert_eq!(fs::read_to_string(&notes).unwrap(), "years of work");
    // The runs were repeated, and those that are no longer in the matrix are gone.
    let after = place.results("b");
    assert_eq!((before.len(), after.len()), (6, 4));
    assert_eq!(names_in(Path::new(&place.path("b/runs"))).len(), 5);

    // A folder that no benchmark has used is refused, whatever its files are called.
    for name in ["runs/fig.svg", "results.jsonl"] {
        let folder = place.path(&name.replace('/', "-"));
        let file = Path::new(&folder).join(name);
        fs::create_dir_all(file.parent().unwrap()).unwrap();
        fs::write(&file, "years of work").unwrap();
        let (code, _, stderr) =
            run(&["bench", "--scene", &place.path("capture"), "--out", &folder, "--force"]);
        assert!(code == 2 && stderr.contains("litetex-lab bench did not create it"), "{code} {stderr}");
        assert_eq!(fs::read_to_string(&file).unwrap(), "years of work");
    }
}

#[test]
fn results_of_another_program_are_not_adopted() {
    let place = Place::new();
    let (folder, file) = (place.path("b"), place.path("b/results.jsonl"));
    fs::create_dir(&folder).unwrap();
    for text in ["{\"my\":\"precious\"}\n", ""] {
        fs::write(&file, text).unwrap();
        for more in [&[][..], &["--resume"], &["--force"], &["--dry-run"]] {
            let (code, stdout, stderr) = place.run_bench("b", 3, more);
            assert!(code == 2 && stdout.is_empty(), "{more:?}: {code} {stderr}");
            assert!(stderr.contains("litetex-lab bench did not create it"), "{more:?}: {stderr}");
            assert_eq!(fs::read_to_string(&file).unwrap(), text);
            assert_eq!(names_in(Path::new(&folder)).len(), 1, "not even a lock");
        }
    }
    // Merged results of benchmarks have no lock either, and are continued.
    fs::remove_file(&file).unwrap();
    assert_eq!(place.run_bench("b", 3, &[]).0, 0);
    fs::remove_file(place.path("b/.bench.lock")).unwrap();
    assert_eq!(place.run_bench("b", 3, &[]).0, 0);
    assert_eq!(place.results("b").len(), 4);
}

#[cfg(unix)]
#[test]
fn pipes_in_the_place_of_files_are_refused_instead_of_waited_for() {
    let place = Place::new();
    let pipe_at = |name: &str| {
        let path = place.path(name);
        fs::create_dir_all(Path::new(&path).parent().unwrap()).unwrap();
        assert!(std::process::Command::new("mkfifo").arg(&path).status().unwrap().success());
        path
    };
    let pipe = pipe_at("pipe");
    let variant = format!("a: --config {pipe}");
    let fresh = |name: &str| place.bench(name, 3, &[]);
    let words = |words: &[&str]| words.iter().map(|&word| word.to_owned()).collect::<Vec<_>>();
    for name in ["results/results.jsonl", "locked/.bench.lock", "charts/.chart-files"] {
        pipe_at(name);
    }
    let charts = place.path("charts");
    for (arguments, name, code) in [
        (place.bench("b", 3, &["--config", &pipe]), "pipe", 3),
        (place.bench("b", 3, &["--variant", &variant]), "pipe", 3),
        (fresh("results"), "results.jsonl", 2),
        (fresh("locked"), ".bench.lock", 2),
        (words(&["chart", &pipe, "-o", &place.path("out")]), "pipe", 3),
        (words(&["chart", &place.path("none.jsonl"), "-o", &charts, "--force"]), ".chart-files", 3),
    ] {
        let mut command = assert_cmd::Command::new(lab());
        let output = command.args(&arguments).timeout(std::time::Duration::from_secs(120)).output().unwrap();
        let stderr = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(code), "{arguments:?}: {stderr}");
        let what = format!("{name}: ");
        assert!(stderr.contains(&what) && stderr.contains("a device or a pipe"), "{arguments:?}: {stderr}");
    }
    assert_eq!(names_in(Path::new(&place.path("results"))).len(), 1, "nothing was made");
}

#[test]
fn shards_merge_into_the_whole_and_charts_compare_pairs() {
    let place = Place::new();
    assert_eq!(place.run_bench("whole", 6, &[]).0, 0);
    for part in ["1/2", "2/2"] {
        let out = format!("part-{}", &part[..1]);
        assert_eq!(place.run_bench(&out, 6, &["--shard", part, "--jobs", "2"]).0, 0);
        assert_eq!(place.results(&out).len(), 2);
    }
    let parts = [place.results("part-1"), place.results("part-2")].concat();
    assert_eq!(psnr_by_key(&parts), psnr_by_key(&place.results("whole")));
    assert!(parts.iter().all(|r| r["noisy"] == true), "two at a time");

    let [one, two, out] = ["part-1", "part-2", "charts"].map(|name| place.path(name));
    let table = ok(&["chart", &one, &two, "-o", &out, "--baseline", "plain", "-q"]);
    let names_and_runs = |row: &str| row.split_whitespace().skip(2).take(2).eq(["fixed:4", "2"]);
    assert!(table.lines().any(names_and_runs), "{table}");
    let page = fs::read_to_string(Path::new(&out).join("index.html")).unwrap();
    assert!(page.contains("<svg") && !page.contains("http"));
    let difference = |out: &str| -> Vec<(String, String, String)> {
        let rows = csv_rows(Path::new(out).join("tables/paired.csv"));
        let psnr = rows.iter().filter(|r| r["measure"] == "Test PSNR");
        psnr.map(|r| (r["pairs"].clone(), r["difference"].clone(), r["low95"].clone())).collect()
    };
    let right = difference(&out);
    assert_eq!((right.len(), right[0].0.as_str()), (1, "2"));
    let rows = csv_rows(Path::new(&out).join("tables/runs.csv"));
    assert_eq!(rows.len(), 4);
    let of = |variant: &str, seed: &str| -> f64 {
        rows.iter().find(|r| r["variant"] == variant && r["seed"] == seed).unwrap()["psnr"].parse().unwrap()
    };
    let mean = 0.5 * (of("fixed:4", "1") - of("plain", "1") + of("fixed:4", "2") - of("plain", "2"));
    assert!((right[0].1.parse::<f64>().unwrap() - mean).abs() < 1e-9);

    // The same lines twice are the same runs.
    let merged = place.path("merged.jsonl");
    let text: String =
        [&one, &two, &one].map(|d| fs::read_to_string(Path::new(d).join("results.jsonl")).unwrap()).concat();
    fs::write(&merged, &text).unwrap();
    ok(&["chart", &merged, "-o", &place.path("merged"), "--baseline", "plain", "-q"]);
    assert_eq!(difference(&place.path("merged")), right);
    // Negative control: a wrong pairing has the same mean and another interval.
    let permuted: String = text
        .lines()
        .map(|line| {
            let mut r: Value = serde_json::from_str(line).unwrap();
            if r["variant"] == "plain" {
                r["seed"] = (3 - r["seed"].as_u64().unwrap()).into();
            }
            format!("{r}\n")
        })
        .collect();
    fs::write(&merged, permuted).unwrap();
    ok(&["chart", &merged, "-o", &place.path("permuted"), "--baseline", "plain", "-q"]);
    let wrong = difference(&place.path("permuted"));
    assert!((wrong[0].1.parse::<f64>().unwrap() - mean).abs() < 1e-9);
    assert_ne!(wrong[0].2, right[0].2);
}

#[test]
fn a_dry_run_writes_nothing_and_renaming_repeats_no_run() {
    let place = Place::new();
    let (code, list, _) = place.run_bench("b", 3, &["--dry-run"]);
    assert_eq!(code, 0);
    assert!(
        list.contains("--policy plain")
            && list.contains("--policy fixed:4")
            && list.contains("4 of 4 runs left"),
        "{list}"
    );
    assert!(!Path::new(&place.path("b")).exists());
    // From a file, one seed, with its own names.
    let (capture, file, out) = (place.path("capture"), place.path("m.toml"), place.path("b"));
    let matrix = |name: &str| {
        format!(
            "seeds = [7]\ncommon = [\"--device\", \"cpu\", \"--steps\", \"9\"]\n[[scene]]\nname = \"still life\"\n\
             path = {capture:?}\n[[variant]]\nname = {name:?}\n[[budget]]\nname = \"short\"\nargs = [\"--steps\", \"2\"]\n"
        )
    };
    fs::write(&file, matrix("none")).unwrap();
    let list = ok(&["bench", "--config", &file, "-o", &out, "--dry-run"]);
    assert!(list.contains("--policy none"), "{list}");
    fs::write(&file, matrix("before")).unwrap();
    ok(&["bench", "--config", &file, "-o", &out, "-q", "--no-export"]);
    let first = place.results("b");
    assert_eq!((first.len(), &first[0]["summary"]["steps"]), (1, &2.into()));
    assert!(first[0]["summary"]["size"]["disk"]["ltgs_tiny_exported"].is_null(), "--no-export");
    fs::write(&file, matrix("after")).unwrap();
    let table = ok(&["bench", "--config", &file, "-o", &out, "-q"]);
    assert!(table.contains("after") && !table.contains("before"), "{table}");
    let results = place.results("b");
    assert_eq!((results.len(), &results[1]["utc"]), (2, &first[0]["utc"]));
    // Results of another build count, with a warning.
    let build = first[0]["build"].as_str().unwrap();
    let known = Path::new(&out).join("results.jsonl");
    fs::write(&known, fs::read_to_string(&known).unwrap().replace(build, "0ld0ld00")).unwrap();
    let (code, _, stderr) = run(&["bench", "--config", &file, "-o", &out]);
    assert_eq!((code, stderr.matches("another build").count()), (0, 1), "{stderr}");
    assert!(stderr.contains("0ld0ld00") && stderr.contains(build), "{stderr}");
    let list = ok(&["bench", "--config", &file, "-o", &out, "--seeds", "7,8", "--dry-run"]);
    assert!(list.contains("done") && list.contains("about") && list.contains("1 of 2 runs"), "{list}");
}

#[test]
fn damaged_results_are_skipped_with_a_warning_or_refused() {
    let dir = tempfile::tempdir().unwrap();
    let path = |name: &str| dir.path().join(name).to_str().unwrap().to_owned();
    let line = |variant: &str, psnr: &str| {
        format!(
            "{{\"schema\":\"litetex-results/2\",\"key\":\"{variant}\",\"scene\":\"s\",\"variant\":\"{variant}\",\"budget\":\"b\",\
             \"seed\":1,\"status\":\"ok\",\"summary\":{{\"quality\":{{\"psnr\":{psnr},\"grad_psnr\":null}},\"curve\":null}}}}\n"
        )
    };
    let good = [line("a", "20.5"), line("</svg><script>", "21"), line("c", "null")].concat();
    let damage = "{\"schema\":\"litetex-results/9\"}\n{\"schema\":\"litetex-res\n\u{0}\nNaN\n";
    fs::write(path("r.jsonl"), format!("{damage}{good}{}{}", line("d", "NaN"), line("e", "1e308"))).unwrap();
    let (code, table, stderr) = run(&["chart", &path("r.jsonl"), "-o", &path("out")]);
    assert_eq!(code, 0, "{stderr}");
    assert!(stderr.contains("litetex-results/9") && stderr.contains("line 2 and 3 more"), "{stderr}");
    assert!(table.contains("20.50") && !table.contains("NaN"), "{table}");
    // An implausible figure counts as missing.
    assert!(table.lines().any(|row| row.contains(" e ")) && !table.contains("00000"), "{table}");
    let page = fs::read_to_string(dir.path().join("out/index.html")).unwrap();
    assert!(page.contains("1 pair: no interval") && !page.contains("<script"));
    assert!(!page.contains("00000000") && !page.contains(">inf<"));
    for (name, text, code, part) in [
        (
            "foreign.jsonl",
            "{\"schema\":\"litetex-results/9\"}\n".to_owned(),
            3,
            "expected \"litetex-results/2\"",
        ),
        ("cut.jsonl", good[..30].to_owned(), 3, "line 1 skipped"),
        ("empty.jsonl", String::new(), 3, "it is empty"),
        ("failed.jsonl", good.replace("\"ok\"", "\"failed\""), 2, "no successful run"),
    ] {
        fs::write(path(name), text).unwrap();
        let (found, stdout, stderr) = run(&["chart", &path(name), "-o", &path("none")]);
        assert_eq!(found, code, "{name}: {stderr}");
        assert!(stdout.is_empty() && stderr.contains(part), "{name}: {stderr}");
    }
    assert!(!Path::new(&path("none")).exists());
    let (code, _, stderr) = run(&["chart", &path("r.jsonl"), "-o", &path("x"), "--baseline", "z"]);
    assert!(code == 2 && stderr.contains("there are \"a\""), "{stderr}");
}

#[test]
fn charts_replace_only_files_that_chart_wrote() {
    let dir = tempfile::tempdir().unwrap();
    let path = |name: &str| dir.path().join(name).to_str().unwrap().to_owned();
    let results = |name: &str, scene: &str| {
        let line = format!(
            "{{\"schema\":\"litetex-results/2\",\"key\":\"k\",\"scene\":\"{scene}\",\"variant\":\"v\",\"budget\":\"b\",\
             \"seed\":1,\"status\":\"ok\",\"summary\":{{\"quality\":{{\"psnr\":20.5}},\"size\":{{\"params\":590}}}}}}\n"
        );
        fs::write(path(name), line).unwrap();
        path(name)
    };
    let (fox, owl, out) = (results("fox.jsonl", "fox"), results("owl.jsonl", "owl"), path("out"));
    ok(&["chart", &fox, "-o", &out, "-q"]);
    let before = names_in(Path::new(&path("out/charts")));
    assert!(before.iter().all(|name| name.starts_with("fox-")) && !before.is_empty(), "{before:?}");
    let mine = ["out/mine.csv", "out/charts/mine.svg", "out/tables/mine.csv"];
    for name in mine {
        fs::write(path(name), "years of work").unwrap();
    }
    assert_eq!(run(&["chart", &owl, "-o", &out]).0, 2);
    ok(&["chart", &owl, "-o", &out, "--force", "-q"]);
    for name in mine {
        assert_eq!(fs::read_to_string(path(name)).unwrap_or_default(), "years of work", "{name}");
    }
    // Charts of the earlier results are gone.
    let after = names_in(Path::new(&path("out/charts")));
    assert!(after.iter().all(|name| name.starts_with("owl-") || name == "mine.svg"), "{after:?}");

    // Neither a file of the name of a chart nor a folder of someone else is touched.
    fs::write(path("out/charts/fox-psnr-params.svg"), "a drawing").unwrap();
    let (code, _, stderr) = run(&["chart", &fox, "-o", &out, "--force"]);
    assert!(code == 2 && stderr.contains("fox-psnr-params.svg"), "{code} {stderr}");
    assert_eq!(fs::read_to_string(path("out/charts/fox-psnr-params.svg")).unwrap(), "a drawing");
    assert!(Path::new(&path("out/charts/owl-psnr-params.svg")).exists());
    fs::create_dir_all(path("thesis/charts")).unwrap();
    fs::write(path("thesis/charts/fig1.svg"), "a drawing").unwrap();
    fs::write(path("thesis/index.html"), "a page").unwrap();
    let (code, _, stderr) = run(&["chart", &fox, "-o", &path("thesis"), "--force"]);
    assert!(code == 2 && stderr.contains("thesis"), "{code} {stderr}");
    assert_eq!(fs::read_to_string(path("thesis/index.html")).unwrap(), "a page");
    assert_eq!(names_in(Path::new(&path("thesis"))).len(), 2);
}
