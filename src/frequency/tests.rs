//! Properties of the schedule for images with known spectra.

use super::fixtures::{fractal, noisy, paper, photo, schedule_by, schedule_of, views};
use super::*;
use crate::image::TargetImage;

/// The first of 15,000 steps at which the scale is below `limit`.
fn first_below(schedule: &FrequencySchedule, limit: f64) -> u32 {
    (0..=15_000).find(|&step| schedule.scale(f64::from(step) / 15_000.0) < limit).unwrap()
}

/// The steps of 15,000 from which r <= 2 and r = 1.
fn openings(schedule: &FrequencySchedule) -> (u32, u32) {
    (first_below(schedule, 3.0), first_below(schedule, 2.0))
}

/// Mean share of pixels, 1 / r^2, until T_r.
fn pixel_work(schedule: &FrequencySchedule, rule: ScaleRule) -> f64 {
    let share = |step: u32| schedule.render_scale(f64::from(step) / 1500.0, rule, 540).powi(-2);
    (0..1500).map(share).sum::<f64>() / 1500.0
}

const SIZE: (usize, usize) = (800, 540);

#[test]
fn constant_images_have_one_stage() {
    for value in [0.0, 0.5, 1.0] {
        for options in [FrequencyOptions::default(), paper()] {
            let schedule = schedule_of(vec![photo(97, 64, |_| [value; 3])], &options);
            assert_eq!(schedule.nodes, FrequencySchedule::flat().nodes, "{value}");
            assert_eq!((schedule.s_max, schedule.views, schedule.scale(0.3)), (1.0, 1, 1.0));
        }
    }
    assert_eq!(schedule_of(vec![], &FrequencyOptions::default()), FrequencySchedule::flat());
}

#[test]
fn white_noise_starts_at_scale_sqrt_beta() {
    let values = vec![0.5; SIZE.0 * SIZE.1];
    let noise = noisy(SIZE.0, SIZE.1, &values, 40.0 / 255.0);
    let schedule = schedule_of(vec![noise.clone()], &paper());
    // Needed: 2.01 %; the mean and the zero padding of the gradient are not white.
    assert!((schedule.s_max / 3.0_f64.sqrt() - 1.0).abs() < 0.03, "{}", schedule.s_max);
    let limited = FrequencyOptions { max_scale: 1.5, ..paper() };
    assert_eq!(schedule_of(vec![noise.clone()], &limited).s_max, 1.5);
    // Recognised as noise it requires no resolution, and the schedule is still valid.
    let robust = schedule_of(vec![noise], &FrequencyOptions::default());
    assert!((robust.noise * 255.0 - 40.0).abs() < 2.0, "{}", robust.noise * 255.0);
    assert!(robust.s_max > 3.0 && robust.nodes.iter().all(|n| n.0.is_finite() && n.1 >= 1.0));
}

#[test]
fn fractal_images_match_the_published_formula() {
    // The formulas of method 7.2, computed by another program on other images of the same spectra: exponent, s_max,
    // steps from which r <= 2 and r = 1, share of pixels with integer scales.
    for (exponent, s_max, two, one, work) in [
        (0.8, 2.4, 0, 3_355, 0.83),
        (1.0, 2.9, 0, 5_156, 0.74),
        (1.3, 4.0, 3_106, 7_549, 0.59),
        (1.6, 4.0, 3_183, 7_906, 0.58),
    ] {
        let values = fractal(SIZE.0, SIZE.1, exponent, 1);
        let schedule = schedule_of(vec![noisy(SIZE.0, SIZE.1, &values, 0.0)], &paper());
        let (r2, r1) = openings(&schedule);
        let integer = pixel_work(&schedule, ScaleRule::Integer);
        let fractional = pixel_work(&schedule, ScaleRule::Fractional);
        // Needed: 0.07 (the table has one decimal), 80 and 100 steps, 0.015.
        assert!((schedule.s_max - s_max).abs() < 0.1, "{exponent}: {}", schedule.s_max);
        assert!(r2.abs_diff(two) < 150 && r1.abs_diff(one) < 150, "{exponent}: {r2} {r1}");
        assert!((integer - work).abs() < 0.02, "{exponent}: {integer}");
        assert!(fractional < integer - 0.1, "{exponent}: {fractional}");
    }
}

