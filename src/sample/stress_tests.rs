//! Each stress changes what it says and nothing else.

use super::*;
use glam::DVec3;

fn options(stress: &str) -> SampleOptions {
    SampleOptions {
        views: 16,
        width_px: 64,
        height_px: 48,
        points: 150,
        supersampling: 1,
        stress: Some(stress.parse().unwrap()),
        ..SampleOptions::default()
    }
}

fn capture(stress: &str) -> Capture {
    Capture::new(&options(stress))
}

fn photos(capture: &Capture, is_test: bool) -> Vec<Vec<u8>> {
    let chosen = (0..capture.views.len()).filter(|&i| capture.views[i].is_test == is_test);
    chosen.map(|i| capture.photo(i).values).collect()
}

/// Largest difference of the poses and points of two sparse models.
fn difference(a: &Capture, b: &Capture) -> f64 {
    let points = a.sparse.points.iter().zip(&b.sparse.points).map(|(p, q)| p.position.distance(q.position));
    let centres = a.sparse.images.iter().zip(&b.sparse.images).map(|(i, j)| {
        i.camera_from_capture.origin_of_a_in_b().distance(j.camera_from_capture.origin_of_a_in_b())
    });
    let turns = a.sparse.images.iter().zip(&b.sparse.images).map(|(i, j)| {
        let [i, j] = [i, j].map(|image| image.camera_from_capture.rotation.row(2));
        i.distance(j)
    });
    points.chain(centres).chain(turns).fold(0.0, f64::max)
}

#[test]
fn what_spoils_training_leaves_the_test_photos_as_they_are() {
    let control = capture("none");
    let test = photos(&control, true);
    assert_eq!((test.len(), photos(&control, false).len()), (2, 14));
    for stress in
        ["noise", "exposure", "pose-noise", "wrong-poses", "outliers", "duplicates", "camera-points"]
    {
        assert!(photos(&capture(stress), true) == test, "{stress}");
    }
    for stress in ["views", "walker", "sizes", "off-centre-padded", "anisotropic", "offset", "turn"] {
        assert!(photos(&capture(stress), true) == test, "{stress}");
    }
    // Negative control: what is about the scene or the test cameras.
    for stress in ["checker", "wires", "mirror", "sky", "cards", "distance", "resolution", "parallel"] {
        assert!(photos(&capture(stress), true) != test, "{stress}");
    }
}

#[test]
fn noise_has_its_standard_deviation_and_exposure_its_range() {
    let clean = photos(&capture("none"), false).concat();
    let noisy = photos(&capture("noise:10"), false).concat();
    let differences: Vec<f64> = clean
        .iter()
        .zip(&noisy)
        .filter(|(c, _)| (60..195).contains(*c))
        .map(|(a, b)| f64::from(*b) - f64::from(*a))
        .collect();
    let sd = (differences.iter().map(|d| d * d).sum::<f64>() / differences.len() as f64).sqrt();
    // Rounding adds 0.04; the error of the estimate is 0.04.
    assert!((sd - 10.04).abs() < 0.2, "{sd}");
    let gains: Vec<DVec3> =
        capture("exposure:0.5").views.iter().filter(|v| !v.is_test).map(|v| v.gain).collect();
    assert!(gains.iter().all(|g| g.y.log2().abs() <= 0.5 && (g.x / g.y - 1.0).abs() <= 0.05));
    assert!(gains.iter().any(|g| g.y.log2() > 0.2) && gains.iter().any(|g| g.y.log2() < -0.2));
}

#[test]
fn frames_and_poses_move_as_far_as_said() {
    let control = capture("none");
    assert!(difference(&control, &capture("noise")) < 1e-12);
    let moved = difference(&control, &capture("offset:1000"));
    assert!((moved - 1000.0 * 1.3125_f64.sqrt()).abs() < 1e-6, "{moved}");
    let centre = |c: &Capture| c.sparse.images[3].camera_from_capture.origin_of_a_in_b();
    let scaled = centre(&capture("scale:100"));
    assert!(scaled.distance(100.0 * centre(&control)) < 1e-9);
    assert!(difference(&control, &capture("turn:37")) > 0.1);
    let off: Vec<f64> = capture("pose-noise:1")
        .views
        .iter()
        .map(|v| v.written.rotation.row(2).angle_between(v.camera_from_capture.rotation.row(2)).to_degrees())
        .collect();
    assert!(off[..14].iter().all(|d| *d < 4.0) && off[..14].iter().sum::<f64>() > 4.0, "{off:?}");
    assert_eq!(off[14..], [0.0, 0.0]);
    let wrong = capture("wrong-poses:0.1");
    let named = |v: &&views::View| v.written != v.camera_from_capture;
    let names: Vec<&str> = wrong.views.iter().filter(named).map(|v| v.name.as_str()).collect();
    assert_eq!(names, ["train_0003.png", "train_0010.png"]);
}

