//! Captures with the faults of files that other programs and people make: what is left out, found and said.

use super::fixtures::{Scene, write_json};
use super::*;
use crate::views::{Split, ViewSource as _};
use crate::{Error, Result};
use glam::{DQuat, DVec3};
use std::path::Path;
use tempfile::{TempDir, tempdir};

pub(super) fn load(root: &Path) -> Result<Capture> {
    Capture::load(root, &LoadOptions::default())
}

pub(super) fn text_model(scene: &Scene) -> TempDir {
    let folder = tempdir().unwrap();
    scene.write_text(&folder.path().join("sparse/0"));
    scene.write_photos(&folder.path().join("images"), (12, 8));
    folder
}

pub(super) fn binary_model(scene: &Scene) -> TempDir {
    let folder = tempdir().unwrap();
    scene.write(folder.path());
    folder
}

/// Replaces text in one of the model's files.
pub(super) fn replace(folder: &TempDir, file: &str, from: &str, to: &str) {
    let path = folder.path().join("sparse/0").join(file);
    let text = std::fs::read_to_string(&path).unwrap();
    assert!(text.contains(from), "{from} is not in {file}");
    std::fs::write(path, text.replacen(from, to, 1)).unwrap();
}

/// The message of the warning with this code and count.
pub(super) fn warning(capture: &Capture, code: &str, count: usize) -> String {
    let found = capture.report.warnings.iter().find(|w| w.code == code && w.count == count);
    found.map(|w| w.message.clone()).unwrap_or_else(|| panic!("no {code}: {:?}", capture.report))
}

pub(super) fn has_warning(capture: &Capture, code: &str) -> bool {
    capture.report.warnings.iter().any(|w| w.code == code)
}

/// Everything that training takes from the poses and points, bit for bit.
fn assert_same(a: &Capture, b: &Capture) {
    assert_eq!(a.views, b.views);
    assert_eq!(a.points, b.points);
    assert_eq!((a.capture_from_local, a.near), (b.capture_from_local, b.near));
}