#[test]
fn noise_removal_keeps_stages_stable() {
    for exponent in [1.0, 1.3, 1.6] {
        let values = fractal(SIZE.0, SIZE.1, exponent, 1);
        let with = |sigma: f64, options: &FrequencyOptions| {
            schedule_of(vec![noisy(SIZE.0, SIZE.1, &values, sigma / 255.0)], options)
        };
        let moved = |options: &FrequencyOptions| {
            let (clean, noisy) = (with(0.0, options), with(10.0, options));
            let (before, after) = (openings(&clean).1, openings(&noisy).1);
            (f64::from(after) / f64::from(before) - 1.0, noisy.s_max - clean.s_max)
        };
        // Needed: 1.3 % and 0.015.
        let (step, scale) = moved(&FrequencyOptions::default());
        assert!(step.abs() < 0.03 && scale.abs() < 0.03, "{exponent}: {step} {scale}");
        // Negative control: with the noise left in they move by 19 to 74 %.
        let (step, scale) = moved(&paper());
        assert!(step < -0.15 && scale < -0.2, "{exponent}: {step} {scale}");
    }
}

/// A photo with detail in one part and a uniform surface in the other.
fn half_detailed(exponent: f64, sigma: f64) -> TargetImage {
    let mut values = fractal(SIZE.0, SIZE.1, exponent, 3);
    values[SIZE.0 * SIZE.1 * 2 / 5..].fill(0.4);
    noisy(SIZE.0, SIZE.1, &values, sigma)
}

#[test]
fn noise_removal_keeps_stages_of_noiseless_photos() {
    // Real photos have quiet places, where noise can be told from detail.
    let photo = half_detailed(1.0, 0.0);
    let (plain, robust) =
        (schedule_of(vec![photo.clone()], &paper()), schedule_of(vec![photo], &FrequencyOptions::default()));
    assert_eq!(robust.noise, 0.0);
    let ((two, one), (robust_two, robust_one)) = (openings(&plain), openings(&robust));
    assert!(two.abs_diff(robust_two) < 50 && one.abs_diff(robust_one) < 50);
    let noisy = |options: &FrequencyOptions| schedule_of(vec![half_detailed(1.0, 6.0 / 255.0)], options);
    let (left_in, taken_out) = (noisy(&paper()), noisy(&FrequencyOptions::default()));
    // The estimate is an upper bound.
    assert!((6.0..6.5).contains(&(taken_out.noise * 255.0)), "{}", taken_out.noise * 255.0);
    let moved = |schedule: &FrequencySchedule| (f64::from(openings(schedule).1) / f64::from(one) - 1.0).abs();
    // Needed: 2.2 %, against 14.7 % with the noise left in.
    assert!(moved(&taken_out) < 0.04 && moved(&left_in) > 0.1);
}

#[test]
fn scales_fall_and_caps_rise_from_start_to_end() {
    let values = fractal(200, 136, 1.3, 5);
    let schedule = schedule_of(vec![noisy(200, 136, &values, 0.0)], &paper());
    let (first, last) = (schedule.nodes[0], schedule.nodes[31]);
    assert_eq!((schedule.nodes.len(), first, last), (32, (0.0, schedule.s_max), (1.0, 1.0)));
    assert!(schedule.nodes.windows(2).all(|n| n[0].0 < n[1].0 && n[0].1 >= n[1].1), "{:?}", schedule.nodes);
    let times: Vec<f64> = (-5..=1010).map(|i| f64::from(i) / 1000.0).collect();
    for t in times.windows(2) {
        assert!(schedule.scale(t[0]) >= schedule.scale(t[1]) && schedule.scale(t[1]) >= 1.0);
        for rule in [ScaleRule::Integer, ScaleRule::Fractional] {
            let scale = |t| schedule.render_scale(t, rule, 1000);
            assert!(scale(t[0]) >= scale(t[1]) && scale(t[1]) >= 1.0 && scale(t[0]) <= schedule.scale(t[0]));
        }
        for rule in [CapRule::Squared, CapRule::Authors] {
            let cap = |t| schedule.texture_cap(t, rule);
            assert!(cap(t[0]) <= cap(t[1]), "{rule:?} at {}", t[0]);
        }
    }
    assert_eq!(
        (schedule.scale(1.0), schedule.scale(7.0), schedule.scale(f64::NAN)),
        (1.0, 1.0, schedule.s_max)
    );
}