#[test]
fn cropped_and_padded_photos_show_the_same() {
    for (cropped, with_padding) in [("sizes", "sizes-padded"), ("off-centre", "off-centre-padded")] {
        let (cropped, with_padding) = (capture(cropped), capture(with_padding));
        for i in 0..8 {
            let (small, large) = (cropped.photo(i), with_padding.photo(i));
            let mask = with_padding.mask(i).unwrap();
            let kept: Vec<u8> = large
                .values
                .as_chunks::<3>()
                .0
                .iter()
                .zip(&mask.values)
                .filter(|(_, m)| **m == 255)
                .flat_map(|(rgb, _)| *rgb)
                .collect();
            assert_eq!(kept, small.values, "{i}");
            let [own, other] = [&cropped, &with_padding].map(|c| c.views[i].file_pinhole());
            assert_eq!((own.fx_px, own.fy_px), (other.fx_px, other.fy_px));
        }
        assert!(cropped.mask(0).is_none());
        let sizes: Vec<_> =
            cropped.sparse.pinholes.iter().map(|p| (p.width_px, p.height_px, p.cx_px)).collect();
        assert!(sizes.len() > 1, "{sizes:?}");
    }
}

#[test]
fn regions_mark_what_the_stress_is_about() {
    let share = |stress: &str| -> Vec<f64> {
        let capture = capture(stress);
        let share = |i: usize| {
            let marked = capture.region(i)?.values.iter().filter(|v| **v == 255).count();
            Some(marked as f64 / capture.views[i].pinhole.num_pixels() as f64)
        };
        (0..capture.views.len()).filter_map(share).collect()
    };
    assert!(share("none").is_empty() && share("noise").is_empty());
    let mean = |shares: &[f64]| shares.iter().sum::<f64>() / shares.len() as f64;
    // About a third of outdoor views is sky.
    let sky = share("sky");
    assert!(sky.len() == 16 && (0.25..0.45).contains(&mean(&sky)), "{sky:?}");
    let walker = share("walker");
    assert!(walker.len() == 3 && mean(&walker) > 0.01, "{walker:?}");
    let [thin, thick] = ["wires:1", "wires:4"].map(|stress| mean(&share(stress)));
    assert!((2.5..6.0).contains(&(thick / thin)), "{thin} {thick}");
    assert!(share("mirror").len() > 8 && share("checker").len() > 8 && share("cards:4").len() == 18);
}

#[test]
fn points_are_wrong_where_the_stress_says_so() {
    let control = capture("none");
    let count = |stress: &str| {
        let capture = capture(stress);
        let places = control.sparse.points.iter().zip(&capture.sparse.points);
        let moved = places.filter(|(a, b)| a.position.distance(b.position) > 1e-9).count();
        (capture.sparse.points.len(), moved)
    };
    let (all, moved) = count("outliers:0.3");
    assert!(all == 150 && (30..60).contains(&moved), "{moved}");
    let (all, moved) = count("duplicates:0.3");
    assert!((180..210).contains(&all) && moved == 0, "{all}");
    let spoilt = capture("camera-points:10");
    let centres: Vec<DVec3> = spoilt.views.iter().map(|v| v.camera_from_capture.origin_of_a_in_b()).collect();
    let at_cameras = spoilt.sparse.points.iter().filter(|p| centres.contains(&p.position)).count();
    assert_eq!((spoilt.sparse.points.len(), at_cameras), (160, 10));
    let sky = capture("sky");
    assert!(!sky.sparse.points.is_empty() && sky.sparse.points.iter().all(|p| p.position.length() < 10.0));
}