#[test]
fn one_broken_pose_of_a_model_leaves_its_view_out() {
    let zero = |scene: &mut Scene| scene.images[3].camera_from_world.0 = DQuat::from_xyzw(0.0, 0.0, 0.0, 0.0);
    let nan = |scene: &mut Scene| scene.images[3].camera_from_world.1.y = f64::NAN;
    let lost = |scene: &mut Scene| scene.images[3].camera_id = 9;
    let broken_camera = |scene: &mut Scene| {
        let mut camera = scene.cameras[0].clone();
        (camera.id, camera.params[0]) = (9, f64::NAN);
        scene.cameras.push(camera);
        scene.images[3].camera_id = 9;
    };
    type Change<'a> = (&'a dyn Fn(&mut Scene), &'a str);
    let changes: [Change<'_>; 4] =
        [(&zero, "quaternion"), (&nan, "translation"), (&lost, "camera 9"), (&broken_camera, "focal length")];
    for (change, what) in changes {
        let mut scene = Scene::ring(12);
        change(&mut scene);
        for folder in [binary_model(&scene), text_model(&scene)] {
            let capture = load(folder.path()).unwrap();
            assert_eq!(capture.views.len(), 11);
            let message = warning(&capture, "views-left-out", 1);
            let named = ["1 of 12 views", "image 4 (\"p09.png\")", what];
            assert!(named.iter().all(|part| message.contains(part)), "{message}");
        }
        // Of nine views, one is more than a tenth.
        let mut scene = Scene::ring(9);
        change(&mut scene);
        let error = load(binary_model(&scene).path()).err().unwrap();
        assert_eq!(error.exit_code(), 3);
        assert!(error.to_string().contains("image 4 (\"p06.png\")"), "{error}");
    }
}

#[test]
fn text_models_may_hold_what_c_writes_for_no_number() {
    let whole = load(text_model(&Scene::ring(12)).path()).unwrap();
    assert!(whole.report.warnings.iter().all(|w| !w.code.ends_with("-left-out")), "negative control");
    let scene = Scene::ring(12);
    let folder = text_model(&scene);
    replace(
        &folder,
        "images.txt",
        &format!("\n4 {:?} ", scene.images[3].camera_from_world.0.w),
        "\n4 -nan(ind) ",
    );
    // A keypoint that is none belongs to its image all the same.
    replace(&folder, "images.txt", "1.5 2.25 100", "-nan(ind) 1.#QNAN 100");
    replace(&folder, "points3D.txt", &format!("107 {:?} ", scene.points[7].0[0]), "107 -1.#IND ");
    replace(&folder, "points3D.txt", " 0.5 1 0", " nan(ind) 1 0");
    replace(&folder, "cameras.txt", "\n7 ", "\n8 PINHOLE 12 8 -nan(ind) -nan(ind) 6 4\n7 ");
    let capture = load(folder.path()).unwrap();
    assert_eq!((capture.views.len(), capture.points.len()), (11, 19));
    assert!(warning(&capture, "views-left-out", 1).contains("image 4 (\"p09.png\")"));
    let message = warning(&capture, "points-left-out", 1);
    assert!(
        message.contains("1 of 20 points") && message.contains("number 8: its position is [NaN"),
        "{message}"
    );
    let message = warning(&capture, "cameras-left-out", 1);
    assert!(message.contains("camera 8 (PINHOLE): the focal length along x is NaN"), "{message}");
    // What views observe still belongs to the right points: no observation lies behind a camera.
    let health = capture.health.unwrap();
    assert_eq!((health.observations, health.observations_behind_camera), (11 * 19, 0));
}

#[test]
fn cameras_that_no_image_uses_may_be_of_any_kind() {
    for (model, focal_px) in [((1, "PINHOLE"), 0.0), ((17, "EQUIRECTANGULAR"), 10.0)] {
        let mut scene = Scene::ring(3);
        let mut unused = scene.cameras[0].clone();
        (unused.id, unused.model, unused.params[0]) = (9, model, focal_px);
        unused.params.truncate(if model.0 == 1 { 4 } else { 2 });
        scene.cameras.push(unused);
        for folder in [binary_model(&scene), text_model(&scene)] {
            assert_same(&load(folder.path()).unwrap(), &load(binary_model(&Scene::ring(3)).path()).unwrap());
        }
        scene.images[0].camera_id = 9;
        assert!(load(binary_model(&scene).path()).is_err(), "negative control");
    }
}

#[test]
fn broken_points_are_left_out_up_to_a_tenth() {
    for bad in [f64::NAN, f64::INFINITY, -1e200] {
        let mut scene = Scene::ring(4);
        scene.points[5].0[1] = bad;
        let capture = load(binary_model(&scene).path()).unwrap();
        assert_eq!(capture.points.len(), 19);
        assert!(warning(&capture, "points-left-out", 1).contains("number 6"));
        scene.points[6].0[1] = bad;
        scene.points[7].0[1] = bad;
        let error = load(binary_model(&scene).path()).err().unwrap().to_string();
        assert!(error.contains("3 of 20 points") && error.contains("number 6"), "{error}");
    }
}

/// A capture of `transforms.json` with 12 frames, its text as `change` leaves it.
pub(super) fn transforms(change: impl Fn(serde_json::Value) -> String) -> TempDir {
    let folder = tempdir().unwrap();
    let scene = Scene::ring(12);
    scene.write_photos(&folder.path().join("images"), (12, 8));
    std::fs::write(folder.path().join("transforms.json"), change(scene.transforms("images/"))).unwrap();
    folder
}

#[test]
fn one_broken_frame_of_a_json_leaves_its_view_out() {
    let set = |field: &'static str, token: &'static str| {
        move |mut json: serde_json::Value| {
            json["frames"][4][field] = "TOKEN".into();
            json.to_string().replace("\"TOKEN\"", token)
        }
    };
    let matrix = |token: &'static str| {
        move |mut json: serde_json::Value| {
            json["frames"][4]["transform_matrix"][0][3] = "TOKEN".into();
            json.to_string().replace("\"TOKEN\"", token)
        }
    };
    let broken = [
        transforms(matrix("NaN")),
        transforms(matrix("-Infinity")),
        transforms(matrix("null")),
        transforms(matrix("-nan(ind)")),
        transforms(matrix("1e999")),
        transforms(set("transform_matrix", "null")),
        // Not those of the whole file, which are sound.
        transforms(set("fl_x", "NaN")),
        transforms(set("cx", "nan")),
        transforms(set("fl_y", "0")),
        transforms(set("w", "0")),
    ];
    for folder in broken {
        let capture = load(folder.path()).unwrap();
        assert_eq!(capture.views.len(), 11);
        let message = warning(&capture, "views-left-out", 1);
        assert!(message.contains("frames[4] (\"images/p08.png\"): "), "{message}");
    }
    for whole in [transforms(set("k1", "null")), transforms(set("note", "NaN"))] {
        let capture = load(whole.path()).unwrap();
        assert_eq!((capture.views.len(), has_warning(&capture, "views-left-out")), (12, false));
    }
    let all = transforms(|json| json.to_string().replace("\"fl_x\":10.0", "\"fl_x\":NaN"));
    let error = load(all.path()).err().unwrap().to_string();
    assert!(error.contains("12 of 12 views") && error.contains("frames[0]"), "{error}");
}

