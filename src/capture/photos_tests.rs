//! Photos and masks as other programs and people leave them: splits, flags, names, masks, EXIF data, sizes.

use super::fixtures::{Scene, write_json};
use super::*;
use crate::views::{Split, ViewSource as _};
use crate::{Report, Warning};
use serde_json::{Value, json};
use std::path::Path;
use tempfile::{TempDir, tempdir};

/// A capture of six views in `transforms.json`, with the JSON as `change` leaves it.
fn transforms(change: impl Fn(&mut Value)) -> TempDir {
    let scene = Scene::ring(6);
    let folder = tempdir().unwrap();
    scene.write_photos(&folder.path().join("images"), (12, 8));
    let mut json = scene.transforms("images/");
    change(&mut json);
    write_json(folder.path().join("transforms.json"), &json);
    folder
}

fn load(root: &Path) -> Capture {
    Capture::load(root, &LoadOptions::default()).unwrap()
}

fn message(root: &Path, options: &LoadOptions) -> String {
    Capture::load(root, options).err().unwrap().to_string()
}

fn held_out(capture: &Capture) -> Vec<&str> {
    capture.indices(Split::Test).into_iter().map(|v| capture.name(v)).collect()
}

fn warning<'a>(report: &'a Report, code: &str) -> Option<&'a Warning> {
    report.warnings.iter().find(|w| w.code == code)
}

#[test]
fn lists_of_a_transforms_json_decide_the_split_and_are_named() {
    let control = transforms(|_| {});
    assert_eq!(held_out(&load(control.path())), ["p01.png"], "negative control: every 8th");
    assert!(load(control.path()).held_out().contains("--test-every 8"));
    let names =
        |numbers: &[u32]| json!(numbers.iter().map(|n| format!("images/p{n:02}.png")).collect::<Vec<_>>());
    let folder = transforms(|j| {
        j["train_filenames"] = names(&[1, 2, 3, 4]);
        j["val_filenames"] = json!(["p05"]);
        j["test_filenames"] = json!(["p06.png"]);
    });
    let capture = load(folder.path());
    assert_eq!(held_out(&capture), ["p05.png", "p06.png"]);
    let words = "2 of 6 views are held out: train_filenames and val_filenames and test_filenames of \"transforms.json\"";
    assert_eq!(capture.held_out(), words);
    // The user's list goes before.
    let list = folder.path().join("list.txt");
    std::fs::write(&list, "p02").unwrap();
    let listed = LoadOptions { test_list: Some(list), ..LoadOptions::default() };
    let capture = Capture::load(folder.path(), &listed).unwrap();
    assert!(held_out(&capture) == ["p02.png"] && capture.split_by.contains("--test-list"));
    let folder = transforms(|j| j["train_filenames"] = names(&[1, 3, 5]));
    assert_eq!(held_out(&load(folder.path())), ["p02.png", "p04.png", "p06.png"]);
    let folder = transforms(|j| {
        j["train_filenames"] = names(&[1, 3, 5]);
        j["test_filenames"] = names(&[2]);
    });
    let capture = load(folder.path());
    assert_eq!((capture.num_views(), held_out(&capture)), (4, vec!["p02.png"]));
    assert_eq!(warning(&capture.report, "frames-in-no-split").unwrap().count, 2);
    let folder = transforms(|j| j["test_filenames"] = json!(["nowhere.png"]));
    let text = message(folder.path(), &LoadOptions::default());
    assert!(text.contains("test_filenames") && text.contains("\"nowhere.png\""), "{text}");
}

