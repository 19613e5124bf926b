//! Behaviour of whole captures; damage to their files is in `tests/capture_damage.rs`.

use super::fixtures::{Scene, write_json};
use super::*;
use crate::Error;
use crate::init::{InitInput, InitOptions, InitPoints, InitialModel, initial_model};
use crate::sample::{SampleOptions, write_sample};
use crate::views::{Split, ViewSource as _, WantedPhoto};
use glam::DVec3;
use tempfile::{TempDir, tempdir};

fn options() -> LoadOptions {
    LoadOptions::default()
}

fn written(scene: &Scene) -> TempDir {
    let folder = tempdir().unwrap();
    scene.write(folder.path());
    folder
}

fn load(folder: &TempDir, options: &LoadOptions) -> Capture {
    Capture::load(folder.path(), options).unwrap()
}

fn error(folder: &TempDir, options: &LoadOptions) -> String {
    Capture::load(folder.path(), options).err().unwrap().to_string()
}

fn has_warning(capture: &Capture, code: &str, count: usize) -> bool {
    capture.report.warnings.iter().any(|w| w.code == code && w.count == count)
}

fn worst_camera_difference(a: &Capture, b: &Capture) -> f64 {
    let mut worst = 0.0_f64;
    for (a, b) in a.views.iter().zip(&b.views) {
        assert_eq!(a.name, b.name);
        assert_eq!(a.split, b.split);
        assert_eq!(a.camera.pinhole, b.camera.pinhole);
        let (a, b) = (a.camera.camera_from_local, b.camera.camera_from_local);
        worst = worst.max((a.translation - b.translation).length());
        let rotation = a.rotation - b.rotation;
        worst = rotation.to_cols_array().iter().fold(worst, |w, v| w.max(v.abs()));
    }
    worst
}

#[test]
fn binary_and_text_give_the_same_capture() {
    let scene = Scene::ring(9);
    let (binary, text) = (written(&scene), tempdir().unwrap());
    scene.write_text(&text.path().join("sparse/0"));
    scene.write_photos(&text.path().join("images"), (12, 8));
    let (a, b) = (load(&binary, &options()), load(&text, &options()));
    assert_eq!(worst_camera_difference(&a, &b), 0.0);
    assert_eq!(a.points, b.points);
    assert_eq!(a.capture_from_local, b.capture_from_local);
    assert_eq!((a.near, a.health.clone()), (b.near, b.health.clone()));
    assert_eq!(a.points.len(), 20);
    assert_eq!(a.health.unwrap().observations, 9 * 20);
}

#[test]
fn text_images_without_keypoint_lines_are_read() {
    let mut scene = Scene::ring(3);
    scene.images.iter_mut().for_each(|i| i.keypoints.clear());
    scene.images[1].name = "with blanks 12.png".to_owned();
    let folder = tempdir().unwrap();
    let sparse = folder.path().join("sparse");
    scene.write_text(&sparse);
    scene.write_photos(&folder.path().join("images"), (12, 8));
    let with_blank_lines = load(&folder, &options());
    let text = std::fs::read_to_string(sparse.join("images.txt")).unwrap();
    let dense: Vec<&str> = text.lines().filter(|l| !l.is_empty()).collect();
    std::fs::write(sparse.join("images.txt"), dense.join("\n")).unwrap();
    let without = load(&folder, &options());
    assert_eq!(without.views.len(), 3);
    assert_eq!(worst_camera_difference(&with_blank_lines, &without), 0.0);
    assert!(without.views.iter().any(|v| v.name == "with blanks 12.png"));
}

