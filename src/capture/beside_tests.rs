//! Captures with more in their folders than their poses name: photos, points and other pose files.

use super::fixtures::{Scene, write_json};
use super::strangers_tests::{csv, has_warning, load, text_model, transforms, warning};
use super::*;
use crate::views::{Split, ViewSource as _};
use std::path::Path;

fn write_points(path: &Path, count: usize) {
    let header = format!(
        "ply\nformat ascii 1.0\nelement vertex {count}\nproperty float x\nproperty float y\nproperty float z\nend_header\n"
    );
    let rows: String = (0..count).map(|i| format!("0 0.1 {i}\n")).collect();
    std::fs::write(path, header + &rows).unwrap();
}

/// Photos of which no pose is known, beside those of a capture.
fn add_photos(root: &Path, names: impl Iterator<Item = String>) {
    let images = root.join("images");
    for name in names {
        std::fs::copy(images.join("p01.png"), images.join(name)).unwrap();
    }
}

fn reasons(capture: &Capture) -> Vec<(&'static str, Rating)> {
    let reasons = capture.verdict().reasons;
    reasons.into_iter().map(|r| (r.code, r.rating)).filter(|r| r.0 == "photos-without-pose").collect()
}

#[test]
fn photos_without_a_pose_are_counted_for_every_form() {
    let json = || transforms(|json| json.to_string());
    for folder in [json(), csv(|row| row)] {
        assert!(!has_warning(&load(folder.path()).unwrap(), "photos-not-registered"), "negative control");
        add_photos(folder.path(), (0..8).map(|i| format!("q{i}.png")));
        let capture = load(folder.path()).unwrap();
        assert!(warning(&capture, "photos-not-registered", 8).contains("8 of 20 photos have no pose"));
        assert_eq!(reasons(&capture), [("photos-without-pose", Rating::Usable)]);
        add_photos(folder.path(), (8..30).map(|i| format!("q{i}.png")));
        assert_eq!(reasons(&load(folder.path()).unwrap()), [("photos-without-pose", Rating::ShootAgain)]);
    }
    // What was made of posed photos, and photos of views that are left out, have one.
    let folder = transforms(|mut json| {
        json["frames"][4]["is_bad"] = true.into();
        json.to_string()
    });
    let made = ["p01_depth.png", "p01_normal_0001.png", "p02.png.png", "p03-mask.png"];
    add_photos(folder.path(), made.into_iter().map(str::to_owned));
    assert!(!has_warning(&load(folder.path()).unwrap(), "photos-not-registered"));
}

#[test]
fn what_programs_put_beside_photos_is_no_photo_without_a_pose() {
    let made = [
        "dynamic_mask_p01.png",
        "thumb_p02.png",
        "p03.png.mask.png",
        "p04.jpg",
        "p05.PNG",
        ".p05.png",
        "masks/p01.png",
        "depth_maps/q1.png",
        "@eaDir/p01.png",
        ".thumb/q1.png",
        "q1.png",
        "q1_mask.png",
        "mask_q1.png",
    ];
    for folder in [transforms(|json| json.to_string()), text_model(&Scene::ring(12))] {
        let images = folder.path().join("images");
        for inner in ["masks", "depth_maps", "@eaDir", ".thumb"] {
            std::fs::create_dir(images.join(inner)).unwrap();
        }
        // On disks that ignore case, p05.PNG is p05.png itself.
        add_photos(folder.path(), made.into_iter().map(str::to_owned));
        let message = warning(&load(folder.path()).unwrap(), "photos-not-registered", 1);
        assert!(message.contains("1 of 13 photos have no pose"), "q1.png alone is one: {message}");
    }
    // Negative controls: folders of a sparse model, and names that only share an end or a number.
    let folder = text_model(&Scene::ring(12));
    std::fs::create_dir(folder.path().join("images/left")).unwrap();
    let names = ["left/p01.png", "left-p01.png", "maskp02.png"];
    add_photos(folder.path(), names.into_iter().map(str::to_owned));
    assert!(warning(&load(folder.path()).unwrap(), "photos-not-registered", 3).contains("3 of 15"));
}