#[test]
fn other_layouts_state_the_split_and_bad_frames_are_left_out() {
    let folder = transforms(|j| {
        let frames = j["frames"].as_array_mut().unwrap();
        frames[0]["is_bad"] = true.into();
        frames[1]["is_bad"] = false.into();
        let test = frames.split_off(4);
        j["test_frames"] = test.into();
    });
    let capture = load(folder.path());
    assert_eq!((capture.num_views(), held_out(&capture)), (5, vec!["p01.png", "p02.png"]));
    let bad = warning(&capture.report, "frames-marked-bad").unwrap();
    assert!(bad.count == 1 && bad.message.contains("p06.png"), "{}", bad.message);
    assert!(capture.split_by.contains("test_frames"));
    let folder = transforms(|j| {
        j["frames"][2]["split"] = "val".into();
        j["frames"][3]["split"] = "train".into();
    });
    assert_eq!(held_out(&load(folder.path())), ["p04.png"]);
    let folder = transforms(|_| {});
    write_json(folder.path().join("splits.json"), &json!({"scenes": 3}));
    assert_eq!(held_out(&load(folder.path())), ["p01.png"], "a file of that name that holds something else");
    write_json(folder.path().join("splits.json"), &json!({"train": ["room"], "test": ["kitchen"]}));
    let capture = load(folder.path());
    assert_eq!(held_out(&capture), ["p01.png"], "a list of other captures");
    assert!(warning(&capture.report, "split-list-of-others").is_some());
    let lists =
        json!({"train": ["p01.JPG", "p02.JPG", "p03.JPG", "p04.JPG"], "test": ["p05.JPG", "p06.JPG"]});
    write_json(folder.path().join("train_test_lists.json"), &lists);
    let capture = load(folder.path());
    assert_eq!(held_out(&capture), ["p05.png", "p06.png"]);
    assert_eq!(capture.split_by, "train and test of \"train_test_lists.json\"");
    let folder = transforms(|j| {
        j["frames"].as_array_mut().unwrap().iter_mut().for_each(|f| f["is_bad"] = true.into());
    });
    assert!(message(folder.path(), &LoadOptions::default()).contains("6 of 6 are marked as bad"));
}

#[test]
fn a_photo_is_not_taken_for_its_own_missing_mask() {
    let folder = transforms(|j| {
        for frame in j["frames"].as_array_mut().unwrap() {
            frame["mask_path"] = frame["file_path"].as_str().unwrap().replace(".png", ".jpg").into();
        }
    });
    let capture = load(folder.path());
    assert_eq!(warning(&capture.report, "views-without-mask").unwrap().count, 6);
    let folder = transforms(|j| j["frames"][0]["mask_path"] = "images/p02.jpg".into());
    let capture = load(folder.path());
    assert_eq!(
        warning(&capture.report, "views-without-mask").unwrap().count,
        5,
        "negative control: another photo"
    );
}

#[test]
fn backslashes_are_turned_in_every_path_and_missing_masks_warn_at_once() {
    let folder = transforms(|j| {
        j["ply_file_path"] = "sub\\points.ply".into();
        for frame in j["frames"].as_array_mut().unwrap() {
            let name = frame["file_path"].as_str().unwrap().replace("images/", "");
            frame["file_path"] = format!(".\\images\\{name}").into();
            frame["mask_path"] = format!("sub\\{name}").into();
        }
    });
    let sub = folder.path().join("sub");
    std::fs::create_dir(&sub).unwrap();
    let ply = "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\n\
               property float z\nend_header\n0.5 0 0\n";
    std::fs::write(sub.join("points.ply"), ply).unwrap();
    let mask = image::GrayImage::from_fn(12, 8, |x, _| image::Luma([if x < 7 { 255 } else { 0 }]));
    for number in 1..=4 {
        mask.save(sub.join(format!("p{number:02}.png"))).unwrap();
    }
    let capture = load(folder.path());
    assert_eq!((capture.num_views(), capture.points.len()), (6, 1));
    let missing = warning(&capture.report, "views-without-mask").unwrap();
    assert!(missing.count == 2 && missing.message.contains("p06.png"), "{}", missing.message);
    assert!(capture.target(0).unwrap().mask.is_some() && capture.target(5).unwrap().mask.is_none());
    assert!(capture.check_photos().unwrap().warnings.is_empty());
}