#[test]
fn colmap_and_transforms_give_the_same_cameras() {
    let scene = Scene::ring(9);
    let folder = written(&scene);
    let colmap = load(&folder, &options());
    for photo_folder in ["images/", "./images/"] {
        write_json(folder.path().join("transforms.json"), &scene.transforms(photo_folder));
        let wanted = LoadOptions { format: "transforms".parse().ok(), ..options() };
        let transforms = load(&folder, &wanted);
        assert_eq!(transforms.format.name(), "transforms");
        // Needed: 3e-16.
        assert!(worst_camera_difference(&colmap, &transforms) < 1e-12);
        assert!((colmap.capture_from_local.scale - transforms.capture_from_local.scale).abs() < 1e-12);
        // Negative control: another capture differs.
        let mut moved = scene.clone();
        moved.images[4].camera_from_world.1.x += 1e-3;
        write_json(folder.path().join("transforms.json"), &moved.transforms(photo_folder));
        assert!(worst_camera_difference(&colmap, &load(&folder, &wanted)) > 1e-4);
    }
    assert_eq!(load(&folder, &options()).format.name(), "colmap", "sparse wins");
}

#[test]
fn changing_the_frame_keeps_projections() {
    let scene = Scene::ring(5);
    let capture = load(&written(&scene), &options());
    let local_from_capture = capture.capture_from_local.inverse();
    for view in &capture.views {
        let image = scene.images.iter().find(|i| i.name == view.name).unwrap();
        for point in &capture.points {
            let (q, t) = image.camera_from_world;
            let p = q * point.position_in_capture + t;
            let expected = (10.0 * p.x / p.z + 6.25, 11.0 * p.y / p.z + 3.75);
            let in_local = local_from_capture.transform_point(point.position_in_capture);
            let in_camera = view.camera.camera_from_local.transform_point(in_local);
            let got = view.camera.pinhole.project(in_camera).unwrap();
            assert!((got.x - expected.0).abs() + (got.y - expected.1).abs() < 1e-9);
        }
    }
    let farthest = capture.views.iter().map(|v| v.camera.centre_in_local().length()).fold(0.0, f64::max);
    assert!((farthest * 1.1 - 1.0).abs() < 1e-12);
}

#[test]
fn intrinsics_scale_with_photo_size_and_max_resolution() {
    let scene = Scene::ring(3);
    let folder = written(&scene);
    scene.write_photos(&folder.path().join("images_2"), (6, 4));
    let scaled = LoadOptions { images: Some("images_2".into()), ..options() };
    let camera = load(&folder, &scaled).views[0].camera.pinhole;
    assert_eq!((camera.width_px, camera.height_px, camera.fx_px, camera.cy_px), (6, 4, 5.0, 1.875));
    let bounded = LoadOptions { max_resolution: 3, ..options() };
    let capture = load(&folder, &bounded);
    let camera = capture.views[0].camera.pinhole;
    assert_eq!((camera.width_px, camera.height_px, camera.fx_px, camera.cx_px), (3, 2, 2.5, 1.5625));
    let photo = capture.target(0).unwrap();
    assert_eq!((photo.width_px, photo.height_px, photo.rgb.len(), &photo.mask), (3, 2, 18, &None));
    // Columns 0 to 3 and rows 0 to 3 of the photo: means of 0, 20, 40, 60 and 0, 30, 60, 90.
    assert_eq!(photo.rgb[..2], [30, 45]);
}

#[test]
fn the_split_follows_test_every_or_test_list() {
    let scene = Scene::ring(17);
    let folder = written(&scene);
    let tests = |o: &LoadOptions| load(&folder, o).indices(Split::Test);
    assert_eq!(tests(&options()), [0, 8, 16]);
    assert!(load(&folder, &options()).views.is_sorted_by_key(|v| v.name.clone()));
    let every = |test_every| LoadOptions { test_every, ..options() };
    assert_eq!(tests(&every(0)), [] as [usize; 0]);
    assert_eq!(tests(&every(5)), [0, 5, 10, 15]);
    assert!(error(&folder, &every(1)).contains("held out"));
    let list = folder.path().join("test.txt");
    std::fs::write(&list, "# held out\np03.png\n\np05\n").unwrap();
    let listed = LoadOptions { test_list: Some(list.clone()), ..options() };
    assert_eq!(tests(&listed), [2, 4]);
    std::fs::write(&list, "P03.PNG\nP05\n").unwrap();
    assert_eq!(tests(&listed), [2, 4], "in any case");
    std::fs::write(&list, "p99.png\n").unwrap();
    assert!(error(&folder, &listed).contains("\"p99.png\""));
}

