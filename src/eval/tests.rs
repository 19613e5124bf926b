//! Quality figures against independent direct implementations, and the properties they must have.

use super::*;

/// A deterministic image with structure at several scales.
fn photo(width_px: u32, height_px: u32) -> TargetImage {
    let rgb = (0..width_px * height_px)
        .flat_map(|i| {
            let (x, y) = (f64::from(i % width_px), f64::from(i / width_px));
            [0.0, 1.0, 2.0].map(|c| {
                let v = 0.5 + 0.3 * (0.31 * x + 0.17 * y + c).sin() + 0.2 * (1.7 * x - 0.9 * y * c).cos();
                (v.clamp(0.0, 1.0) * 255.0) as u8
            })
        })
        .collect();
    TargetImage::opaque(width_px, height_px, rgb)
}

/// The photo with pseudo-random noise of the given amplitude.
fn noisy(photo: &TargetImage, amplitude: f32) -> Vec<f32> {
    let mut state = 12345_u32;
    photo
        .rgb
        .iter()
        .map(|&v| {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            f32::from(v) / 255.0 + amplitude * ((state >> 8) as f32 / 8_388_608.0 - 1.0)
        })
        .collect()
}

fn exact(photo: &TargetImage) -> Vec<f32> {
    noisy(photo, 0.0)
}

const SIZES: [(u32, u32); 5] = [(1, 1), (3, 2), (17, 13), (11, 11), (40, 31)];

#[test]
fn identical_images_have_the_best_figures() {
    for (w, h) in SIZES {
        let photo = photo(w, h);
        let q = quality_of("a.png", &exact(&photo), &photo);
        assert_eq!((q.psnr, q.grad_psnr), (PSNR_CAP_DB, PSNR_CAP_DB), "{w}x{h}");
        // Needed 0.
        assert!((q.ssim_3dgs - 1.0).abs() < 1e-14 && (q.ssim_valid - 1.0).abs() < 1e-14);
        assert_eq!(q.flip, 0.0);
    }
}

#[test]
fn figures_get_worse_with_noise() {
    let photo = photo(40, 31);
    let figures: Vec<_> =
        [0.0, 0.02, 0.05, 0.1, 0.3, 0.6].iter().map(|&a| quality_of("", &noisy(&photo, a), &photo)).collect();
    for pair in figures.windows(2) {
        assert!(pair[1].psnr < pair[0].psnr - 1.0);
        assert!(pair[1].grad_psnr < pair[0].grad_psnr - 1.0);
        assert!(pair[1].ssim_3dgs < pair[0].ssim_3dgs);
        assert!(pair[1].ssim_valid < pair[0].ssim_valid);
        assert!(pair[1].flip > pair[0].flip);
    }
}

#[test]
fn psnr_of_a_constant_offset_follows_the_formula() {
    let photo = TargetImage::opaque(5, 4, vec![100; 60]);
    let rendered = vec![110.4 / 255.0; 60]; // rounds to 110
    let q = quality_of("", &rendered, &photo);
    // Needed 0.
    assert!((q.psnr - 20.0 * (25.5_f64).log10()).abs() < 1e-12);
    assert_eq!(q.grad_psnr, PSNR_CAP_DB, "an offset changes no gradient");
}

#[test]
fn renders_are_clamped_and_rounded_before_comparison() {
    let photo = TargetImage::opaque(2, 1, vec![255, 0, 128, 0, 255, 0]);
    let rendered = [7.0, -3.0, 128.4 / 255.0, f32::NAN, 1.0019, -0.0];
    assert_eq!(quality_of("", &rendered, &photo).psnr, PSNR_CAP_DB);
}

