//! Distorted captures against photos of the same scene through a pinhole.

use super::fixtures::{Scene, write_json};
use super::lens::{Distortion, Lens, Tilt};
use super::warp::Warp;
use super::*;
use crate::camera::Pinhole;
use crate::image::TargetImage;
use crate::views::ViewSource as _;
use glam::DVec2;
use tempfile::tempdir;

const SIZE: (u32, u32) = (120, 80);
const FOCAL_PX: f64 = 90.0;
const CENTRE_PX: DVec2 = DVec2::new(61.0, 38.5);

/// What lies in a direction (x, y, 1): smooth, so that sampling hardly matters.
fn colour(direction: DVec2) -> [u8; 3] {
    let wave = |a: f64, b: f64| (127.5 + 110.0 * (a * direction.x + b * direction.y).sin()) as u8;
    [wave(9.0, 2.0), wave(-3.0, 8.0), wave(5.0, -6.0)]
}

/// Inverse of the distortion by fixed-point iteration.
fn undistort(distortion: &Distortion, distorted: DVec2) -> DVec2 {
    let mut guess = distorted;
    for _ in 0..300 {
        guess += 0.5 * (distorted - distortion.distort(guess));
    }
    guess
}

/// A photo of `colour` through the lens.
fn distorted_photo(distortion: &Distortion) -> image::RgbImage {
    image::RgbImage::from_fn(SIZE.0, SIZE.1, |x, y| {
        let at = DVec2::new(f64::from(x) + 0.5, f64::from(y) + 0.5);
        image::Rgb(colour(undistort(distortion, (at - CENTRE_PX) / FOCAL_PX)))
    })
}