#[test]
fn masks_of_cut_outs_lie_in_alpha_and_nearly_empty_ones_warn() {
    let folder = transforms(|_| {});
    let masks = folder.path().join("masks");
    std::fs::create_dir(&masks).unwrap();
    // Columns below `kept` count; of a cut-out the colours say nothing.
    let write = |kept: u32, in_alpha: bool| {
        for number in 1..=6 {
            let mask = image::RgbaImage::from_fn(12, 8, |x, y| {
                let on = if x < kept { 255 } else { 0 };
                if in_alpha {
                    image::Rgba([20 * y as u8, 9, 200, on])
                } else {
                    image::Rgba([on, on, on, 255])
                }
            });
            mask.save(masks.join(format!("p{number:02}.png"))).unwrap();
        }
        load(folder.path())
    };
    let columns = |kept: usize| Some([vec![255; kept], vec![0; 12 - kept]].concat().repeat(8));
    for in_alpha in [true, false] {
        let capture = write(2, in_alpha);
        assert_eq!(capture.target(0).unwrap().mask, columns(2));
        assert!(capture.check_photos().unwrap().warnings.is_empty(), "negative control: 83 % are left out");
        let report = write(1, in_alpha).check_photos().unwrap();
        let found = warning(&report, "views-nearly-masked-out").unwrap();
        assert!(found.count == 6 && found.message.contains("91.7 % in the median"), "{}", found.message);
        assert!(found.message.contains("mask-invert"));
    }
}

/// Puts an EXIF segment with this orientation into every JPEG of a folder.
fn set_orientation(photos: &Path, orientation: u8) {
    let tiff =
        [&b"II*\0\x08\0\0\0\x01\0\x12\x01\x03\0\x01\0\0\0"[..], &[orientation, 0, 0, 0], &[0; 4]].concat();
    let exif = [&b"Exif\0\0"[..], &tiff].concat();
    let segment = [&[0xff, 0xe1][..], &(exif.len() as u16 + 2).to_be_bytes(), &exif].concat();
    for entry in std::fs::read_dir(photos).unwrap() {
        let path = entry.unwrap().path();
        let bytes = std::fs::read(&path).unwrap();
        // A segment that was put in before goes.
        let rest = if bytes[2..4] == [0xff, 0xe1] { 2 + segment.len() } else { 2 };
        std::fs::write(&path, [&bytes[..2], &segment, &bytes[rest..]].concat()).unwrap();
    }
}

#[test]
fn turns_in_exif_data_that_the_sides_do_not_show_are_warned_of_and_obeyed_on_request() {
    let mut scene = Scene::ring(3);
    scene.images.iter_mut().for_each(|i| i.name = i.name.replace("png", "jpg"));
    let folder = tempdir().unwrap();
    scene.write(folder.path());
    let images = folder.path().join("images");
    let with = |exif| Capture::load(folder.path(), &LoadOptions { exif, ..LoadOptions::default() });
    let stored = with(ExifTurn::Auto).unwrap();
    assert!(warning(&stored.report, "photos-turned-by-exif").is_none(), "negative control: no EXIF data");
    let stored = stored.target(0).unwrap();
    let reversed: Vec<u8> = stored.rgb.as_chunks::<3>().0.iter().rev().flatten().copied().collect();
    set_orientation(&images, 3);
    let capture = with(ExifTurn::Auto).unwrap();
    let found = warning(&capture.report, "photos-turned-by-exif").unwrap();
    assert!(found.count == 3 && found.message.contains("\"p01.jpg\""), "{}", found.message);
    assert_eq!(capture.target(0).unwrap().rgb, stored.rgb);
    for (exif, rgb) in [(ExifTurn::Ignore, &stored.rgb), (ExifTurn::Apply, &reversed)] {
        let capture = with(exif).unwrap();
        assert!(warning(&capture.report, "photos-turned-by-exif").is_none());
        assert_eq!(capture.target(0).unwrap().rgb, *rgb, "{exif:?}");
    }
    set_orientation(&images, 2);
    assert!(warning(&with(ExifTurn::Auto).unwrap().report, "photos-turned-by-exif").is_some(), "mirrored");
    // Sides that only fit as stored leave nothing open.
    set_orientation(&images, 6);
    let capture = with(ExifTurn::Auto).unwrap();
    assert!(warning(&capture.report, "photos-turned-by-exif").is_none());
    let text = with(ExifTurn::Apply).err().unwrap().to_string();
    assert!(text.contains("8x12 pixels once turned as its EXIF data ask"), "{text}");
    // And those of a camera in portrait only turned.
    scene.cameras[0].size = (8, 12);
    scene.write_binary(&folder.path().join("sparse/0"));
    assert_eq!(with(ExifTurn::Auto).unwrap().target(0).unwrap().width_px, 8);
    assert!(with(ExifTurn::Ignore).err().unwrap().to_string().contains("size mismatch"));
}

