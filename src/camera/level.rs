//! Fits the direction to which the photos of a capture are level: people hold cameras with little roll, or turned by a
//! quarter for photos in portrait, but look down as often as not.
//!
//! Least squares of the right axes is the rule. A fit that takes photos for ones in portrait, or for ones that were held
//! anyhow, replaces it only where it makes the photos far more probable: of many directions that pairs of photos are level to,
//! one is always near a good part of them.

use super::symmetric::{covariance, eigen, least_ratio};
use glam::{DMat3, DVec3};

/// The level axes leave up open if the second of the three eigenvalues of their covariance is smaller. Measured, first and
/// second eigenvalue: flower, whose photos all face alike, 0.00004 and 0.0013; castle of Sceaux 0.0002 and 0.107; bonsai
/// 0.0006 and 0.247; fox 0.0017 and 0.251; lego 0 and 0.442.
const OPEN_BELOW: f64 = 0.03;

/// Photos in portrait have a pitch of up to 60 degrees ([`PORTRAIT_RISE`]), as two thirds of all angles are.
const PITCHED: f64 = 1.5;

/// How much more probable than one of any angle is the pitch of an upright photo that looks ahead, and less of one upside down.
/// Measured: with the last, and without it, of 48 captures of 32 photos, half in portrait to either side, with a roll of 12
/// degrees, 2 and 18 are off by more than 25 degrees, of those over a third of a circle 5 and 35.
const UPRIGHT: f64 = 0.9;

/// A photo counts as level up to this roll, as a sine.
const LEVEL_SIN: f64 = 0.1736; // 10 degrees

/// A photo is in portrait only where its right axis rises at least this much: with a pitch of up to 60 degrees. Without
/// it, the axis that parallel cameras look along would pass for up.
const PORTRAIT_RISE: f64 = 0.5;

/// Roll is not known better than this, as a sine, so that photos without any do not outweigh all else. Measured, root mean
/// square of the roll: flower 0.4 degrees, castle of Sceaux 0.9, bonsai 1.4, fox 2.4, lego 0.
const LEAST_ROLL_SIN: f64 = 0.0087; // 0.5 degrees

/// Standard deviations of roll that mixtures are fitted with, as sines: 1, 2, 4 and 8 degrees.
const ROLL_SINES: [f64; 4] = [0.0175, 0.0349, 0.0698, 0.1392];

/// Shares of photos in landscape, in portrait, and held anyhow that mixtures are fitted with.
const SHARES: [[f64; 3]; 2] = [[0.6, 0.2, 0.2], PORTRAIT_SHARES];
const PORTRAIT_SHARES: [f64; 3] = [0.1, 0.7, 0.2];

/// Standard deviations of roll of careful photos in mixtures in which half of the photos are careless, as sines: 1 and 2 degrees.
const CAREFUL_SINES: [f64; 2] = [0.0175, 0.0349];

/// How many times as much careless photos are rolled. Measured: of fox, half of the photos are level to within 2 degrees, the
/// others rolled by 5 to 26, mostly to one side; least squares is off by 6 degrees from the frames on the wall.
const CARELESS: f64 = 6.0;

/// What a mixture must gain in log likelihood over least squares, less [`GAIN_LESS`] for each photo. Measured on photos in
/// landscape with normally distributed roll of 0 to 20 degrees, where the photos' mean upward direction speaks for the mixture:
/// of 12 photos 3.6 at most, 32 3.8, 60 3.3, 100 -0.1; in the middle far less, and those that pass are as near to up as least
/// squares. What is found of 12 photos, a third of them rolled by 20 to 60 degrees: 3.3 in the middle; of 32 at least 6.9.
const GAIN_MIN: f64 = 4.0;

/// Normally distributed roll costs a mixture more with each photo. Measured: fox gains -2.2, of 50 photos.
const GAIN_LESS: f64 = 0.13;

/// What it must gain besides, by the number of photos, if the mean does not speak for it. Measured as above, in all: of 8 photos
/// 6.7 at most, of 12 6.0, of 16 3.8, of 24 1.6, of 32 1.3. What is found where 40 % are in portrait, roll 2 degrees: of 12
/// photos at least 11, of 32 at least 43; roll 5 degrees, over a sixth of a circle: of 32 photos 4 in the middle.
const GAIN_MIN_ASIDE: f64 = 50.0;

/// How much more probable a mixture must be than another that the mean speaks for, if it does not for this one, in log
/// likelihood. Without it, of 32 photos all around that look ahead, 40 % of them in portrait, what is found lies on its side.
const ASIDE: f64 = 5.0;

