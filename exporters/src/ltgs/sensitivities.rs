//! From how much images change with the numbers of an asset to how these are rounded.

use super::math::two_to;
use super::shape::{EXPONENT_MAX, Shape};
use super::steps::Steps;
use super::texels::Map;
use crate::SplatAsset;
use std::f64::consts::LN_2;

/// Kinds of numbers with a step of their own.
const KINDS: usize = 7;

/// Steps of colours and texels over those of equal errors: few of their bits are left at common rates, and the last ones cost less
/// than a bit of geometry. With 0.7, files are 1.7 % smaller at equal loss (fox, lego).
const OF_COLOURS: f64 = 0.65;

/// Rounds in which exponents and steps are fitted to each other; they settle in three.
const ROUNDS: usize = 4;

/// Share of the median that is added to each splat's sensitivity: what a splat that no view shows is taken to have.
const UNSEEN: f64 = 0.02;

/// How much images change with the numbers of each splat: sums over the pixels of some views of squared derivatives, added over the
/// three channels. Where a splat has several numbers of a kind, the mean. Any common factor will do.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Sensitivities {
    /// By a coordinate of the centre, per local unit. `[n]`
    pub positions: Vec<f32>,
    /// By the angle around an axis of the surfel, radians. `[n]`
    pub tilts: Vec<f32>,
    /// By the angle around the normal, radians. `[n]`
    pub twists: Vec<f32>,
    /// By the natural logarithm of a standard deviation. `[n]`
    pub log_scales: Vec<f32>,
    /// By the natural logarithm of the opacity. `[n]`
    pub log_opacities: Vec<f32>,
    /// By a channel of SH degree 0. `[n]`
    pub colours: Vec<f32>,
    /// By a channel of a texel. `[num_texels]`
    pub texels: Vec<f32>,
}

/// A splat's numbers of one kind.
#[derive(Clone, Copy, Default)]
struct Numbers {
    count: f64,
    /// Mean squared change of images where a number is off by its kind's step times 2^x, with a step of 1.
    sensitivity: f64,
}

impl Sensitivities {
    /// Steps, of the order of [`Steps::balanced`], and exponents of the splats, by which rounding any number costs the same error of
    /// images: at a high rate, the error is then the least for all files of this size. `self` must be of this valid asset; there
    /// are no exponents without splats.
    pub fn rounding(&self, asset: &SplatAsset) -> (Steps, Vec<i8>) {
        let all: Vec<[Numbers; KINDS]> = (0..asset.num_splats()).map(|s| self.numbers(asset, s)).collect();
        let mut exponents = vec![0.0; all.len()];
        for _ in 0..ROUNDS {
            let steps = equal_errors(&all, &exponents);
            exponents = finer_where_it_counts(&all, &steps);
        }
        let steps = equal_errors(&all, &exponents);
        (named(&steps), exponents.iter().map(|&x| x as i8).collect())
    }

    fn numbers(&self, asset: &SplatAsset, splat: usize) -> [Numbers; KINDS] {
        let map = &asset.maps[splat];
        let shape = Shape { exponent: 0, scales: asset.scales[splat], texel_sizes: map.texel_sizes };
        let h = |of: &[f32]| of.get(splat).copied().map(f64::from).filter(|h| h.is_finite()).unwrap_or(0.0);
        let numbers = |count: usize, sensitivity: f64| Numbers { count: count as f64, sensitivity };
        // Noise in luma reaches all three channels, noise in chroma fewer.
        let chroma = Steps::balanced().chroma;
        let of_colours = (3.0 + (0.75 + 0.5) * chroma * chroma) / 9.0;
        let band = usize::from(asset.sh_degrees[splat]) + 1;
        [
            numbers(3, h(&self.positions) * shape.mean_scale().powi(2)),
            // Components of quaternions are half angles.
            numbers(2, h(&self.tilts) * 4.0),
            numbers(1, h(&self.twists) * 4.0 / shape.anisotropy().powi(2)),
            numbers(2, h(&self.log_scales) * LN_2 * LN_2),
            numbers(1, h(&self.log_opacities) * LN_2 * LN_2),
            numbers(3 * band * band, h(&self.colours) * of_colours),
            numbers(3 * map.num_texels(), self.of_texels(asset, splat, shape) * of_colours),
        ]
    }

    /// Mean sensitivity of the texels of a map, times the squares of their steps.
    fn of_texels(&self, asset: &SplatAsset, splat: usize, shape: Shape) -> f64 {
        let map = &asset.maps[splat];
        let first = map.offset_texels as usize;
        let texels = self.texels.get(first..first + map.num_texels()).unwrap_or_default();
        let map = Map { shape, rows: map.rows, cols: map.cols, shift: map.shift };
        let sum: f64 = texels
            .iter()
            .zip(map.falloff_exponents())
            .map(|(&h, falloff)| f64::from(h) * two_to(2 * falloff))
            .filter(|h| h.is_finite())
            .sum();
        sum / texels.len().max(1) as f64
    }
}

