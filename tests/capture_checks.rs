//! Faults of captures that no single reader detects: endless files, truncated photos, paths that leave the capture,
//! implausible cameras.

#![allow(clippy::unwrap_used, reason = "tests")]

#[path = "../src/capture/fixtures.rs"]
#[allow(dead_code, reason = "shared with the unit tests, which use all of it")]
mod fixtures;

use fixtures::{Scene, write_json};
use litetex_gs::capture::{Capture, LoadOptions};
use litetex_gs::views::ViewSource as _;
use litetex_gs::{Error, Report, Warning};
use std::io::Write as _;
use std::path::{Path, PathBuf};
use tempfile::{TempDir, tempdir};

fn load(root: &Path) -> Result<Capture, Error> {
    Capture::load(root, &LoadOptions::default())
}

fn message(root: &Path) -> String {
    load(root).err().expect("an error").to_string()
}

fn written(scene: &Scene) -> TempDir {
    let folder = tempdir().unwrap();
    scene.write(folder.path());
    folder
}

fn warning<'a>(report: &'a Report, code: &str) -> Option<&'a Warning> {
    report.warnings.iter().find(|w| w.code == code)
}

/// A capture of `transforms.json` and `images/`, with the JSON as `change` leaves it.
fn transforms(scene: &Scene, change: impl Fn(&mut serde_json::Value)) -> TempDir {
    let folder = tempdir().unwrap();
    scene.write_photos(&folder.path().join("images"), (12, 8));
    let mut json = scene.transforms("images/");
    change(&mut json);
    write_json(folder.path().join("transforms.json"), &json);
    folder
}

/// A ZIP archive of a folder's files.
fn archive_of(folder: &Path, archive: &Path) {
    let mut out = zip::ZipWriter::new(std::fs::File::create(archive).unwrap());
    let mut folders = vec![folder.to_owned()];
    while let Some(next) = folders.pop() {
        for entry in std::fs::read_dir(next).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                folders.push(path);
                continue;
            }
            let name = path.strip_prefix(folder).unwrap().to_str().unwrap().to_owned();
            out.start_file(name, zip::write::SimpleFileOptions::default()).unwrap();
            out.write_all(&std::fs::read(path).unwrap()).unwrap();
        }
    }
    out.finish().unwrap();
}

fn archived(folder: &TempDir) -> (TempDir, PathBuf) {
    let elsewhere = tempdir().unwrap();
    let archive = elsewhere.path().join("garden.zip");
    archive_of(folder.path(), &archive);
    (elsewhere, archive)
}

fn truncate(path: &Path) {
    let whole = std::fs::read(path).unwrap();
    std::fs::write(path, &whole[..whole.len() / 2 + 10]).unwrap();
}

#[cfg(unix)]
#[test]
fn devices_and_pipes_named_by_a_capture_are_refused_unread() {
    let pipe = |path: &Path| {
        assert!(std::process::Command::new("mkfifo").arg(path).status().unwrap().success());
    };
    let scene = Scene::ring(3);
    let points = transforms(&scene, |j| j["ply_file_path"] = "/dev/zero".into());
    let without = load(points.path()).unwrap();
    let is_named = |w: &litetex_gs::Warning| w.message.contains("/dev/zero: a device");
    assert!(without.points.is_empty() && without.report.warnings.iter().any(is_named));
    let masked = transforms(&scene, |j| j["frames"][1]["mask_path"] = "mask.png".into());
    pipe(&masked.path().join("mask.png"));
    let text = load(masked.path()).unwrap().check_photos().unwrap_err().to_string();
    assert!(text.contains("mask.png: a device or a pipe"), "{text}");
    let photo = written(&scene);
    std::fs::remove_file(photo.path().join("images/p02.png")).unwrap();
    pipe(&photo.path().join("images/p02.png"));
    assert!(message(photo.path()).contains("p02.png: a device or a pipe, expected a regular file"));
    let listed = LoadOptions { test_list: Some("/dev/zero".into()), ..LoadOptions::default() };
    let text = Capture::load(written(&scene).path(), &listed).err().unwrap().to_string();
    assert!(text.contains("/dev/zero: a device"), "{text}");
    let table = tempdir().unwrap();
    pipe(&table.path().join("cameras.csv"));
    assert!(message(table.path()).contains("no poses found"));
}

