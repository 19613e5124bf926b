//! Damaged captures: the result is a typed error that names the file, or a valid capture; never a
//! panic, nor an allocation for counts that the file cannot hold.

#![allow(clippy::unwrap_used, reason = "tests")]

#[path = "../src/capture/fixtures.rs"]
#[allow(dead_code, reason = "shared with the unit tests, which use all of it")]
mod fixtures;

use fixtures::{Scene, write_json};
use litetex_gs::Error;
use litetex_gs::capture::{Capture, LoadOptions};
use litetex_gs::init::{InitInput, InitOptions, InitPoints, initial_model};
use litetex_gs::views::ViewSource as _;
use std::path::Path;

fn load(root: &Path) -> Result<Capture, Error> {
    Capture::load(root, &LoadOptions::default())
}

fn message(root: &Path) -> String {
    load(root).err().expect("an error").to_string()
}

fn ring(count: u32) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    Scene::ring(count).write(folder.path());
    folder
}

const FILES: [&str; 3] = ["cameras.bin", "images.bin", "points3D.bin"];

#[test]
fn binary_files_truncated_at_any_byte_are_errors_naming_the_file() {
    let folder = ring(3);
    for file in FILES {
        let path = folder.path().join("sparse/0").join(file);
        let whole = std::fs::read(&path).unwrap();
        for length in 0..whole.len() {
            std::fs::write(&path, &whole[..length]).unwrap();
            let error = load(folder.path()).err().unwrap_or_else(|| panic!("{file} cut at {length}"));
            assert!(matches!(error, Error::InvalidInput { .. }), "{file} cut at {length}: {error}");
            assert!(error.to_string().contains(file), "{file} cut at {length}: {error}");
        }
        let mut longer = whole.clone();
        longer.push(0);
        std::fs::write(&path, longer).unwrap();
        assert!(message(folder.path()).contains("follow the last element"));
        std::fs::write(&path, whole).unwrap();
    }
    assert!(load(folder.path()).is_ok());
}

#[test]
fn flipped_bits_and_bytes_never_panic() {
    let folder = ring(3);
    let mut state = 12_345_u32;
    let mut next = || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (state >> 8) as usize
    };
    let (mut errors, mut captures) = (0, 0);
    for file in FILES {
        let path = folder.path().join("sparse/0").join(file);
        let whole = std::fs::read(&path).unwrap();
        for round in 0..400 {
            let mut damaged = whole.clone();
            for _ in 0..=round % 4 {
                let at = next() % damaged.len();
                damaged[at] ^= 1 << (next() % 8);
                if next() % 4 == 0 {
                    damaged[at] = 255;
                }
            }
            std::fs::write(&path, damaged).unwrap();
            match load(folder.path()) {
                Ok(capture) => {
                    captures += 1;
                    assert!(capture.near > 0.0 && capture.near <= 0.04);
                    assert!(capture.capture_from_local.scale > 0.0);
                    let input = InitInput {
                        views: &capture,
                        points: InitPoints::Sparse(&capture.points),
                        points_file: &capture.poses,
                        capture_from_local: capture.capture_from_local,
                        near: capture.near,
                    };
                    let _ = initial_model(&input, &InitOptions::default());
                }
                Err(_) => errors += 1,
            }
        }
        std::fs::write(&path, whole).unwrap();
    }
    assert!(errors > 50 && captures > 50, "{errors} errors, {captures} captures");
}

#[test]
fn damaged_text_models_never_panic() {
    let folder = tempfile::tempdir().unwrap();
    let scene = Scene::ring(3);
    let sparse = folder.path().join("sparse/0");
    scene.write_text(&sparse);
    scene.write_photos(&folder.path().join("images"), (12, 8));
    let mut state = 5_u32;
    for file in ["cameras.txt", "images.txt", "points3D.txt"] {
        let path = sparse.join(file);
        let whole = std::fs::read(&path).unwrap();
        for length in (0..whole.len()).step_by(7) {
            std::fs::write(&path, &whole[..length]).unwrap();
            let _ = load(folder.path());
            let mut damaged = whole.clone();
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            damaged[length] = (state >> 24) as u8;
            std::fs::write(&path, damaged).unwrap();
            let _ = load(folder.path());
        }
        std::fs::write(&path, whole).unwrap();
    }
    std::fs::write(sparse.join("cameras.txt"), "7 PINHOLE 12 8 10 11 x 4\n").unwrap();
    let text = message(folder.path());
    assert!(text.contains("cameras.txt: line 1") && text.contains("\"x\""), "{text}");
}

