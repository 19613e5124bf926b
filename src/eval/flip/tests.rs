//! FLIP against stored results of the authors' program.

use super::*;

/// Pseudo-random numbers of 0 to 255.
fn noise(seed: u32) -> impl FnMut() -> u8 {
    let mut state = seed;
    move || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (state >> 24) as u8
    }
}

/// A pair of images, each given by the code values at (x, y).
fn pair(
    (width_px, height_px): (usize, usize),
    mut target: impl FnMut(usize, usize) -> [u8; 3],
    mut rendered: impl FnMut(usize, usize) -> [u8; 3],
) -> ImagePair {
    let pixels = || (0..height_px).flat_map(move |y| (0..width_px).map(move |x| (x, y)));
    let target = pixels().flat_map(|(x, y)| target(x, y)).collect();
    let rendered = pixels().flat_map(|(x, y)| rendered(x, y)).collect();
    ImagePair { width_px, height_px, rendered, target, unmasked: None }
}

/// Images of every kind that FLIP treats differently.
fn pairs() -> Vec<(&'static str, ImagePair)> {
    let ramp = |x: usize, y: usize| [(5 * x) as u8, (7 * y) as u8, (3 * x + 2 * y) as u8];
    let step = |edge: usize| move |x: usize, _: usize| if x < edge { [40, 60, 50] } else { [200, 180, 220] };
    let dots = |every: usize| {
        move |x: usize, y: usize| if x % every == 3 && y % every == 2 { [255; 3] } else { [90, 80, 70] }
    };
    let grain = |seed: u32, amplitude: u8| {
        let mut next = noise(seed);
        move |x: usize, y: usize| ramp(x, y).map(|v| v.saturating_add(next() / (255 / amplitude)))
    };
    let random = |seed: u32| {
        let mut next = noise(seed);
        move |_: usize, _: usize| [next(), next(), next()]
    };
    vec![
        ("equal", pair((48, 31), ramp, ramp)),
        ("flat greys", pair((20, 9), |_, _| [100; 3], |_, _| [108; 3])),
        ("green and blue", pair((20, 9), |_, _| [0, 255, 0], |_, _| [0, 0, 255])),
        (
            "another hue",
            pair((48, 31), ramp, |x, y| {
                let [r, g, b] = ramp(x, y);
                [g, r, b]
            }),
        ),
        ("shifted edge", pair((48, 31), step(20), step(22))),
        ("turned edge", pair((48, 31), step(20), |x, y| step(20)(y, x))),
        ("points", pair((48, 31), dots(9), dots(48))),
        ("faint noise", pair((48, 31), ramp, grain(1, 15))),
        ("noise", pair((70, 75), random(2), random(3))),
        ("one column", pair((1, 40), random(4), random(5))),
        ("one row", pair((40, 1), random(6), random(7))),
        ("one pixel", pair((1, 1), random(8), random(9))),
    ]
}

/// Sizes of pixels at which the pairs are compared, per degree: 67 is what [`mean_flip`] uses.
const SIZES: [f64; 3] = [24.0, 67.0, 130.0];