#[test]
fn points_beside_poses_without_points_are_named() {
    let folder = transforms(|json| json.to_string());
    assert!(!has_warning(&load(folder.path()).unwrap(), "points-beside-not-used"), "negative control");
    write_points(&folder.path().join("points.ply"), 3);
    let capture = load(folder.path()).unwrap();
    let message = warning(&capture, "points-beside-not-used", 1);
    assert!(message.starts_with("1 point cloud beside ") && message.contains("points.ply"), "{message}");
    assert!(message.contains("--init ply:FILE") && capture.points.is_empty());
    let model = text_model(&Scene::ring(4));
    write_points(&model.path().join("sparse/0/points3D.ply"), 3);
    write_points(&model.path().join("dense.ply"), 3);
    let capture = load(model.path()).unwrap();
    assert_eq!((capture.points.len(), has_warning(&capture, "points-beside-not-used")), (20, false));
    // The converters for Gaussian splats write the model's own points.
    std::fs::remove_file(model.path().join("sparse/0/points3D.txt")).unwrap();
    assert_eq!(load(model.path()).unwrap().points.len(), 3);
    std::fs::remove_file(model.path().join("sparse/0/points3D.ply")).unwrap();
    let capture = load(model.path()).unwrap();
    assert!(capture.points.is_empty());
    assert!(warning(&capture, "points-beside-not-used", 1).contains("dense.ply"));
}

#[test]
fn the_pose_file_leads_to_its_capture() {
    let rows = csv(|row| row);
    let model = text_model(&Scene::ring(12));
    let of_scannet = tempfile::tempdir().unwrap();
    let dslr = of_scannet.path().join("dslr");
    Scene::ring(12).write_photos(&dslr.join("resized_images"), (12, 8));
    std::fs::create_dir(dslr.join("nerfstudio")).unwrap();
    write_json(dslr.join("nerfstudio/transforms.json"), &Scene::ring(12).transforms(""));
    for (root, file, format) in [
        (rows.path(), "cameras.csv", "reality-capture"),
        (model.path(), "sparse/0/images.txt", "colmap"),
        (of_scannet.path(), "dslr/nerfstudio/transforms.json", "scannetpp"),
    ] {
        let (by_file, by_folder) = (load(&root.join(file)).unwrap(), load(root).unwrap());
        assert_eq!((by_file.format.name(), by_file.views.len()), (format, 12));
        assert_eq!(by_file.views, by_folder.views);
        // The CSV is found by its columns.
        assert_eq!(Capture::is_pose_file(&root.join(file)), format != "reality-capture");
    }
    std::fs::write(rows.path().join("other.csv"), "a,b\n1,2\n").unwrap();
    assert_eq!(load(&rows.path().join("other.csv")).err().unwrap().exit_code(), 4, "negative control");
    let photo = model.path().join("images/p01.png");
    assert!(load(&photo).is_err() && !Capture::is_pose_file(&photo), "a photo is no pose file");
}

#[test]
fn photos_beside_the_folder_of_the_poses_are_named_with_the_option() {
    let folder = csv(|row| row);
    let inner = folder.path().join("poses");
    std::fs::create_dir(&inner).unwrap();
    std::fs::rename(folder.path().join("cameras.csv"), inner.join("cameras.csv")).unwrap();
    for path in [inner.clone(), inner.join("cameras.csv")] {
        let error = load(&path).err().unwrap();
        let images = folder.path().canonicalize().unwrap().join("images");
        let command = format!("--images {}", images.display());
        assert!(error.exit_code() == 3 && error.to_string().contains(&command), "{error}");
        let options = LoadOptions { images: Some(images), ..LoadOptions::default() };
        assert_eq!(Capture::load(&path, &options).unwrap().views.len(), 12);
    }
}