#[test]
fn unknown_camera_models_name_camera_model_and_remedy() {
    for (model, name, remedy) in
        [((17, "EQUIRECTANGULAR"), "17", "perspective views"), ((99, "NOVEL"), "99", "image_undistorter")]
    {
        let mut scene = Scene::ring(3);
        scene.cameras[0].model = model;
        // A whole panorama has no focal length.
        scene.cameras[0].params.truncate(if model.0 == 17 { 2 } else { 4 });
        let folder = tempfile::tempdir().unwrap();
        scene.write(folder.path());
        let error = load(folder.path()).err().unwrap();
        assert!(matches!(error, Error::Unsupported { .. }));
        let text = error.to_string();
        for part in ["cameras.bin", "camera 7", name, "SIMPLE_RADIAL", remedy] {
            assert!(text.contains(part), "{part}: {text}");
        }
    }
}

#[test]
fn invalid_poses_name_their_image() {
    let nan = |scene: &mut Scene| scene.images[1].camera_from_world.1.y = f64::NAN;
    let zero =
        |scene: &mut Scene| scene.images[1].camera_from_world.0 = glam::DQuat::from_xyzw(0., 0., 0., 0.);
    let infinite = |scene: &mut Scene| scene.images[1].camera_from_world.0.w = f64::INFINITY;
    let changes: [&dyn Fn(&mut Scene); 3] = [&nan, &zero, &infinite];
    for change in changes {
        let mut scene = Scene::ring(3);
        change(&mut scene);
        let folder = tempfile::tempdir().unwrap();
        scene.write(folder.path());
        let text = message(folder.path());
        assert!(text.contains("image 2 (\"p02.png\")"), "{text}");
    }
}

#[test]
fn models_without_images_or_with_unknown_cameras_are_errors() {
    let mut scene = Scene::ring(3);
    let folder = tempfile::tempdir().unwrap();
    scene.write(folder.path());
    scene.images[0].camera_id = 3;
    scene.write_binary(&folder.path().join("sparse/0"));
    assert!(message(folder.path()).contains("it refers to camera 3, but the cameras are \"7\""));
    scene.images.clear();
    scene.write_binary(&folder.path().join("sparse/0"));
    assert!(message(folder.path()).contains("no registered images"));
    let mut twice = Scene::ring(3);
    twice.images[1].name = twice.images[0].name.clone();
    twice.write_binary(&folder.path().join("sparse/0"));
    assert!(message(folder.path()).contains("1 of 2 photos occur with different poses"));
    let nothing = tempfile::tempdir().unwrap();
    assert!(message(nothing.path()).contains("no poses found"));
    assert!(message(&nothing.path().join("absent")).contains("no such file or folder"));
}

#[test]
fn invalid_intrinsics_name_their_camera() {
    for (index, value) in [(0, 0.0), (1, -4.0), (1, f64::NAN), (2, f64::INFINITY)] {
        let mut scene = Scene::ring(3);
        scene.cameras[0].params[index] = value;
        let folder = tempfile::tempdir().unwrap();
        scene.write(folder.path());
        assert!(message(folder.path()).contains("camera 7 (PINHOLE)"));
    }
}

#[test]
fn photos_with_another_aspect_ratio_name_both_sizes() {
    let folder = ring(3);
    image::RgbImage::new(8, 12).save(folder.path().join("images/p02.png")).unwrap();
    let text = message(folder.path());
    for part in ["size mismatch", "\"p02.png\"", "8x12", "12x8", "--images"] {
        assert!(text.contains(part), "{part}: {text}");
    }
}

