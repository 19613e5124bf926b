//! The command on a tiny sample capture, end to end: train, evaluate, render, resume, repeat.

#![allow(clippy::unwrap_used, reason = "helpers of tests are tests")]

use assert_cmd::Command;
use serde_json::Value;
use std::fs;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// For commands that could wait for the other end of a pipe.
const TIMEOUT: Duration = Duration::from_secs(300);

/// Exit code, standard output, standard error.
fn run(arguments: &[&str]) -> (i32, String, String) {
    run_in(".", arguments)
}

/// [`run`] in another working directory.
fn run_in(folder: &str, arguments: &[&str]) -> (i32, String, String) {
    let mut command = Command::cargo_bin("litetex").unwrap();
    let output = command.current_dir(folder).args(arguments).timeout(TIMEOUT).output().unwrap();
    let text = |bytes: Vec<u8>| String::from_utf8(bytes).unwrap();
    (output.status.code().unwrap_or(-1), text(output.stdout), text(output.stderr))
}

fn ok(arguments: &[&str]) -> String {
    let (code, stdout, stderr) = run(arguments);
    assert_eq!(code, 0, "{arguments:?}\n{stdout}{stderr}");
    stdout
}

/// A folder with a capture of 9 images, 2 of them held out.
struct Place {
    dir: tempfile::TempDir,
}

impl Place {
    fn new() -> Self {
        let place = Self { dir: tempfile::tempdir().unwrap() };
        let capture = place.path("capture");
        ok(&["sample", &capture, "--views", "9", "--size", "64x48", "--points", "300", "--no-truth", "-q"]);
        place
    }

    fn path(&self, name: &str) -> String {
        self.dir.path().join(name).to_str().unwrap().to_owned()
    }

    /// Trains into the folder `out` with further arguments.
    fn train(&self, out: &str, arguments: &[&str]) -> String {
        let (capture, out) = (self.path("capture"), self.path(out));
        let all = ["train", &capture, "-o", &out, "--device", "cpu", "-q"];
        ok(&[&all[..], arguments].concat())
    }

    fn json(&self, name: &str) -> Value {
        serde_json::from_slice(&fs::read(self.path(name)).unwrap()).unwrap()
    }
}

/// A checkpoint's bytes.
fn bytes_of(path: impl AsRef<Path>) -> Vec<u8> {
    let bytes = fs::read(path).unwrap();
    assert!(bytes.len() > 10_000);
    bytes
}

fn pngs(folder: &str) -> Vec<PathBuf> {
    let mut found: Vec<PathBuf> = fs::read_dir(folder)
        .unwrap()
        .map(|e| e.unwrap().path())
        .filter(|p| p.extension().is_some_and(|e| e == "png"))
        .collect();
    found.sort();
    found
}

#[test]
fn a_run_writes_what_the_schema_documents() {
    let place = Place::new();
    let table = place.train("run", &["--steps", "30", "--set", "eval-every=10", "--set", "save-every=20"]);
    assert!(table.contains("test PSNR") && table.contains("splats"), "{table}");
    let summary = place.json("run/summary.json");
    assert_eq!(summary["schema"], "litetex-summary/5");
    for (pointer, above) in [
        ("/quality/psnr", 5.0),
        ("/quality/grad_psnr", 5.0),
        ("/quality/ssim_3dgs", -1.0),
        ("/quality/ssim_valid", -1.0),
        ("/quality/flip", 0.0),
        ("/quality/psnr_corrected", 5.0),
        ("/quality/uncovered", -1.0),
        ("/size/splats", 99.0),
        // Measured: 316, 2 x 2 for a quarter of 300 splats.
        ("/size/texels", 199.0),
        ("/size/params", 0.0),
        ("/time/train_wall_secs", 0.0),
        ("/time/train_cpu_secs", 0.0),
        ("/time/total_wall_secs", 0.0),
        ("/fps/median", 0.0),
        ("/layers_per_pixel/blended", 0.1),
        ("/layers_per_pixel/share_of_largest", 0.05),
        ("/curve/2/psnr_test", 5.0),
        ("/curve/2/wall_secs", 0.0),
    ] {
        let found = summary.pointer(pointer).and_then(Value::as_f64);
        assert!(found.is_some_and(|x| x > above), "{pointer}: {found:?}");
    }
    let steps: Vec<&Value> = summary["curve"].as_array().unwrap().iter().map(|p| &p["step"]).collect();
    assert_eq!(steps, [10, 20, 30]);
    assert_eq!((&summary["steps"], &summary["stopped_by"]), (&30.into(), &"steps".into()));
    assert_eq!(summary["quality"]["per_view"].as_array().unwrap().len(), 2);
    assert!(summary["quality"]["lpips"].is_null() && summary["quality"]["lpips_reason"].is_string());
    let layers = &summary["layers_per_pixel"];
    assert!(layers["rasterised"].as_f64() > layers["blended"].as_f64(), "{layers}");
    let inspected: Value =
        serde_json::from_str(&ok(&["inspect", &place.path("run"), "--json", "-q"])).unwrap();
    assert_eq!(&inspected["checkpoint"]["layers_per_pixel"], layers);
    assert_eq!(pngs(&place.path("run/eval/000030")).len(), 2);
    assert_eq!(pngs(&place.path("run/eval/000030/error")).len(), 2);
    assert_eq!(pngs(&place.path("run/eval/000010")).len(), 0);
    for file in
        ["config.toml", "metrics.jsonl", "eval/000010/per_view.csv", "checkpoints/step-000020.safetensors"]
    {
        assert!(Path::new(&place.path("run")).join(file).is_file(), "{file}");
    }
}