#[test]
fn names_of_a_test_list_may_differ_in_case_where_one_view_is_left() {
    let mut scene = Scene::ring(6);
    for (image, name) in scene.images.iter_mut().zip(["a.png", "A.png", "b.png"]) {
        image.name = name.to_owned();
    }
    let folder = written(&scene);
    let list = folder.path().join("test.txt");
    let listed = LoadOptions { test_list: Some(list.clone()), ..options() };
    for (text, expected) in [("a", 1), ("A.png", 0), ("B.PNG", 2)] {
        std::fs::write(&list, text).unwrap();
        assert_eq!(load(&folder, &listed).indices(Split::Test), [expected], "{text}");
    }
    std::fs::write(&list, "A.PNG").unwrap();
    assert!(error(&folder, &listed).contains("\"A.PNG\""), "either may be meant");
}

#[test]
fn blender_files_define_the_split_and_may_omit_sizes_and_extensions() {
    let scene = Scene::ring(6);
    let folder = tempdir().unwrap();
    for (side, range) in [("train", 0..4), ("test", 4..6)] {
        let part = Scene { images: scene.images[range].to_vec(), ..scene.clone() };
        part.write_photos(&folder.path().join(side), (10, 10));
        let mut json = part.transforms(&format!("./{side}/"));
        let fields = json.as_object_mut().unwrap();
        for field in ["fl_x", "fl_y", "cx", "cy", "w", "h"] {
            fields.remove(field);
        }
        fields.insert("camera_angle_x".to_owned(), (2.0 * 0.5_f64.atan()).into());
        for frame in fields["frames"].as_array_mut().unwrap() {
            let path = frame["file_path"].as_str().unwrap().trim_end_matches(".png").to_owned();
            frame["file_path"] = path.into();
        }
        write_json(folder.path().join(format!("transforms_{side}.json")), &json);
    }
    let capture = load(&folder, &options());
    assert_eq!(capture.indices(Split::Test), [0, 1]);
    assert_eq!(capture.views[0].name, "test/p01.png");
    assert_eq!(capture.views[5].name, "train/p06.png");
    let camera = capture.views[3].camera.pinhole;
    assert!((camera.fx_px - 10.0).abs() < 1e-12 && camera.fy_px == camera.fx_px);
    assert_eq!((camera.cx_px, camera.cy_px), (5.0, 5.0));
    assert!(capture.health.is_none() && capture.near == 0.04);
}

#[test]
fn transforms_support_points_per_frame_intrinsics_and_photo_folders() {
    let scene = Scene::ring(4);
    let folder = tempdir().unwrap();
    scene.write_photos(&folder.path().join("images_2"), (6, 4));
    let mut json = scene.transforms("images/");
    json["ply_file_path"] = "points.ply".into();
    json["frames"][1]["fl_x"] = 20.0.into();
    write_json(folder.path().join("transforms.json"), &json);
    let ply = "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\n\
               property float z\nend_header\n0.5 0 0\n";
    std::fs::write(folder.path().join("points.ply"), ply).unwrap();
    let other = LoadOptions { images: Some("images_2".into()), ..options() };
    let capture = load(&folder, &other);
    let focal: Vec<f64> = capture.views.iter().map(|v| v.camera.pinhole.fx_px).collect();
    assert_eq!(focal, [5.0, 5.0, 10.0, 5.0]);
    assert_eq!(capture.points[0].position_in_capture, DVec3::new(0.5, 0.0, 0.0));
}