#[test]
fn photos_that_cannot_be_decoded_are_found_before_they_are_needed() {
    let folder = written(&Scene::ring(5));
    // p01 is held out, p02 and p03 are trained on.
    for name in ["p01.png", "p03.png"] {
        truncate(&folder.path().join("images").join(name));
    }
    let capture = load(folder.path()).unwrap();
    let text = capture.check_photos().unwrap_err().to_string();
    for part in ["images/p01.png", "unreadable image", "1 other view", "\"p03.png\""] {
        assert!(text.contains(part), "{part}: {text}");
    }
    let folder = written(&Scene::ring(5));
    let valid = load(folder.path()).unwrap();
    assert!(valid.check_photos().unwrap().warnings.is_empty());
    assert_eq!(valid.cached_bytes(), 5 * 12 * 8 * 3, "what was decoded is kept");
}

#[test]
fn truncated_but_decodable_jpegs_are_reported() {
    let mut scene = Scene::ring(4);
    scene.images.iter_mut().for_each(|i| i.name = i.name.replace("png", "jpg"));
    let folder = written(&scene);
    assert!(load(folder.path()).unwrap().check_photos().unwrap().warnings.is_empty());
    let path = folder.path().join("images/p02.jpg");
    let whole = std::fs::read(&path).unwrap();
    std::fs::write(&path, &whole[..whole.len() - 10]).unwrap();
    let report = load(folder.path()).unwrap().check_photos().unwrap();
    let found = warning(&report, "photos-truncated").unwrap();
    assert!(found.count == 1 && found.message.contains("images/p02.jpg"), "{}", found.message);
}

#[test]
fn memory_for_decoding_counts_bit_depth_channels_masks_and_resampling() {
    const PIXELS: u64 = 12 * 8;
    let folder = written(&Scene::ring(3));
    let images = folder.path().join("images");
    let at_once = |threads, max_resolution| {
        let options = LoadOptions { max_resolution, ..LoadOptions::default() };
        Capture::load(folder.path(), &options).unwrap().decoding_bytes(threads)
    };
    assert_eq!((at_once(1, 1600), at_once(2, 1600)), (3 * PIXELS, 6 * PIXELS));
    // Means in f32 and the result, of a quarter of the pixels.
    assert_eq!(at_once(1, 6), 3 * PIXELS + (4 + 1) * 3 * PIXELS / 4);
    // The 8-bit copy next to 16 bits; alpha is composited in f32.
    image::ImageBuffer::<image::Rgba<u16>, _>::new(12, 8).save(images.join("p02.png")).unwrap();
    assert_eq!(at_once(1, 1600), (8 + 4) * PIXELS + (4 + 1) * 3 * PIXELS);
    // The mask has 16 bits, too, and becomes 8-bit grey.
    std::fs::create_dir(folder.path().join("masks")).unwrap();
    let mask = image::ImageBuffer::<image::Rgba<u16>, _>::new(12, 8);
    mask.save(folder.path().join("masks/p02.png")).unwrap();
    assert_eq!(at_once(1, 1600), (8 + 4) * PIXELS + (4 * 2 + 1) * PIXELS + (4 + 1) * 4 * PIXELS);
}

#[test]
fn fully_masked_training_views_are_reported() {
    let folder = written(&Scene::ring(5));
    let masks = folder.path().join("masks");
    std::fs::create_dir(&masks).unwrap();
    for index in 1..=5 {
        // p01, which is held out, and p04 are black.
        let value = if [1, 4].contains(&index) { 0 } else { 255 };
        let mask = image::GrayImage::from_pixel(12, 8, image::Luma([value]));
        mask.save(masks.join(format!("p{index:02}.png"))).unwrap();
    }
    let report = load(folder.path()).unwrap().check_photos().unwrap();
    let found = warning(&report, "views-masked-out").unwrap();
    assert!(found.count == 1 && found.message.contains("\"p04.png\""), "{}", found.message);
}

