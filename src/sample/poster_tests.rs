//! The poster's content: its spectrum, borders, colours and lettering.

use super::super::capture::Capture;
use super::super::options::SampleOptions;
use super::*;
use rustfft::FftPlanner;
use rustfft::num_complex::Complex;

/// Places along each side of the squares on which spectra are taken, and the side of these squares, metres.
const N: usize = 256;
const SIDE: f64 = 0.8;

fn place(i: usize) -> DVec2 {
    SIDE * (DVec2::new((i % N) as f64, (i / N) as f64) / N as f64 - 0.5)
}

/// Mean power of the frequencies around 4, 8, 16, 32 and 64 cycles per side, over four seeds.
fn spectrum(value: impl Fn(u64, DVec2) -> f64) -> [f64; 5] {
    let fft = FftPlanner::new().plan_fft_forward(N);
    let mut sums = [(0.0, 0); 5];
    for seed in 0..4 {
        let values: Vec<f64> = (0..N * N).map(|i| value(seed, place(i))).collect();
        let mean = values.iter().sum::<f64>() / values.len() as f64;
        // Without a window, the sides would be edges.
        let window = |i: usize| (std::f64::consts::PI * (i as f64 + 0.5) / N as f64).sin().powi(2);
        let windowed = |i: usize| (values[i] - mean) * window(i % N) * window(i / N);
        let mut rows: Vec<Complex<f64>> = (0..N * N).map(|i| windowed(i).into()).collect();
        fft.process(&mut rows);
        let mut columns: Vec<_> = (0..N * N).map(|i| rows[i % N * N + i / N]).collect();
        fft.process(&mut columns);
        for (i, value) in columns.iter().enumerate() {
            let frequency = |k: usize| k.min(N - k) as f64;
            let octave = (frequency(i % N).hypot(frequency(i / N)).log2() - 1.5).floor();
            if let Some(sum) = sums.get_mut(octave as usize).filter(|_| octave >= 0.0) {
                *sum = (sum.0 + value.norm_sqr(), sum.1 + 1);
            }
        }
    }
    sums.map(|(power, count)| power / f64::from(count))
}

/// Exponent of the frequency in the power, by least squares.
fn slope(spectrum: [f64; 5]) -> f64 {
    let octaves = [-2.0, -1.0, 0.0, 1.0, 2.0];
    octaves.iter().zip(spectrum).map(|(octave, power)| octave * power.log2()).sum::<f64>() / 10.0
}

fn brightness(poster: &Poster, at: DVec2) -> f64 {
    poster.content(at).element_sum() / 3.0
}

fn posters(octaves: u32) -> Vec<Poster> {
    (0..4).map(|seed| Poster::new(octaves, seed)).collect()
}

#[test]
fn power_falls_with_frequency_as_in_photos() {
    let posters = posters(9);
    let of_noise = slope(spectrum(|seed, at| octaves(&Noise::new(seed), at, 9)));
    let of_content = slope(spectrum(|seed, at| brightness(&posters[seed as usize], at)));
    let white = |seed, at: DVec2| Noise::new(seed).cell((at.x * 1e6) as i64, (at.y * 1e6) as i64);
    let of_white = slope(spectrum(white));
    // Measured: -1.99, -2.41 with the borders, and of white noise 0.02. Photos have about -2.
    let figures = format!("noise {of_noise:.2}, content {of_content:.2}, white {of_white:.2}");
    assert!((-2.1..-1.9).contains(&of_noise) && (-2.6..-2.2).contains(&of_content), "{figures}");
    assert!(of_white.abs() < 0.1, "{figures}");
}

#[test]
fn more_octaves_add_detail_and_leave_the_rest() {
    let of = |octaves| {
        let posters = posters(octaves);
        spectrum(|seed, at| brightness(&posters[seed as usize], at))
    };
    let (few, many) = (of(5), of(8));
    let more = [0, 1, 2, 3, 4].map(|band| many[band] / few[band]);
    // Measured: 1.04, 1.04, 1.37, 1.88 and 2.23.
    assert!(more[..2].iter().all(|more| (more - 1.0).abs() < 0.1) && more[4] > 2.0, "{more:?}");
}

/// Places 1 nm apart: at borders between neighbours of a grid, or next to one of these if they are in one shape. With
/// whether they are at a border.
fn close_pairs(poster: &Poster) -> Vec<(bool, DVec2, DVec2)> {
    let step = DVec2::new(1e-9, 0.0);
    let close = |i: usize| {
        let (mut a, mut b) = (place(i), place(i + 1));
        let left = poster.shape(a);
        if left == poster.shape(b) {
            return (false, a, a + step);
        }
        // The borders may be several: this finds one of them.
        while b.x - a.x > step.x {
            let middle = a.midpoint(b);
            *if poster.shape(middle) == left { &mut a } else { &mut b } = middle;
        }
        (true, a, b)
    };
    (0..N * N).step_by(17).filter(|i| i % N < N - 1).map(close).collect()
}

