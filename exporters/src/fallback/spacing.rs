//! Whether the coordinates of a format without transforms are fine enough for the splats: far from the origin, as in
//! georeferenced captures, f32 is not.

use super::baked::Baked;
use crate::ORIGIN_OPTION;

/// Spacing of coordinates, in standard deviations of the median splat, above which a file deserves a warning. Measured on five
/// trained scenes, moved away from the origin step by step: PLY falls below 60 dB, its limit, at 0.02 to 0.07, and loses 0.02 dB
/// on photos at 0.1 to 0.2; SPZ loses 1 dB of its 52 to 57 at 0.02 to 0.03. Where they were trained, the scenes have 1e-5 (f32)
/// and 2e-5 to 1.4e-4 (24 bits).
pub(crate) const COARSE: f64 = 0.02;

/// How finely the numbers of a file resolve its splats.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Spacing {
    /// Median over the splats of the distance between coordinates that the file can hold where the splat lies, in the splat's
    /// smaller standard deviations.
    pub in_sigmas: f64,
    /// The largest coordinate, units of the file.
    pub largest: f64,
    /// The largest distance of a coordinate from the middle of the splats, units of the file.
    pub spread: f64,
}

/// Collects the splats of a file.
#[derive(Default)]
pub(crate) struct Spacings {
    in_sigmas: Vec<f32>,
    /// Coordinates by axis.
    along: [Vec<f32>; 3],
}

impl Spacings {
    /// Adds a splat; `spacing` is that of numbers next to its largest coordinate.
    pub(crate) fn add(&mut self, splat: &Baked, spacing: f64) {
        let smaller = splat.scales[0].min(splat.scales[1]);
        self.in_sigmas.push((spacing / smaller) as f32);
        self.along.iter_mut().zip(splat.position).for_each(|(along, v)| along.push(v as f32));
    }

    pub(crate) fn summary(mut self) -> Spacing {
        let mut spacing = Spacing { in_sigmas: median(&mut self.in_sigmas), ..Spacing::default() };
        for along in &mut self.along {
            let middle = median(along);
            for &v in along.iter() {
                let v = f64::from(v);
                spacing.largest = spacing.largest.max(v.abs());
                spacing.spread = spacing.spread.max((v - middle).abs());
            }
        }
        spacing
    }
}

impl Spacing {
    /// What to warn of, if anything. `numbers`: what kind of numbers the coordinates are.
    pub(crate) fn note(&self, numbers: &str) -> Option<String> {
        let Self { in_sigmas, largest, spread } = *self;
        let remedy = if is_elsewhere(largest, spread) {
            format!(
                "{ORIGIN_OPTION} of litetex export moves the origin of the file to the scene, which readers of this program undo"
            )
        } else {
            "leave out what lies far away with --crop".to_owned()
        };
        (in_sigmas > COARSE).then(|| {
            format!(
                "{numbers} cannot hold coordinates of up to {largest:.3e} units: steps between them are {in_sigmas:.2} standard \
                 deviations of the median splat; {remedy}"
            )
        })
    }
}

/// Whether another origin would make coordinates half as large or smaller.
pub(crate) fn is_elsewhere(largest: f64, spread: f64) -> bool {
    spread < 0.5 * largest
}

/// Distance from an f32 to the next.
pub(crate) fn of_f32(v: f64) -> f64 {
    let v = v.abs() as f32;
    f64::from(v.next_up()) - f64::from(v)
}

fn median(values: &mut [f32]) -> f64 {
    let middle = values.len() / 2;
    if values.is_empty() { 0.0 } else { (*values.select_nth_unstable_by(middle, f32::total_cmp).1).into() }
}