#[test]
fn gradient_psnr_matches_a_direct_sobel_filter() {
    let photo = photo(17, 13);
    let pair = ImagePair::new(&noisy(&photo, 0.2), &photo);
    let mean = |p: &[u8], x: i32, y: i32| {
        let at = 3 * (y * 17 + x) as usize;
        p[at..at + 3].iter().map(|&v| f64::from(v) / 255.0).sum::<f64>() / 3.0
    };
    let sobel = [[-1.0, 0.0, 1.0], [-2.0, 0.0, 2.0], [-1.0, 0.0, 1.0]];
    let (mut sum, mut count) = (0.0, 0.0);
    for y in 1..12_i32 {
        for x in 1..16_i32 {
            for transposed in [false, true] {
                let gradient = |p: &[u8]| {
                    let mut g = 0.0;
                    for dy in 0..3_i32 {
                        for dx in 0..3_i32 {
                            let (i, j) = if transposed { (dx, dy) } else { (dy, dx) };
                            g += sobel[i as usize][j as usize] / 8.0 * mean(p, x + dx - 1, y + dy - 1);
                        }
                    }
                    g
                };
                sum += (gradient(&pair.rendered) - gradient(&pair.target)).powi(2);
                count += 1.0;
            }
        }
    }
    let expected = 10.0 * (count / sum).log10();
    // Needed 0; the direct sum may round differently on other machines.
    assert!((gradient_psnr(&pair) - expected).abs() < 1e-10);
    // The gradient of a ramp is its slope: here 2 code values per pixel, against a flat image.
    let ramp = TargetImage::opaque(8, 8, (0..64).flat_map(|i| [2 * (i % 8) as u8; 3]).collect());
    let flat = ImagePair::new(&[0.0; 192], &ramp);
    let slope = 2.0 / 255.0_f64;
    assert!((gradient_psnr(&flat) - psnr_from_mse(slope * slope / 2.0)).abs() < 1e-10);
}

/// SSIM by definition, with a full 2D window at each pixel and zero padding: (all pixels, valid region).
fn direct_ssim(pair: &ImagePair, sigma: f64) -> (f64, f64) {
    let (w, h) = (pair.width_px as i32, pair.height_px as i32);
    let g = |d: i32| (-f64::from(d * d) / (2.0 * sigma * sigma)).exp();
    let norm: f64 = (-5..=5).flat_map(|a| (-5..=5).map(move |b| g(a) * g(b))).sum();
    let (mut all, mut valid, mut num_valid) = (0.0, 0.0, 0.0);
    for c in 0..3 {
        for y in 0..h {
            for x in 0..w {
                let mut m = [0.0; 5];
                for dy in -5..=5 {
                    for dx in -5..=5 {
                        let (u, v) = (x + dx, y + dy);
                        if u < 0 || v < 0 || u >= w || v >= h {
                            continue;
                        }
                        let at = (3 * (v * w + u) + c) as usize;
                        let (a, b) =
                            (f64::from(pair.rendered[at]) / 255.0, f64::from(pair.target[at]) / 255.0);
                        for (sum, q) in m.iter_mut().zip([a, b, a * a, b * b, a * b]) {
                            *sum += g(dx) * g(dy) / norm * q;
                        }
                    }
                }
                let [mx, my, xx, yy, xy] = m;
                let s = (2.0 * mx * my + 1e-4) * (2.0 * (xy - mx * my) + 9e-4)
                    / ((mx * mx + my * my + 1e-4) * (xx - mx * mx + yy - my * my + 9e-4));
                all += s;
                if x >= 5 && y >= 5 && x + 5 < w && y + 5 < h {
                    valid += s;
                    num_valid += 1.0;
                }
            }
        }
    }
    let all = all / f64::from(3 * w * h);
    (all, if num_valid > 0.0 { valid / num_valid } else { all })
}