/// Steps with which each kind of number costs the same mean error, that of the fourth being 1; 0 for kinds that cost none.
fn equal_errors(all: &[[Numbers; KINDS]], exponents: &[f64]) -> [f64; KINDS] {
    let mut means = [0.0; KINDS];
    for (kind, mean) in means.iter_mut().enumerate() {
        let (mut count, mut sum) = (0.0, 0.0);
        for (numbers, &exponent) in all.iter().zip(exponents) {
            count += numbers[kind].count;
            sum += numbers[kind].count * numbers[kind].sensitivity * two_to(2 * exponent as i32);
        }
        *mean = sum / f64::max(count, 1.0);
    }
    let reference = means[3];
    means.map(|mean| if mean > 0.0 && reference > 0.0 { (reference / mean).sqrt() } else { 0.0 })
}

/// The exponents with which the numbers of each splat cost the same mean error as those of any other; their median is about 0.
fn finer_where_it_counts(all: &[[Numbers; KINDS]], steps: &[f64; KINDS]) -> Vec<f64> {
    let error = |numbers: &[Numbers; KINDS]| {
        let (mut count, mut sum) = (0.0, 0.0);
        for (n, step) in numbers.iter().zip(steps).filter(|(_, step)| **step > 0.0) {
            count += n.count;
            sum += n.count * n.sensitivity * step * step;
        }
        sum / f64::max(count, 1.0)
    };
    let errors: Vec<f64> = all.iter().map(error).collect();
    let mut sorted = errors.clone();
    sorted.sort_by(f64::total_cmp);
    let median = sorted.get(sorted.len() / 2).copied().unwrap_or(0.0);
    let exponent = |error: &f64| {
        let ratio = (error + UNSEEN * median) / ((1.0 + UNSEEN) * median);
        // Nothing is known where half of the splats change nothing.
        let exponent = if median > 0.0 { -0.5 * ratio.log2() } else { 0.0 };
        exponent.round().clamp(f64::from(-EXPONENT_MAX), f64::from(EXPONENT_MAX))
    };
    errors.iter().map(exponent).collect()
}

/// Relative steps as those of a file; kinds that cost nothing keep typical steps.
fn named(relative: &[f64; KINDS]) -> Steps {
    let mut steps = Steps::balanced();
    let scale = steps.log2_scale;
    let [position, tilt, twist, log2_scale, log2_opacity, colour, texel] = *relative;
    for (step, relative) in [
        (&mut steps.position, position),
        (&mut steps.tilt, tilt),
        (&mut steps.twist, twist),
        (&mut steps.log2_scale, log2_scale),
        (&mut steps.log2_opacity, log2_opacity),
        (&mut steps.sh0, OF_COLOURS * colour),
        (&mut steps.texel, OF_COLOURS * texel),
    ] {
        if relative > 0.0 {
            // Within the bounds of a file also where the search makes them coarser or finer.
            *step = scale * relative.clamp(1.0 / 1024.0, 1024.0);
        }
    }
    steps.sh_rest = [steps.sh0; 3];
    steps
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::asset::tests::fixture;

    /// An asset and sensitivities that are those of its first splat times a factor for each.
    fn scene() -> (SplatAsset, Sensitivities) {
        let asset = fixture(40, 1);
        let factors: Vec<f32> = (0..40).map(|i| [1.0, 16.0, 256.0, 1.0][i % 4]).collect();
        let times = |h: f32| factors.iter().map(|f| f * h).collect::<Vec<f32>>();
        let by_area = |i: usize| factors[i] * 5.0 / (asset.scales[i][0] * asset.scales[i][1]);
        let all = Sensitivities {
            positions: (0..40).map(by_area).collect(),
            tilts: times(3.0),
            twists: times(0.5),
            log_scales: times(4.0),
            log_opacities: times(4.0),
            colours: times(100.0),
            texels: vec![1.0; asset.num_texels()],
        };
        (asset, all)
    }

    #[test]
    fn splats_that_count_more_get_finer_steps() {
        let (asset, all) = scene();
        let (steps, exponents) = all.rounding(&asset);
        steps.validate().unwrap();
        assert!(exponents[1] < exponents[0] && exponents[2] < exponents[1], "{exponents:?}");
        // Colours count 25 times as much as logarithms of scales, in luma and chroma and without the square of ln 2.
        let expected = OF_COLOURS * (4.0 * LN_2 * LN_2 / (100.0 * (3.0 + 1.25 * 6.25) / 9.0)).sqrt();
        assert!((steps.sh0 / steps.log2_scale / expected - 1.0).abs() < 0.05, "{steps:?}");
        // Equal sensitivities: no exponents.
        let equal = Sensitivities { log_scales: vec![1.0; 40], ..Sensitivities::default() };
        assert_eq!(equal.rounding(&asset).1, [0; 40]);
        // Nothing known: typical steps.
        let nothing = Sensitivities::default();
        assert_eq!(nothing.rounding(&asset), (Steps::balanced(), vec![0; 40]));
        assert!(nothing.rounding(&SplatAsset::default()).1.is_empty());
        let broken = Sensitivities { log_scales: vec![f32::NAN; 40], ..all };
        broken.rounding(&asset).0.validate().unwrap();
    }
}