/// The mean speaks for a direction to within this angle, as a cosine. Measured: photos over an arc, 30 degrees down, tilt it by
/// 24 degrees.
const MEAN_SPEAKS_COS: f64 = 0.766; // 40 degrees

/// How much more probable than photos that are held anyhow what is found must be to be believed, in log likelihood, and besides
/// for each photo. Measured: of photos held anyhow, 12 gain 2 to 5 in the middle, 12 at most, 32 gain 6 to 11, 17 at most; of
/// landscape with a roll of 25 degrees, 12 photos gain at least 8.4, 32 at least 22, 60 at least 46; half in portrait, roll 12
/// degrees, 12 photos gain 7 in the middle, 32 at least 10, 60 at least 26; castle of Sceaux 42.
const TELLING_MIN: f64 = 4.0;
const TELLING_MORE: f64 = 0.18;

/// How much less probable than what is found another direction may be that it is warned of, in log likelihood. Measured, of 48
/// captures of 32 photos over a third of a circle, half in portrait to either side, roll 12 degrees: 5 are off by more than 25
/// degrees, all are warned of, 4 with more than 0.6 times their error; 9 that are off by less than 10 are warned of needlessly.
const RIVAL_LESS: f64 = 4.0;

/// How far apart they are at least, as a cosine.
const RIVAL_COS: f64 = 0.940; // 20 degrees

/// Least squares divides by how far a photo is from looking along up, for a roll shows in the right axis only that far; this
/// is added, for photos that look straight down tell by their right axes alone. Measured, 60 photos over a third of a circle,
/// roll of 20 degrees: off by 3.7 degrees in the middle, 8.9 without the division.
const STEEP: f64 = 0.1;

/// Photos whose pairs propose directions; more do not find better ones where half of the photos are level.
const PROPOSING: usize = 16;

/// Photos that decide between proposals; the best are then fitted to all.
const DECIDING: usize = 120;

/// Rounds of reweighting; each changes the direction less than a third as much as the one before.
const ROUNDS: usize = 30;

/// The axes of a photo's camera in the frame of the capture.
#[derive(Clone, Copy, Debug)]
pub(super) struct Axes {
    pub right: DVec3,
    pub down: DVec3,
    pub forward: DVec3,
}

impl Axes {
    /// Of the rotation of `camera_from_capture`.
    pub fn of(rotation: &DMat3) -> Self {
        Self { right: rotation.row(0), down: rotation.row(1), forward: rotation.row(2) }
    }

    /// Whether the photo is in portrait where `up` is up, and the sine of its roll from there.
    fn roll(&self, up: DVec3) -> (bool, f64) {
        let (right, down) = (self.right.dot(up).abs(), self.down.dot(up).abs());
        if right >= PORTRAIT_RISE && down < right { (true, down) } else { (false, right) }
    }
}

/// A direction and how well the photos agree on it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Fit {
    /// Up or down.
    pub vertical: DVec3,
    /// Eigenvalues of the covariance of the level axes about the origin, ascending; their sum is 1.
    pub eigenvalues: [f64; 3],
    /// The eigenvector of the largest.
    pub common: DVec3,
    /// Photos that are level.
    pub num_level: usize,
    /// Expected error of the direction, degrees; infinite where the photos leave it open.
    pub error_degrees: f64,
    /// A direction far from it that is nearly as probable.
    pub rival: Option<DVec3>,
}

impl Fit {
    /// With the level axes and their weights.
    fn of(photos: &[Axes], vertical: DVec3, level: &[(DVec3, f64)]) -> Self {
        let (eigenvalues, vectors) = eigen(covariance(level.iter().copied()));
        let num = level.iter().map(|(_, weight)| weight).sum::<f64>();
        let [least, second, _] = eigenvalues.map(|v| v.max(0.0));
        let error = (least * second / num).sqrt() / (second - least);
        Self {
            vertical,
            eigenvalues,
            common: vectors[2],
            num_level: photos.iter().filter(|p| p.roll(vertical).1 <= LEVEL_SIN).count(),
            error_degrees: if second > least { error.to_degrees() } else { f64::INFINITY },
            rival: None,
        }
    }

    /// Whether the level axes are all alike, as those of photos that all face alike are.
    pub fn is_open(&self) -> bool {
        self.eigenvalues[1] < OPEN_BELOW
    }

    /// Of the photos that are level, those in portrait and the others.
    pub fn level<'a>(&self, photos: &'a [Axes]) -> (Vec<&'a Axes>, Vec<&'a Axes>) {
        let level = photos.iter().filter(|p| p.roll(self.vertical).1 <= LEVEL_SIN);
        level.partition(|p| p.roll(self.vertical).0)
    }
}

