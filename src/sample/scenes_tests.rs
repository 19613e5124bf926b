//! Scenes other than the still life: what they show, where the cameras are, and where points lie.

use super::*;
use glam::DVec3;

fn capture(scene: &str) -> Capture {
    Capture::new(&SampleOptions {
        views: 24,
        width_px: 64,
        height_px: 48,
        points: 128,
        point_noise_m: 0.0,
        supersampling: 2,
        scene: Some(scene.parse().unwrap()),
        ..SampleOptions::default()
    })
}

/// Share of the values of all photos for which a condition holds.
fn share(capture: &Capture, is_counted: impl Fn(u8) -> bool) -> f64 {
    let photos = (0..capture.views.len()).flat_map(|i| capture.photo(i).values);
    let (mut counted, mut all) = (0, 0);
    for value in photos {
        counted += usize::from(is_counted(value));
        all += 1;
    }
    counted as f64 / f64::from(all)
}

#[test]
fn cameras_are_on_a_cap_and_every_eighth_view_is_held_out() {
    let capture = capture("wall");
    assert_eq!((capture.views.len(), capture.summary().test_views), (24, 3));
    let mut tilt_max: f64 = 0.0;
    for view in &capture.views {
        let centre = view.camera_from_capture.origin_of_a_in_b();
        assert!((centre.length() - 1.6).abs() < 1e-12);
        tilt_max = tilt_max.max(centre.angle_between(DVec3::NEG_Z).to_degrees());
        let axis = view.camera_from_capture.transform_point(DVec3::ZERO).normalize();
        assert!(axis.distance(DVec3::Z) < 1e-12, "looks at the origin");
        assert_eq!(view.pinhole.fx_px, 0.95 * 64.0);
    }
    assert!((33.0..35.0).contains(&tilt_max), "{tilt_max}");
}

#[test]
fn every_scene_is_grey_around_and_of_its_range() {
    for (scene, grey) in [
        ("wall", [0.4, 0.7]),
        ("quilt", [0.6, 0.9]),
        ("stripes:30", [0.4, 0.7]),
        ("planted", [0.4, 0.9]),
        ("gloss", [0.4, 0.7]),
        ("poster", [0.4, 0.6]),
    ] {
        let capture = capture(scene);
        let found = share(&capture, |v| v == 128);
        assert!((grey[0]..grey[1]).contains(&found), "{scene}: {found}");
        // 0.2 and 0.8 of 255, and up to 1 with the gloss.
        let (low, high) = match scene {
            "gloss" => (51, 255),
            "planted" => (13, 242),
            "poster" => (10, 245),
            _ => (51, 204),
        };
        assert_eq!(share(&capture, |v| (low..=high).contains(&v)), 1.0, "{scene}");
        let corners = [0, 63, 47 * 64, 48 * 64 - 1];
        let photo = capture.photo(0);
        assert!(corners.iter().all(|c| photo.values[3 * c..3 * c + 3] == [128; 3]), "{scene}");
    }
    assert_eq!(share(&capture("flat"), |v| v == 128), 1.0);
    let dithered = capture("flat:0.5");
    assert_eq!(share(&dithered, |v| v == 127 || v == 128), 1.0);
    assert!((share(&dithered, |v| v == 127) - 0.5).abs() < 0.01);
}

#[test]
fn every_photo_shows_the_whole_poster() {
    let capture = capture("poster");
    for view in 0..24 {
        let photo = capture.photo(view).values;
        let is_border = |i: usize| [0, 63].contains(&(i % 64)) || [0, 47].contains(&(i / 64));
        assert!(
            (0..64 * 48).filter(|i| is_border(*i)).all(|i| photo[3 * i..3 * i + 3] == [128; 3]),
            "{view}"
        );
    }
}

#[test]
fn a_seed_repeats_a_poster_and_another_shows_another() {
    let photos = |level: u32, seed: u64| {
        let options = SampleOptions {
            views: 3,
            width_px: 64,
            height_px: 48,
            points: 0,
            seed,
            scene: Some(format!("poster:{level}").parse().unwrap()),
            ..SampleOptions::default()
        };
        let capture = Capture::new(&options);
        [0, 1, 2].map(|view| capture.photo(view).values)
    };
    let first = photos(6, 0);
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    assert!(pool.install(|| photos(6, 0)) == first);
    for other in [photos(6, 1), photos(7, 0)] {
        assert!(first.iter().zip(&other).all(|(a, b)| a != b));
    }
}