#[test]
fn config_toml_repeats_a_run_byte_for_byte_with_any_number_of_threads() {
    let place = Place::new();
    place.train("a", &["--steps", "12", "--texture", "fixed:3", "--threads", "1"]);
    let (config, again) = (place.path("a/config.toml"), place.path("b"));
    ok(&["train", "--config", &config, "-o", &again, "--threads", "2", "-q"]);
    let last = "checkpoints/step-000012.safetensors";
    let checkpoint_of = |run: &str| bytes_of(place.path(&format!("{run}/{last}")));
    assert!(checkpoint_of("a") == checkpoint_of("b"));
    // Negative control: another seed draws other views.
    place.train("c", &["--steps", "12", "--texture", "fixed:3", "--seed", "7"]);
    assert!(checkpoint_of("a") != checkpoint_of("c"));
    let images = |run: &str| -> Vec<Vec<u8>> {
        pngs(&place.path(&format!("{run}/eval/000012"))).iter().map(|p| fs::read(p).unwrap()).collect()
    };
    assert_eq!(images("a"), images("b"));
}

#[test]
fn a_resumed_run_equals_the_uninterrupted_one_byte_for_byte() {
    let place = Place::new();
    place.train("whole", &["--steps", "25", "--set", "save-every=10"]);
    // As after a crash behind step 10: the run as it was then.
    let (whole, broken) = (place.path("whole"), place.path("broken"));
    fs::create_dir_all(Path::new(&broken).join("checkpoints")).unwrap();
    for file in ["config.toml", "metrics.jsonl", "checkpoints/step-000010.safetensors"] {
        fs::copy(Path::new(&whole).join(file), Path::new(&broken).join(file)).unwrap();
    }
    ok(&["train", "--resume", &broken, "-q"]);
    let last = "checkpoints/step-000025.safetensors";
    assert!(bytes_of(Path::new(&whole).join(last)) == bytes_of(Path::new(&broken).join(last)));
    let summary = place.json("broken/summary.json");
    assert_eq!(summary["resumed"]["from_step"], 10);
    assert_eq!(summary["resumed"]["new_schedule"], false);
    // More steps are a new schedule, and said to be one.
    let longer = place.path("longer");
    let (code, _, stderr) = run(&["train", "--resume", &broken, "-o", &longer, "--steps", "30"]);
    assert_eq!(code, 0, "{stderr}");
    assert!(stderr.contains("new schedule"), "{stderr}");
    assert_eq!(place.json("longer/summary.json")["resumed"]["new_schedule"], true);
    // What cannot change is refused.
    let (code, _, stderr) = run(&["train", "--resume", &broken, "--set", "sh-degree=1"]);
    assert_eq!(code, 2, "{stderr}");
}