#[test]
fn model_folders_are_found_in_all_layouts_and_the_largest_wins() {
    let scene = Scene::ring(4);
    for layout in ["sparse/0", "sparse", "colmap/sparse/0", "colmap/sparse", ""] {
        let folder = tempdir().unwrap();
        scene.write_text(&folder.path().join(layout));
        scene.write_photos(&folder.path().join("images"), (12, 8));
        assert_eq!(load(&folder, &options()).views.len(), 4, "{layout}");
        let named = Capture::load(&folder.path().join(layout), &options()).unwrap();
        assert_eq!(named.views.len(), 4, "{layout} named by the user");
    }
    let folder = written(&Scene::ring(3));
    scene.write_binary(&folder.path().join("sparse/1"));
    scene.write_photos(&folder.path().join("images"), (12, 8));
    let capture = load(&folder, &options());
    assert_eq!(capture.views.len(), 4);
    assert!(has_warning(&capture, "several-sub-models", 1));
}

#[test]
fn extra_files_of_newer_colmap_are_ignored() {
    let folder = written(&Scene::ring(3));
    for file in ["rigs.bin", "frames.bin"] {
        std::fs::write(folder.path().join("sparse/0").join(file), b"anything").unwrap();
    }
    assert_eq!(load(&folder, &options()).views.len(), 3);
}

#[test]
fn missing_photos_are_skipped_and_counted_but_two_must_remain() {
    let folder = written(&Scene::ring(9));
    let before = load(&folder, &options()).capture_from_local;
    let photo = |i: u32| folder.path().join(format!("images/p{i:02}.png"));
    (1..=6).for_each(|i| std::fs::remove_file(photo(i)).unwrap());
    let capture = load(&folder, &options());
    assert_eq!(capture.views.len(), 3);
    assert!(has_warning(&capture, "views-without-photo", 6));
    let warning = capture.report.warnings.iter().find(|w| w.code == "views-without-photo");
    assert!(warning.unwrap().message.contains("\"p05.png\" and 1 more"));
    assert_eq!(capture.capture_from_local, before, "the frame is that of all poses");
    (7..=8).for_each(|i| std::fs::remove_file(photo(i)).unwrap());
    assert!(error(&folder, &options()).contains("at least two"));
    std::fs::remove_dir_all(folder.path().join("images")).unwrap();
    let message = error(&folder, &options());
    assert!(message.contains("--images") && message.contains("\"p01.png\""), "{message}");
}

#[test]
fn alpha_is_composited_before_averaging() {
    let scene = Scene::ring(2);
    let folder = written(&scene);
    for image in &scene.images {
        let photo = image::RgbaImage::from_fn(12, 8, |x, _| {
            image::Rgba(if x % 2 == 0 { [200, 100, 0, 255] } else { [0, 0, 255, 0] })
        });
        photo.save(folder.path().join("images").join(&image.name)).unwrap();
    }
    let grey = LoadOptions { background: [1.0, 0.0, 0.5], max_resolution: 6, test_every: 0, ..options() };
    let photo = load(&folder, &grey).target(0).unwrap();
    // Means of (200, 100, 0) and the background (255, 0, 127.5); the hidden blue must not show.
    assert_eq!((&photo.rgb[..3], &photo.alpha), (&[228, 50, 64][..], &None));
    let kept = LoadOptions { keep_alpha: true, max_resolution: 6, test_every: 0, ..options() };
    let photo = load(&folder, &kept).target(0).unwrap();
    assert_eq!((&photo.rgb[..3], photo.alpha.as_ref().unwrap()[0]), (&[100, 50, 0][..], 64), "over black");
}

#[test]
fn photos_with_an_opaque_alpha_channel_are_like_photos_without() {
    let scene = Scene::ring(3);
    let folder = written(&scene);
    assert!(!load(&folder, &options()).has_alpha());
    let save = |image: usize, alpha: u8| {
        let mut photo = image::RgbaImage::from_pixel(12, 8, image::Rgba([9, 9, 9, 255]));
        photo.put_pixel(11, 7, image::Rgba([9, 9, 9, alpha]));
        photo.save(folder.path().join("images").join(&scene.images[image].name)).unwrap();
    };
    (0..3).for_each(|image| save(image, 255));
    assert!(!load(&folder, &options()).has_alpha());
    save(1, 254);
    assert!(load(&folder, &options()).has_alpha(), "negative control: one pixel");
}

