//! The command as users meet it: help, exit codes, messages, refusal to overwrite. Tests that train
//! use a tiny sample capture and live in `cli_train.rs`.

#![allow(clippy::unwrap_used, reason = "helpers of tests are tests")]

use assert_cmd::Command;
use std::path::Path;

fn litetex() -> Command {
    Command::cargo_bin("litetex").unwrap()
}

/// Exit code, standard output, standard error.
fn run(arguments: &[&str]) -> (i32, String, String) {
    let output = litetex().args(arguments).output().unwrap();
    let text = |bytes: Vec<u8>| String::from_utf8(bytes).unwrap();
    (output.status.code().unwrap(), text(output.stdout), text(output.stderr))
}

/// Subcommands and their one-line descriptions, as the help lists them.
fn commands_of_help() -> Vec<(String, String)> {
    let (code, help, _) = run(&["--help"]);
    assert_eq!(code, 0);
    let rows = help.lines().skip_while(|l| *l != "Commands:").skip(1).take_while(|l| !l.is_empty());
    rows.filter_map(|row| row.trim().split_once("  "))
        .map(|(name, about)| (name.to_owned(), about.trim().split(" [alias").next().unwrap().to_owned()))
        .filter(|(name, _)| name != "help")
        .collect()
}

#[test]
fn the_documentation_lists_the_commands_as_the_help_does() {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/commands.md");
    let text = std::fs::read_to_string(file).unwrap();
    let commands = commands_of_help();
    assert_eq!(commands.len(), 18, "{commands:?}");
    let section = text.split("## `litetex`\n").nth(1).unwrap().split("## ").next().unwrap();
    let rows: Vec<(String, String)> = section
        .lines()
        .filter_map(|l| l.strip_prefix("| `")?.strip_suffix(" |")?.split_once("` | "))
        .map(|(name, about)| (name.to_owned(), about.to_owned()))
        .collect();
    assert_eq!(rows, commands);
}

#[test]
fn every_command_has_help() {
    for (name, about) in commands_of_help() {
        let (code, help, stderr) = run(&[&name, "--help"]);
        assert_eq!((code, stderr.as_str()), (0, ""), "{name}");
        assert!(help.starts_with(&about), "{name}: {help}");
    }
    let (code, version, _) = run(&["--version"]);
    assert_eq!((code, version.trim()), (0, concat!("litetex ", env!("CARGO_PKG_VERSION"))));
}

#[test]
fn completions_and_manual_pages_have_text() {
    for shell in ["bash", "zsh", "fish", "powershell", "elvish"] {
        let (code, text, _) = run(&["completions", shell]);
        assert!(code == 0 && text.contains("max-resolution"), "{shell}");
    }
    let (code, page, _) = run(&["man"]);
    assert!(code == 0 && page.contains(".TH litetex"), "{page}");
    let dir = tempfile::tempdir().unwrap();
    let folder = dir.path().join("man");
    assert_eq!(run(&["man", "--out", folder.to_str().unwrap()]).0, 0);
    let train = std::fs::read_to_string(folder.join("litetex-train.1")).unwrap();
    assert!(train.contains("max\\-resolution"), "{train}");
    assert_eq!(std::fs::read_dir(folder).unwrap().count(), 20); // 18 commands, help, litetex
}

#[test]
fn usage_errors_exit_with_2_and_say_what_to_do() {
    let dir = tempfile::tempdir().unwrap();
    let here = dir.path().to_str().unwrap();
    for (arguments, part) in [
        (&[][..], "Usage"),
        (&["trian"], "train"),
        (&["train", here], "-o <RUN>"),
        (&["train", "-o", "x"], "<CAPTURE>"),
        (&["train", here, "-o", "x", "--texture", "fixed:1"], "fixed:R"),
        (&["train", here, "-o", "x", "--set", "sh-degree=4"], "train.sh-degree: found 4"),
        (&["train", here, "-o", "x", "--steps", "0"], "--steps"),
        (&["train", here, "-o", "x", "--time", "soon"], "20m"),
        (&["train", here, "-o", "x", "--set", "background=mauve"], "#rrggbb"),
        (&["train", here, "-o", "x", "--init", "magic"], "random:COUNT"),
        (&["train", here, "-o", "x", "--init", "random:10000001"], "10,000,000"),
        (&["train", here, "-o", "x", "--max-resolution", "15"], "expected a whole number from 16 to 65536"),
        (&["inspect", here, "--format", "fbx"], "reality-capture"),
        (&["inspect", here, "--image-cache", "big"], "4GiB"),
        (&["train", here, "--resume"], "--out"),
        (&["render", here, "-o", "x"], "--orbit"),
        (&["render", here, "-o", "x", "--test", "--orbit", "3"], "--orbit"),
        (&["devices", "--threads", "0"], "--threads"),
        (&["-q", "-v", "devices"], "--verbose"),
    ] {
        let (code, stdout, stderr) = litetex_in(dir.path(), arguments);
        assert_eq!(code, 2, "{arguments:?}: {stderr}");
        assert!(stdout.is_empty() && stderr.contains(part), "{arguments:?}: {stderr}");
    }
    assert_eq!(std::fs::read_dir(dir.path()).unwrap().count(), 0, "nothing was made");
}

