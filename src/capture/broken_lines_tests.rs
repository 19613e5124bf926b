//! Models of COLMAP in which single lines, names or cameras cannot be read.

use super::fixtures::Scene;
use super::strangers_tests::{binary_model, has_warning, load, replace, text_model, warning};
use tempfile::TempDir;

/// A text model of 12 images with a change in one of its files.
fn changed(file: &str, from: &str, to: &str) -> TempDir {
    let folder = text_model(&Scene::ring(12));
    replace(&folder, file, from, to);
    folder
}

/// The start of the line of the fourth image, "p09.png".
fn fourth_line() -> String {
    format!("\n4 {:?} ", Scene::ring(12).images[3].camera_from_world.0.w)
}

#[test]
fn cameras_that_cannot_be_read_and_that_no_image_uses_are_left_out() {
    for (line, part) in [
        ("8 NOVEL 12 8 1 2 3", "camera 8 (NOVEL): its model is not supported"),
        ("8 PINHOLE 12 8 10 11 x 4", "camera 8: cameras.txt: line 3: \"x\" is not a number"),
        ("8 PINHOLE 12 8 10", "camera 8: cameras.txt: line 3: 1 parameters found, PINHOLE has 4"),
        ("8 PINHOLE", "camera 8: cameras.txt: line 3: the line ends where a width was expected"),
        ("eight PINHOLE 12 8 10 11 6 4", "cameras.txt: line 3: \"eight\" found where a camera id"),
    ] {
        let capture = load(changed("cameras.txt", "\n7 ", &format!("\n{line}\n7 ")).path()).unwrap();
        assert_eq!(capture.views.len(), 12, "{line}");
        let message = warning(&capture, "cameras-left-out", 1);
        assert!(message.contains("1 of 2 cameras") && message.contains(part), "{message}");
    }
}

#[test]
fn cameras_that_images_use_must_be_read() {
    let error = load(changed("cameras.txt", " PINHOLE ", " NOVEL ").path()).err().unwrap();
    let text = error.to_string();
    assert!(error.exit_code() == 4 && text.contains("\"NOVEL\"") && text.contains("undistort"), "{text}");
    for (to, part) in [("\n7 PINHOLE x", "line 3: \"x\""), ("\nseven PINHOLE 1", "line 3: \"seven\"")] {
        let error = load(changed("cameras.txt", "\n7 PINHOLE ", &format!("{to} ")).path()).err().unwrap();
        let text = error.to_string();
        assert!(error.exit_code() == 3 && text.contains("12 of 12 views"), "{text}");
        assert!(text.contains("cameras.txt") && text.contains(part), "{text}");
    }
    // One of twelve images uses a broken one.
    let folder = changed("cameras.txt", "\n7 ", "\n8 PINHOLE 12 8 10 11 x 4\n7 ");
    replace(&folder, "images.txt", " 7 p09.png", " 8 p09.png");
    let capture = load(folder.path()).unwrap();
    assert_eq!((capture.views.len(), has_warning(&capture, "cameras-left-out")), (11, false));
    assert!(warning(&capture, "views-left-out", 1).contains("image 4 (\"p09.png\"): camera 8: cameras.txt"));
}

#[test]
fn a_binary_model_cannot_be_read_past_an_unknown_camera() {
    let mut scene = Scene::ring(3);
    let mut novel = scene.cameras[0].clone();
    (novel.id, novel.model) = (9, (99, "NOVEL"));
    scene.cameras.push(novel);
    let error = load(binary_model(&scene).path()).err().unwrap();
    let text = error.to_string();
    assert!(error.exit_code() == 4 && text.contains("camera 9"), "{text}");
    assert!(text.contains("number 99, past which the file cannot be read"), "{text}");
}

#[test]
fn one_line_of_an_image_that_cannot_be_read_leaves_its_view_out() {
    let start = fourth_line();
    for (from, to, part) in [
        (&*start, "\n4 x ", "\"x\" found where a quaternion was expected"),
        (&start, "\n4 1e ", "\"1e\" found"),
        (" 7 p09.png", " seven p09.png", "\"seven\" found where a camera id was expected"),
        (" 7 p09.png\n1.5 2.25 100", " 7 p09.png\n1.5 2.25", "no keypoints"),
        (" 7 p09.png\n1.5 ", " 7 p09.png\nx ", "no keypoints"),
    ] {
        let capture = load(changed("images.txt", from, to).path()).unwrap();
        assert_eq!((capture.views.len(), capture.points.len()), (11, 20), "{to}");
        let message = warning(&capture, "views-left-out", 1);
        assert!(message.contains("1 of 12 views") && message.contains("image 4 (\"p09.png\")"), "{message}");
        assert!(message.contains("images.txt: line ") && message.contains(part), "{message}");
        assert!(capture.views.iter().all(|v| v.name != "p09.png"));
        // Of the others nothing is lost.
        assert_eq!(capture.health.unwrap().observations, 11 * 20);
    }
    // Without lines of keypoints.
    let folder = text_model(&Scene::ring(12));
    let path = folder.path().join("sparse/0/images.txt");
    let text = std::fs::read_to_string(&path).unwrap();
    let images: String = text.lines().filter(|l| l.ends_with("png")).map(|l| format!("{l}\n")).collect();
    std::fs::write(&path, images.replacen(" 7 p09", " seven p09", 1)).unwrap();
    let capture = load(folder.path()).unwrap();
    assert_eq!(capture.views.len(), 11);
    assert!(warning(&capture, "views-left-out", 1).contains("image 4 (\"p09.png\"): images.txt: line 4"));
}