#[test]
fn a_frame_of_another_shape_leaves_its_view_out() {
    let change = |change: &dyn Fn(&mut serde_json::Value)| {
        transforms(|mut json| {
            change(&mut json["frames"][4]);
            json.to_string()
        })
    };
    let no_path = change(&|frame| drop(frame.as_object_mut().unwrap().remove("file_path")));
    let wrong_matrix = change(&|frame| frame["transform_matrix"] = "x".into());
    let wrong_field = change(&|frame| frame["fl_x"] = serde_json::json!({}));
    let no_object = change(&|frame| *frame = 7.into());
    for (folder, part) in [
        (no_path, "frames[4] (\"\"): missing field `file_path`"),
        (wrong_matrix, "frames[4] (\"images/p08.png\"): transform_matrix: "),
        (wrong_field, "frames[4] (\"images/p08.png\"): fl_x: "),
        (no_object, "frames[4] (\"\"): "),
    ] {
        let capture = load(folder.path()).unwrap();
        assert_eq!(capture.views.len(), 11, "{part}");
        assert!(warning(&capture, "views-left-out", 1).contains(part), "{:?}", capture.report);
    }
    let three = transforms(|mut json| {
        (3..6).for_each(|index| json["frames"][index]["transform_matrix"] = "x".into());
        json.to_string()
    });
    assert!(load(three.path()).err().unwrap().to_string().contains("3 of 12 views"), "negative control");
}

#[test]
fn points_of_a_json_that_are_not_there_are_no_error() {
    let with = |ply: &str| {
        transforms(|mut json| {
            json["ply_file_path"] = ply.into();
            json.to_string()
        })
    };
    let folder = with("points.ply");
    let capture = load(folder.path()).unwrap();
    assert_eq!((capture.views.len(), capture.points.len()), (12, 0));
    assert!(warning(&capture, "points-file-missing", 1).contains("points.ply: "));
    write_ply(&folder.path().join("points.ply"), &["0 0 1"]);
    let capture = load(folder.path()).unwrap();
    assert_eq!((capture.points.len(), has_warning(&capture, "points-file-missing")), (1, false));
}

#[test]
fn lists_may_name_views_that_were_left_out() {
    let mut scene = Scene::ring(24);
    scene.images[5].camera_from_world.1 *= 1e4;
    scene.images[6].camera_from_world.1.y = f64::NAN;
    let folder = binary_model(&scene);
    std::fs::remove_file(folder.path().join("images/p17.png")).unwrap();
    let list = folder.path().join("list.txt");
    let with = |text: &str| {
        std::fs::write(&list, text).unwrap();
        let options = LoadOptions { test_list: Some(list.clone()), ..LoadOptions::default() };
        Capture::load(folder.path(), &options)
    };
    let capture = with("p01.png\n.\\p02.png\np19.png\np18\np17.png\n").unwrap();
    assert_eq!(capture.views.iter().filter(|v| v.split == crate::views::Split::Test).count(), 2);
    let message = warning(&capture, "held-out-views-left-out", 3);
    for part in
        ["\"p19.png\" is far from all others", "\"p18.png\" is broken", "\"p17.png\" is without a photo"]
    {
        assert!(message.contains(part), "{part}: {message}");
    }
    assert!(!has_warning(&with("p01.png\n").unwrap(), "held-out-views-left-out"), "negative control");
    let error = with("p01.png\np17.png\np99.png\n").err().unwrap();
    let text = error.to_string();
    assert!(
        error.exit_code() == 3 && text.contains("\"p99.png\"") && !text.contains("\"p17.png\""),
        "{text}"
    );
}