fn litetex_in(dir: &Path, arguments: &[&str]) -> (i32, String, String) {
    let mut command = litetex();
    // The folder x of the arguments does not exist here; it stays so.
    std::fs::create_dir_all(dir).unwrap();
    let output = command.current_dir(dir).args(arguments).output().unwrap();
    (
        output.status.code().unwrap(),
        String::from_utf8(output.stdout).unwrap(),
        String::from_utf8(output.stderr).unwrap(),
    )
}

#[test]
fn wrong_input_exits_with_3_and_leaves_no_run_behind() {
    let dir = tempfile::tempdir().unwrap();
    let path = |name: &str| dir.path().join(name).to_str().unwrap().to_owned();
    std::fs::create_dir(path("empty")).unwrap();
    std::fs::write(path("broken.safetensors"), "no tensors here").unwrap();
    std::fs::write(path("broken.ply"), "plyish").unwrap();
    std::fs::write(path("bad.toml"), "[train]\nstps = 3\n").unwrap();
    let (nowhere, empty, run_dir) = (path("nowhere"), path("empty"), path("run"));
    for (arguments, parts) in [
        (
            vec!["train", &nowhere, "-o", &run_dir],
            vec!["error[missing]: ", "nowhere: no such file or folder; check the path\n"],
        ),
        (vec!["schedule", &nowhere], vec!["error[missing]: "]),
        (vec!["train", &empty, "-o", &run_dir], vec!["error[invalid-input]: ", "empty"]),
        (vec!["train", &empty, "-o", &run_dir, "--config", &path("bad.toml")], vec!["bad.toml", "stps"]),
        (vec!["train", "--resume", &empty], vec!["no checkpoint"]),
        (vec!["train", &empty, "-o", &empty, "--resume"], vec!["no checkpoint"]),
        (vec!["eval", &nowhere], vec!["nowhere: no such file or folder; check the path\n"]),
        (vec!["eval", &path("broken.safetensors")], vec!["broken.safetensors", "safetensors file"]),
        (vec!["render", &empty, "--test", "-o", &run_dir], vec!["no checkpoint"]),
        (vec!["inspect", &nowhere], vec!["nowhere"]),
        (vec!["inspect", &path("broken.ply")], vec!["broken.ply"]),
    ] {
        let (code, stdout, stderr) = run(&arguments);
        assert_eq!(code, 3, "{arguments:?}: {stderr}");
        assert!(stdout.is_empty() && stderr.starts_with("error["), "{stderr}");
        for part in parts {
            assert!(stderr.contains(part), "{arguments:?}: {stderr}");
        }
    }
    assert!(!Path::new(&run_dir).exists());
}