#[test]
fn wide_lenses_say_what_is_lost_and_auto_keeps_more() {
    let mut scene = Scene::ring(3);
    scene.cameras[0].model = (5, "OPENCV_FISHEYE");
    scene.cameras[0].size = (160, 120);
    scene.cameras[0].params = vec![48.0, 48.0, 80.0, 60.0, 0.0, 0.0, 0.0, 0.0];
    let folder = tempdir().unwrap();
    scene.write(folder.path());
    let with = |undistort_focal| {
        let options = LoadOptions { undistort_focal, ..LoadOptions::default() };
        Capture::load(folder.path(), &options).unwrap()
    };
    let (lens, auto) = (with(UndistortFocal::Lens), with(UndistortFocal::Auto));
    let share = |capture: &Capture| capture.undistortion.as_ref().unwrap().kept_share_min;
    let found = warning(&lens.report, "undistortion-loses-pixels").unwrap();
    assert!(found.count == 3 && found.message.contains("undistort-focal=auto"), "{}", found.message);
    assert!(share(&lens) < 0.45 && share(&auto) > 0.55, "{} {}", share(&lens), share(&auto));
    let focal = |capture: &Capture| capture.views[0].camera.pinhole.fx_px;
    assert_eq!((focal(&lens), focal(&auto)), (48.0, 24.0));
    // The photo shows the angle from the axis as red: the pinhole image must show it where its own camera says.
    let angle_of = |theta: f64| (100.0 * theta) as u8;
    for image in &scene.images {
        let photo = image::RgbImage::from_fn(160, 120, |x, y| {
            let (x, y) = (f64::from(x) + 0.5 - 80.0, f64::from(y) + 0.5 - 60.0);
            image::Rgb([angle_of(x.hypot(y) / 48.0), 0, 0])
        });
        photo.save(folder.path().join("images").join(&image.name)).unwrap();
    }
    for capture in [with(UndistortFocal::Lens), with(UndistortFocal::Auto)] {
        let (image, focal) = (capture.target(0).unwrap(), focal(&capture));
        assert!(image.mask.is_none(), "the photo covers both pinhole images");
        for (x, y) in [(80, 60), (20, 60), (150, 20), (90, 110)] {
            let r = (f64::from(x) + 0.5 - 80.0).hypot(f64::from(y) + 0.5 - 60.0) / focal;
            let red = image.rgb[3 * (160 * y as usize + x as usize)];
            assert!(red.abs_diff(angle_of(r.atan())) <= 2, "{x} {y}: {red} {r}");
        }
    }
    let plain = tempdir().unwrap();
    Scene::ring(3).write(plain.path());
    assert!(load(plain.path()).undistortion.is_none(), "negative control");
}