#[test]
fn held_out_views_of_a_json_that_are_left_out_are_named() {
    let folder = transforms(|mut json| {
        json["test_filenames"] = serde_json::json!(["images/p08.png", "p01"]);
        json["frames"][4]["transform_matrix"] = "x".into();
        json.to_string()
    });
    let capture = load(folder.path()).unwrap();
    assert_eq!(capture.views.iter().filter(|v| v.split == crate::views::Split::Test).count(), 1);
    assert!(warning(&capture, "held-out-views-left-out", 1).contains("\"p08.png\" is broken"));
    let whole = transforms(|mut json| {
        json["test_filenames"] = serde_json::json!(["images/p08.png", "p01"]);
        json.to_string()
    });
    assert!(!has_warning(&load(whole.path()).unwrap(), "held-out-views-left-out"), "negative control");
}

#[test]
fn views_that_are_left_out_do_not_count_as_photos_without_a_pose() {
    let mut scene = Scene::ring(24);
    scene.images[5].camera_from_world.1 *= 1e4;
    scene.images[6].camera_from_world.1.y = f64::NAN;
    let folder = binary_model(&scene);
    assert!(!has_warning(&load(folder.path()).unwrap(), "photos-not-registered"));
    let images = folder.path().join("images");
    std::fs::remove_file(images.join("p17.png")).unwrap();
    std::fs::copy(images.join("p01.png"), images.join("q01.png")).unwrap();
    let capture = load(folder.path()).unwrap();
    assert!(warning(&capture, "photos-not-registered", 1).contains("1 of 24 photos"), "negative control");
}

const CSV_HEADER: &str = "#cameras 12\n#name,x,y,alt,heading,pitch,roll,f,px,py,k1,k2,k3,k4,t1,t2\n";

/// A capture of RealityCapture's CSV with 12 rows, one of them changed.
pub(super) fn csv(change: impl Fn(String) -> String) -> TempDir {
    let folder = tempdir().unwrap();
    let scene = Scene::ring(12);
    scene.write_photos(&folder.path().join("images"), (12, 8));
    let rows = scene.images.iter().enumerate().map(|(i, image)| {
        let angle = 30.0 * i as f64;
        let row = format!(
            "{},{},{},1,{angle},80,0,30,0,0,0,0,0,0,0,0\n",
            image.name,
            angle.to_radians().sin(),
            angle.to_radians().cos()
        );
        if i == 5 { change(row) } else { row }
    });
    std::fs::write(folder.path().join("cameras.csv"), CSV_HEADER.to_owned() + &rows.collect::<String>())
        .unwrap();
    folder
}

#[test]
fn one_broken_row_of_a_csv_leaves_its_view_out() {
    assert_eq!(load(csv(|row| row).path()).unwrap().views.len(), 12, "negative control");
    for (from, to) in [(",80,", ",-nan(ind),"), (",80,", ",,"), (",30,0", ",0,0"), (",1,150", ",inf,150")] {
        let folder = csv(|row| row.replacen(from, to, 1));
        let capture = load(folder.path()).unwrap();
        assert_eq!(capture.views.len(), 11, "{from} {to}");
        assert!(warning(&capture, "views-left-out", 1).contains("line 8 (\"p07.png\"): "));
    }
}

fn write_ply(path: &Path, rows: &[&str]) {
    let header = format!(
        "ply\nformat ascii 1.0\nelement vertex {}\nproperty float x\nproperty float y\nproperty float z\nend_header\n",
        rows.len()
    );
    std::fs::write(path, header + &rows.join("\n") + "\n").unwrap();
}

#[test]
fn points_beside_a_csv_are_used_or_named() {
    for (file, is_used) in
        [("points.ply", true), ("Points3D.PLY", true), ("init.ply", true), ("house.ply", false)]
    {
        let folder = csv(|row| row);
        write_ply(&folder.path().join(file), &["0 0 1", "0 1 0"]);
        let capture = load(folder.path()).unwrap();
        assert_eq!(capture.points.len(), if is_used { 2 } else { 0 }, "{file}");
        assert_eq!(has_warning(&capture, "points-beside-not-used"), !is_used, "{file}");
    }
    let folder = csv(|row| row);
    write_ply(&folder.path().join("init.ply"), &["0 0 1"]);
    write_ply(&folder.path().join("points.ply"), &["0 0 1", "0 0 2", "-nan(ind) 0 0"]);
    let capture = load(folder.path()).unwrap();
    assert!(capture.points.is_empty());
    assert!(warning(&capture, "points-beside-unreadable", 1).contains("points.ply: 1 of 3 points"));
    std::fs::write(folder.path().join("points.ply"), "no PLY").unwrap();
    let capture = load(folder.path()).unwrap();
    assert_eq!((capture.views.len(), capture.points.len()), (12, 0));
    assert!(warning(&capture, "points-beside-unreadable", 1).contains("points.ply"));
    let mut rows = vec!["0 0 1"; 11];
    rows[3] = "0 -nan 0";
    write_ply(&folder.path().join("points.ply"), &rows);
    let capture = load(folder.path()).unwrap();
    assert_eq!(capture.points.len(), 10);
    assert!(warning(&capture, "points-left-out", 1).contains("number 4"));
    assert!(warning(&capture, "points-beside-not-used", 1).contains("init.ply"));
}