#[test]
fn validation_views_beside_test_views_are_named() {
    let folder = transforms(|mut json| {
        json["ply_file_path"] = "points.ply".into();
        json.to_string()
    });
    let root = folder.path();
    write_points(&root.join("points.ply"), 5);
    let text = std::fs::read_to_string(root.join("transforms.json")).unwrap();
    std::fs::remove_file(root.join("transforms.json")).unwrap();
    let whole: serde_json::Value = serde_json::from_str(&text).unwrap();
    for (side, range) in [("train", 0..8), ("val", 8..10), ("test", 10..12)] {
        let mut part = whole.clone();
        part["frames"] = whole["frames"].as_array().unwrap()[range].into();
        write_json(root.join(format!("transforms_{side}.json")), &part);
    }
    let held_out = |capture: &Capture| capture.views.iter().filter(|v| v.split == Split::Test).count();
    let capture = load(root).unwrap();
    assert_eq!((capture.views.len(), held_out(&capture), capture.points.len()), (10, 2, 5));
    assert!(warning(&capture, "validation-views-not-used", 2).contains("transforms_val.json: 2 frames"));
    assert!(!has_warning(&capture, "photos-not-registered"), "their photos have poses");
    std::fs::remove_file(root.join("transforms_test.json")).unwrap();
    let capture = load(root).unwrap();
    assert_eq!((capture.views.len(), held_out(&capture), capture.points.len()), (10, 2, 5));
    assert!(!has_warning(&capture, "validation-views-not-used") && capture.split_by.contains("_val"));
    std::fs::rename(root.join("transforms_val.json"), root.join("transforms_eval.json")).unwrap();
    let capture = load(root).unwrap();
    assert!(held_out(&capture) == 2 && capture.split_by.contains("_eval"), "{}", capture.split_by);
}

#[test]
fn a_json_wins_over_the_model_that_it_was_made_of() {
    for (place, format) in [("colmap/sparse/0", "transforms"), ("sparse/0", "colmap")] {
        let folder = transforms(|mut json| {
            json["test_filenames"] = serde_json::json!(["images/p03.png"]);
            json.to_string()
        });
        Scene::ring(12).write_text(&folder.path().join(place));
        let capture = load(folder.path()).unwrap();
        assert_eq!(capture.format.name(), format, "{place}");
        assert_eq!(capture.split_by.contains("test_filenames"), format == "transforms");
    }
}

#[test]
fn the_folder_that_holds_the_photos_is_named() {
    for (place, words) in [
        ("photos", "--images photos"),
        ("DCIM/100MEDIA", "--images DCIM/100MEDIA"),
        ("my photos", "--images 'my photos'"),
        ("elsewhere/a/b/c", "--images elsewhere/a/b"),
        ("a/b/c/d/e/f/g", "--images"),
    ] {
        let folder = text_model(&Scene::ring(12));
        let (images, moved) = (folder.path().join("images"), folder.path().join(place));
        std::fs::create_dir_all(moved.parent().unwrap()).unwrap();
        std::fs::rename(&images, &moved).unwrap();
        for is_empty in [false, true] {
            if is_empty {
                std::fs::create_dir(&images).unwrap();
            }
            let error = load(folder.path()).err().unwrap();
            assert!(error.exit_code() == 3 && error.to_string().ends_with(words), "{error}");
        }
    }
}

#[test]
fn the_folder_that_holds_the_photos_is_named_for_stored_paths_too() {
    for (stored, place, words) in [
        ("images/", "rgb", "--images rgb"),
        ("", "rgb", "--images rgb"),
        ("/home/me/x/images/", "rgb/sub", "--images rgb/sub"),
        ("images/", "pics/raw", "--images pics/raw"),
        ("images/", "masks", "--images"),
    ] {
        let (scene, folder) = (Scene::ring(12), tempfile::tempdir().unwrap());
        scene.write_photos(&folder.path().join(place), (12, 8));
        write_json(folder.path().join("transforms.json"), &scene.transforms(stored));
        let error = load(folder.path()).err().unwrap();
        assert!(error.exit_code() == 3 && error.to_string().ends_with(words), "{error}");
        if let Some(images) = words.strip_prefix("--images ") {
            let options = LoadOptions { images: Some(images.into()), ..LoadOptions::default() };
            assert_eq!(Capture::load(folder.path(), &options).unwrap().views.len(), 12, "{words}");
        }
    }
    // A row of a table that has no photo anywhere does not hide where the others are.
    let folder = csv(|row| row + "lost.png,0,0,1,0,80,0,30,0,0,0,0,0,0,0,0\n");
    std::fs::rename(folder.path().join("images"), folder.path().join("pics")).unwrap();
    let error = load(folder.path()).err().unwrap().to_string();
    assert!(error.ends_with("--images pics"), "{error}");
}