#[test]
fn borders_are_sharp_and_noise_changes_across_them() {
    let mut poster = Poster::new(7, 0);
    for is_grey in [false, true] {
        if is_grey {
            poster.shapes.iter_mut().for_each(|shape| shape.mean = DVec3::splat(0.5));
        }
        let jump = |a: DVec2, b: DVec2| (poster.content(a) - poster.content(b)).abs().max_element();
        let (mut at_borders, mut elsewhere) = (Vec::new(), Vec::new());
        for (is_border, a, b) in close_pairs(&poster) {
            if is_border { at_borders.push(jump(a, b)) } else { elsewhere.push(jump(a, b)) }
        }
        at_borders.sort_by(f64::total_cmp);
        let median = at_borders[at_borders.len() / 2];
        let largest = elsewhere.iter().copied().fold(0.0, f64::max);
        assert!(at_borders.len() > 100 && median > 0.05 && largest < 1e-5, "{median} {largest}");
    }
}

fn correlation(pairs: &[(f64, f64)]) -> f64 {
    let n = pairs.len() as f64;
    let (x, y) = pairs.iter().fold((0.0, 0.0), |sum, p| (sum.0 + p.0 / n, sum.1 + p.1 / n));
    let sum = |f: &dyn Fn(f64, f64) -> f64| pairs.iter().map(|p| f(p.0 - x, p.1 - y)).sum::<f64>();
    sum(&|x, y| x * y) / (sum(&|x, _| x * x) * sum(&|_, y| y * y)).sqrt()
}

#[test]
fn channels_vary_together() {
    let mut poster = Poster::new(7, 0);
    poster.shapes.iter_mut().for_each(|shape| shape.mean = DVec3::splat(0.5));
    let of = |i: usize, j: usize, of_colour: &dyn Fn(DVec2) -> DVec3| {
        let colours = (0..N * N).step_by(7).map(|i| of_colour(place(i)));
        correlation(&colours.map(|colour| (colour[i], colour[j])).collect::<Vec<_>>())
    };
    let content = |at| poster.content(at);
    let independent = |at: DVec2| DVec3::from([0.0, 100.0, 200.0].map(|o| octaves(&poster.noise, at + o, 7)));
    for (i, j) in [(0, 1), (0, 2), (1, 2)] {
        let (found, control) = (of(i, j, &content), of(i, j, &independent));
        // Measured: 0.96, 0.91 and 0.91; controls up to 0.08.
        assert!((0.85..0.99).contains(&found) && control.abs() < 0.2, "{i}, {j}: {found}, {control}");
    }
}

/// Share of dots in the panel with small print that a photo of this width shows as ink or paper, as they are.
fn legible(octaves: u32, width_px: u32) -> f64 {
    let options = SampleOptions {
        views: 2,
        width_px,
        height_px: 3 * width_px / 4,
        points: 0,
        supersampling: 2,
        scene: Some(format!("poster:{octaves}").parse().unwrap()),
        ..SampleOptions::default()
    };
    let (capture, poster) = (Capture::new(&options), Poster::new(octaves, options.seed));
    let (view, photo) = (&capture.views[0], capture.photo(0));
    let (dot, block) = poster.small_print();
    let corner = PANEL.0 - 0.5 * block * DOWN;
    let counts = (block / dot).round();
    let (mut right, mut all) = (0, 0);
    for i in 0..counts.x as usize {
        for j in 0..counts.y as usize {
            let at = corner + (DVec2::new(i as f64, j as f64) + 0.5) * dot * DOWN;
            let is_ink = poster.lettering(at) == Some(INK);
            let in_camera = view.camera_from_capture.transform_point((at * DOWN).extend(0.0));
            let pixel = view.pinhole.project(in_camera).unwrap().floor();
            let value = photo.values[3 * (pixel.x as usize + pixel.y as usize * width_px as usize)];
            right += usize::from((value < 128) == is_ink);
            all += 1;
        }
    }
    right as f64 / f64::from(all)
}

#[test]
fn small_print_is_legible_where_a_dot_has_two_pixels() {
    // Measured: 0.998, and 0.778 where two dots share a pixel: about as much as if all were paper.
    let (found, control) = (legible(7, 320), legible(7, 80));
    assert!(found > 0.98 && control < 0.9, "{found} {control}");
}

#[test]
fn lettering_becomes_finer_with_more_octaves() {
    let changes = |octaves: u32| {
        let poster = Poster::new(octaves, 0);
        let row = |y: f64| {
            let ink = |i: u32| {
                let at = DVec2::new(2.0 * f64::from(i) / 2000.0 - 1.0, y) * PANEL.1 + PANEL.0;
                poster.lettering(at) == Some(INK)
            };
            (1..2000).filter(|i| ink(*i) != ink(i - 1)).count()
        };
        (0..100).map(|i| row(0.02 * f64::from(i) - 1.0)).sum::<usize>()
    };
    // Measured: 590, 590, 1338, 2520.
    let [coarsest, six, seven, eight] = [1, 6, 7, 8].map(changes);
    assert!(coarsest == six && six > 500, "{coarsest} {six}");
    assert!(seven * 2 > six * 3 && eight * 2 > seven * 3, "{six} {seven} {eight}");
}