#[test]
fn more_than_a_tenth_of_broken_lines_is_an_error() {
    let folder = text_model(&Scene::ring(12));
    for name in ["p09", "p08"] {
        replace(&folder, "images.txt", &format!(" 7 {name}"), &format!(" x {name}"));
    }
    let error = load(folder.path()).err().unwrap();
    assert!(error.exit_code() == 3 && error.to_string().contains("2 of 12 views"), "{error}");
    let folder = text_model(&Scene::ring(12));
    for id in [105, 106, 107] {
        replace(&folder, "points3D.txt", &format!("\n{id} "), &format!("\n{id} x "));
    }
    let error = load(folder.path()).err().unwrap();
    assert!(error.exit_code() == 3 && error.to_string().contains("3 of 20 points"), "{error}");
}

#[test]
fn one_line_of_a_point_that_cannot_be_read_leaves_it_out() {
    let folder = changed("points3D.txt", "\n105 ", "\n105 x ");
    let capture = load(folder.path()).unwrap();
    assert_eq!((capture.views.len(), capture.points.len()), (12, 19));
    let message = warning(&capture, "points-left-out", 1);
    assert!(
        message.contains("1 of 20 points") && message.contains("point 105: points3D.txt: line 7"),
        "{message}"
    );
    // Counted with those whose numbers are none.
    replace(&folder, "points3D.txt", "\n107 ", "\n107 nan 0 0 1 2 3 0.5\n99 ");
    assert!(warning(&load(folder.path()).unwrap(), "points-left-out", 2).contains("2 of 21 points"));
}

#[test]
fn a_file_that_ends_inside_a_line_was_cut() {
    for (file, cut_bytes) in [("cameras.txt", 6), ("points3D.txt", 22)] {
        let folder = text_model(&Scene::ring(12));
        let path = folder.path().join("sparse/0").join(file);
        let text = std::fs::read_to_string(&path).unwrap();
        std::fs::write(&path, text.trim_end()).unwrap();
        assert_eq!(
            load(folder.path()).unwrap().views.len(),
            12,
            "negative control: no line break at the end"
        );
        std::fs::write(&path, &text[..text.len() - cut_bytes]).unwrap();
        let error = load(folder.path()).err().unwrap();
        assert!(error.exit_code() == 3 && error.to_string().contains("ends inside this line"), "{error}");
    }
    let folder = text_model(&Scene::ring(12));
    let path = folder.path().join("sparse/0/images.txt");
    let text = std::fs::read_to_string(&path).unwrap();
    for end in [" 7 p01.png", "2.25 100 3.0"] {
        let at = text.rfind(end).unwrap();
        std::fs::write(&path, &text[..at + if end.starts_with(" 7") { 0 } else { end.len() }]).unwrap();
        let error = load(folder.path()).err().unwrap();
        assert!(error.to_string().contains("ends inside this line"), "{end}: {error}");
    }
}

#[test]
fn a_name_that_is_no_text_leaves_its_view_out() {
    for file in ["images.bin", "images.txt"] {
        let folder =
            if file.ends_with("bin") { binary_model(&Scene::ring(12)) } else { text_model(&Scene::ring(12)) };
        let path = folder.path().join("sparse/0").join(file);
        let mut data = std::fs::read(&path).unwrap();
        let at = data.windows(7).position(|w| w == b"p09.png").unwrap();
        data[at] = 0xff;
        std::fs::write(&path, data).unwrap();
        let capture = load(folder.path()).unwrap();
        assert_eq!(
            (capture.views.len(), capture.health.as_ref().unwrap().observations),
            (11, 11 * 20),
            "{file}"
        );
        let message = warning(&capture, "views-left-out", 1);
        assert!(
            message.contains("image 4 (\"\u{fffd}09.png\")") && message.contains("not UTF-8"),
            "{message}"
        );
    }
}