#[test]
fn every_command_leaves_by_the_same_door() {
    let dir = tempfile::tempdir().unwrap();
    let capture = sample(dir.path());
    for (name, _) in commands_of_help() {
        let (code, stdout, stderr) = run(&[&name, "--no-such-option"]);
        assert!(code == 2 && stdout.is_empty(), "{name}: {code} {stdout}");
        assert!(stderr.starts_with("error: unexpected argument '--no-such-option'"), "{name}: {stderr}");
    }
    let out = dir.path().join("x").to_str().unwrap().to_owned();
    for command in [
        "train /nowhere -o OUT",
        "eval /nowhere",
        "render /nowhere --test -o OUT",
        "export /nowhere -o OUT.glb",
        "convert /nowhere.glb OUT.glb",
        "verify /nowhere.glb --against /nowhere",
        "validate /nowhere.glb",
        "compare /nowhere /nowhere",
        "inspect /nowhere",
        "view /nowhere --no-open",
        "schedule /nowhere",
    ] {
        let command = command.replace("OUT", &out);
        let mut words: Vec<&str> = command.split(' ').collect();
        words.extend(["--json", "--log-format", "json"]);
        let (code, stdout, stderr) = run(&words);
        assert!(code == 3 && stdout.is_empty(), "{command}: {code} {stdout}{stderr}");
        let error: serde_json::Value = serde_json::from_str(stderr.trim()).unwrap();
        assert_eq!((&error["event"], &error["code"]), (&"error".into(), &"missing".into()), "{command}");
        assert!(error["message"].as_str().unwrap().starts_with("/nowhere"), "{command}: {error}");
    }
    for (command, schema) in [
        ("sample OUT --views 3 --size 16x16 --no-truth", "litetex-sample/1"),
        ("inspect CAPTURE", "litetex-inspect/1"),
        ("schedule CAPTURE", "litetex-schedule/1"),
        ("devices", "litetex-devices/1"),
        ("selftest --device cpu", "litetex-selftest/1"),
        ("man -o OUT/man", "litetex-man/1"),
        ("train CAPTURE -o OUT/run --steps 3 --device cpu", "litetex-summary/5"),
        ("eval OUT/run --device cpu", "litetex-eval/2"),
        ("export OUT/run OUT/a.glb --device cpu", "litetex-export/1"),
        ("verify OUT/a.glb --against OUT/run --device cpu", "litetex-verify/1"),
        ("validate OUT/a.glb", "litetex-validate/1"),
        ("render OUT/a.glb --test -o OUT/views --device cpu", "litetex-render/1"),
        ("compare OUT/a.glb OUT/run --device cpu", "litetex-compare/1"),
    ] {
        let command = command.replace("OUT", &out).replace("CAPTURE", &capture);
        let mut words: Vec<&str> = command.split(' ').collect();
        words.extend(["--json", "-q"]);
        let (code, stdout, stderr) = run(&words);
        assert_eq!(code, 0, "{command}: {stderr}");
        let report: serde_json::Value = serde_json::from_str(&stdout).unwrap();
        assert_eq!(report["schema"], schema, "{command}");
    }
}

#[test]
fn errors_are_json_with_log_format_json() {
    let (code, _, stderr) = run(&["inspect", "/nowhere", "--log-format", "json"]);
    assert_eq!(code, 3);
    let value: serde_json::Value = serde_json::from_str(stderr.trim()).unwrap();
    assert_eq!(value["event"], "error");
    assert!(value["message"].as_str().unwrap().contains("/nowhere"));
}

#[test]
fn an_unknown_device_exits_with_4() {
    let dir = tempfile::tempdir().unwrap();
    let capture = sample(dir.path());
    let out = dir.path().join("run");
    let (code, _, stderr) = run(&["train", &capture, "-o", out.to_str().unwrap(), "--device", "abacus"]);
    assert_eq!(code, 4, "{stderr}");
    assert!(stderr.contains("\"abacus\"") && stderr.contains("\"cpu\""), "{stderr}");
    assert!(!out.exists());
}

#[test]
fn foreign_folders_and_files_are_refused_before_anything_is_read() {
    let dir = tempfile::tempdir().unwrap();
    let note = dir.path().join("note.txt");
    std::fs::write(&note, "mine").unwrap();
    let here = dir.path().to_str().unwrap();
    for arguments in [
        &["train", "/nowhere", "-o", here][..],
        &["sample", here],
        &["quickstart", "-o", here],
        &["eval", "/nowhere", "-o", here],
        &["train", "/nowhere", "-o", here, "--force"],
        &["quickstart", "-o", here, "--force"],
    ] {
        let (code, _, stderr) = run(arguments);
        assert_eq!(code, 2, "{arguments:?}: {stderr}");
        assert!(stderr.contains("not empty"), "{stderr}");
    }
    assert_eq!(std::fs::read_to_string(&note).unwrap(), "mine");
    assert_eq!(std::fs::read_dir(dir.path()).unwrap().count(), 1);
}

