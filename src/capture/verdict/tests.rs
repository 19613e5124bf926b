//! The verdict as a function of figures, and the measures on made photos.

use super::exposure::{Seen, spread_stops};
use super::sharpness::{self, Levels, Sharpness};
use super::{Figures, Rating, blur, judge, same_points};
use crate::image::TargetImage;
use glam::DVec2;

const SIDE: usize = 192;

/// Figures of a capture that nothing is wrong with.
fn good() -> Figures {
    Figures {
        photos: 50,
        views: 50,
        train_views: 43,
        places: 50,
        views_per_point: Some(10.5),
        parallax_degrees: Some(23.0),
        reprojection_error_px: Some(0.9),
        photos_decoded: 50,
        sharpness: Some(0.5),
        exposure_stops: Some(1.1),
        ..Figures::default()
    }
}

fn names(count: usize) -> Vec<String> {
    (0..count).map(|i| format!("{i}.jpg")).collect()
}

#[test]
fn each_fault_has_its_reason_and_good_figures_have_none() {
    assert_eq!(judge::reasons(&good()), []);
    let known_only = Figures { views: 75, train_views: 50, places: 75, ..Figures::default() };
    assert_eq!(judge::reasons(&known_only), [], "poses without points");
    let (usable, again) = (Rating::Usable, Rating::ShootAgain);
    for (code, rating, figures) in [
        ("few-views", usable, Figures { train_views: 9, ..good() }),
        ("few-views", again, Figures { train_views: 3, ..good() }),
        ("one-place", again, Figures { places: 1, parallax_degrees: Some(0.0), ..good() }),
        ("one-place", again, Figures { parallax_degrees: Some(0.4), ..good() }),
        ("little-overlap", usable, Figures { views_per_point: Some(4.5), ..good() }),
        ("little-overlap", usable, Figures { views_without_overlap: 4, ..good() }),
        ("little-overlap", again, Figures { views_without_overlap: 30, ..good() }),
        ("blurred-photos", usable, Figures { blurred: names(1), ..good() }),
        ("blurred-photos", again, Figures { blurred: names(20), ..good() }),
        ("blurred-photos", again, Figures { sharpness: Some(0.15), ..good() }),
        ("photos-without-pose", usable, Figures { photos: 80, ..good() }),
        ("photos-without-pose", again, Figures { photos: 200, ..good() }),
        ("drifting-exposure", usable, Figures { exposure_stops: Some(2.8), ..good() }),
        ("inexact-poses", usable, Figures { reprojection_error_px: Some(2.0), ..good() }),
        ("far-cameras", usable, Figures { far_cameras: 2, ..good() }),
        ("masks", usable, Figures { masked_share: Some(0.95), ..good() }),
        ("unreadable-photos", again, Figures { unreadable: Some("a.jpg".into()), ..good() }),
        ("unreadable-masks", again, Figures { unreadable_mask: Some("a.png".into()), ..good() }),
    ] {
        let reasons = judge::reasons(&figures);
        assert_eq!(reasons.iter().map(|r| (r.code, r.rating)).collect::<Vec<_>>(), [(code, rating)]);
    }
}

#[test]
fn the_worst_three_reasons_are_stated_and_names_are_cut() {
    let figures = Figures {
        far_cameras: 1,
        masked_share: Some(0.95),
        exposure_stops: Some(2.8),
        views_without_overlap: 30,
        blurred: names(12),
        ..good()
    };
    let reasons = judge::reasons(&figures);
    let codes: Vec<&str> = reasons.iter().map(|r| r.code).collect();
    assert_eq!(codes, ["little-overlap", "blurred-photos", "drifting-exposure"]);
    assert!(reasons[1].found.starts_with("12 of 50 photos are blurred: \"0.jpg\""), "{:?}", reasons[1]);
    assert!(reasons[1].found.ends_with("\"7.jpg\" and 4 more"), "{:?}", reasons[1]);
}

/// A photo of random rectangles, blurred along x and y by a box of these sides, twice.
fn photo(seed: usize, blur: [usize; 2]) -> TargetImage {
    let value = |i: usize| (((i + 1 + 977 * seed) as f64 * 12.9898).sin() * 43_758.547).rem_euclid(1.0);
    let mut grey = vec![90.0_f64; SIDE * SIDE];
    for rectangle in 0..120 {
        let at = |k: usize| value(8 * rectangle + k);
        let (x, y) = ((at(0) * SIDE as f64) as usize, (at(1) * SIDE as f64) as usize);
        let (w, h) = (4 + (at(2) * 40.0) as usize, 4 + (at(3) * 40.0) as usize);
        for row in y..(y + h).min(SIDE) {
            grey[row * SIDE + x..row * SIDE + (x + w).min(SIDE)].fill(255.0 * at(4));
        }
    }
    for (side, step) in [(blur[0], 1), (blur[1], SIDE), (blur[0], 1), (blur[1], SIDE)] {
        let half = side as isize / 2;
        let at = |i: usize, k: isize| {
            let along = if step == 1 { i % SIDE } else { i / SIDE } as isize;
            let moved = (along + k).clamp(0, SIDE as isize - 1) - along;
            (i as isize + moved * step as isize) as usize
        };
        grey = (0..SIDE * SIDE)
            .map(|i| (-half..=half).map(|k| grey[at(i, k)]).sum::<f64>() / (2 * half + 1) as f64)
            .collect();
    }
    let rgb = grey.iter().flat_map(|&v| [v.round() as u8; 3]).collect();
    TargetImage { width_px: SIDE as u32, height_px: SIDE as u32, rgb, mask: None, alpha: None }
}