/// Moves the photos at these places of the order of names into a folder inside.
fn move_photos(images: &Path, inside: &str, which: impl Fn(usize) -> bool) {
    std::fs::create_dir(images.join(inside)).unwrap();
    for index in (1..=12).filter(|&index| which(index)) {
        let name = format!("p{index:02}.png");
        std::fs::rename(images.join(&name), images.join(inside).join(name)).unwrap();
    }
}

#[test]
fn photos_in_another_folder_than_the_stored_one_or_in_folders_inside_are_found() {
    for stored in ["photos/", "images/", ""] {
        for is_split in [false, true] {
            let (scene, folder) = (Scene::ring(12), tempfile::tempdir().unwrap());
            let images = folder.path().join("images");
            scene.write_photos(&images, (12, 8));
            write_json(folder.path().join("transforms.json"), &scene.transforms(stored));
            if is_split {
                move_photos(&images, "A", |index| index % 2 == 0);
                move_photos(&images, "B", |index| index % 2 == 1);
            }
            let found = load(folder.path());
            // Negative control: what is in folders inside another folder may be anything.
            let is_found = !(is_split && stored == "photos/");
            assert_eq!(found.map(|capture| capture.views.len()).ok(), is_found.then_some(12), "{stored}");
        }
    }
    let folder = text_model(&Scene::ring(12));
    move_photos(&folder.path().join("images"), "A", |_| true);
    assert_eq!(load(folder.path()).unwrap().views.len(), 12);
}