#[test]
fn files_of_an_unknown_kind_get_one_sentence_and_one_exit_code() {
    let dir = tempfile::tempdir().unwrap();
    std::fs::write(dir.path().join("a.txt"), "text").unwrap();
    for (arguments, expected) in [
        (["export", "a.txt", "-o", "b.glb"].as_slice(), "step-*.safetensors"),
        (&["validate", "a.txt"], ".glb"),
        (&["verify", "a.txt", "--against", "a.txt"], ".glb"),
        (&["compare", "a.txt", "a.txt"], "an image"),
        (&["view", "a.txt"], ".glb"),
        (&["render", "a.txt", "--test", "-o", "images"], ".glb"),
        (&["inspect", "a.txt"], "a capture"),
        (&["eval", "a.txt"], "step-*.safetensors"),
        (&["train", "a.txt", "-o", "run"], "a capture"),
        (&["schedule", "a.txt"], "a capture"),
    ] {
        let (code, _, stderr) = litetex_in(dir.path(), arguments);
        let says = |what: &str| stderr.contains(what);
        let is_told = says("a.txt: a \".txt\" file cannot be used here; expected ") && says(expected);
        assert!(code == 4 && is_told, "{arguments:?}: {code} {stderr}");
        assert!(!says("SuperSplat"), "negative control: {stderr}");
    }
    std::fs::write(dir.path().join("a.SPLAT"), [0; 32]).unwrap();
    for arguments in [["export", "a.SPLAT", "-o", "b.glb"].as_slice(), &["inspect", "a.SPLAT"]] {
        let (code, _, stderr) = litetex_in(dir.path(), arguments);
        assert!(code == 4 && stderr.contains("; open it in SuperSplat and export it as PLY"), "{stderr}");
    }
}

#[test]
fn files_named_like_a_quickstart_are_not_replaced_without_its_run() {
    let dir = tempfile::tempdir().unwrap();
    let mine = ["still-life/images/view_0000.png", "still-life.ply"].map(|name| dir.path().join(name));
    for file in &mine {
        std::fs::create_dir_all(file.parent().unwrap()).unwrap();
        std::fs::write(file, "mine").unwrap();
    }
    let (code, _, stderr) = run(&["quickstart", "-o", dir.path().to_str().unwrap(), "--force"]);
    assert!(code == 2 && stderr.contains("not empty") && stderr.contains("is no run"), "{code} {stderr}");
    for file in &mine {
        assert_eq!(std::fs::read_to_string(file).unwrap(), "mine");
    }
    assert_eq!(std::fs::read_dir(dir.path()).unwrap().count(), 2);
}

#[test]
fn a_sample_is_made_and_inspected() {
    let dir = tempfile::tempdir().unwrap();
    let capture = sample(dir.path());
    let (code, text, stderr) = run(&["inspect", &capture]);
    assert_eq!(code, 0, "{stderr}");
    assert!(text.contains("capture") && text.contains("colmap"), "{text}");
    let (_, json, _) = run(&["inspect", &capture, "--json", "--quiet"]);
    let value: serde_json::Value = serde_json::from_str(&json).unwrap();
    assert_eq!(value["kind"], "capture");
    assert_eq!(value["views"], 9);
    assert_eq!(value["test_views"].as_array().unwrap().len(), 2);
    assert_eq!(value["sizes"]["64x48"], 9);
}

#[test]
fn a_sample_without_points_reports_zero_reprojection_error() {
    let dir = tempfile::tempdir().unwrap();
    let capture = dir.path().join("capture").to_str().unwrap().to_owned();
    let arguments = ["sample", &capture, "--views", "3", "--size", "16x16", "--points", "0", "--no-truth"];
    let (code, text, stderr) = run(&arguments);
    assert_eq!(code, 0, "{stderr}");
    assert!(text.contains(" 0.00 px") && !text.contains("-0"), "{text}");
}

#[test]
fn devices_are_listed() {
    let (code, text, _) = run(&["devices"]);
    assert!(code == 0 && text.starts_with("cpu"), "{text}");
    let (_, json, _) = run(&["devices", "--json", "--threads", "2"]);
    let value: serde_json::Value = serde_json::from_str(&json).unwrap();
    assert_eq!(value["devices"][0]["name"], "cpu");
    assert!(value["devices"][0]["description"].as_str().unwrap().contains("2 threads"), "{json}");
}