/// The direction to which the photos are level; `None` without photos.
pub(super) fn fit(photos: &[Axes]) -> Option<Fit> {
    let mean = photos.iter().map(|p| p.down).sum::<DVec3>().try_normalize();
    let is_aside = |up: DVec3| mean.is_none_or(|mean| mean.dot(up).abs() < MEAN_SPEAKS_COS);
    let score = |likelihood: f64, up: DVec3| likelihood - if is_aside(up) { ASIDE } else { 0.0 };
    let deciding = spread(photos, DECIDING);
    let proposed = proposals(photos);
    let mut readings: Vec<(f64, DVec3)> = Vec::new();
    let mixed = Mixture::all().into_iter().map(|mixture| {
        let first = readings.len();
        readings.extend(proposed.iter().map(|&up| (score(mixture.likelihood(&deciding, up), up), up)));
        let best = readings[first..].iter().max_by(|a, b| a.0.total_cmp(&b.0));
        let near = best.map_or(DVec3::NEG_Y, |best| best.1);
        let (likelihood, up) = mixture.refined(photos, near);
        (likelihood, mixture.fit(photos, up))
    });
    // Level axes that are all alike are level to many a direction.
    let mixed = mixed.filter(|(_, fit)| !fit.is_open());
    let mixed = mixed.max_by(|a, b| score(a.0, a.1.vertical).total_cmp(&score(b.0, b.1.vertical)));

    let (likelihood, plain) = least_squares(photos);
    let aside = |up| if is_aside(up) { GAIN_MIN_ASIDE / photos.len() as f64 } else { 0.0 };
    // What a mixture gains over least squares.
    let gain =
        |mixed: f64, up: DVec3| mixed - likelihood - GAIN_MIN + GAIN_LESS * photos.len() as f64 - aside(up);
    let chosen = mixed.filter(|(mixed, fit)| gain(*mixed, fit.vertical) > 0.0);
    let (chosen_gain, chosen) = chosen.map_or((0.0, plain), |(mixed, fit)| (gain(mixed, fit.vertical), fit));
    let readings = readings.iter().map(|(score, up)| (gain(*score, *up), *up));
    let rivals = readings
        .chain([(0.0, plain.vertical)])
        .filter(|(gain, up)| *gain > chosen_gain - RIVAL_LESS && up.dot(chosen.vertical).abs() < RIVAL_COS);
    let rival = rivals.max_by(|a, b| a.0.total_cmp(&b.0)).map(|best| best.1);
    // Any height is as probable as any other then.
    let anyhow = photos.len() as f64 * 0.5_f64.ln();
    let tells = likelihood + chosen_gain - anyhow >= TELLING_MIN + TELLING_MORE * photos.len() as f64;
    let error_degrees = if tells { chosen.error_degrees } else { f64::INFINITY };
    (!photos.is_empty()).then_some(Fit { rival, error_degrees, ..chosen })
}

/// The fit of photos that are mostly in portrait, from a direction near it.
pub(super) fn fit_portrait(photos: &[Axes], near: DVec3) -> Option<Fit> {
    let mixtures = ROLL_SINES.map(|sine| Mixture::of(PORTRAIT_SHARES, sine));
    let fits = mixtures.into_iter().map(|mixture| (mixture.refined(photos, near), mixture));
    let ((_, up), mixture) = fits.max_by(|a, b| a.0.0.total_cmp(&b.0.0))?;
    Some(mixture.fit(photos, up))
}

/// How much more probable a photo's pitch is than one of any angle. Photos are seldom upside down.
fn upright(photo: &Axes, up: DVec3) -> f64 {
    1.0 - UPRIGHT * photo.down.dot(up)
}

/// The log likelihood and fit of photos that are all in landscape, with one standard deviation of roll.
fn least_squares(photos: &[Axes]) -> (f64, Fit) {
    let level: Vec<(DVec3, f64)> = photos.iter().map(|p| (p.right, 1.0)).collect();
    let right_axes = covariance(level.iter().copied());
    let across = DMat3::IDENTITY * (1.0 + STEEP) - covariance(photos.iter().map(|p| (p.forward, 1.0)));
    let fit = Fit::of(photos, least_ratio(right_axes, across), &level);
    let mean_square = eigen(right_axes).0[0];
    let variance = mean_square.max(LEAST_ROLL_SIN * LEAST_ROLL_SIN);
    let of_roll = (2.0 * std::f64::consts::PI * variance).ln() + mean_square / variance;
    let of_pitch = |up: DVec3| photos.iter().map(|p| upright(p, up).ln()).sum::<f64>();
    let of_pitch = of_pitch(fit.vertical).max(of_pitch(-fit.vertical));
    (of_pitch - 0.5 * photos.len() as f64 * of_roll, fit)
}