#[test]
fn large_photos_are_within_a_limit_that_the_message_lifts() {
    let mut scene = Scene::ring(3);
    let folder = tempdir().unwrap();
    scene.write(folder.path());
    scene.cameras[0].size = (17_000, 12_000);
    scene.write_binary(&folder.path().join("sparse/0"));
    // 204 megapixels, of which the file holds the header only: more than image libraries decode unasked.
    let chunk = |kind: &[u8; 4], data: &[u8]| {
        let body = [&kind[..], data].concat();
        [&(data.len() as u32).to_be_bytes()[..], &body, &crc32(&body).to_be_bytes()].concat()
    };
    let size = [17_000_u32.to_be_bytes(), 12_000_u32.to_be_bytes()].concat();
    let header = chunk(b"IHDR", &[&size[..], &[8, 2, 0, 0, 0]].concat());
    let photo = [b"\x89PNG\r\n\x1a\n", &header[..], &chunk(b"IDAT", &[])].concat();
    for image in &scene.images {
        std::fs::write(folder.path().join("images").join(&image.name), &photo).unwrap();
    }
    let limited = |photo_memory_bytes| LoadOptions { photo_memory_bytes, ..LoadOptions::default() };
    let capture = Capture::load(folder.path(), &LoadOptions::default()).unwrap();
    let text = capture.target(0).unwrap_err().to_string();
    assert!(text.contains("unreadable image"), "the data are missing, the memory is not: {text}");
    let text = message(folder.path(), &limited(500 << 20));
    for part in ["p01.png", "17000x12000", "one photo may take 500.0 MiB", "capture.photo-memory-bytes="] {
        assert!(text.contains(part), "{part}: {text}");
    }
    let asked = text.split("photo-memory-bytes=").nth(1).unwrap().split(' ').next().unwrap().parse().unwrap();
    assert!(Capture::load(folder.path(), &limited(asked)).is_ok(), "the remedy helps");
    assert!(Capture::load(folder.path(), &limited(asked - 1)).is_err());
}

/// The checksum of PNG.
fn crc32(bytes: &[u8]) -> u32 {
    !bytes.iter().fold(u32::MAX, |crc, &byte| {
        (0..8).fold(crc ^ u32::from(byte), |crc, _| (crc >> 1) ^ if crc & 1 == 1 { 0xedb8_8320 } else { 0 })
    })
}

/// A COLMAP model of six views with these names, and their photos under others.
fn renamed(names: &[&str], files: &[&str]) -> TempDir {
    let mut scene = Scene::ring(6);
    let folder = tempdir().unwrap();
    scene.write_photos(&folder.path().join("images"), (12, 8));
    for (index, file) in files.iter().enumerate() {
        let photo = image::RgbImage::from_pixel(12, 8, image::Rgb([index as u8 + 1; 3]));
        photo.save(folder.path().join("images").join(file)).unwrap();
    }
    for (image, name) in scene.images.iter_mut().zip(names) {
        let _ = std::fs::remove_file(folder.path().join("images").join(&image.name));
        image.name = (*name).to_owned();
    }
    scene.write_binary(&folder.path().join("sparse/0"));
    folder
}

#[test]
fn a_photo_belongs_to_one_view_and_exact_names_go_first() {
    for (names, files, lost, owner) in [
        (["img_1.png", "IMG_1.png"], &["IMG_1.png"][..], "img_1.png", Some("IMG_1.png")),
        (["a.png", "a.webp"], &["a.webp"], "a.png", Some("a.webp")),
        (["b.tif", "x/b.png"], &["b.png"], "x/b.png", Some("b.tif")),
        (["c.tif", "c.jpg"], &["c.png"], "c.jpg", None),
    ] {
        let folder = renamed(&names, files);
        let capture = load(folder.path());
        let left = if owner.is_some() { 1 } else { 2 };
        assert_eq!(capture.views.len(), 6 - left, "{names:?}");
        assert_eq!(warning(&capture.report, "views-without-photo").unwrap().count, left);
        let found = warning(&capture.report, "photos-of-other-views").unwrap();
        assert!(found.count == left && found.message.contains(&format!("\"{lost}\" (")), "{}", found.message);
        let is_there = |name: &str| capture.views.iter().any(|v| v.name == name);
        assert_eq!(owner.map(is_there), owner.map(|_| true));
        assert!(!is_there(lost));
    }
    // Negative control: a file for each.
    let capture = load(renamed(&["img_1.png", "IMG_1.png"], &["img_1.png", "IMG_1.png"]).path());
    assert_eq!((capture.views.len(), warning(&capture.report, "photos-of-other-views")), (6, None));
    // Too few are left: refused as photos that are missing.
    let names = ["1/a.tif", "2/a.tif", "3/a.tif", "4/a.tif", "5/a.tif", "6/a.tif"];
    let text = message(renamed(&names, &["a.png"]).path(), &LoadOptions::default());
    assert!(text.contains("photos of 6 of 6 views are missing"), "{text}");
}