#[test]
fn a_run_is_evaluated_rendered_and_inspected() {
    let place = Place::new();
    // With rates at which splats stay faint, some pixels are uncovered.
    let faint = ["--set", "rates.raise=0.5", "--set", "rates.fall=1"];
    let short = ["--steps", "12", "--texture", "none"];
    place.train("run", &[&short[..], &faint].concat());
    let (run_dir, out) = (place.path("run"), place.path("out"));
    let json: Value = serde_json::from_str(&ok(&["eval", &run_dir, "--json", "-q", "-o", &out])).unwrap();
    let trained = place.json("run/summary.json");
    assert_eq!(json["quality"]["psnr"], trained["quality"]["psnr"]);
    assert_eq!(json["quality"]["psnr_corrected"], trained["quality"]["psnr_corrected"]);
    assert_eq!(json["uncovered_by"], Value::Null);
    let images = pngs(&out);
    assert_eq!(images.len(), 2);
    let name = images[0].file_name().unwrap();
    let of_run = Path::new(&run_dir).join("eval/000012").join(name);
    assert_eq!(fs::read(&images[0]).unwrap(), fs::read(of_run).unwrap());

    // Another run defines which pixels count; here it is the same one.
    let own = ok(&["eval", &run_dir, "--uncovered-by", &run_dir, "--json", "-q"]);
    let own: Value = serde_json::from_str(&own).unwrap();
    let side = |key: &str| trained["capture"][key].as_f64().unwrap();
    let per_view = own["quality"]["per_view"].as_array().unwrap();
    let uncovered: f64 = per_view.iter().map(|v| v["uncovered"].as_f64().unwrap()).sum();
    let pixels = uncovered * side("width_px") * side("height_px");
    assert!(pixels > 0.5 && (own["uncovered_by"]["pixels"].as_f64().unwrap() - pixels).abs() < 1e-3, "{own}");
    let there = own["uncovered_by"]["psnr"].as_f64().unwrap();
    assert!(there > 1.0 && there < own["quality"]["psnr"].as_f64().unwrap(), "{own}");

    let views = place.path("views");
    ok(&["render", &run_dir, "--test", "-o", &views, "--what", "colour,depth,normal,alpha", "-q"]);
    assert_eq!(pngs(&views).len(), 8);
    let orbit = place.path("orbit");
    ok(&["render", &run_dir, "--orbit", "3", "-o", &orbit, "--size", "32", "--exr", "-q"]);
    assert_eq!(fs::read_dir(&orbit).unwrap().count(), 3);
    let (code, _, stderr) = run(&["render", &run_dir, "--view", "nobody.png", "-o", &views]);
    assert!(code == 2 && stderr.contains("nobody.png"), "{stderr}");

    let found: Value = serde_json::from_str(&ok(&["inspect", &run_dir, "--json"])).unwrap();
    assert_eq!(found["checkpoint"]["model"]["texels"], 0);
    assert!(found["checkpoint"]["model"]["maps"]["0x0"].as_u64().is_some_and(|n| n > 99));
}

#[test]
fn a_time_is_kept_from_start_to_exit_and_progress_can_be_json() {
    let place = Place::new();
    let (capture, out) = (place.path("capture"), place.path("run"));
    // Probing GPUs may make drivers write to standard error.
    let arguments =
        [&["train", &capture, "-o", &out, "--time", "20s", "--device", "cpu"][..], &["--log-format", "json"]]
            .concat();
    let (code, _, stderr) = run(&arguments);
    assert_eq!(code, 0, "{stderr}");
    let events: Vec<Value> = stderr.lines().map(|l| serde_json::from_str(l).unwrap()).collect();
    for event in ["plan", "resource-estimate", "progress", "evaluated"] {
        assert!(events.iter().any(|e| e["event"] == event), "{event}: {stderr}");
    }
    let summary = place.json("run/summary.json");
    assert_eq!((&summary["stopped_by"], &summary["steps"]), (&"steps".into(), &summary["steps_planned"]));
    // The plan repeats the run byte for byte, without a clock.
    let again = place.path("again");
    ok(&["train", "--config", &place.path("run/config.toml"), "-o", &again, "--device", "cpu", "-q"]);
    let last = format!("checkpoints/step-{:06}.safetensors", summary["steps"].as_u64().unwrap());
    assert!(bytes_of(place.path(&format!("run/{last}"))) == bytes_of(place.path(&format!("again/{last}"))));
    // Not timed by the wall: the machine may be busy.
    let short = run(&["train", &capture, "-o", &place.path("short"), "--time", "0.1s", "--device", "cpu"]);
    assert!(short.0 == 2 && short.2.contains("the shortest is about"), "{}", short.2);
    let both = run(&["train", &capture, "-o", &place.path("short"), "--time", "9s", "--steps", "3"]);
    assert!(both.0 == 2 && both.2.contains("--steps"), "{}", both.2);
    // Another time is no reason to touch a finished run, but one to say so; its own, or none, is not.
    let again =
        |time: &[&str]| run(&[&["train", &capture, "-o", &out, "--resume-or-start"][..], time].concat());
    let settings = fs::read(place.path("run/config.toml")).unwrap();
    for (time, is_told) in [(&["--time", "30s"][..], true), (&["--time", "20s"], false), (&[], false)] {
        let (code, _, stderr) = again(time);
        let told = stderr.contains("warning[finished-with-other-settings]") && stderr.contains("(time)");
        assert!(code == 0 && told == is_told, "{time:?}: {stderr}");
    }
    let (code, _, stderr) = run(&["train", "--resume", &out, "--time", "30s"]);
    assert!(code == 2 && stderr.contains("--time: the run has all of its"), "{stderr}");
    assert!(fs::read(place.path("run/config.toml")).unwrap() == settings);
    // The folder is taken now.
    let (code, _, stderr) = run(&["train", &capture, "-o", &out, "--steps", "1"]);
    assert!(code == 2 && stderr.contains("--force"), "{stderr}");
    ok(&["train", &capture, "-o", &out, "--steps", "2", "--force", "-q"]);
    assert_eq!(place.json("run/summary.json")["steps"], 2);
}