#[test]
fn files_outside_the_capture_warn_in_folders_and_fail_in_archives() {
    let scene = Scene::ring(3);
    let outside = tempdir().unwrap();
    scene.write_photos(outside.path(), (12, 8));
    let photo = outside.path().join("p02.png").display().to_string();
    let leads_out: [&dyn Fn(&mut serde_json::Value); 3] = [
        &|j| j["frames"][1]["file_path"] = photo.as_str().into(),
        &|j| j["frames"][1]["mask_path"] = photo.as_str().into(),
        &|j| j["frames"][1]["file_path"] = "images/../../p02.png".into(),
    ];
    for (case, change) in leads_out.into_iter().enumerate() {
        let folder = transforms(&scene, change);
        let in_folder = load(folder.path()).unwrap();
        let found = warning(&in_folder.report, "files-outside-the-capture");
        // Nothing lies at the path of the last case.
        assert_eq!(found.is_some_and(|w| w.count == 1 && w.message.contains("p02.png")), case < 2);
        let (_kept, archive) = archived(&folder);
        let text = message(&archive);
        assert!(text.contains("garden.zip") && text.contains("outside the archive"), "{text}");
    }
    let folder = transforms(&scene, |j| j["ply_file_path"] = "/dev/zero".into());
    let (_kept, archive) = archived(&folder);
    assert!(message(&archive).contains("\"/dev/zero\" is outside the archive"));
    let folder = transforms(&scene, |j| j["frames"][1]["file_path"] = "images/../images/p02.png".into());
    let (_kept, archive) = archived(&folder);
    for path in [folder.path(), &archive] {
        let inside = load(path).unwrap();
        assert!(inside.views.len() == 3 && warning(&inside.report, "files-outside-the-capture").is_none());
    }
}

#[test]
fn folders_that_the_user_names_may_lie_outside_an_archive() {
    let scene = Scene::ring(3);
    let (elsewhere, apart) = (tempdir().unwrap(), tempdir().unwrap());
    // Photos of the same names serve as masks; a photo is no mask of its own.
    for place in [&elsewhere, &apart] {
        scene.write_photos(place.path(), (12, 8));
    }
    let (photos, masks) = (Some(elsewhere.path().to_owned()), apart.path().to_owned());
    let named = LoadOptions { images: photos, masks: Some(masks), ..LoadOptions::default() };
    for folder in [written(&scene), transforms(&scene, |_| {})] {
        let (_kept, archive) = archived(&folder);
        let capture = Capture::load(&archive, &named).unwrap();
        assert_eq!(capture.views.len(), 3);
        for code in ["files-outside-the-capture", "views-without-mask"] {
            assert!(warning(&capture.report, code).is_none(), "{:?}", capture.report);
        }
        assert!(capture.check_photos().is_ok());
    }
    // Negative control: the archive's own names must not lead out of the named folder either.
    std::fs::create_dir(elsewhere.path().join("inner")).unwrap();
    let mut sly = scene.clone();
    sly.images[0].name = "../p01.png".to_owned();
    let folder = written(&scene);
    sly.write_binary(&folder.path().join("sparse/0"));
    let (_kept, archive) = archived(&folder);
    let named = LoadOptions { images: Some(elsewhere.path().join("inner")), ..LoadOptions::default() };
    let text = Capture::load(&archive, &named).err().unwrap().to_string();
    assert!(text.contains("\"../p01.png\" is outside the archive"), "{text}");
}

#[test]
fn folders_of_photos_and_masks_that_are_none_are_named_for_what_they_are() {
    let folder = written(&Scene::ring(3));
    let file = folder.path().join("images/p01.png");
    let mut cases = vec![(file, "is a file, expected a folder"), ("/nowhere".into(), "no such folder")];
    if cfg!(unix) {
        cases.push(("/dev/zero".into(), "is a device or a pipe, expected a folder"));
    }
    for (path, what) in cases {
        let images = LoadOptions { images: Some(path.clone()), ..LoadOptions::default() };
        let masks = LoadOptions { masks: Some(path.clone()), ..LoadOptions::default() };
        for (options, option) in [(images, "--images"), (masks, "capture.masks")] {
            let text = Capture::load(folder.path(), &options).err().unwrap().to_string();
            let expected = format!("{}: {what}; {option} takes", path.display());
            assert!(text.starts_with(&expected), "{text}");
        }
    }
}

#[test]
fn names_of_megabytes_give_short_messages() {
    let scene = Scene::ring(3);
    let long = "x".repeat(3 << 20);
    let changes: [&dyn Fn(&mut serde_json::Value); 5] = [
        &|j| j["camera_model"] = long.as_str().into(),
        &|j| j["ply_file_path"] = long.as_str().into(),
        &|j| j["fl_x"] = long.as_str().into(),
        &|j| j["frames"][1]["mask_path"] = long.as_str().into(),
        &|j| j["frames"][1]["file_path"] = long.as_str().into(),
    ];
    for (case, change) in changes.into_iter().enumerate() {
        let folder = transforms(&scene, change);
        let texts: Vec<String> = match load(folder.path()) {
            Err(error) => vec![error.to_string()],
            Ok(capture) => {
                let errors = capture.check_photos().err().map(|e| e.to_string());
                capture.report.warnings.iter().map(|w| w.message.clone()).chain(errors).collect()
            }
        };
        assert!(texts.iter().any(|text| text.contains("xxx")), "case {case}: {texts:?}");
        for text in texts {
            assert!(text.len() < 5000 && text.contains('…') == text.contains("xxx"), "case {case}: {text}");
        }
    }
}