#[test]
fn webp_photos_are_read() {
    let scene = Scene::ring(2);
    let folder = written(&scene);
    for image in &scene.images {
        // Formats are told by content: COLMAP's list of images keeps its names.
        let photo = image::RgbImage::from_fn(12, 8, |x, y| image::Rgb([10 * x as u8, 20 * y as u8, 7]));
        let path = folder.path().join("images").join(&image.name);
        photo.save_with_format(path, image::ImageFormat::WebP).unwrap();
    }
    let photo = load(&folder, &options()).target(0).unwrap();
    assert_eq!(photo.rgb[3..6], [10, 0, 7], "lossless");
}

#[test]
fn formats_that_are_not_read_come_with_the_command_that_converts_them() {
    let folder = written(&Scene::ring(2));
    let photo = folder.path().join("images/p01.png");
    std::fs::write(&photo, b"\0\0\0\x18ftypheic\0\0\0\0mif1heic").unwrap();
    let error = Capture::load(folder.path(), &options()).err().unwrap();
    assert_eq!(error.exit_code(), 4);
    let message = error.to_string();
    assert!(message.contains("HEIC is not read") && message.contains("magick "), "{message}");
}

#[test]
fn photos_without_poses_come_with_the_commands_that_find_them() {
    let folder = written(&Scene::ring(3));
    std::fs::remove_dir_all(folder.path().join("sparse")).unwrap();
    let message = Capture::load(folder.path(), &options()).err().unwrap().to_string();
    assert!(message.contains("the 3 photos") && message.contains("litetex capture "), "{message}");
}

#[test]
fn masks_are_found_reduced_and_inverted() {
    let scene = Scene::ring(4);
    let folder = written(&scene);
    let masks = folder.path().join("masks");
    std::fs::create_dir(&masks).unwrap();
    let mask = image::GrayImage::from_fn(12, 8, |x, _| image::Luma([if x < 7 { 255 } else { 0 }]));
    mask.save(masks.join("p01.png")).unwrap();
    mask.save(masks.join("p02.png.png")).unwrap();
    let white = image::GrayImage::from_pixel(12, 8, image::Luma([255]));
    white.save(masks.join("p03.png")).unwrap();
    let bounded = LoadOptions { max_resolution: 3, ..options() };
    let capture = load(&folder, &bounded);
    assert!(has_warning(&capture, "views-without-mask", 1));
    // Column 1 covers pixels 4 to 7, of which 3 of 4 are white.
    let expected = Some([255, 255, 0].repeat(2));
    assert_eq!(capture.target(0).unwrap().mask, expected);
    assert_eq!(capture.target(1).unwrap().mask, expected);
    assert_eq!(capture.target(2).unwrap().mask, None, "all white counts everywhere");
    assert_eq!(capture.target(3).unwrap().mask, None);
    let inverted = LoadOptions { mask_invert: true, ..bounded };
    assert_eq!(load(&folder, &inverted).target(0).unwrap().mask, Some([0, 0, 255].repeat(2)));
    image::GrayImage::new(8, 12).save(masks.join("p01.png")).unwrap();
    let message = load(&folder, &options()).target(0).unwrap_err().to_string();
    assert!(message.contains("size mismatch"), "{message}");
}

#[test]
fn coincident_cameras_get_a_scale_and_a_warning() {
    let mut scene = Scene::ring(3);
    for image in &mut scene.images {
        // Centre = -R^T t: all at (0, 0, 9).
        image.camera_from_world.1 = -(image.camera_from_world.0 * DVec3::new(0.0, 0.0, 9.0));
    }
    let capture = load(&written(&scene), &options());
    assert!(has_warning(&capture, "all-cameras-coincide", 3));
    assert!((capture.capture_from_local.scale - 9.0).abs() < 0.5, "{:?}", capture.capture_from_local);
    assert!(capture.views.iter().all(|v| v.camera.camera_from_local.translation.is_finite()));
}