#[test]
fn unreadable_photos_are_named_and_refused_when_they_are_decoded() {
    let folder = ring(3);
    let path = folder.path().join("images/p02.png");
    let whole = std::fs::read(&path).unwrap();
    for bytes in [&b"no photo"[..], b""] {
        std::fs::write(&path, bytes).unwrap();
        let capture = load(folder.path()).unwrap();
        let warning = capture.report.warnings.iter().find(|w| w.code == "photos-unreadable").unwrap();
        assert!(warning.count == 1 && warning.message.contains("1 of 3 photos cannot be read"));
        assert!(warning.message.contains("p02.png") && capture.target(0).is_ok(), "{}", warning.message);
        assert!(capture.check_photos().unwrap_err().to_string().contains("p02.png"));
        let reason = &capture.verdict().reasons[0];
        assert!(reason.code == "unreadable-photos" && reason.found.contains("p02.png"), "{reason:?}");
    }
    // The header is whole, the pixels are not: seen when decoded.
    std::fs::write(&path, &whole[..whole.len() / 2 + 10]).unwrap();
    let capture = load(folder.path()).unwrap();
    assert!(capture.report.warnings.iter().all(|w| w.code != "photos-unreadable"), "negative control");
    let text = capture.target(1).unwrap_err().to_string();
    assert!(text.contains("p02.png") && text.contains("unreadable image"), "{text}");
    assert!(capture.target(0).is_ok());
}

#[test]
fn damaged_transforms_name_the_frame() {
    let scene = Scene::ring(3);
    let folder = tempfile::tempdir().unwrap();
    scene.write_photos(&folder.path().join("images"), (12, 8));
    let path = folder.path().join("transforms.json");
    let valid = scene.transforms("images/");
    let check = |change: &dyn Fn(&mut serde_json::Value), parts: &[&str]| {
        let mut json = valid.clone();
        change(&mut json);
        write_json(path.clone(), &json);
        let text = message(folder.path());
        for part in parts {
            assert!(text.contains(part), "{part}: {text}");
        }
    };
    check(&|j| j["frames"][1]["transform_matrix"][0][0] = 5.0.into(), &["frames[1]", "rotation"]);
    check(&|j| j["frames"][2]["transform_matrix"] = serde_json::json!([[1, 2]]), &["frames[2]", "4"]);
    check(&|j| j["fl_x"] = 0.0.into(), &["frames[0]", "focal length"]);
    check(&|j| j["w"] = 0.5.into(), &["frames[0]", "size"]);
    check(&|j| j["camera_model"] = "EQUIRECTANGULAR".into(), &["EQUIRECTANGULAR", "OPENCV_FISHEYE"]);
    check(&|j| j["frames"] = serde_json::json!([]), &["no registered images"]);
    check(&|j| j["frames"] = 3.into(), &["transforms.json", "expected"]);
    std::fs::write(folder.path().join("damaged.ply"), "ply").unwrap();
    let mut json = valid.clone();
    json["ply_file_path"] = "damaged.ply".into();
    write_json(path.clone(), &json);
    let capture = load(folder.path()).unwrap();
    let is_named = |w: &litetex_gs::Warning| w.message.contains("damaged.ply");
    assert!(capture.points.is_empty() && capture.report.warnings.iter().any(is_named));
    let whole = valid.to_string();
    for number in ["1e999", "NaN", "null"] {
        std::fs::write(&path, whole.replacen("0.0", number, 1)).unwrap();
        assert!(message(folder.path()).contains("transforms.json"));
    }
    for length in (0..whole.len()).step_by(11) {
        std::fs::write(&path, &whole[..length]).unwrap();
        assert!(load(folder.path()).is_err());
    }
    let wants_colmap = LoadOptions { format: "colmap".parse().ok(), ..LoadOptions::default() };
    assert!(Capture::load(folder.path(), &wants_colmap).is_err());
}
