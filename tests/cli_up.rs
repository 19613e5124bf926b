//! Files stand upright whatever is up in the capture. The cameras of the sample are level and look down on a table.
#![allow(clippy::unwrap_used, reason = "a failing test may panic")]

#[path = "common/cli.rs"]
mod cli;

use cli::{bad, good, json, litetex, text};
use glam::{DMat3, DMat4, DQuat, DVec3};
use serde_json::{Value, json as object};
use std::path::{Path, PathBuf};

/// The poses of the sample as `world_from_camera` in axes of OpenGL, by name of the photo, and its lens.
struct Sample {
    folder: tempfile::TempDir,
    poses: Vec<(String, DMat4)>,
    lens: Vec<f64>,
    points: Vec<DVec3>,
}

fn sample() -> Sample {
    let folder = tempfile::tempdir().unwrap();
    let path = text(folder.path());
    good(&[
        "sample",
        path,
        "--views",
        "12",
        "--size",
        "96x72",
        "--points",
        "300",
        "--text",
        "--no-truth",
        "-q",
    ]);
    let lines = |name: &str| -> Vec<String> {
        let all = std::fs::read_to_string(folder.path().join("sparse/0").join(name)).unwrap();
        all.lines().filter(|line| !line.starts_with('#')).map(str::to_owned).collect()
    };
    let numbers = |words: &[&str]| words.iter().map(|w| w.parse().unwrap()).collect::<Vec<f64>>();
    let pose = |line: &String| {
        let words: Vec<&str> = line.split_whitespace().collect();
        let n = numbers(&words[1..8]);
        let camera_from_world = DMat4::from_rotation_translation(
            DQuat::from_xyzw(n[1], n[2], n[3], n[0]),
            DVec3::new(n[4], n[5], n[6]),
        );
        let opengl = DMat4::from_scale(DVec3::new(1.0, -1.0, -1.0));
        (words[9].to_owned(), camera_from_world.inverse() * opengl)
    };
    let poses = lines("images.txt").iter().step_by(2).map(pose).collect();
    let lens = numbers(&lines("cameras.txt")[0].split_whitespace().skip(2).collect::<Vec<_>>());
    let point = |line: &String| {
        DVec3::from_slice(&numbers(&line.split_whitespace().skip(1).take(3).collect::<Vec<_>>()))
    };
    let points = lines("points3D.txt").iter().map(point).collect();
    Sample { folder, poses, lens, points }
}

impl Sample {
    /// The same capture as JSON of a name, turned; `pose` may replace poses.
    fn capture(&self, name: &str, turn: DMat3, pose: impl Fn(DMat4) -> DMat4) -> tempfile::TempDir {
        self.placed(name, DMat4::from_mat3(turn), pose)
    }

    fn placed(&self, name: &str, place: DMat4, pose: impl Fn(DMat4) -> DMat4) -> tempfile::TempDir {
        let capture = tempfile::tempdir().unwrap();
        let frame = |(photo, world_from_camera): &(String, DMat4)| {
            let matrix = place * pose(*world_from_camera);
            let rows: Vec<[f64; 4]> = (0..4).map(|i| matrix.row(i).to_array()).collect();
            let photo = self.folder.path().join("images").join(photo);
            object!({ "file_path": text(&photo), "transform_matrix": rows })
        };
        let [w, h, fx, fy, cx, cy] = self.lens[..] else { panic!("a pinhole") };
        let frames: Vec<Value> = self.poses.iter().map(frame).collect();
        let all = object!({ "w": w, "h": h, "fl_x": fx, "fl_y": fy, "cx": cx, "cy": cy, "frames": frames,
            "ply_file_path": "points.ply" });
        let header = "property double x\nproperty double y\nproperty double z\nend_header\n";
        let mut ply = format!("ply\nformat ascii 1.0\nelement vertex {}\n{header}", self.points.len());
        for p in self.points.iter().map(|p| place.transform_point3(*p)) {
            ply += &format!("{} {} {}\n", p.x, p.y, p.z);
        }
        std::fs::write(capture.path().join("points.ply"), ply).unwrap();
        std::fs::write(capture.path().join(name), all.to_string()).unwrap();
        capture
    }
}