#[test]
fn rules_round_as_documented() {
    let schedule =
        FrequencySchedule { s_max: 4.0, nodes: vec![(0.0, 4.0), (1.0, 1.0)], views: 1, noise: 0.0 };
    // 1/s^2 = 1/16 + 15/16 t: s = 4, 2 and sqrt(2) at t = 0, 1/5 and 7/15.
    let times = [0.0, 0.2, 7.0 / 15.0, 1.0];
    for (t, scale) in times.into_iter().zip([4.0, 2.0, 2.0_f64.sqrt(), 1.0]) {
        assert!((schedule.scale(t) - scale).abs() < 1e-12);
    }
    let scales = |rule, side| times.map(|t| schedule.render_scale(t, rule, side));
    assert_eq!(scales(ScaleRule::Integer, 256), [4.0, 2.0, 1.0, 1.0]);
    assert_eq!(scales(ScaleRule::Integer, 255), [3.0, 2.0, 1.0, 1.0]);
    assert_eq!(scales(ScaleRule::Integer, 20), [1.0; 4]);
    assert_eq!(scales(ScaleRule::Fractional, 256), [4.0, 2.0, 2.0_f64.sqrt(), 1.0]);
    assert_eq!(schedule.render_scale(0.01, ScaleRule::Fractional, 256), 2.0_f64.powf(1.75));
    assert_eq!(times.map(|t| schedule.texture_cap(t, CapRule::Squared)), [16, 64, 128, 256]);
    // s linear between the nodes: 4, 3.4, 2.6, 1.
    assert_eq!(times.map(|t| schedule.texture_cap(t, CapRule::Authors)), [64, 64, 85, 256]);
    let flat = FrequencySchedule::flat();
    assert_eq!((flat.scale(0.0), flat.texture_cap(0.0, CapRule::Squared)), (1.0, 256));
    assert_eq!(flat.render_scale(0.0, ScaleRule::Integer, 1000), 1.0);
}

#[test]
fn the_weight_of_a_view_does_not_depend_on_its_size() {
    let rules = RuleSet { start: StartRule::Quantile(1.0), ..ScheduleRules::Paper.set() };
    let options = &paper();
    let fine = || noisy(SIZE.0, SIZE.1, &vec![0.5; SIZE.0 * SIZE.1], 0.15);
    let coarse = |w: usize, h: usize| noisy(w, h, &fractal(w, h, 1.3, 2), 0.0);
    let one = |schedule: &FrequencySchedule| openings(schedule).1;
    let same = one(&schedule_by(vec![fine(), coarse(SIZE.0, SIZE.1)], options, &rules));
    let smaller = one(&schedule_by(vec![fine(), coarse(267, 180)], options, &rules));
    let alone = one(&schedule_by(vec![coarse(267, 180)], options, &rules));
    // Needed: 480 steps, since the spectrum of a smaller fractal has fewer octaves.
    assert!(same.abs_diff(smaller) < 700, "{same} {smaller}");
    // Weighted by its pixels, the small view would make no difference; alone, it decides.
    let unnoticed = one(&schedule_by(vec![fine()], options, &rules));
    assert!(smaller > unnoticed + 2_000 && alone > smaller + 500, "{unnoticed} {smaller} {alone}");
}