/// Directions that may be up: those to which pairs of photos are level, and principal axes of all.
fn proposals(photos: &[Axes]) -> Vec<DVec3> {
    let all = |axis: fn(&Axes) -> DVec3| eigen(covariance(photos.iter().map(|p| (axis(p), 1.0)))).1;
    let mut proposed: Vec<DVec3> = [all(|p| p.right), all(|p| p.down)].concat();
    let proposing = spread(photos, PROPOSING);
    for (i, a) in proposing.iter().enumerate() {
        for b in &proposing[..i] {
            let pairs = [(a.right, b.right), (a.right, b.down), (a.down, b.right), (a.down, b.down)];
            proposed.extend(pairs.iter().filter_map(|(a, b)| a.cross(*b).try_normalize()));
        }
    }
    proposed.iter().flat_map(|up| [*up, -*up]).collect()
}

/// At most `count` photos, evenly taken.
fn spread(photos: &[Axes], count: usize) -> Vec<Axes> {
    photos.iter().step_by(photos.len().div_ceil(count).max(1)).copied().collect()
}

/// How photos are held: in landscape or in portrait, with roll that is normally distributed, or anyhow.
#[derive(Clone, Copy)]
struct Mixture {
    /// Shares of the photos: in landscape, in portrait, anyhow, and in landscape but careless.
    shares: [f64; 4],
    /// Standard deviation of the roll, as a sine.
    roll_sin: f64,
}

impl Mixture {
    fn of(shares: [f64; 3], roll_sin: f64) -> Self {
        Self { shares: [shares[0], shares[1], shares[2], 0.0], roll_sin }
    }

    fn all() -> Vec<Self> {
        let turned = SHARES.into_iter().flat_map(|shares| ROLL_SINES.map(|sine| Self::of(shares, sine)));
        let careless = CAREFUL_SINES.map(|roll_sin| Self { shares: [0.5, 0.0, 0.0, 0.5], roll_sin });
        turned.chain(careless).collect()
    }

    /// Densities of a photo: in landscape, in portrait, in landscape but careless, and of any. A direction that is held anyhow
    /// has any height evenly.
    fn densities(&self, photo: &Axes, up: DVec3) -> [f64; 4] {
        let normal = |share: f64, height: f64, sine: f64| {
            let scaled = height / sine;
            share * (-0.5 * scaled * scaled).exp() / (sine * (2.0 * std::f64::consts::PI).sqrt())
        };
        let (right, down) = (photo.right.dot(up), photo.down.dot(up));
        let [landscape, portrait, anyhow, careless] = self.shares;
        let landscape = normal(landscape, right, self.roll_sin) * upright(photo, up);
        let rises = right.abs() >= PORTRAIT_RISE && portrait > 0.0;
        let portrait = if rises { PITCHED * normal(portrait, down, self.roll_sin) } else { 0.0 };
        let careless = if careless > 0.0 {
            normal(careless, right, CARELESS * self.roll_sin) * upright(photo, up)
        } else {
            0.0
        };
        [landscape, portrait, careless, landscape + portrait + careless + 0.5 * anyhow]
    }

    /// Logarithm; finite, for no density is so small that it is zero.
    fn likelihood(&self, photos: &[Axes], up: DVec3) -> f64 {
        photos.iter().map(|photo| self.densities(photo, up)[3].max(f64::MIN_POSITIVE).ln()).sum()
    }

    /// The level axes with the probabilities that they are; careless photos weigh by their variance.
    fn level(&self, photos: &[Axes], up: DVec3) -> Vec<(DVec3, f64)> {
        let of = |photo: &Axes| {
            let [landscape, portrait, careless, any] =
                self.densities(photo, up).map(|d| d.max(f64::MIN_POSITIVE));
            let right = (landscape + careless / (CARELESS * CARELESS)) / any;
            [(photo.right, right), (photo.down, portrait / any)]
        };
        photos.iter().flat_map(of).collect()
    }

    /// The log likelihood and direction that reweighting finds from one near it.
    fn refined(&self, photos: &[Axes], near: DVec3) -> (f64, DVec3) {
        let mut best = (self.likelihood(photos, near), near);
        for _ in 0..ROUNDS {
            let next = eigen(covariance(self.level(photos, best.1).into_iter())).1[0];
            let next = if next.dot(best.1) < 0.0 { -next } else { next };
            let likelihood = self.likelihood(photos, next);
            if likelihood <= best.0 {
                break;
            }
            best = (likelihood, next);
        }
        best
    }

    fn fit(&self, photos: &[Axes], up: DVec3) -> Fit {
        Fit::of(photos, up, &self.level(photos, up))
    }
}