fn sample(dir: &Path) -> String {
    let capture = dir.join("capture").to_str().unwrap().to_owned();
    let arguments =
        ["sample", &capture, "--views", "9", "--size", "64x48", "--points", "300", "--no-truth", "-q"];
    let (code, stdout, stderr) = run(&arguments);
    assert_eq!(code, 0, "{stderr}");
    assert!(stdout.contains("photos") && stderr.is_empty(), "{stdout}{stderr}");
    capture
}

/// A folder whose name is not UTF-8, or `None` where the file system refuses such names.
#[cfg(unix)]
fn folder_that_is_not_unicode(dir: &Path) -> Option<std::path::PathBuf> {
    use std::os::unix::ffi::OsStrExt;
    let folder = dir.join(std::ffi::OsStr::from_bytes(b"not\xffunicode"));
    std::fs::create_dir(&folder).ok().map(|()| folder)
}

#[cfg(unix)]
#[test]
fn non_unicode_paths_never_panic() {
    let dir = tempfile::tempdir().unwrap();
    let Some(folder) = folder_that_is_not_unicode(dir.path()) else {
        println!("skipped: the file system takes no such names");
        return;
    };
    let at = |name: &str| folder.join(name);
    let command = |arguments: &[&dyn AsRef<std::ffi::OsStr>]| {
        let mut command = litetex();
        for argument in arguments {
            command.arg(argument);
        }
        let output = command.output().unwrap();
        let stderr = String::from_utf8(output.stderr).unwrap();
        assert!(!stderr.contains("panicked"), "{stderr}");
        (output.status.code().unwrap(), String::from_utf8_lossy(&output.stdout).into_owned(), stderr)
    };
    let (capture, run_dir) = (at("capture"), at("run"));
    let plain = dir.path().join("capture");
    for capture in [&capture, &plain] {
        let sample: [&dyn AsRef<std::ffi::OsStr>; 9] =
            [&"sample", capture, &"--views", &"9", &"--size", &"64x48", &"--points", &"300", &"--no-truth"];
        assert_eq!(command(&sample).0, 0);
    }
    // The settings of a run are text, and name the capture.
    let (code, _, stderr) = command(&[&"train", &capture, &"-o", &dir.path().join("run")]);
    assert!(code == 2 && stderr.contains("UTF-8"), "{code}: {stderr}");
    assert!(!dir.path().join("run").exists());
    let (code, _, stderr) =
        command(&[&"train", &plain, &"-o", &run_dir, &"--steps", &"3", &"--device", &"cpu", &"-q"]);
    assert!(code == 0 && stderr.lines().count() == 1 && stderr.contains("only 7 training views"), "{stderr}");
    let (glb, ply, images) = (at("a.glb"), at("a.ply"), at("images"));
    let cpu: [&dyn AsRef<std::ffi::OsStr>; 2] = [&"--device", &"cpu"];
    let of_run: [&[&dyn AsRef<std::ffi::OsStr>]; 13] = [
        &[&"eval", &run_dir, &"--json", cpu[0], cpu[1]],
        &[&"eval", &run_dir, &"-o", &at("evaluated"), cpu[0], cpu[1]],
        &[&"export", &run_dir, &"-o", &glb, &ply, cpu[0], cpu[1]],
        &[&"convert", &glb, &at("b.ltgs"), cpu[0], cpu[1]],
        &[&"render", &run_dir, &"--test", &"-o", &images, cpu[0], cpu[1]],
        &[&"verify", &glb, &"--against", &run_dir, &"--json", cpu[0], cpu[1]],
        &[&"validate", &glb, &"--json"],
        &[&"compare", &glb, &run_dir, &"--json", cpu[0], cpu[1]],
        &[&"compare", &images, &images, &"--json"],
        &[&"inspect", &run_dir, &"--json"],
        &[&"inspect", &glb, &"--json"],
        &[&"inspect", &capture, &"--json"],
        &[&"schedule", &capture, &"--json"],
    ];
    for arguments in of_run {
        let (code, stdout, stderr) = command(arguments);
        let words: Vec<_> = arguments.iter().map(|a| a.as_ref().to_owned()).collect();
        assert_eq!(code, 0, "{words:?}: {stderr}");
        if words.iter().any(|word| word == "--json") {
            serde_json::from_str::<serde_json::Value>(&stdout).unwrap();
        }
    }
    let resume = command(&[&"train", &"--resume", &run_dir, &"--steps", &"5", &"--device", &"cpu"]);
    assert_eq!(resume.0, 0, "{}", resume.2);
}