fn sharpness_of(photos: &[TargetImage]) -> Vec<Option<Sharpness>> {
    photos.iter().map(|photo| sharpness::of(&Levels::of(photo))).collect()
}

#[test]
fn blurred_photos_are_found_and_no_others() {
    for (blurred, bad) in [([9, 9], 1..3), ([13, 1], 2..3), ([1, 13], 0..4), ([9, 9], 0..8), ([1, 1], 0..0)] {
        let of = |seed| photo(seed, if bad.contains(&seed) { blurred } else { [1, 1] });
        let photos: Vec<TargetImage> = (0..16).map(of).collect();
        let found = blur::of(&sharpness_of(&photos), &[None; 16]);
        assert_eq!(found.blurred, bad.clone().collect::<Vec<_>>(), "{blurred:?}");
        assert!(!blur::is_everywhere(found.median.unwrap()), "{found:?}");
    }
    let all: Vec<TargetImage> = (0..16).map(|seed| photo(seed, [9, 9])).collect();
    let found = blur::of(&sharpness_of(&all), &[None; 16]);
    assert!(found.blurred.is_empty() && blur::is_everywhere(found.median.unwrap()), "{found:?}");
}

/// The share of the detail of its points that each photo shows; all show the same ones in the same places.
fn shares_of(photos: &[TargetImage]) -> Vec<Option<f64>> {
    let along = |i: u32| f64::from(12 * i + 16);
    let points: Vec<(u32, DVec2)> = (0..196).map(|i| (i, DVec2::new(along(i % 14), along(i / 14)))).collect();
    let seen: Vec<_> = photos.iter().map(|photo| same_points::seen(&Levels::of(photo), &points)).collect();
    same_points::shares(&seen)
}

#[test]
fn a_blur_of_few_pixels_is_found_where_photos_show_the_same() {
    for blur in [[5, 5], [7, 1]] {
        let of = |i: usize| photo(1, if [2, 5].contains(&i) { blur } else { [1, 1] });
        let photos: Vec<TargetImage> = (0..16).map(of).collect();
        let (sharpness, shares) = (sharpness_of(&photos), shares_of(&photos));
        assert_eq!(blur::of(&sharpness, &shares).blurred, [2, 5], "{blur:?}: {shares:?}, {sharpness:?}");
        assert!((0..16).all(|i| [2, 5].contains(&i) || shares[i] == Some(1.0)), "{shares:?}");
    }
    // Negative control: too few photos show the points.
    assert_eq!(shares_of(&[photo(1, [1, 1]), photo(1, [5, 5])]), [None, None]);
}

#[test]
fn smooth_and_masked_photos_are_not_judged() {
    let mut wall = photo(0, [1, 1]);
    assert!(sharpness::of(&Levels::of(&wall)).is_some(), "negative control");
    wall.mask = Some(vec![0; SIDE * SIDE]);
    assert_eq!(sharpness::of(&Levels::of(&wall)), None);
    for (i, value) in wall.rgb.iter_mut().enumerate() {
        *value = 90 + (i / 3 % SIDE / 8) as u8;
    }
    wall.mask = None;
    assert_eq!(sharpness::of(&Levels::of(&wall)), None, "a smooth wall");
}

#[test]
fn exposures_follow_from_points_that_photos_share() {
    let photos = |drift: f64| -> Vec<Vec<Seen>> {
        let of = |view: usize| {
            let exposure = drift * (view as f64 / 9.0 - 0.5);
            // Every view shows other points, of another brightness.
            (20 * view..20 * view + 200)
                .map(|point| Seen { point: point as u32, stops: [-3.0 + 0.01 * point as f64 + exposure; 3] })
                .collect()
        };
        (0..10).map(of).collect()
    };
    let found = |drift: f64| spread_stops(&photos(drift)).unwrap();
    assert!(found(0.0).abs() < 0.01, "{}", found(0.0));
    // From the 10th to the 90th percentile; neighbours only share points, so eight passes do not find all.
    assert!((1.5..3.3).contains(&found(4.0)), "{}", found(4.0));
    assert_eq!(spread_stops(&photos(4.0)[..2]), None, "two photos");
}