#[test]
fn labels_of_one_photo_do_not_refuse_the_capture() {
    let folder = transforms(|j| {
        let mut again = j["frames"][0].clone();
        again["file_path"] = "images/P06.png".into();
        j["frames"].as_array_mut().unwrap().push(again);
    });
    let capture = load(folder.path());
    assert_eq!(capture.views.len(), 6);
    assert!(
        warning(&capture.report, "photos-of-other-views").unwrap().message.contains("\"images/P06.png\"")
    );
}

#[test]
fn a_mask_beside_the_photos_is_not_taken_for_a_missing_photo() {
    let folder = renamed(&["a.jpg", "b.jpg"], &["a.jpg.png", "b.webp", "b.jpg.png"]);
    let capture = load(folder.path());
    assert_eq!(capture.views.len(), 5);
    assert!(warning(&capture.report, "views-without-photo").unwrap().message.contains("\"a.jpg\""));
    assert_eq!(capture.target(0).unwrap().rgb[0], 2, "negative control: of b the photo, not the mask");
}

#[test]
fn a_mask_belongs_to_one_photo_too() {
    let folder = renamed(&["a.png", "a.webp"], &["a.png", "a.webp"]);
    let masks = folder.path().join("masks");
    std::fs::create_dir(&masks).unwrap();
    half_mask(12, 8).save(masks.join("a.png")).unwrap();
    let capture = load(folder.path());
    let is_masked = |v: usize| capture.target(v).unwrap().mask.is_some();
    assert_eq!((is_masked(0), is_masked(1)), (true, false));
    half_mask(12, 8).save(masks.join("a.webp.png")).unwrap();
    let capture = load(folder.path());
    assert!(capture.target(1).unwrap().mask.is_some(), "negative control");
}

/// A mask that leaves out its right half, and of the left the lower half.
fn half_mask(width_px: u32, height_px: u32) -> image::GrayImage {
    image::GrayImage::from_fn(width_px, height_px, |x, y| {
        image::Luma([if 2 * x < width_px && 2 * y < height_px { 255 } else { 0 }])
    })
}

/// A capture of six JPEG photos of `size` whose EXIF data ask for turns, one for each photo, and masks; its cameras have
/// the photos' stored size or the turned one.
fn turned(
    size: (u32, u32),
    orientations: [u8; 6],
    is_turned: bool,
    mask: impl Fn(usize) -> image::GrayImage,
) -> TempDir {
    let mut scene = Scene::ring(6);
    scene.images.reverse();
    scene.images.iter_mut().for_each(|i| i.name = i.name.replace("png", "jpg"));
    let camera = scene.cameras[0].clone();
    scene.cameras.clear();
    let folder = tempdir().unwrap();
    let photos = folder.path().join("images");
    let masks = folder.path().join("masks");
    std::fs::create_dir(&masks).unwrap();
    scene.write_photos(&photos, size);
    for (index, image) in scene.images.iter_mut().enumerate() {
        let alone = tempdir().unwrap();
        let path = alone.path().join(&image.name);
        std::fs::copy(photos.join(&image.name), &path).unwrap();
        set_orientation(alone.path(), orientations[index]);
        std::fs::copy(&path, photos.join(&image.name)).unwrap();
        mask(index).save(masks.join(image.name.replace("jpg", "png"))).unwrap();
        let swaps = is_turned && orientations[index] > 4;
        let mut own = camera.clone();
        own.id = index as u32 + 1;
        own.size = if swaps { (size.1, size.0) } else { size };
        image.camera_id = own.id;
        scene.cameras.push(own);
    }
    scene.write_binary(&folder.path().join("sparse/0"));
    folder
}