#[test]
fn a_far_camera_is_left_out_and_the_rest_loads_as_without_it() {
    for factor in [30.0, 1e4, 1e9] {
        let mut scene = Scene::ring(12);
        scene.images[5].camera_from_world.1 *= factor;
        let folder = binary_model(&scene);
        let capture = load(folder.path()).unwrap();
        let message = warning(&capture, "far-cameras", 1);
        assert!(message.contains("1 of 12 cameras") && message.contains("\"p07.png\""), "{message}");
        let mut rest = Scene::ring(12);
        rest.images.remove(5);
        assert_same(&capture, &load(binary_model(&rest).path()).unwrap());
        let keep_far = LoadOptions { keep_far: true, ..LoadOptions::default() };
        let kept = Capture::load(folder.path(), &keep_far).unwrap();
        assert_eq!((kept.views.len(), has_warning(&kept, "far-cameras")), (12, false));
        assert!(kept.capture_from_local.scale > 2.0 * capture.capture_from_local.scale);
    }
}

#[test]
fn far_points_are_left_out_with_a_count() {
    let mut scene = Scene::ring(6);
    scene.points[3].0 = [0.0, 50.0, 0.0];
    let capture = load(binary_model(&scene).path()).unwrap();
    assert!(warning(&capture, "far-points", 1).contains("1 of 20 points"));
    assert_eq!((capture.points.len(), capture.health.unwrap().observations), (19, 6 * 19));
}

/// The rule against lost cameras touches no other capture: all of them load to the same bytes as without it.
#[test]
fn captures_without_far_cameras_load_to_the_same_bytes() {
    let mut walk = Scene::ring(12);
    for (index, image) in walk.images.iter_mut().enumerate() {
        let centre = DVec3::new(index as f64, 0.0, -4.0);
        image.camera_from_world = (DQuat::IDENTITY, -centre);
    }
    // Two places where photos were taken, a third of the photos in the second one.
    let mut two_places = walk.clone();
    two_places.images[..4].iter_mut().for_each(|i| i.camera_from_world.1.x -= 1000.0);
    let mut one_spot = walk.clone();
    one_spot.images[..11].iter_mut().for_each(|i| i.camera_from_world.1 = DVec3::Z);
    let sample = tempdir().unwrap();
    let options = crate::sample::SampleOptions {
        views: 9,
        width_px: 32,
        height_px: 24,
        supersampling: 1,
        points: 300,
        ..Default::default()
    };
    crate::sample::write_sample(sample.path(), &options).unwrap();
    let mut folders: Vec<TempDir> =
        [Scene::ring(2), Scene::ring(3), Scene::ring(12), walk, two_places, one_spot]
            .iter()
            .map(binary_model)
            .collect();
    folders.extend([sample, transforms(|json| json.to_string()), csv(|row| row)]);
    for folder in folders {
        let keep_far = LoadOptions { keep_far: true, ..LoadOptions::default() };
        let (capture, kept) =
            (load(folder.path()).unwrap(), Capture::load(folder.path(), &keep_far).unwrap());
        assert_same(&capture, &kept);
        assert!(!has_warning(&capture, "far-cameras") && !has_warning(&capture, "far-points"));
    }
}