/// y of the right axis and of the upward axis of every camera in a `.glb`, whose world has y up.
fn cameras(glb: &Path) -> Vec<(f64, f64)> {
    let bytes = std::fs::read(glb).unwrap();
    let length = u32::from_le_bytes(bytes[12..16].try_into().unwrap()) as usize;
    let file: Value = serde_json::from_slice(&bytes[20..20 + length]).unwrap();
    let rotation = |node: &Value| {
        let q: Vec<f64> = node["rotation"].as_array()?.iter().map(|v| v.as_f64().unwrap()).collect();
        let q = DQuat::from_xyzw(q[0], q[1], q[2], q[3]);
        node.get("camera").map(|_| ((q * DVec3::X).y, (q * DVec3::Y).y))
    };
    file["nodes"].as_array().unwrap().iter().filter_map(rotation).collect()
}

fn steepest(cameras: &[(f64, f64)]) -> f64 {
    cameras.iter().map(|(right, _)| right.abs().asin().to_degrees()).fold(0.0, f64::max)
}

/// Settings of a training whose result does not matter.
const SHORT: [&str; 8] =
    ["--steps", "3", "--max-resolution", "48", "--set", "save-images=none", "--device", "cpu"];

/// What a command that succeeds says while it works.
fn said(arguments: &[&str]) -> String {
    let output = litetex(arguments);
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.success(), "{said}");
    said
}

#[test]
fn a_training_on_a_georeferenced_capture_says_how_to_export_it() {
    let sample = sample();
    let far = DMat4::from_translation(DVec3::new(512_345.0, 4_512_345.0, 100.0));
    for (place, is_far) in [(far, true), (DMat4::IDENTITY, false)] {
        let capture = sample.placed("transforms.json", place, |pose| pose);
        let at = |name: &str| capture.path().join(name);
        let (run, files) = (at("run"), ["a.glb", "a.ply", "a.spz"].map(at));
        let output = litetex(
            &[
                &["train", text(capture.path()), "-o", text(&run)],
                &SHORT[..],
                &["--export", text(&files[0]), "--export", text(&files[1]), "--export", text(&files[2])],
            ]
            .concat(),
        );
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.success(), !is_far, "{said}");
        let command =
            |file: &Path| format!("litetex export {} {} --origin auto --force", text(&run), text(file));
        let advised = files.each_ref().map(|file| said.contains(&command(file)));
        assert_eq!(advised, [false, is_far, is_far], "{said}");
        if is_far {
            for file in &files[1..] {
                let command = command(file);
                good(&command.split(' ').skip(1).collect::<Vec<_>>());
                assert!(file.exists());
            }
        }
    }
}