/// A training without end in the folder `out`, once it has done some steps. Killed when dropped.
#[cfg(unix)]
struct Running(std::process::Child);

#[cfg(unix)]
impl Running {
    fn spawn(place: &Place, out: &str, arguments: &[&str]) -> Self {
        let child = std::process::Command::new(env!("CARGO_BIN_EXE_litetex"))
            .args(["train", &place.path("capture"), "-o", &place.path(out), "--device", "cpu", "-q"])
            .args(arguments)
            .stderr(std::process::Stdio::piped())
            .spawn()
            .unwrap();
        Self(child)
    }

    fn start(place: &Place, out: &str) -> Self {
        let running = Self::spawn(place, out, &["--steps", "1000000", "--set", "save-every=5"]);
        let metrics = Path::new(&place.path(out)).join("metrics.jsonl");
        let has_stepped = || fs::read_to_string(&metrics).is_ok_and(|t| t.contains("\"step\":10"));
        for _ in 0..600 {
            if has_stepped() {
                return running;
            }
            std::thread::sleep(std::time::Duration::from_millis(50));
        }
        panic!("no step in half a minute");
    }

    /// Sends as many signals at once as there are names.
    fn kill(&self, names: &[&str]) {
        let kills = names.iter().map(|name| format!("kill -{name} {}", self.0.id()));
        let script = kills.collect::<Vec<_>>().join("; ");
        std::process::Command::new("sh").args(["-c", &script]).status().unwrap();
    }

    /// Exit code and standard error.
    fn wait(mut self) -> (Option<i32>, String) {
        let mut stderr = String::new();
        std::io::Read::read_to_string(&mut self.0.stderr.take().unwrap(), &mut stderr).unwrap();
        (self.0.wait().unwrap().code(), stderr)
    }
}

