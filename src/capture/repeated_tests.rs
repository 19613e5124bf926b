//! Captures whose pose files say something twice.

use super::fixtures::Scene;
use super::strangers_tests::{binary_model, csv, has_warning, load, text_model, transforms, warning};

/// Captures of 12 views in every format, of which one occurs twice: as it is, or moved.
fn twice(is_moved: bool) -> [tempfile::TempDir; 4] {
    let mut scene = Scene::ring(12);
    let mut again = scene.images[3].clone();
    again.id = 99;
    if is_moved {
        again.camera_from_world.1.x += 1.0;
    }
    scene.images.push(again);
    let json = transforms(|mut json| {
        let mut again = json["frames"][3].clone();
        if is_moved {
            again["transform_matrix"][0][3] = 7.into();
        }
        json["frames"].as_array_mut().unwrap().push(again);
        json.to_string()
    });
    let rows = csv(|row| row.clone() + &if is_moved { row.replacen(",1,", ",2,", 1) } else { row });
    [binary_model(&scene), text_model(&scene), json, rows]
}

#[test]
fn a_view_that_is_repeated_counts_once() {
    for folder in twice(false) {
        let capture = load(folder.path()).unwrap();
        assert_eq!(capture.views.len(), 12, "{}", capture.format.name());
        assert!(warning(&capture, "views-repeated", 1).contains("1 photo occurs more than once"));
        assert!(!has_warning(&capture, "views-with-several-poses"));
    }
    assert!(!has_warning(&load(binary_model(&Scene::ring(12)).path()).unwrap(), "views-repeated"));
}

#[test]
fn last_digits_make_no_second_pose() {
    let again_by = |by: f64, key: &str| {
        transforms(|mut json| {
            let mut again = json["frames"][3].clone();
            let fl_x = json["fl_x"].as_f64().unwrap();
            again["fl_x"] = serde_json::json!(if key == "fl_x" { fl_x * (1.0 + by) } else { fl_x });
            for row in 0..3 {
                for column in 0..if key == "pose" { 4 } else { 0 } {
                    let number = again["transform_matrix"][row][column].as_f64().unwrap();
                    again["transform_matrix"][row][column] = (number + by).into();
                }
            }
            json["frames"].as_array_mut().unwrap().push(again);
            json.to_string()
        })
    };
    for key in ["pose", "fl_x"] {
        let capture = load(again_by(1e-7, key).path()).unwrap();
        assert_eq!(capture.views.len(), 12, "{key}");
        assert!(warning(&capture, "views-repeated", 1).contains("1 photo"));
        let capture = load(again_by(1e-3, key).path()).unwrap();
        assert!(
            capture.views.len() == 11 && has_warning(&capture, "views-with-several-poses"),
            "negative control"
        );
    }
}

#[test]
fn a_photo_with_two_poses_is_left_out_up_to_a_tenth() {
    for folder in twice(true) {
        let capture = load(folder.path()).unwrap();
        assert_eq!(capture.views.len(), 11, "{}", capture.format.name());
        let message = warning(&capture, "views-with-several-poses", 1);
        let name = if capture.format.name() == "reality-capture" { "\"p07.png\"" } else { "\"p09.png\"" };
        assert!(message.contains(name), "{message}");
        assert!(capture.views.iter().all(|v| !name.contains(&v.name)));
    }
    let mut scene = Scene::ring(9);
    let mut again = scene.images[3].clone();
    (again.id, again.camera_from_world.1.x) = (99, 1.0);
    scene.images.push(again);
    let error = load(binary_model(&scene).path()).err().unwrap();
    assert_eq!(error.exit_code(), 3);
    assert!(error.to_string().contains("1 of 9 photos occur with different poses"), "{error}");
}

#[test]
fn a_camera_that_is_repeated_counts_once_and_two_of_one_id_are_broken() {
    let mut scene = Scene::ring(12);
    scene.cameras.push(scene.cameras[0].clone());
    for folder in [binary_model(&scene), text_model(&scene)] {
        let capture = load(folder.path()).unwrap();
        assert_eq!(capture.views.len(), 12);
        assert!(warning(&capture, "cameras-repeated", 1).contains("camera 7"));
    }
    // One image has a camera that is there twice, with other parameters.
    let mut other = scene.cameras[0].clone();
    other.id = 9;
    scene.cameras[1] = other.clone();
    other.params[0] = 20.0;
    scene.cameras.push(other);
    scene.images[3].camera_id = 9;
    let capture = load(binary_model(&scene).path()).unwrap();
    assert_eq!((capture.views.len(), has_warning(&capture, "cameras-repeated")), (11, false));
    assert!(warning(&capture, "views-left-out", 1).contains("camera 9 occurs twice, with other parameters"));
    scene.images.iter_mut().for_each(|image| image.camera_id = 9);
    assert_eq!(load(binary_model(&scene).path()).err().unwrap().exit_code(), 3);
}

#[test]
fn images_that_share_an_id_are_named() {
    let mut scene = Scene::ring(12);
    scene.images[3].id = 1;
    let capture = load(binary_model(&scene).path()).unwrap();
    assert_eq!(capture.views.len(), 12);
    assert!(warning(&capture, "image-ids-repeated", 1).contains("\"p09.png\" (1)"), "{:?}", capture.report);
    assert!(!has_warning(&load(binary_model(&Scene::ring(12)).path()).unwrap(), "image-ids-repeated"));
}

#[test]
fn points_of_a_json_that_cannot_be_read_are_no_error() {
    let with = |stated: serde_json::Value| {
        transforms(|mut json| {
            json["ply_file_path"] = stated.clone();
            json.to_string()
        })
    };
    let header = "ply\nformat ascii 1.0\nelement vertex 2\nproperty float x\nproperty float y\nproperty float z\nend_header\n";
    for (stated, content, part) in [
        ("points.ply".into(), format!("{header}0 0 1\n0 0"), "points.ply"),
        ("points.ply".into(), "LASF".to_owned(), "points.ply"),
        ("images".into(), String::new(), "folder"),
        (serde_json::json!(["points.ply"]), String::new(), "ply_file_path"),
    ] {
        let folder = with(stated);
        std::fs::write(folder.path().join("points.ply"), content).unwrap();
        let capture = load(folder.path()).unwrap();
        assert_eq!((capture.views.len(), capture.points.len()), (12, 0), "{part}");
        assert!(warning(&capture, "points-file-unreadable", 1).contains(part), "{:?}", capture.report);
        let is_named_twice = part == "points.ply" && has_warning(&capture, "points-beside-not-used");
        assert!(!is_named_twice, "{:?}", capture.report);
    }
    let folder = with("points.ply".into());
    std::fs::write(folder.path().join("points.ply"), format!("{header}0 0 1\n0 0 2\n")).unwrap();
    assert_eq!(load(folder.path()).unwrap().points.len(), 2, "negative control");
    for nothing in ["".into(), serde_json::Value::Null] {
        let capture = load(with(nothing).path()).unwrap();
        assert!(capture.report.warnings.iter().all(|w| !w.code.starts_with("points-file")));
    }
}