/// A capture of two views of `colour` taken with the lens, loaded.
fn captured(model: (i32, &'static str), extra: &[f64], distortion: &Distortion, max: u32) -> TargetImage {
    let mut scene = Scene::ring(2);
    let mut params = match model.0 {
        2 | 3 | 8 | 9 | 12 | 14 => vec![FOCAL_PX],
        _ => vec![FOCAL_PX, FOCAL_PX],
    };
    params.extend([CENTRE_PX.x, CENTRE_PX.y]);
    params.extend(extra);
    scene.cameras[0].model = model;
    scene.cameras[0].size = SIZE;
    scene.cameras[0].params = params;
    let folder = tempdir().unwrap();
    scene.write(folder.path());
    for image in &scene.images {
        distorted_photo(distortion).save(folder.path().join("images").join(&image.name)).unwrap();
    }
    let options = LoadOptions { test_every: 0, max_resolution: max, ..LoadOptions::default() };
    let capture = Capture::load(folder.path(), &options).unwrap();
    assert_eq!(capture.views[0].camera.pinhole.fx_px * 120.0 / f64::from(max), FOCAL_PX);
    TargetImage::clone(&capture.target(0).unwrap())
}

/// Mean and worst difference to the pinhole image where the mask keeps, and the share kept.
fn differences(photo: &TargetImage) -> (f64, f64, f64) {
    let scale = f64::from(SIZE.0) / f64::from(photo.width_px);
    let (mut sum, mut worst, mut kept) = (0.0, 0.0_f64, 0);
    for y in 0..photo.height_px {
        for x in 0..photo.width_px {
            let index = (y * photo.width_px + x) as usize;
            if photo.mask.as_ref().is_some_and(|m| m[index] == 0) {
                continue;
            }
            let at = DVec2::new(f64::from(x) + 0.5, f64::from(y) + 0.5) * scale;
            let expected = colour((at - CENTRE_PX) / FOCAL_PX);
            for (channel, value) in expected.iter().enumerate() {
                let difference = f64::from(photo.rgb[3 * index + channel].abs_diff(*value));
                sum += difference;
                worst = worst.max(difference);
            }
            kept += 1;
        }
    }
    let all = f64::from(photo.width_px * photo.height_px);
    (sum / (3.0 * f64::from(kept)), worst, f64::from(kept) / all)
}

fn radial(k: [f64; 6], p: [f64; 2]) -> Distortion {
    Distortion::Radial { k, p }
}

#[test]
fn every_lens_model_is_undistorted_to_the_pinhole_image() {
    let tilted = |k: &[f64], tilt| {
        let mut all = [0.0; 6];
        all[..k.len()].copy_from_slice(k);
        Distortion::Fisheye { k: all, tilt }
    };
    let fisheye = |k: &[f64]| tilted(k, Tilt::None);
    let thin_prism = Tilt::BeforeRadial { p: [0.004, -0.003], s: [0.01, -0.02] };
    let rad_tan = Tilt::AfterRadial { p: [0.004, -0.003], s: [0.01, 0.002, -0.02, 0.003] };
    let cases: [((i32, &str), &[f64], Distortion); 15] = [
        ((2, "SIMPLE_RADIAL"), &[-0.15], radial([-0.15, 0., 0., 0., 0., 0.], [0.; 2])),
        ((3, "RADIAL"), &[0.1, -0.05], radial([0.1, -0.05, 0., 0., 0., 0.], [0.; 2])),
        ((4, "OPENCV"), &[-0.1, 0.02, 0.004, -0.003], radial([-0.1, 0.02, 0., 0., 0., 0.], [0.004, -0.003])),
        (
            (6, "FULL_OPENCV"),
            &[0.2, 0.05, 0.002, 0.001, 0.01, 0.3, 0.02, 0.01],
            radial([0.2, 0.05, 0.01, 0.3, 0.02, 0.01], [0.002, 0.001]),
        ),
        ((5, "OPENCV_FISHEYE"), &[0.05, -0.02, 0.01, 0.0], fisheye(&[0.05, -0.02, 0.01])),
        ((8, "SIMPLE_RADIAL_FISHEYE"), &[0.05], fisheye(&[0.05])),
        ((9, "RADIAL_FISHEYE"), &[0.05, 0.02], fisheye(&[0.05, 0.02])),
        ((7, "FOV"), &[0.6], Distortion::FieldOfView { omega: 0.6 }),
        (
            (10, "THIN_PRISM_FISHEYE"),
            &[0.05, -0.02, 0.004, -0.003, 0.01, 0.0, 0.01, -0.02],
            tilted(&[0.05, -0.02, 0.01], thin_prism),
        ),
        (
            (11, "RAD_TAN_THIN_PRISM_FISHEYE"),
            &[0.05, -0.02, 0.01, 0.0, 0.001, 0.002, 0.004, -0.003, 0.01, 0.002, -0.02, 0.003],
            tilted(&[0.05, -0.02, 0.01, 0.0, 0.001, 0.002], rad_tan),
        ),
        ((12, "SIMPLE_DIVISION"), &[-0.2], Distortion::Division { k: -0.2 }),
        ((13, "DIVISION"), &[-0.1], Distortion::Division { k: -0.1 }),
        ((14, "SIMPLE_FISHEYE"), &[], fisheye(&[])),
        ((15, "FISHEYE"), &[], fisheye(&[])),
        ((16, "EUCM"), &[0.6, 1.1], Distortion::Unified { alpha: 0.6, beta: 1.1 }),
    ];
    for (model, extra, distortion) in &cases {
        let (mean, worst, kept) = differences(&captured(*model, extra, distortion, 120));
        // Needed: mean 0.6, worst 3 (truncation of colours, bilinear sampling).
        assert!(mean < 1.0 && worst <= 4.0, "{model:?}: mean {mean}, worst {worst}");
        assert!(kept > 0.9, "{model:?}: {kept}");
        // Negative control: the same photos taken for a pinhole's.
        let (mean, ..) = differences(&captured((1, "PINHOLE"), &[], distortion, 120));
        assert!(mean > 1.5, "{model:?}: {mean} without undistortion");
    }
}

#[test]
fn photos_are_undistorted_and_reduced_in_one_pass() {
    let distortion = radial([-0.15, 0., 0., 0., 0., 0.], [0.; 2]);
    let (mean, ..) = differences(&captured((2, "SIMPLE_RADIAL"), &[-0.15], &distortion, 60));
    assert!(mean < 1.0, "{mean}");
}

#[test]
fn pixels_outside_the_distorted_image_are_masked() {
    // Pincushion: the photo shows less than the pinhole would.
    let distortion = radial([0.5, 0., 0., 0., 0., 0.], [0.; 2]);
    let photo = captured((2, "SIMPLE_RADIAL"), &[0.5], &distortion, 120);
    let mask = photo.mask.clone().unwrap();
    assert_eq!((mask[0], mask[40 * 120 + 60]), (0, 255));
    let (mean, _, kept) = differences(&photo);
    assert!(mean < 1.0 && kept > 0.5 && kept < 0.95, "{mean} {kept}");
}

/// As `captured`, with the lens and its k4 in a `transforms.json`.
fn captured_by_json(model: &str, k: [f64; 4], distortion: &Distortion) -> TargetImage {
    let mut scene = Scene::ring(2);
    scene.cameras[0].size = SIZE;
    scene.cameras[0].params = vec![FOCAL_PX, FOCAL_PX, CENTRE_PX.x, CENTRE_PX.y];
    let folder = tempdir().unwrap();
    std::fs::create_dir(folder.path().join("images")).unwrap();
    let mut json = scene.transforms("images/");
    json["camera_model"] = model.into();
    for (name, value) in ["k1", "k2", "k3", "k4"].into_iter().zip(k) {
        json[name] = value.into();
    }
    write_json(folder.path().join("transforms.json"), &json);
    for image in &scene.images {
        distorted_photo(distortion).save(folder.path().join("images").join(&image.name)).unwrap();
    }
    let options = LoadOptions { test_every: 0, ..LoadOptions::default() };
    let capture = Capture::load(folder.path(), &options).unwrap();
    let is_said = capture.report.warnings.iter().any(|w| w.code == "brown-k4" && w.count == 2);
    assert_eq!(is_said, model == "OPENCV");
    TargetImage::clone(&capture.target(0).unwrap())
}

#[test]
fn k4_of_a_json_is_browns_fourth_term() {
    let k = [-0.05, 0.02, -0.01, 0.10];
    let brown = Distortion::Brown { k, p: [0.0; 2], shear: 0.0 };
    let (mean, worst, _) = differences(&captured_by_json("OPENCV", k, &brown));
    assert!(mean < 1.0 && worst <= 4.0, "mean {mean}, worst {worst}");
    // Negative control: as OpenCV's denominator, it is 6 px off in the corners.
    let (mean, worst, _) = differences(&captured_by_json("FULL_OPENCV", k, &brown));
    assert!(mean > 3.0 && worst > 50.0, "mean {mean}, worst {worst}");
}

#[test]
fn positions_in_distorted_photos_are_found_in_the_pinhole_image() {
    let fisheye = |k: [f64; 6]| Distortion::Fisheye { k, tilt: Tilt::None };
    let lenses = [
        ("barrel", radial([-0.15, 0., 0., 0., 0., 0.], [0.; 2])),
        ("pincushion", radial([0.5, 0., 0., 0., 0., 0.], [0.004, -0.003])),
        ("rational", radial([0.2, 0.05, 0.01, 0.3, 0.02, 0.01], [0.002, 0.001])),
        ("fisheye", fisheye([0.05, -0.02, 0.01, 0., 0., 0.])),
        ("field of view", Distortion::FieldOfView { omega: 0.9 }),
        ("division", Distortion::Division { k: -0.2 }),
        ("unified", Distortion::Unified { alpha: 0.6, beta: 1.1 }),
    ];
    for (name, distortion) in lenses {
        for focal_px in [90.0, 45.0] {
            let (width_px, height_px) = SIZE;
            let (cx_px, cy_px) = (CENTRE_PX.x, CENTRE_PX.y);
            let pinhole = Pinhole { fx_px: focal_px, fy_px: focal_px, cx_px, cy_px, width_px, height_px };
            let warp = Warp::new(Lens { pinhole, distortion }, 1.0);
            let mut found = 0;
            for (x, y) in (0..SIZE.0 as usize)
                .step_by(3)
                .flat_map(|x| (0..SIZE.1 as usize).step_by(3).map(move |y| (x, y)))
            {
                let Some(distorted) = warp.source_px(x, y) else { continue };
                let expected = DVec2::new(x as f64 + 0.5, y as f64 + 0.5);
                let back = warp.undistorted_px(distorted);
                let back = back.unwrap_or_else(|| panic!("{name}, {focal_px}: {expected} at {distorted}"));
                // Near the largest radius positions hardly move with the ray.
                assert!(back.distance(expected) < 0.05, "{name}, {focal_px}: {back} for {expected}");
                assert!(warp.distorted_px(back).unwrap().distance(distorted) < 1e-5, "{name}, {focal_px}");
                found += 1;
            }
            assert!(found > 400, "{name}, {focal_px}: {found}");
            // Negative controls: the lens moves them, and outside of the photo there is nothing.
            let corner = DVec2::new(2.5, 2.5);
            assert!(warp.undistorted_px(corner).is_none_or(|p| p.distance(corner) > 0.5), "{name}");
            assert_eq!(warp.undistorted_px(DVec2::new(-1.0, 40.0)), None);
        }
    }
}