/// Which quarter of a target image counts: "top left".
fn quarter(capture: &Capture, view: usize) -> String {
    let image = capture.target(view).unwrap();
    let (w, h) = (image.width_px as usize, image.height_px as usize);
    let mask = image.mask.as_ref().unwrap();
    let at = |x: usize, y: usize| mask[y * w + x] == 255;
    let corners = [
        (0, 0, "top left"),
        (w - 1, 0, "top right"),
        (0, h - 1, "bottom left"),
        (w - 1, h - 1, "bottom right"),
    ];
    let found: Vec<&str> = corners.iter().filter(|(x, y, _)| at(*x, *y)).map(|(.., name)| *name).collect();
    found.join(", ")
}

#[test]
fn masks_lie_as_their_photos_where_nothing_tells() {
    for (size, orientation) in [((12, 8), 3), ((12, 8), 2), ((8, 8), 6)] {
        let folder = turned(size, [orientation; 6], true, |_| half_mask(size.0, size.1));
        let with =
            |exif| Capture::load(folder.path(), &LoadOptions { exif, ..LoadOptions::default() }).unwrap();
        let applied = with(ExifTurn::Apply);
        // As an image editor shows the photo.
        assert_eq!(quarter(&applied, 0), "top left", "{orientation}");
        let found = warning(&applied.report, "masks-of-turned-photos").unwrap();
        assert!(found.count == 6 && found.message.contains("image editor"), "{}", found.message);
        let stored = with(ExifTurn::Auto);
        assert_eq!(quarter(&stored, 0), "top left");
        assert!(warning(&stored.report, "masks-of-turned-photos").is_none());
        let words = &warning(&stored.report, "photos-turned-by-exif").unwrap().message;
        assert!(words.contains("as are their masks"), "{words}");
        assert!(with(ExifTurn::Ignore).report.warnings.iter().all(|w| !w.code.contains("turned")));
    }
    let folder = turned((12, 8), [1; 6], true, |_| half_mask(12, 8));
    let options = LoadOptions { exif: ExifTurn::Apply, ..LoadOptions::default() };
    let capture = Capture::load(folder.path(), &options).unwrap();
    assert!(warning(&capture.report, "masks-of-turned-photos").is_none(), "negative control: no turn");
}

#[test]
fn the_sides_of_some_masks_tell_of_all() {
    // One photo in portrait; the others are upside down.
    let orientations = [6, 3, 3, 3, 3, 3];
    let load = |folder: &TempDir, exif| {
        Capture::load(folder.path(), &LoadOptions { exif, ..LoadOptions::default() }).unwrap()
    };
    // Masks of a program that reads pixels as stored.
    let folder = turned((12, 8), orientations, true, |_| half_mask(12, 8));
    let capture = load(&folder, ExifTurn::Apply);
    assert_eq!(
        (quarter(&capture, 0), quarter(&capture, 1)),
        ("top right".to_owned(), "bottom right".to_owned())
    );
    let found = warning(&capture.report, "masks-of-turned-photos").unwrap();
    assert!(found.count == 5 && found.message.contains("like the others"), "{}", found.message);
    // Masks painted in an image editor.
    let painted = |index| if index == 0 { half_mask(8, 12) } else { half_mask(12, 8) };
    let folder = turned((12, 8), orientations, true, painted);
    let capture = load(&folder, ExifTurn::Apply);
    assert_eq!((quarter(&capture, 0), quarter(&capture, 1)), ("top left".to_owned(), "top left".to_owned()));
    // The same, where the poses were computed from stored pixels: the masks are turned back.
    let folder = turned((12, 8), orientations, false, painted);
    let capture = load(&folder, ExifTurn::Auto);
    assert_eq!(
        (quarter(&capture, 0), quarter(&capture, 1)),
        ("bottom left".to_owned(), "bottom right".to_owned())
    );
}