#[test]
fn messages_name_the_archive_not_a_temporary_file() {
    let folder = written(&Scene::ring(3));
    let masks = folder.path().join("masks");
    std::fs::create_dir(&masks).unwrap();
    truncate(&folder.path().join("images/p02.png"));
    let (_kept, archive) = archived(&folder);
    let shown = archive.display().to_string();
    let temporary = std::env::temp_dir().join("litetex-").display().to_string();
    let capture = load(&archive).unwrap();
    let mut texts = vec![
        capture.check_photos().unwrap_err().to_string(),
        capture.target(1).unwrap_err().to_string(),
        capture.root.display().to_string(),
        capture.poses.display().to_string(),
    ];
    drop(capture);
    truncate(&folder.path().join("sparse/0/cameras.bin"));
    let (_kept, archive) = archived(&folder);
    texts.push(message(&archive).replace(&archive.display().to_string(), &shown));
    for text in texts {
        assert!(text.contains(&shown) && !text.contains(&temporary), "{text}");
    }
}

#[test]
fn implausible_cameras_and_sizes_give_warnings_naming_views() {
    let codes = [
        "implausible-focal-lengths",
        "photos-far-smaller-than-cameras",
        "views-too-small",
        "implausible-principal-points",
    ];
    let check = |change: &dyn Fn(&mut Scene), max_resolution, expected: &str| {
        let mut scene = Scene::ring(3);
        scene.cameras[0] =
            fixtures::Camera { size: (48, 32), params: vec![40., 44., 24., 16.], ..scene.cameras[0].clone() };
        change(&mut scene);
        let folder = tempdir().unwrap();
        scene.write_binary(&folder.path().join("sparse/0"));
        scene.write_photos(&folder.path().join("images"), (48, 32));
        let options = LoadOptions { max_resolution, ..LoadOptions::default() };
        let report = Capture::load(folder.path(), &options).unwrap().report;
        for code in codes {
            let found = warning(&report, code);
            assert_eq!(found.is_some(), code == expected, "{code}, expected {expected:?}");
            assert!(found.is_none_or(|w| w.count == 3 && w.message.contains("\"p01.png\"")));
            assert!(found.is_none_or(|w| w.message.len() < 400), "{found:?}");
        }
    };
    check(&|_| {}, 1600, "");
    for focal_px in [1e-300, 1e-3, 4.0, 2000.0, 1e12, 1e300] {
        let change = |scene: &mut Scene| scene.cameras[0].params[..2].fill(focal_px);
        check(&change, 1600, codes[0]);
    }
    check(&|scene| scene.cameras[0].params[0] = 100.0, 1600, codes[0]);
    // Image of 48 x 32: beside it is plausible, further off than its own size is not.
    for (index, centre_px, expected) in
        [(2, 96.0, ""), (3, -32.0, ""), (2, 97.0, codes[3]), (3, -33.0, codes[3]), (3, 1e9, codes[3])]
    {
        check(&|scene| scene.cameras[0].params[index] = centre_px, 1600, expected);
    }
    let huge = |scene: &mut Scene| {
        scene.cameras[0].size = (48_000, 32_000);
        scene.cameras[0].params = vec![40e3, 44e3, 24e3, 16e3];
    };
    check(&huge, 1600, codes[1]);
    check(&|_| {}, 15, codes[2]);
}

#[test]
fn byte_order_marks_are_skipped() {
    let scene = Scene::ring(3);
    let folder = transforms(&scene, |_| {});
    let path = folder.path().join("transforms.json");
    let mut marked = b"\xef\xbb\xbf".to_vec();
    marked.extend(std::fs::read(&path).unwrap());
    std::fs::write(&path, marked).unwrap();
    assert_eq!(load(folder.path()).unwrap().views.len(), 3);
    let list = folder.path().join("test.txt");
    std::fs::write(&list, "\u{feff}p02.png\n").unwrap();
    let options = LoadOptions { test_list: Some(list), ..LoadOptions::default() };
    let capture = Capture::load(folder.path(), &options).unwrap();
    assert_eq!(capture.indices(litetex_gs::views::Split::Test), [1]);
}
