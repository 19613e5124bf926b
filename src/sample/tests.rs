//! Consistency of the sample capture: files, colours, depths, determinism.

use super::*;
use glam::DVec2;
use std::path::PathBuf;

fn small() -> SampleOptions {
    SampleOptions {
        views: 6,
        width_px: 96,
        height_px: 72,
        points: 300,
        text: true,
        ..SampleOptions::default()
    }
}

/// All files below a folder with their bytes, sorted by path.
fn contents(dir: &Path) -> Vec<(PathBuf, Vec<u8>)> {
    let mut found = Vec::new();
    let mut folders = vec![dir.to_owned()];
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                folders.push(path);
            } else {
                let bytes = std::fs::read(&path).unwrap();
                found.push((path.strip_prefix(dir).unwrap().to_owned(), bytes));
            }
        }
    }
    found.sort();
    found
}

fn sample(options: &SampleOptions) -> Vec<(PathBuf, Vec<u8>)> {
    let dir = tempfile::tempdir().unwrap();
    write_sample(dir.path(), options).unwrap();
    contents(dir.path())
}

#[test]
fn same_options_give_the_same_bytes_for_any_number_of_threads() {
    let first = sample(&small());
    assert_eq!(first.len(), 6 + 3 + 3 + 6 + 1);
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    assert!(pool.install(|| sample(&small())) == first);
    // Negative control: another seed changes every image.
    let other = sample(&SampleOptions { seed: 1, ..small() });
    let images = |files: &[(PathBuf, Vec<u8>)]| -> Vec<Vec<u8>> {
        let png = files.iter().filter(|f| f.0.extension().is_some_and(|e| e == "png"));
        png.map(|f| f.1.clone()).collect()
    };
    assert!(images(&first).iter().zip(&images(&other)).all(|(a, b)| a != b));
}

#[test]
fn binary_file_sizes_follow_from_the_counts() {
    let capture = Capture::new(&small());
    let summary = capture.summary();
    let files = sample(&small());
    let size = |name: &str| {
        let file = files.iter().find(|f| f.0 == Path::new("sparse/0").join(name));
        file.unwrap().1.len()
    };
    assert_eq!(summary.points, 300);
    assert!(summary.observations >= 600);
    assert_eq!(size("cameras.bin"), 8 + 4 + 4 + 8 + 8 + 4 * 8);
    let per_image = 4 + 7 * 8 + 4 + "view_0000.png".len() + 1 + 8;
    assert_eq!(size("images.bin"), 8 + 6 * per_image + 24 * summary.observations);
    assert_eq!(size("points3D.bin"), 8 + 300 * (8 + 24 + 3 + 8 + 8) + 8 * summary.observations);
}

#[test]
fn tracks_and_keypoints_agree() {
    let files = sample(&small());
    let text = |name: &str| {
        let file = files.iter().find(|f| f.0 == Path::new("sparse/0").join(name));
        String::from_utf8(file.unwrap().1.clone()).unwrap()
    };
    // Point ids of the keypoints, by image.
    let images = text("images.txt");
    let lines: Vec<&str> = images.lines().filter(|l| !l.starts_with('#')).collect();
    let keypoints: Vec<Vec<&str>> =
        lines.chunks_exact(2).map(|l| l[1].split(' ').skip(2).step_by(3).collect()).collect();
    let mut observations = 0;
    for line in text("points3D.txt").lines().filter(|l| !l.starts_with('#')) {
        let fields: Vec<&str> = line.split(' ').collect();
        for track in fields[8..].chunks_exact(2) {
            let (image, keypoint): (usize, usize) = (track[0].parse().unwrap(), track[1].parse().unwrap());
            assert_eq!(keypoints[image - 1][keypoint], fields[0]);
            observations += 1;
        }
        assert!(fields.len() >= 8 + 2 * 2, "every point is seen in at least two images");
    }
    assert_eq!(observations, keypoints.iter().map(Vec::len).sum::<usize>());
}

#[test]
fn points_have_the_colour_of_the_pixels_where_they_are_seen() {
    let options = SampleOptions { width_px: 320, height_px: 240, ..small() };
    let capture = Capture::new(&options);
    let images: Vec<_> = (0..options.views).map(|v| capture.photo(v).values).collect();
    let differences = |shift_px: f64| -> Vec<u8> {
        let points = &capture.sparse.points;
        let mut all: Vec<u8> = points
            .iter()
            .flat_map(|p| p.observations.iter().map(move |o| (p, o)))
            .map(|(p, &(view, at))| {
                let at = (at + DVec2::splat(shift_px)).clamp(DVec2::ZERO, DVec2::new(319.0, 239.0));
                let pixel = 3 * (at.y as usize * 320 + at.x as usize);
                (0..3).map(|c| images[view][pixel + c].abs_diff(p.rgb[c])).max().unwrap()
            })
            .collect();
        all.sort_unstable();
        all
    };
    let in_place = differences(0.0);
    let median = |d: &[u8]| d[d.len() / 2];
    // Pixels average over patterns of about their own size, so only the median must agree. Needed 3.
    assert!(median(&in_place) <= 5, "median {}", median(&in_place));
    // Negative control: colours 12 pixels away are unrelated (median 63).
    assert!(median(&differences(12.0)) > 30);
}

#[test]
fn depths_agree_with_the_points() {
    let capture = Capture::new(&SampleOptions { point_noise_m: 0.0, ..small() });
    let pinhole = capture.sparse.pinholes[0];
    let depths: Vec<_> = (0..6).map(|v| capture.depth(v).unwrap().1).collect();
    let (mut close, mut all) = (0, 0);
    for point in &capture.sparse.points {
        assert!(point.error_px < 1e-9);
        for &(view, at) in &point.observations {
            let z = capture.sparse.images[view].camera_from_capture.transform_point(point.position).z;
            let pixel = at.y as usize * pinhole.width_px as usize + at.x as usize;
            close += usize::from((f64::from(depths[view][pixel]) - z).abs() < 0.05 * z);
            all += 1;
        }
    }
    // The rest lies at depth edges and on floors seen at a grazing angle. Needed 0.976.
    assert!(close as f64 > 0.95 * f64::from(all), "{close} of {all}");
}

#[test]
fn unusual_options_work_and_invalid_ones_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let dir = folder.path().join("sample");
    for bad in [
        SampleOptions { views: 1, ..small() },
        SampleOptions { width_px: 0, ..small() },
        SampleOptions { supersampling: 0, ..small() },
        SampleOptions { point_noise_m: f64::NAN, ..small() },
    ] {
        assert!(matches!(write_sample(&dir, &bad), Err(Error::Usage(_))));
    }
    assert!(!dir.exists());
    let tiny = SampleOptions { views: 2, width_px: 1, height_px: 1, points: 0, ..small() };
    assert_eq!(write_sample(&dir, &tiny).unwrap().points, 0);
}