#[test]
fn turned_stripes_and_gloss_differ_as_they_should() {
    let photo = |scene: &str, view: usize| capture(scene).photo(view).values;
    let mean = |a: &[u8], b: &[u8]| {
        a.iter().zip(b).map(|(a, b)| f64::from(a.abs_diff(*b))).sum::<f64>() / a.len() as f64
    };
    assert!(mean(&photo("stripes", 0), &photo("stripes:30", 0)) > 3.0);
    assert!(photo("stripes", 0) == photo("stripes:0", 0));
    // The middle of the gloss changes by direction, that of the wall does not.
    let spread = |scene: &str| {
        let capture = capture(scene);
        let middle = |view: usize| f64::from(capture.photo(view).values[3 * (24 * 64 + 32)]);
        let values: Vec<f64> = (0..24).map(middle).collect();
        values.iter().copied().fold(0.0, f64::max) - values.iter().copied().fold(255.0, f64::min)
    };
    // Of 0.3 x 255 the directions show most; measured 70 and 3.
    assert!(spread("gloss") > 50.0 && spread("wall:8") < 20.0, "{} {}", spread("gloss"), spread("wall:8"));
}

#[test]
fn regions_and_points_lie_where_they_should() {
    for (scene, area) in [("quilt", 0.5), ("gloss", 0.1), ("poster", 0.43)] {
        let capture = capture(scene);
        let marked = capture.region(0).unwrap().values.iter().filter(|v| **v == 255).count() as f64;
        // A pixel of the middle of the image measures 1.6 / (0.95 x 64) m.
        let found = marked * (1.6_f64 / (0.95 * 64.0)).powi(2);
        assert!((0.85..1.15).contains(&(found / area)), "{scene}: {found}");
    }
    assert!(capture("wall").region(0).is_none() && capture("planted").region(0).is_none());
    for scene in ["wall", "flat", "stripes:30"] {
        let points = capture(scene).sparse.points;
        assert_eq!(points.len(), 128);
        assert!(points.iter().all(|p| p.position.z == 0.0 && p.position.length() < 0.7072), "{scene}");
    }
    let points = capture("poster").sparse.points;
    assert_eq!(points.len(), 128);
    assert!(points.iter().all(|p| p.position.abs().cmple(DVec3::new(0.62, 0.465, 0.0)).all()));
    let model = planted_model(0);
    for point in capture("planted").sparse.points {
        let centres = model.splats.positions.as_chunks::<3>().0;
        let nearest = centres.iter().map(|c| point.position.distance(DVec3::from(c.map(f64::from))));
        assert!(nearest.fold(f64::MAX, f64::min) < 0.06);
    }
}

#[test]
fn planted_splats_do_not_overlap() {
    let model = planted_model(0);
    let splats: Vec<(DVec3, f64)> = (0..model.num_splats())
        .map(|i| {
            let at = |k: usize| f64::from(model.splats.positions[3 * i + k]);
            let sigma =
                model.splats.log_scales[2 * i..2 * i + 2].iter().copied().fold(f32::MIN, f32::max).exp();
            // Where alpha falls to 1/255 at an opacity of 0.9.
            (DVec3::new(at(0), at(1), at(2)), f64::from(sigma) * (2.0 * (0.9_f64 * 255.0).ln()).sqrt())
        })
        .collect();
    for (i, (a, r)) in splats.iter().enumerate() {
        for (b, s) in &splats[..i] {
            assert!(a.distance(*b) > r + s, "{a} {b} {r} {s}");
        }
    }
    assert_eq!((model.num_texels(), model.size().params()), (64 * 64, 64 * (13 + 2 + 3 * 64)));
}

#[test]
fn a_scene_excludes_a_stress_and_has_no_depths() {
    let options = SampleOptions {
        views: 2,
        width_px: 8,
        height_px: 6,
        points: 4,
        scene: Some("wall:2".parse().unwrap()),
        ..SampleOptions::default()
    };
    let folder = tempfile::tempdir().unwrap();
    let dir = folder.path().join("sample");
    let both = SampleOptions { stress: Some("noise".parse().unwrap()), ..options.clone() };
    let error = write_sample(&dir, &both).unwrap_err().to_string();
    assert!(error.contains("found the scene wall:2 and the stress noise:10"), "{error}");
    write_sample(&dir, &options).unwrap();
    assert!(dir.join("truth/scene.json").exists() && !dir.join("truth/depth").exists());
}