#[test]
fn exports_stand_upright_whatever_is_up_in_the_capture() {
    let sample = sample();
    let quarter = DMat3::from_rotation_x(-std::f64::consts::FRAC_PI_2);
    let tilt = DMat3::from_rotation_x(51_f64.to_radians());
    for (turn, expected) in [(DMat3::IDENTITY, "-y: "), (quarter, "z: "), (tilt, "0.0000,-0.6293,-0.7771: ")]
    {
        let capture = sample.capture("transforms.json", turn, |pose| pose);
        let at = |name: &str| -> PathBuf { capture.path().join(name) };
        let run = at("run");
        let words = format!("{expected}12 of 12 photos are level to it");
        let trained = said(
            &[
                &["train", text(capture.path()), "-o", text(&run)],
                &SHORT[..],
                &["--export", text(&at("t.glb"))],
            ]
            .concat(),
        );
        assert_eq!(trained.matches(&format!("up is {words}")).count(), 1, "{trained}");
        let files = ["a.glb", "a.usda", "a.ltgs", "a.ply", "a.spz"].map(at);
        let output = litetex(
            &[
                &["export", text(&run), "--cameras", "all", "--no-verify", "--quality", "lossless"],
                &files.each_ref().map(|file| text(file))[..],
            ]
            .concat(),
        );
        let exported = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(output.status.success(), "{exported}");
        assert_eq!(exported.matches(&format!("up is {words}")).count(), 1, "{exported}");
        // An orbit has an axis; a view of the capture has none.
        let render = |which: &[&str], out: &str| {
            said(&[&["render", text(&run), "-o", text(&at(out)), "--device", "cpu"], which].concat())
        };
        assert!(render(&["--orbit", "2"], "orbit").contains(&format!("up is {words}")));
        assert!(!render(&["--test"], "views").contains("up is"));
        let found = cameras(&files[0]);
        // The home camera and all 12: needed 1e-6 degrees.
        assert!(found.len() >= 12 && steepest(&found) < 1e-4, "{found:?}");
        let mean = found.iter().map(|(_, up)| up).sum::<f64>() / found.len() as f64;
        assert!((0.8..0.95).contains(&mean), "they look down: {mean}");
        assert_eq!(json(&["inspect", text(&run)])["checkpoint"]["up"]["words"], Value::from(words.clone()));
        for file in &files {
            assert_eq!(
                json(&["inspect", text(file)])["provenance"]["up"],
                Value::from(words.clone()),
                "{file:?}"
            );
        }
        let header = String::from_utf8_lossy(&std::fs::read(&files[3]).unwrap()[..2000]).into_owned();
        let frame =
            if turn == DMat3::IDENTITY { "of the capture (up is -y)" } else { "the file's own (up is -y)" };
        assert!(header.contains(&format!("comment frame: {frame}")), "{header}");
        // Negative control, and the way to choose another.
        let other = at("other.glb");
        good(&["export", text(&run), text(&other), "--up=1,2,0", "--cameras", "all", "--no-verify"]);
        assert!(steepest(&cameras(&other)) > 20.0);
        let of_other = json(&["inspect", text(&other)]);
        assert_eq!(of_other["provenance"]["up"], "1.0000,2.0000,0.0000: requested with --up");
    }
}

#[test]
fn the_format_says_what_is_up_where_the_photos_do_not() {
    let sample = sample();
    let (code, message) = bad(&["export", "run", "a.glb", "--up", "w"]);
    assert!(code == 2 && message.contains("--up"), "{message}");
    let turn = DMat3::from_rotation_x(-std::f64::consts::FRAC_PI_2);
    // All photos look the way of the first, ahead and down.
    let (_, first) = sample.poses[0];
    let alike = |pose: DMat4| DMat4::from_cols(first.x_axis, first.y_axis, first.z_axis, pose.w_axis);
    let found = |capture: &tempfile::TempDir| json(&["inspect", text(capture.path())]);
    let of_blender = found(&sample.capture("transforms_train.json", turn, alike));
    assert_eq!(
        (&of_blender["up"]["source"], &of_blender["up"]["in_capture"]),
        (&"pose-format".into(), &object!([0.0, 0.0, 1.0]))
    );
    let of_others = found(&sample.capture("transforms.json", turn, alike));
    assert_eq!(of_others["up"]["source"], "mean-of-photos");
    assert_ne!(of_others["up"]["in_capture"], of_blender["up"]["in_capture"]);
    // Photos that tell win, with a warning where the format says otherwise.
    let warned =
        |found: &Value| found["warnings"].as_array().unwrap().iter().any(|w| w["code"] == "up-not-as-stated");
    let upright = found(&sample.capture("transforms_train.json", turn, |pose| pose));
    assert!(upright["up"]["source"] == "level-photos" && !warned(&upright), "{upright}");
    let tilt = DMat3::from_rotation_y(30_f64.to_radians()) * turn;
    let tilted = found(&sample.capture("transforms_train.json", tilt, |pose| pose));
    assert!(tilted["up"]["source"] == "level-photos" && warned(&tilted), "{tilted}");
    assert!((tilted["up"]["apart_degrees"].as_f64().unwrap() - 30.0).abs() < 1e-3, "{tilted}");
}