#[test]
fn invalid_numbers_are_refused_by_the_options_own_message() {
    for (arguments, part) in [
        (
            &["train", "x", "-o", "y", "--seed", "-1"][..],
            "'-1' for '--seed <N>': expected a whole number of at least 0",
        ),
        (&["train", "x", "-o", "y", "--test-every", "x"], "'x' for '--test-every <N>': expected a whole"),
        (&["train", "x", "-o", "y", "--steps", "-5"], "'-5' for '--steps <N>'"),
        (&["train", "x", "-o", "y", "--budget-params", "-5"], "5000, 500k or 1.5M"),
        (&["sample", "x", "--seed", "-1"], "'-1' for '--seed <N>': expected a whole number"),
        (&["sample", "x", "--views", "-3"], "'-3' for '--views <N>': expected a whole number"),
        (&["sample", "x", "--points", "1.5"], "'1.5' for '--points <N>': expected a whole number"),
        (&["verify", "x", "--against", "y", "--max-loss", "-1"], "such as 0.1dB"),
        (&["train", "x", "-o", "y", "--time", "-5m"], "'-5m' for '--time <TIME>': expected a time like 90s"),
        (&["train", "x", "-o", "y", "--budget-params", "-5k"], "'-5k' for '--budget-params <N>'"),
        (&["inspect", "x", "--image-cache", "-4GiB"], "'-4GiB' for '--image-cache"),
        // Negative control: a value where none is expected.
        (&["inspect", "x", "-5m"], "unexpected argument '-5'"),
    ] {
        let (code, _, stderr) = run(arguments);
        assert!(code == 2 && stderr.contains(part) && !stderr.contains("tip:"), "{arguments:?}: {stderr}");
    }
}

#[test]
fn unknown_options_get_the_tip_to_pass_them_as_values_only_where_such_a_file_exists() {
    let dir = tempfile::tempdir().unwrap();
    for is_file in [false, true] {
        let (code, _, stderr) = litetex_in(dir.path(), &["inspect", "run", "--seed", "-1"]);
        assert!(code == 2 && stderr.contains("unexpected argument '--seed'"), "{stderr}");
        assert_eq!(stderr.contains("'-- --seed'"), is_file, "{stderr}");
        std::fs::write(dir.path().join("--seed"), "").unwrap();
    }
    // Tips about the spelling stay.
    let (_, _, stderr) = litetex_in(dir.path(), &["train", "x", "--sed", "1"]);
    assert!(stderr.contains("'--seed'"), "{stderr}");
}

#[test]
fn tips_name_what_is_looked_for() {
    for (arguments, tip, other) in [
        (["--max-time", "5m"], "tip: the time of a training is set with '--time 10m'", "max-resolution"),
        (["--profile", "fast"], "a shorter training is '--time 2m'", "similar value"),
        // Negative control: an option that no tip is about.
        (["--max-resolutio", "64"], "tip: a similar argument exists: '--max-resolution'", "--time 10m"),
    ] {
        let (code, _, stderr) = run(&[&["train", "x", "-o", "y"][..], &arguments].concat());
        assert!(code == 2 && stderr.contains(tip) && !stderr.contains(other), "{arguments:?}: {stderr}");
    }
}

#[test]
fn manual_pages_are_not_replaced_without_force() {
    let dir = tempfile::tempdir().unwrap();
    let mine = dir.path().join("litetex-eval.1");
    std::fs::write(&mine, "mine").unwrap();
    let out = ["man", "-o", dir.path().to_str().unwrap()];
    let (code, _, stderr) = run(&out);
    assert!(code == 2 && stderr.contains("litetex-eval.1") && stderr.contains("--force"), "{stderr}");
    assert_eq!(std::fs::read_to_string(&mine).unwrap(), "mine");
    assert_eq!(std::fs::read_dir(dir.path()).unwrap().count(), 1);
    assert_eq!(run(&[&out[..], &["--force"]].concat()).0, 0);
    assert_ne!(std::fs::read_to_string(&mine).unwrap(), "mine");
}