#[cfg(unix)]
impl Drop for Running {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

#[cfg(unix)]
#[test]
fn an_interrupted_run_is_saved_even_if_the_signal_comes_twice() {
    let place = Place::new();
    for (out, signals) in [("once", &["INT"][..]), ("twice", &["INT", "TERM"])] {
        let running = Running::start(&place, out);
        running.kill(signals);
        let (code, stderr) = running.wait();
        assert_eq!(code, Some(130), "{out}: {stderr}");
        assert_eq!(stderr.matches("saving the run; press Ctrl-C again to abort").count(), 1, "{stderr}");
        let summary = place.json(&format!("{out}/summary.json"));
        assert_eq!(summary["stopped_by"], "interrupted");
        let found: Value = serde_json::from_str(&ok(&["inspect", &place.path(out), "--json"])).unwrap();
        assert_eq!(found["checkpoint"]["step"], summary["steps"], "the last step is saved");
    }
}

#[cfg(unix)]
#[test]
fn a_killed_run_is_resumed_to_the_bytes_of_an_uninterrupted_one() {
    let place = Place::new();
    let names = |run: &str| -> Vec<String> {
        let entries = fs::read_dir(place.path(&format!("{run}/checkpoints"))).into_iter().flatten().flatten();
        let mut names: Vec<String> = entries.map(|e| e.file_name().into_string().unwrap()).collect();
        names.retain(|name| name.starts_with("step-") && name.ends_with(".safetensors"));
        names
    };
    // Killed after its first checkpoint, which nobody asked for; then resumed. Returns its last one, unless it was done before.
    let killed = |run: &str, length: &[&str]| -> Option<Vec<u8>> {
        let is_done = || Path::new(&place.path(run)).join("summary.json").exists();
        let running = Running::spawn(&place, run, &[length, &["--set", "save-secs=3"]].concat());
        let began = Instant::now();
        while names(run).is_empty() && !is_done() && began.elapsed() < TIMEOUT {
            std::thread::sleep(Duration::from_millis(10));
        }
        running.kill(&["KILL"]);
        let (code, stderr) = running.wait();
        if is_done() || code.is_some() {
            assert_eq!(code.unwrap_or(0), 0, "{run}: {stderr}");
            return None;
        }
        ok(&["train", "--resume", &place.path(run), "--device", "cpu", "-q"]);
        let summary = place.json(&format!("{run}/summary.json"));
        assert!(summary["resumed"]["from_step"].as_u64().unwrap() > 0);
        // The folder has not grown.
        let last = format!("step-{:06}.safetensors", summary["steps"].as_u64().unwrap());
        assert_eq!(names(run), [&*last]);
        Some(bytes_of(place.path(&format!("{run}/checkpoints/{last}"))))
    };
    // As many steps as take a while on this machine.
    let tried = [60, 600, 6_000].into_iter().find_map(|steps| {
        let length = format!("--steps={steps}");
        Some((killed(&format!("steps-{steps}"), &[&length])?, length))
    });
    let (last, length) = tried.unwrap();
    place.train("whole", &[&length, "--set", "save-secs=3"]);
    assert!(last == bytes_of(place.path(&format!("whole/checkpoints/{}", names("whole")[0]))));
    // A run with a time: as its plan says, in one go.
    let last = killed("planned", &["--time", "20s"]).unwrap();
    let (plan, again) = (place.path("planned/config.toml"), place.path("again"));
    ok(&["train", "--config", &plan, "-o", &again, "--device", "cpu", "-q"]);
    assert!(last == bytes_of(place.path(&format!("again/checkpoints/{}", names("again")[0]))));
}

#[cfg(unix)]
#[test]
fn a_run_folder_is_locked_until_its_training_ends_or_is_killed() {
    let place = Place::new();
    let (capture, out) = (place.path("capture"), place.path("run"));
    let running = Running::start(&place, "run");
    for arguments in [
        &["train", &capture, "-o", &out, "--force", "--steps", "2"][..],
        &["train", "--resume", &out],
        &["train", "--resume", &out, "--force"],
    ] {
        let (code, _, stderr) = run(&[arguments, &["--device", "cpu"]].concat());
        assert!(code == 2 && stderr.contains("another training") && stderr.contains(&out), "{stderr}");
    }
    // Reading is harmless.
    ok(&["eval", &out, "--device", "cpu", "-q"]);
    ok(&["render", &out, "--test", "-o", &place.path("views"), "--device", "cpu", "-q"]);
    running.kill(&["KILL"]);
    assert_eq!(running.wait().0, None);
    let done = ok(&["inspect", &out, "--json"]);
    let done: Value = serde_json::from_str(&done).unwrap();
    let next = (done["checkpoint"]["step"].as_u64().unwrap() + 1).to_string();
    ok(&["train", "--resume", &out, "--steps", &next, "--device", "cpu", "-q"]);
}

#[test]
fn force_deletes_only_files_of_a_run() {
    let place = Place::new();
    let (capture, out) = (place.path("capture"), place.path("models"));
    for folder in ["checkpoints", "eval/000001"] {
        fs::create_dir_all(Path::new(&out).join(folder)).unwrap();
    }
    let mine = ["checkpoints/best.pt", "eval/000001/notes.txt"].map(|name| Path::new(&out).join(name));
    mine.iter().for_each(|file| fs::write(file, "mine").unwrap());
    let train = ["train", &capture, "-o", &out, "--steps", "2", "--device", "cpu", "-q"];
    for arguments in [&train[..], &[&train[..], &["--force"]].concat()] {
        let (code, _, stderr) = run(arguments);
        assert!(code == 2 && stderr.contains("not empty") && stderr.contains(&out), "{stderr}");
    }
    assert_eq!(fs::read_dir(&out).unwrap().count(), 2, "nothing was made");
    // A run next to files of others is replaced, and they stay.
    place.train("run", &["--steps", "3"]);
    let stays = place.path("run/checkpoints/best.pt");
    fs::write(&stays, "mine").unwrap();
    place.train("run", &["--steps", "2", "--force"]);
    assert_eq!(place.json("run/summary.json")["steps"], 2);
    assert_eq!(found(&place.path("run/checkpoints"), "step-"), 2);
    for file in mine.iter().map(PathBuf::as_path).chain([Path::new(&stays)]) {
        assert_eq!(fs::read_to_string(file).unwrap(), "mine", "{}", file.display());
    }
}

#[cfg(unix)]
#[test]
fn checkpoint_permissions_follow_the_umask() {
    use std::os::unix::fs::PermissionsExt;
    let place = Place::new();
    place.train("run", &["--steps", "2"]);
    let mode = |name: &str| fs::metadata(place.path(name)).unwrap().permissions().mode() & 0o777;
    let checkpoint = mode("run/checkpoints/step-000002.safetensors");
    assert_eq!(checkpoint, mode("capture/images/view_0000.png"));
    assert_ne!(checkpoint, 0o600);
}

#[test]
fn invalid_settings_and_tight_budgets_are_named() {
    let place = Place::new();
    let (capture, out) = (place.path("capture"), place.path("run"));
    let train = ["train", &capture, "-o", &out, "--steps", "2", "--device", "cpu"];
    for (setting, part) in [("stps=3", "stps"), ("rates.texel=-1", "train.rates.texel: found -1")] {
        let (code, _, stderr) = run(&[&train[..], &["--set", setting]].concat());
        assert!(code == 2 && stderr.contains(part), "{code}: {stderr}");
    }
    assert!(!Path::new(&out).exists());
    let (code, _, stderr) = run(&[
        &train[..],
        &["--policy", "fixed:2", "--set", "budget.max-splats=10", "--set", "budget.max-texels=5"],
    ]
    .concat());
    assert!(code == 0 && stderr.contains("budget.max-texels 5 leaves room for 1 splat"), "{code}: {stderr}");
    let summary = place.json("run/summary.json");
    let warnings = summary["warnings"].as_array().unwrap();
    assert!(warnings.iter().any(|w| w["code"] == "start-bounded-by-budget"), "{warnings:?}");
}

/// Everything below a folder whose name contains `part`.
fn found(folder: &str, part: &str) -> usize {
    fs::read_dir(folder)
        .unwrap()
        .filter(|e| e.as_ref().unwrap().path().to_string_lossy().contains(part))
        .count()
}

#[test]
fn a_run_is_not_resumed_or_evaluated_on_other_views() {
    let place = Place::new();
    place.train("run", &["--steps", "6", "--test-every", "3"]);
    let (run_dir, capture, other) = (place.path("run"), place.path("capture"), place.path("other"));
    let last = place.path("run/checkpoints/step-000006.safetensors");
    let before = bytes_of(&last);
    let more = ["train", "--resume", &run_dir, "--steps", "9"];
    let (code, _, stderr) = run(&[&more[..], &["--test-every", "2"]].concat());
    assert!(code == 2 && stderr.contains("training view") && stderr.contains("start a new run"), "{stderr}");
    let (code, _, stderr) = run(&[&more[..], &["--init", "random"]].concat());
    assert!(code == 2 && stderr.contains("init: a resumed run keeps"), "{stderr}");

    // Another capture: other cameras, other frame.
    ok(&["sample", &other, "--views", "11", "--size", "64x48", "--points", "300", "--no-truth", "-q"]);
    let (code, _, stderr) = run(&[&more[..], &[&other]].concat());
    assert_eq!(code, 2, "{stderr}");
    for arguments in [&["eval", &run_dir][..], &["render", &run_dir, "--test", "-o", &place.path("views")]] {
        let (code, _, stderr) = run(&[arguments, &["--capture", &other]].concat());
        assert!(code == 2 && stderr.contains("not the capture the run was trained on"), "{stderr}");
    }
    assert!(before == bytes_of(&last));

    // A file of settings that names no capture keeps that of the run; the history is told to be missing,
    // and a damaged one hinders only those who need it.
    let file = place.path("more.toml");
    fs::write(&file, "[capture]\ntest-every = 3\n[train]\nsteps = 9\n").unwrap();
    let history = place.path("run/checkpoints/step-000006.history.json");
    fs::write(&history, "{").unwrap();
    ok(&["eval", &run_dir, "-q"]);
    ok(&["inspect", &run_dir, "-q"]);
    let resume = ["train", "--resume", &run_dir, "--config", &file];
    assert_eq!(run(&resume).0, 3);
    fs::remove_file(&history).unwrap();
    let (code, _, stderr) = run(&resume);
    assert!(code == 0 && stderr.contains("history.json: missing"), "{stderr}");
    let summary = place.json("run/summary.json");
    assert_eq!((&summary["steps"], &summary["capture"]["path"]), (&9.into(), &capture.into()));
    let codes: Vec<&Value> = summary["warnings"].as_array().unwrap().iter().map(|w| &w["code"]).collect();
    assert_eq!(codes, ["few-training-views", "history-missing"]);
}

#[test]
fn training_views_are_refused_as_test_views() {
    let place = Place::new();
    let (list, run_dir) = (place.path("held-out.txt"), place.path("run"));
    let found: Value = serde_json::from_str(&ok(&["inspect", &place.path("capture"), "--json"])).unwrap();
    let names: Vec<&str> =
        found["test_views"].as_array().unwrap().iter().map(|n| n.as_str().unwrap()).collect();
    fs::write(&list, names[0]).unwrap();
    place.train("run", &["--steps", "3", "--test-list", &list]);
    ok(&["eval", &run_dir, "-q"]);
    fs::write(&list, names[1]).unwrap();
    let (code, _, stderr) = run(&["eval", &run_dir]);
    assert!(code == 2 && stderr.contains(names[1]) && stderr.contains("training view"), "{stderr}");
}

#[test]
fn an_older_checkpoint_resumes_only_elsewhere_or_with_force() {
    let place = Place::new();
    place.train("run", &["--steps", "9", "--set", "save-every=3", "--set", "eval-every=3"]);
    let older = place.path("run/checkpoints/step-000003.safetensors");
    let (checkpoints, evaluations) = (place.path("run/checkpoints"), place.path("run/eval"));
    let in_place = ["train", "--resume", &older, "--set", "save-every=0", "--set", "eval-every=0", "-q"];
    let (code, _, stderr) = run(&in_place);
    assert!(code == 2 && stderr.contains("--force") && stderr.contains("step-000009"), "{stderr}");
    assert_eq!((found(&checkpoints, "safetensors"), found(&evaluations, "0000")), (3, 3));
    let elsewhere = place.path("elsewhere");
    ok(&[&in_place[..], &["-o", &elsewhere]].concat());
    ok(&[&in_place[..], &["--force"]].concat());
    // Step 6 is gone.
    assert_eq!((found(&checkpoints, "safetensors"), found(&checkpoints, "history")), (2, 2));
    assert_eq!(found(&evaluations, "0000"), 2);
}

#[test]
fn a_checkpoint_with_a_relative_path_resumes_in_its_run() {
    let place = Place::new();
    place.train("run", &["--steps", "9", "--set", "save-every=3", "--set", "eval-every=3"]);
    let (run_dir, checkpoints) = (place.path("run"), place.path("run/checkpoints"));
    let first = place.path("run/checkpoints/step-000003.safetensors");
    let before = bytes_of(&first);
    let name = "step-000006.safetensors";
    let in_folder = format!("checkpoints/{name}");
    for (folder, checkpoint, out) in [
        (&run_dir, in_folder.as_str(), &[][..]),
        (&run_dir, &in_folder, &["-o", "."]),
        (&checkpoints, name, &[]),
        (&checkpoints, name, &["-o", ".."]),
    ] {
        let resume =
            ["train", "--resume", checkpoint, "--set", "save-every=0", "--set", "eval-every=0", "-q"];
        let resume = [&resume[..], &["--device", "cpu"], out].concat();
        let (code, _, stderr) = run_in(folder, &resume);
        assert!(code == 2 && stderr.contains("step-000009"), "{resume:?}: {code} {stderr}");
        let (code, _, stderr) = run_in(folder, &[&resume[..], &["--force"]].concat());
        assert_eq!(code, 0, "{resume:?}: {stderr}");
        assert!(bytes_of(&first) == before);
        assert_eq!(found(&checkpoints, "safetensors"), 3);
        assert_eq!(place.json("run/summary.json")["resumed"]["from_step"], 6);
        assert!(Path::new(&place.path("run/eval/000003/per_view.csv")).exists());
        let metrics = fs::read_to_string(place.path("run/metrics.jsonl")).unwrap();
        assert!(metrics.contains("\"step\":3"), "{metrics}");
    }
    // A run is not replaced by a continuation of what lies in it.
    let copy = place.path("run/best.safetensors");
    fs::copy(&first, &copy).unwrap();
    let (code, _, stderr) = run(&["train", "--resume", &copy, "-o", &run_dir, "--force", "--device", "cpu"]);
    assert!(code == 2 && stderr.contains("holds the checkpoint to continue from"), "{code} {stderr}");
    assert!(bytes_of(&first) == before);
}

#[test]
fn a_run_is_replaced_or_resumed_without_the_images_of_others() {
    let place = Place::new();
    place.train("run", &["--steps", "4", "--set", "save-every=2", "--set", "eval-every=2"]);
    let names = [
        "run/eval/000004/comparison.png",
        "run/eval/000004/error/comparison.png",
        "run/eval/20240101/trip/beach.png",
        "run/eval/.thesis.part/chapter.doc",
        "photos/view_0000.png",
    ];
    let mine = names.map(|name| place.path(name));
    for file in &mine {
        fs::create_dir_all(Path::new(file).parent().unwrap()).unwrap();
        fs::write(file, "mine").unwrap();
    }
    let table = place.path("photos/per_view.csv");
    fs::copy(place.path("run/eval/000004/per_view.csv"), &table).unwrap();
    #[cfg(unix)]
    std::os::unix::fs::symlink(place.path("photos"), place.path("run/eval/000777")).unwrap();
    let check = |images: bool| {
        mine.iter().for_each(|file| assert_eq!(fs::read_to_string(file).unwrap(), "mine", "{file}"));
        assert!(Path::new(&table).exists());
        assert_eq!(Path::new(&place.path("run/eval/000004/view_0000.png")).exists(), images);
    };
    check(true);
    let older = place.path("run/checkpoints/step-000002.safetensors");
    ok(&["train", "--resume", &older, "--steps", "3", "--force", "--device", "cpu", "-q"]);
    check(false);
    ok(&["train", "--resume", &place.path("run"), "--steps", "4", "--device", "cpu", "-q"]);
    check(true);
    place.train("run", &["--steps", "1", "--force"]);
    check(false);
}

#[test]
fn force_covers_the_files_of_export_as_the_help_says() {
    let place = Place::new();
    let (capture, out, asset) = (place.path("capture"), place.path("run"), place.path("scene.ply"));
    fs::write(&asset, "mine").unwrap();
    let train = ["train", &capture, "-o", &out, "--steps", "2", "--device", "cpu", "-q", "--export", &asset];
    let (code, _, stderr) = run(&train);
    assert!(code == 2 && stderr.contains("scene.ply") && stderr.contains("--force"), "{code} {stderr}");
    assert_eq!(fs::read_to_string(&asset).unwrap(), "mine");
    ok(&[&train[..], &["--force"]].concat());
    assert!(fs::read(&asset).unwrap() != b"mine");
    let words = ok(&["train", "--help"]).split_whitespace().collect::<Vec<_>>().join(" ");
    assert!(words.contains("the files of --export"), "{words}");
}

#[cfg(unix)]
#[test]
fn pipes_in_a_run_are_refused_instead_of_waited_for() {
    let place = Place::new();
    place.train("run", &["--steps", "2"]);
    let run_dir = place.path("run");
    let resume = ["train", "--resume", &run_dir, "--steps", "4", "--device", "cpu"];
    let eval = ["eval", &run_dir, "--device", "cpu"];
    for (name, arguments, code) in [
        (".litetex-train.lock", &resume[..], 2),
        ("metrics.jsonl", &resume, 2),
        ("checkpoints/step-000002.history.json", &resume, 3),
        ("checkpoints/step-000002.safetensors", &resume, 3),
        ("checkpoints/step-000002.safetensors", &eval, 3),
    ] {
        let (path, kept) = (place.path(&format!("run/{name}")), place.path("kept"));
        fs::rename(&path, &kept).unwrap();
        assert!(std::process::Command::new("mkfifo").arg(&path).status().unwrap().success());
        let (found, _, stderr) = run(arguments);
        assert!(found == code && stderr.contains(name) && stderr.contains("pipe"), "{found} {stderr}");
        fs::rename(&kept, &path).unwrap();
    }
    // Negative control.
    ok(&[&resume[..], &["-q"]].concat());
}

#[test]
fn a_budget_beyond_the_device_is_refused_with_counts_and_leaves_no_folder() {
    let place = Place::new();
    let (capture, out) = (place.path("capture"), place.path("run"));
    let train = |most: &str| {
        let most = format!("budget.max-splats={most}");
        run(&["train", &capture, "-o", &out, "--device", "CPU", "-q", "--steps", "2", "--set", &most])
    };
    // The CPU numbers SH coefficients with 32 bits, 48 floats for a splat of degree 3.
    let (code, _, stderr) = train("89478486");
    assert!(code == 5 && !Path::new(&out).exists(), "{code}: {stderr}");
    assert!(stderr.contains("budget.max-splats allows 89478486 splats, at most 89478485 fit"), "{stderr}");
    let (code, _, stderr) = train("89478485");
    assert!(code == 0 && Path::new(&out).exists(), "{code}: {stderr}");
}