#[test]
fn photos_of_one_name_in_several_folders_are_named() {
    let folder = text_model(&Scene::ring(12));
    let images = folder.path().join("images");
    move_photos(&images, "A", |index| index % 2 == 0);
    move_photos(&images, "B", |index| index % 2 == 1);
    std::fs::create_dir(images.join("C")).unwrap();
    std::fs::copy(images.join("A/p02.png"), images.join("C/p02.png")).unwrap();
    std::fs::remove_file(images.join("B/p05.png")).unwrap();
    let capture = load(folder.path()).unwrap();
    assert_eq!(capture.views.len(), 10);
    let message = warning(&capture, "views-of-several-photos", 1);
    assert!(
        message.contains(r#"1 of 12 views is left out, since several photos fit each: "p02.png" may be "#)
    );
    assert!(message.contains("images/A/p02.png") && message.contains("images/C/p02.png"), "{message}");
    assert!(warning(&capture, "views-without-photo", 1).contains("\"p05.png\""));
    // Of all: an error that names the folders.
    let folder = text_model(&Scene::ring(12));
    let images = folder.path().join("images");
    Scene::ring(12).write_photos(&images.join("B"), (12, 8));
    move_photos(&images, "A", |_| true);
    let error = load(folder.path()).err().unwrap().to_string();
    let words = "several photos fit each of 12 of 12 views (\"p01.png\" may be";
    assert!(error.contains(words) && error.ends_with("--images images/A (or images/B)"), "{error}");
    // A folder that has every other photo is none to name.
    let halves = text_model(&Scene::ring(12));
    let inside = halves.path().join("images");
    move_photos(&inside, "A", |index| index % 2 == 0);
    move_photos(&inside, "B", |index| index % 2 == 1);
    Scene::ring(12).write_photos(&inside.join("RAW"), (12, 8));
    let error = load(halves.path()).err().unwrap().to_string();
    assert!(error.ends_with("--images images/RAW"), "{error}");
    // The extension tells them apart where it can.
    for index in 1..=12 {
        let name = format!("p{index:02}");
        std::fs::rename(images.join(format!("B/{name}.png")), images.join(format!("B/{name}.tif"))).unwrap();
    }
    assert_eq!(load(folder.path()).unwrap().views.len(), 12, "negative control");
}

#[test]
fn of_several_pose_files_the_largest_is_read_and_the_others_are_named() {
    let folder = csv(|row| row);
    let table = std::fs::read_to_string(folder.path().join("cameras.csv")).unwrap();
    assert!(!has_warning(&load(folder.path()).unwrap(), "several-pose-files"), "negative control");
    let part: Vec<&str> = table.lines().take(7).collect();
    std::fs::write(folder.path().join("a.csv"), part.join("\n")).unwrap();
    std::fs::write(folder.path().join("b.csv"), "name;size\n").unwrap();
    let capture = load(folder.path()).unwrap();
    assert_eq!(capture.views.len(), 12);
    let message = warning(&capture, "several-pose-files", 1);
    assert!(message.contains("cameras.csv (12 cameras)"), "{message}");
    assert!(message.contains("a.csv (5)") && !message.contains("b.csv"), "{message}");
    let capture = load(&folder.path().join("a.csv")).unwrap();
    assert_eq!((capture.views.len(), has_warning(&capture, "several-pose-files")), (5, false));
}

#[test]
fn pose_files_may_be_in_utf16_with_a_byte_order_mark() {
    let folder = csv(|row| row);
    let path = folder.path().join("cameras.csv");
    let units: Vec<u16> = std::fs::read_to_string(&path).unwrap().encode_utf16().collect();
    for (mark, to_bytes) in
        [(&[0xff, 0xfe][..], u16::to_le_bytes as fn(u16) -> [u8; 2]), (&[0xfe, 0xff], u16::to_be_bytes)]
    {
        let bytes = units.iter().copied().flat_map(to_bytes);
        std::fs::write(&path, mark.iter().copied().chain(bytes).collect::<Vec<u8>>()).unwrap();
        assert_eq!(load(folder.path()).unwrap().views.len(), 12);
    }
}

#[test]
fn a_photo_that_is_named_by_way_of_another_folder_is_counted_once() {
    let mut scene = Scene::ring(12);
    let folder = text_model(&scene);
    for image in &mut scene.images {
        image.name = format!("../images/{}", image.name);
    }
    scene.write_text(&folder.path().join("sparse/0"));
    let capture = load(folder.path()).unwrap();
    assert_eq!((capture.views.len(), capture.photos_without_pose), (12, 0));
    std::fs::copy(folder.path().join("images/p01.png"), folder.path().join("images/q.png")).unwrap();
    assert_eq!(load(folder.path()).unwrap().photos_without_pose, 1, "negative control");
}

/// Masks of all photos in a folder, called as `name` says.
fn write_masks(folder: &Path, name: impl Fn(&str) -> String) {
    std::fs::create_dir_all(folder).unwrap();
    for index in 1..=12 {
        let mask = image::GrayImage::from_fn(12, 8, |x, _| image::Luma([if x < 6 { 255 } else { 0 }]));
        mask.save(folder.join(name(&format!("p{index:02}")))).unwrap();
    }
}

#[test]
fn masks_in_one_folder_fit_photos_in_folders_inside() {
    for stored in ["A/", ""] {
        let mut scene = Scene::ring(12);
        let folder = text_model(&scene);
        let masks = folder.path().join("masks");
        write_masks(&masks, |stem| format!("{stem}_mask.png"));
        move_photos(&folder.path().join("images"), "A", |_| true);
        for image in &mut scene.images {
            image.name.insert_str(0, stored);
        }
        scene.write_text(&folder.path().join("sparse/0"));
        let capture = load(folder.path()).unwrap();
        assert!(!has_warning(&capture, "views-without-mask"), "{stored}");
        assert!(capture.target(3).unwrap().mask.is_some());
        // Masks in folders inside, of names without folders as well.
        move_masks(&masks, "A");
        assert!(!has_warning(&load(folder.path()).unwrap(), "views-without-mask"), "{stored}");
        move_masks(&masks.join("A"), "B");
        let found = load(folder.path()).unwrap();
        assert_eq!(has_warning(&found, "views-without-mask"), !stored.is_empty(), "negative control");
    }
    // A mask that two photos may claim belongs to none.
    let mut scene = Scene::ring(12);
    scene.images[0].name = "A/p12.png".to_owned();
    scene.images[1].name = "B/p12.png".to_owned();
    let folder = tempfile::tempdir().unwrap();
    for inside in ["A", "B"] {
        std::fs::create_dir_all(folder.path().join("images").join(inside)).unwrap();
    }
    scene.write(folder.path());
    write_masks(&folder.path().join("masks"), |stem| format!("{stem}.png"));
    let message = warning(&load(folder.path()).unwrap(), "views-without-mask", 2);
    assert!(message.contains("\"A/p12.png\", \"B/p12.png\""), "{message}");
}

fn move_masks(masks: &Path, inside: &str) {
    std::fs::create_dir(masks.join(inside)).unwrap();
    for index in 1..=12 {
        let name = format!("p{index:02}_mask.png");
        std::fs::rename(masks.join(&name), masks.join(inside).join(name)).unwrap();
    }
}

#[test]
fn masks_in_another_place_are_named_with_the_option_that_uses_them() {
    let with_suffix = |stem: &str| format!("{stem}_mask.png");
    let like_photos = |stem: &str| format!("{stem}.png");
    for (place, name, option) in [
        ("mask", &with_suffix as &dyn Fn(&str) -> String, "mask"),
        ("My-Masks", &like_photos, "My-Masks"),
        ("my segmentation", &like_photos, "'my segmentation'"),
        ("images_masks", &with_suffix, "images_masks"),
        ("images/masks", &like_photos, "images/masks"),
        ("images", &with_suffix, "images"),
        ("images", &|stem: &str| format!("{stem}.png.png"), "images"),
    ] {
        let folder = text_model(&Scene::ring(12));
        write_masks(&folder.path().join(place), name);
        let message = warning(&load(folder.path()).unwrap(), "masks-beside-not-used", 12);
        assert!(message.starts_with("masks of 12 of 12 views in "), "{message}");
        assert!(
            message
                .contains(&format!("; --set capture.masks={option} (inspect: --masks {option}) uses them")),
            "{message}"
        );
        let options = LoadOptions { masks: Some(place.into()), ..LoadOptions::default() };
        let capture = Capture::load(folder.path(), &options).unwrap();
        assert!(!has_warning(&capture, "masks-beside-not-used") && capture.target(0).unwrap().mask.is_some());
        assert_eq!(capture.views.len(), 12);
    }
    // Negative controls: images of other kinds, and masks of other photos.
    let folder = text_model(&Scene::ring(12));
    write_masks(&folder.path().join("depth"), like_photos);
    write_masks(&folder.path().join("mask"), |stem| format!("other_{stem}.png"));
    write_masks(&folder.path().join("images"), |stem| format!("{stem}_depth.png"));
    assert!(!has_warning(&load(folder.path()).unwrap(), "masks-beside-not-used"));
}

#[test]
fn a_mask_that_does_not_fit_is_no_fault_of_its_photo() {
    let folder = text_model(&Scene::ring(12));
    let masks = folder.path().join("masks");
    write_masks(&masks, |stem| format!("{stem}.png"));
    let good = load(folder.path()).unwrap().verdict();
    assert!(!good.reasons.iter().any(|reason| reason.code.starts_with("unreadable")), "negative control");
    image::GrayImage::new(8, 12).save(masks.join("p03.png")).unwrap();
    let reason = load(folder.path()).unwrap().verdict().reasons.remove(0);
    assert_eq!(
        (reason.code, reason.remedy),
        ("unreadable-masks", "replace the mask, or remove it: all pixels count then")
    );
    assert!(reason.found.contains("masks/p03.png"), "{}", reason.found);
}

#[test]
fn poses_in_another_folder_are_named_with_their_photos() {
    let folder = tempfile::tempdir().unwrap();
    let root = folder.path();
    let scene = Scene::ring(12);
    scene.write_text(&root.join("dslr/scan"));
    for place in ["dslr/resized", "dslr/resized_masks", "dslr/.thumbs"] {
        scene.write_photos(&root.join(place), (12, 8));
    }
    let error = load(root).err().unwrap().to_string();
    assert!(error.ends_with(&format!("--images {}", root.join("dslr/resized").display())), "{error}");
    scene.write_photos(&root.join("dslr/original"), (12, 8));
    let error = load(root).err().unwrap().to_string();
    assert!(
        error.contains("--images PHOTOS, where PHOTOS is one of") && error.contains("original"),
        "{error}"
    );
}

#[test]
fn points_named_by_a_path_on_another_computer_are_found() {
    for (stated, count) in
        [("C:\\proj\\points.ply", 5), ("/home/me/a/points.ply", 5), ("C:\\proj\\cloud.ply", 0)]
    {
        let folder = transforms(|mut json| {
            json["ply_file_path"] = stated.into();
            json.to_string()
        });
        write_points(&folder.path().join("points.ply"), 5);
        let capture = load(folder.path()).unwrap();
        assert_eq!(capture.points.len(), count, "{stated}");
        assert_eq!(has_warning(&capture, "points-file-missing"), count == 0);
    }
}