#[test]
fn ssim_matches_its_definition() {
    for (w, h) in SIZES {
        let photo = photo(w, h);
        let pair = ImagePair::new(&noisy(&photo, 0.2), &photo);
        let ours = ssim(&pair);
        let (all, valid) = direct_ssim(&pair, 1.5);
        // Needed 1.7e-15.
        assert!((ours.zero_padded - all).abs() < 1e-12, "{w}x{h}");
        assert!((ours.valid - valid).abs() < 1e-12, "{w}x{h}");
        // Negative control: a window of another width is detected (it differs by 5e-3).
        if w > 10 {
            assert!((ours.zero_padded - direct_ssim(&pair, 1.6).0).abs() > 1e-3);
        }
    }
}

#[test]
fn masked_pixels_have_no_influence() {
    let mut photo = photo(40, 31);
    let masked = |i: usize| (i % 40) < 9 || i / 40 == 20;
    photo.mask = Some((0..40 * 31).map(|i| if masked(i) { 0 } else { 255 }).collect());
    let clean = noisy(&photo, 0.05);
    let mut dirty = clean.clone();
    for pixel in (0..40 * 31).filter(|&i| masked(i)) {
        dirty[3 * pixel..3 * pixel + 3].fill(0.77);
    }
    let a = quality_of("", &clean, &photo);
    assert_eq!(a, quality_of("", &dirty, &photo));
    // Negative control: without the mask, the same change affects every figure.
    photo.mask = None;
    let b = quality_of("", &clean, &photo);
    let c = quality_of("", &dirty, &photo);
    assert!(c.psnr < b.psnr - 1.0 && c.grad_psnr < b.grad_psnr - 1.0);
    assert!(c.ssim_3dgs < b.ssim_3dgs && c.ssim_valid < b.ssim_valid && c.flip > b.flip);
}

#[test]
fn a_fully_masked_view_has_the_best_figures() {
    let mut photo = photo(17, 13);
    photo.mask = Some(vec![0; 17 * 13]);
    let q = quality_of("", &noisy(&photo, 0.5), &photo);
    assert_eq!((q.psnr, q.ssim_3dgs, q.flip), (PSNR_CAP_DB, 1.0, 0.0));
}

#[test]
fn figures_of_a_set_are_means_over_its_views() {
    let photo = photo(17, 13);
    let views =
        vec![quality_of("a", &noisy(&photo, 0.1), &photo), quality_of("b", &noisy(&photo, 0.4), &photo)];
    let e = Evaluation::from_views(views.clone()).unwrap();
    assert_eq!(e.psnr, (views[0].psnr + views[1].psnr) / 2.0);
    assert_eq!(e.flip, (views[0].flip + views[1].flip) / 2.0);
    assert_eq!(e.per_view, views);
    assert_eq!(Evaluation::from_views(Vec::new()), None, "no views");
}

#[test]
fn error_maps_show_where_images_differ() {
    let mut photo = photo(4, 1);
    photo.mask = Some(vec![255, 255, 255, 0]);
    let mut rendered = exact(&photo);
    rendered[3..6].iter_mut().for_each(|v| *v = 1.0 - v.round());
    let map = error_map(&rendered, &photo);
    assert_eq!(map[0..3], crate::image::magma(0.0));
    assert_eq!(map[3..6], crate::image::magma(1.0));
    assert_eq!(map[9..12], [128; 3]);
}

/// A photo of colours whose left and right halves have the same range.
fn drifting(map: impl Fn([f64; 3]) -> [f64; 3]) -> (Vec<f32>, TargetImage) {
    let (w, h) = (64, 32);
    let clean: Vec<[f64; 3]> = (0..w * h)
        .map(|i| {
            let (x, y) = (f64::from(i % w), f64::from(i / w));
            let wave = |k: f64| 0.45 + 0.2 * (k * x + 0.37 * k * y).sin();
            [wave(0.9), wave(1.7), wave(2.3)]
        })
        .collect();
    let rgb = clean.iter().flat_map(|&c| map(c)).map(|v| (v * 255.0).round() as u8).collect();
    let rendered = clean.as_flattened().iter().map(|v| *v as f32).collect();
    (rendered, TargetImage::opaque(w, h, rgb))
}