#[test]
fn poses_in_the_places_of_other_programs_are_found() {
    let scene = Scene::ring(4);
    let usual = load(binary_model(&scene).path()).unwrap();
    for (model, photos) in [
        ("distorted/sparse/0", "images"),
        ("distorted/sparse/0", "input"),
        ("dense/sparse", "images"),
        ("dense/sparse", "dense/images"),
        ("dense/0/sparse", "dense/0/images"),
        ("undistorted/sparse", "undistorted/images"),
        ("colmap", "images"),
        ("model", "images"),
        ("model/0", "model/images"),
    ] {
        let folder = tempdir().unwrap();
        scene.write_text(&folder.path().join(model));
        scene.write_photos(&folder.path().join(photos), (12, 8));
        let capture = load(folder.path()).unwrap();
        assert_same(&capture, &usual);
        assert!(warning(&capture, "poses-elsewhere", 1).contains(model), "{model} {photos}");
        // Poses in the usual places come first.
        write_json(folder.path().join("transforms.json"), &scene.transforms(&format!("{photos}/")));
        let capture = load(folder.path()).unwrap();
        assert_eq!((capture.format.name(), has_warning(&capture, "poses-elsewhere")), ("transforms", false));
    }
}

#[test]
fn test_frames_alone_are_a_capture() {
    let scene = Scene::ring(9);
    let few = Scene { images: scene.images[..3].to_vec(), ..scene.clone() };
    for name in ["transforms_test.json", "transforms_val.json"] {
        let folder = tempdir().unwrap();
        scene.write_photos(&folder.path().join("images"), (12, 8));
        let counts = || {
            let capture = load(folder.path()).unwrap();
            let held_out = capture.views.iter().filter(|view| view.split == Split::Test).count();
            (capture.format.name(), capture.views.len(), held_out)
        };
        write_json(folder.path().join(name), &few.transforms("images/"));
        assert_eq!(counts(), ("transforms", 3, 1), "{name}");
        // Negative control: beside training frames they are the test views.
        write_json(folder.path().join("transforms_train.json"), &scene.transforms("images/"));
        assert_eq!(counts(), ("transforms", 9, 3), "{name}");
    }
}

#[test]
fn a_folder_on_the_way_to_the_capture_may_be_called_distorted() {
    let scene = Scene::ring(4);
    let outer = tempdir().unwrap();
    let root = outer.path().join("distorted/sparse/house");
    scene.write_text(&root.join("model"));
    scene.write_photos(&root.join("images"), (12, 8));
    // Photos of another size, which would be taken if the name on the way counted.
    scene.write_photos(&root.join("input"), (24, 16));
    let photo_of = |capture: Capture| capture.target(0).map(|image| image.rgb[..9].to_vec()).unwrap();
    let inside = photo_of(load(&root).unwrap());
    std::fs::remove_dir_all(root.join("input")).unwrap();
    assert_eq!(inside, photo_of(load(&root).unwrap()));
    // Negative control: the converter's own place.
    std::fs::create_dir(root.join("distorted")).unwrap();
    std::fs::rename(root.join("model"), root.join("distorted/sparse")).unwrap();
    let mut other = scene.clone();
    other.images.reverse();
    other.write_photos(&root.join("input"), (12, 8));
    assert_ne!(inside, photo_of(load(&root).unwrap()));
}

#[test]
fn poses_in_other_folders_are_named_in_the_error() {
    let scene = Scene::ring(3);
    let folder = tempdir().unwrap();
    let root = folder.path();
    scene.write_photos(&root.join("images"), (12, 8));
    let message = |path: &Path| match load(path).err().unwrap() {
        error @ (Error::InvalidInput { .. } | Error::Unsupported { .. }) => error.to_string(),
        error => panic!("{error:?}"),
    };
    assert!(message(root).contains("litetex capture"), "negative control: no poses");
    let model = root.join("jobs/day 1/sparse/0");
    scene.write_text(&model);
    let text = message(root);
    let command = format!("litetex train '{root}/jobs/day 1' --images {root}/images", root = root.display());
    assert!(text.contains(&command) && !text.contains("colmap mapper"), "{text}");
    let named = LoadOptions { images: Some(root.join("images")), ..LoadOptions::default() };
    assert_eq!(Capture::load(&root.join("jobs/day 1"), &named).unwrap().views.len(), 3, "the command loads");
    let model = root.join("jobs/day 2");
    scene.write_photos(&model.join("images"), (12, 8));
    write_json(model.join("transforms.json"), &scene.transforms("images/"));
    let text = message(root);
    assert!(text.contains("poses are in 2 folders") && text.contains("day 2\""), "{text}");
    // Who names the photos of a capture, or one of them, is led to the capture.
    for path in [model.join("images"), model.join("images/p01.png")] {
        let text = message(&path);
        assert!(text.contains("name it: litetex train ") && text.contains("day 2'"), "{text}");
        assert!(!text.contains("colmap mapper") && !text.contains("--images"), "{text}");
    }
}