#[test]
fn masked_pixels_are_ignored() {
    let (width, height) = (120, 100);
    let values = fractal(width, height, 1.0, 4);
    let with = |masked: f64, mask: bool| {
        let hidden = |i: usize| i % width > 80;
        let mut photo = photo(width, height, |i| {
            // Stripes two pixels wide are fine detail.
            let stripe = f64::from(u8::from(i / 2 % 2 == 0));
            [if hidden(i) { masked * stripe } else { values[i] }; 3]
        });
        photo.mask = mask.then(|| (0..width * height).map(|i| 255 * u8::from(!hidden(i))).collect());
        schedule_of(vec![photo], &FrequencyOptions::default())
    };
    assert_eq!(with(1.0, true), with(0.0, true));
    assert_ne!(with(1.0, false).nodes, with(0.0, false).nodes);
    let mut hidden = photo(16, 16, |i| [(i % 7) as f64 / 7.0; 3]);
    hidden.mask = Some(vec![0; 256]);
    assert_eq!(schedule_of(vec![hidden], &FrequencyOptions::default()), FrequencySchedule::flat());
}

#[test]
fn one_noisy_photo_does_not_set_the_first_scale() {
    let mut photos: Vec<TargetImage> =
        (0..20).map(|seed| noisy(120, 90, &fractal(120, 90, 1.3, seed), 0.0)).collect();
    photos[7] = noisy(120, 90, &vec![0.5; 120 * 90], 0.2);
    let start = |quantile: f64| {
        let rules = RuleSet { start: StartRule::Quantile(quantile), ..ScheduleRules::Paper.set() };
        schedule_by(photos.clone(), &paper(), &rules).s_max
    };
    assert!(start(0.0) < 1.9 && start(0.1) > 3.0, "{} {}", start(0.0), start(0.1));
    // Of the mean, one photo is a twentieth.
    let of_mean = schedule_of(photos.clone(), &paper()).s_max;
    assert!(of_mean > start(0.0) + 0.1, "{of_mean}");
}

#[test]
fn schedules_do_not_depend_on_threads_and_round_trip_as_json() {
    let photos: Vec<TargetImage> =
        (0..7).map(|seed| noisy(90, 67, &fractal(90, 67, 1.2, seed), 0.02)).collect();
    let with = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| schedule_of(photos.clone(), &FrequencyOptions::default()))
    };
    let schedule = with(1);
    assert_eq!(schedule, with(3));
    assert!(schedule.noise > 0.0 && schedule.nodes.len() == 32);
    let text = serde_json::to_string(&schedule).unwrap();
    let read: FrequencySchedule = serde_json::from_str(&text).unwrap();
    assert_eq!(read, schedule);
    for damage in ["\"nodes\":[[0.0,", "\"nodes\":[[0.5,0.5],[0.0,"] {
        let damaged = text.replace("\"nodes\":[[0.0,", damage);
        assert_eq!(serde_json::from_str::<FrequencySchedule>(&damaged).is_ok(), damaged == text, "{damaged}");
    }
    for nodes in ["[]", "[[0.0,2.0]]", "[[0.0,2.0],[1.0,3.0]]", "[[0.0,2.0],[0.5,1.0]]"] {
        let text = format!("{{\"s_max\":2.0,\"nodes\":{nodes},\"views\":1,\"noise\":0.0}}");
        assert!(serde_json::from_str::<FrequencySchedule>(&text).is_err(), "{text}");
    }
}

#[test]
fn settings_are_read_by_name_and_checked() {
    let options: FrequencyOptions = toml::from_str("max-scale = 3.0\nrules = \"paper\"").unwrap();
    assert_eq!((options.max_scale, options.beta, options.rules), (3.0, 3.0, ScheduleRules::Paper));
    assert!(toml::from_str::<FrequencyOptions>("max_scale = 3.0").is_err());
    let wrong = [
        ("beta", FrequencyOptions { beta: 1.0, ..FrequencyOptions::default() }),
        ("beta", FrequencyOptions { beta: f64::NAN, ..FrequencyOptions::default() }),
        ("max-scale", FrequencyOptions { max_scale: 0.5, ..FrequencyOptions::default() }),
    ];
    for (name, options) in wrong {
        let error = FrequencySchedule::analyse(&views(vec![]), &options).unwrap_err();
        assert!(error.to_string().contains(name), "{error}");
    }
}