#[test]
fn health_detects_collapsed_cameras_and_points_behind_them() {
    let mut scene = Scene::ring(6);
    scene.images[1].camera_from_world = scene.images[0].camera_from_world;
    scene.points[3].0 = [10.0, 0.0, 0.0];
    let capture = load(&written(&scene), &options());
    let health = capture.health.clone().unwrap();
    assert_eq!(health.coincident_cameras, 2);
    assert!(health.observations_behind_camera >= 2, "{health:?}");
    assert!(has_warning(&capture, "coincident-cameras", 2));
    assert!(has_warning(&capture, "points-behind-cameras", health.observations_behind_camera));
    let valid = load(&written(&Scene::ring(6)), &options()).health.unwrap();
    assert_eq!(
        (valid.coincident_cameras, valid.observations_behind_camera, valid.cameras_far_off),
        (0, 0, 0)
    );
    let mut lost = Scene::ring(6);
    lost.images[4].camera_from_world.1 *= 15.0;
    assert!(has_warning(&load(&written(&lost), &options()), "cameras-far-off", 1));
}

#[test]
fn the_near_plane_is_half_the_depth_quantile_within_bounds() {
    let mut scene = Scene::ring(6);
    assert_eq!(load(&written(&scene), &options()).near, 0.04);
    // All points 0.1 in front of the first camera: depth 0.1 there, more elsewhere.
    let (q, t) = scene.images[0].camera_from_world;
    for (index, point) in scene.points.iter_mut().enumerate() {
        let in_camera = DVec3::new(0.001 * index as f64, 0.0, 0.1);
        point.0 = (q.inverse() * (in_camera - t)).to_array();
    }
    let capture = load(&written(&scene), &options());
    let expected = 0.5 * 0.1 / capture.capture_from_local.scale;
    assert!((f64::from(capture.near) - expected).abs() < 1e-6, "{} {expected}", capture.near);
}

#[test]
fn wrong_options_are_usage_errors() {
    let folder = written(&Scene::ring(3));
    for wrong in [
        LoadOptions { max_resolution: 0, ..options() },
        LoadOptions { background: [0.0, f32::NAN, 0.0], ..options() },
    ] {
        assert!(matches!(Capture::load(folder.path(), &wrong), Err(Error::Usage(_))));
    }
}

#[test]
fn prefetching_through_the_capture_gives_the_same_photos() {
    let folder = written(&Scene::ring(9));
    let (a, b) = (load(&folder, &options()), load(&folder, &options()));
    b.prefetch(&WantedPhoto::full(&(0..9).rev().collect::<Vec<_>>()));
    for view in 0..9 {
        assert_eq!(a.target(view).unwrap(), b.target(view).unwrap());
    }
    assert_eq!(a.cached_bytes(), 9 * 12 * 8 * 3);
}

#[test]
fn the_sample_is_a_valid_capture() {
    let folder = tempdir().unwrap();
    let small = SampleOptions {
        views: 10,
        width_px: 48,
        height_px: 32,
        supersampling: 1,
        points: 400,
        text: true,
        ..SampleOptions::default()
    };
    let summary = write_sample(folder.path(), &small).unwrap();
    let capture = load(&folder, &options());
    assert_eq!((capture.views.len(), capture.points.len()), (summary.views, summary.points));
    let health = capture.health.clone().unwrap();
    assert_eq!(health.observations, summary.observations);
    assert_eq!((health.observations_behind_camera, health.coincident_cameras), (0, 0));
    let input = InitInput {
        views: &capture,
        points: InitPoints::Sparse(&capture.points),
        points_file: &capture.poses,
        capture_from_local: capture.capture_from_local,
        near: capture.near,
    };
    let InitialModel { model, report } = initial_model(&input, &InitOptions::default()).unwrap();
    assert_eq!((model.num_splats(), report.warnings.len()), (summary.points, 0));
}