#[test]
fn affine_colour_drift_is_corrected_and_other_errors_are_not() {
    let drift = |[r, g, b]: [f64; 3]| [0.8 * r + 0.1 * g + 0.05, 0.7 * g + 0.02, 1.1 * b + 0.1 * r + 0.01];
    let (rendered, photo) = drifting(drift);
    let q = quality_of("", &rendered, &photo);
    // Measured: 56.5 dB, the rounding of both images to 8 bits.
    assert!(q.psnr < 25.0 && q.psnr_corrected.unwrap() > 52.0, "{} {:?}", q.psnr, q.psnr_corrected);
    // Negative controls: a curve, and colours that differ between the halves, are no affine map of the colours.
    let (rendered, curved) = drifting(|c| c.map(|v| 4.0 * (v - 0.45).powi(2) + 0.3));
    // Measured: 24.0 dB.
    assert!(quality_of("", &rendered, &curved).psnr_corrected.unwrap() < 30.0);
    let (rendered, mut halves) = drifting(|c| c);
    assert_eq!(quality_of("", &rendered, &halves).psnr_corrected, Some(PSNR_CAP_DB));
    for (i, value) in halves.rgb.iter_mut().enumerate().filter(|(i, _)| i / 3 % 64 >= 32) {
        *value = value.saturating_sub(20 + (i % 3) as u8);
    }
    assert!(quality_of("", &rendered, &halves).psnr_corrected.unwrap() < 25.0);
}

#[test]
fn colours_are_corrected_in_flat_images_and_not_where_a_half_is_masked() {
    let flat = |value: u8| TargetImage::opaque(8, 4, vec![value; 96]);
    let q = quality_of("", &vec![0.5; 96], &flat(100));
    assert!(q.psnr < 20.0 && q.psnr_corrected.unwrap() > 60.0, "{q:?}");
    for hidden in [0..4, 4..8] {
        let mut masked = flat(100);
        masked.mask = Some((0..32).map(|i| if hidden.contains(&(i % 8)) { 0 } else { 255 }).collect());
        assert_eq!(quality_of("", &vec![0.5; 96], &masked).psnr_corrected, None);
    }
}

#[test]
fn uncovered_pixels_are_counted_where_the_photo_counts_and_shows_something() {
    let mut photo = TargetImage::opaque(4, 1, vec![9; 12]);
    let alpha = [0.0, 0.49, 0.5, 1.0];
    let black = [0.0; 3];
    assert_eq!(uncovered_pixels(&alpha, &photo, black), [true, true, false, false]);
    assert_eq!(uncovered_share(&alpha, &photo, black), 0.5);
    assert_eq!(uncovered_share(&alpha, &photo, [9.0 / 255.0; 3]), 0.0, "the photo shows the background");
    photo.mask = Some(vec![0, 255, 255, 255]);
    assert_eq!(uncovered_share(&alpha, &photo, black), 1.0 / 3.0);
    photo.mask = Some(vec![0; 4]);
    assert_eq!(uncovered_share(&alpha, &photo, black), 0.0);
}

#[test]
fn views_without_a_corrected_figure_are_left_out_of_its_mean() {
    let photo = photo(40, 31);
    let mut views = vec![quality_of("a", &noisy(&photo, 0.1), &photo); 3];
    views[1].psnr_corrected = None;
    views[2].psnr_corrected = views[0].psnr_corrected.map(|p| p + 2.0);
    let mean = Evaluation::from_views(views.clone()).unwrap().psnr_corrected.unwrap();
    // Needed 4e-15.
    assert!((mean - views[0].psnr_corrected.unwrap() - 1.0).abs() < 1e-12);
    views.iter_mut().for_each(|v| v.psnr_corrected = None);
    assert_eq!(Evaluation::from_views(views).unwrap().psnr_corrected, None);
}