/// Of each pair and size of pixels, the mean error and those of the pixels at (0, 0), at (21, 11) or the nearest, and in
/// the last corner. Made with the authors' C++ code, as the crate nv-flip 0.1.2 wraps it: `flip(target, rendered,
/// pixels_per_degree)` on the pairs of [`pairs`].
const EXPECTED: [(&str, [[f64; 4]; 3]); 12] = [
    ("equal", [[0.0; 4]; 3]),
    ("flat greys", [[0.131_446; 4], [0.131_434; 4], [0.131_437; 4]]),
    ("green and blue", [[1.0; 4]; 3]),
    (
        "another hue",
        [
            [0.711_43, 0.003_224, 0.432_857, 0.563_83],
            [0.721_408, 0.017_039, 0.443_675, 0.582_079],
            [0.730_036, 0.043_282, 0.458_322, 0.595_398],
        ],
    ),
    (
        "shifted edge",
        [[0.071_178, 0.0, 0.975_217, 0.0], [0.104_717, 0.0, 0.734_892, 0.0], [0.128_921, 0.0, 0.539_1, 0.0]],
    ),
    (
        "turned edge",
        [
            [0.540_423, 0.0, 0.973_727, 0.0],
            [0.600_198, 0.0, 0.978_765, 0.0],
            [0.652_585, 0.0, 0.974_457, 0.074_461],
        ],
    ),
    (
        "points",
        [
            [0.040_362, 0.0, 0.981_59, 0.0],
            [0.085_937, 0.0, 0.541_269, 0.000_747],
            [0.101_509, 0.001_513, 0.230_509, 0.003_234],
        ],
    ),
    (
        "faint noise",
        [
            [0.176_556, 0.072_977, 0.180_202, 0.177_693],
            [0.165_586, 0.083_152, 0.164_806, 0.144_631],
            [0.172_131, 0.103_607, 0.163_369, 0.145_266],
        ],
    ),
    (
        "noise",
        [
            [0.818_193, 0.959_381, 0.974_918, 0.988_335],
            [0.447_386, 0.761_09, 0.558_417, 0.983_421],
            [0.300_118, 0.642_558, 0.312_309, 0.977_481],
        ],
    ),
    (
        "one column",
        [
            [0.886_428, 0.909_386, 0.977_892, 0.974_672],
            [0.741_864, 0.863_44, 0.900_456, 0.972_299],
            [0.643_463, 0.716_512, 0.772_25, 0.969_4],
        ],
    ),
    (
        "one row",
        [
            [0.890_489, 0.766_24, 0.791_646, 0.977_587],
            [0.704_336, 0.651_723, 0.665_262, 0.981_412],
            [0.676_715, 0.766_664, 0.437_676, 0.980_974],
        ],
    ),
    ("one pixel", [[0.952_388; 4]; 3]),
];

/// Largest difference between stored results and ours.
fn largest_difference(expected: &[f64; 4], pair: &ImagePair, pixels_per_degree: f64) -> f64 {
    let errors = flip_errors(pair, pixels_per_degree);
    let mean = errors.iter().map(|e| f64::from(*e)).sum::<f64>() / errors.len() as f64;
    let (last_x, last_y) = (pair.width_px - 1, pair.height_px - 1);
    let at = |x: usize, y: usize| f64::from(errors[y.min(last_y) * pair.width_px + x.min(last_x)]);
    let found = [mean, at(0, 0), at(21, 11), at(last_x, last_y)];
    expected.iter().zip(found).map(|(expected, found)| (expected - found).abs()).fold(0.0, f64::max)
}

#[test]
fn errors_equal_those_of_the_authors() {
    for ((name, pair), (expected_name, expected)) in pairs().iter().zip(&EXPECTED) {
        assert_eq!(name, expected_name);
        for (expected, size) in expected.iter().zip(SIZES) {
            let difference = largest_difference(expected, pair, size);
            println!("{name}, {size} pixels per degree: {difference:.1e}");
            // Needed 2.3e-5; over all pixels of all pairs 4.1e-5.
            assert!(difference < 1e-4, "{name}, {size} pixels per degree: {difference}");
        }
    }
}

#[test]
fn pixels_of_another_size_give_other_errors() {
    // Negative control of the comparison above.
    for ((name, pair), (_, expected)) in pairs().iter().zip(&EXPECTED) {
        let is_flat = ["equal", "flat greys", "green and blue", "one pixel"].contains(name);
        let difference = largest_difference(&expected[0], pair, SIZES[1]);
        assert_eq!(difference > 1e-2, !is_flat, "{name}: {difference}");
    }
}

#[test]
fn bands_of_rows_join_without_seams() {
    // An image of one column and more rows than a band, and the same as one row.
    let height_px = 2 * BAND_ROWS + 7;
    let mut next = [noise(1), noise(2)];
    let column = {
        let [target, rendered] = &mut next;
        pair(
            (1, height_px),
            |_, _| [target(), target(), target()],
            |_, _| [rendered(), rendered(), rendered()],
        )
    };
    let row = ImagePair { width_px: height_px, height_px: 1, ..column.clone() };
    for (a, b) in flip_errors(&column, 67.0).iter().zip(flip_errors(&row, 67.0)) {
        // Needed 7e-7.
        assert!((a - b).abs() < 1e-5, "{a} {b}");
    }
}
