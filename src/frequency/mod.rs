//! The frequency-aware scheduler: from the photos' spectra, how coarse the training images may be at
//! each time, how large textures may grow and how many primitives there should be (method section 8).
//!
//! Times are fractions of T_r, when the last stage begins (two thirds of the steps). What a trainer does with
//! the answers does not belong here, nor do backends or files.

mod analyse;
mod budget;
mod fft;
#[cfg(test)]
mod fixtures;
mod noise;
mod options;
mod significance;
mod spectrum;
mod stages;

pub use budget::SplatBudget;
pub use options::{CapRule, FrequencyOptions, ScaleRule};

#[cfg(test)]
mod tests;

use crate::Result;
use crate::views::ViewSource;
use serde::{Deserialize, Serialize};

/// The smaller side of a reduced image is at least this: SSIM's window is 11 pixels, a tile 16
/// (method section 11).
pub const SMALLEST_SIDE_PX: u32 = 64;

/// Bounds of the texture cap (method section 8.6).
const CAP_MIN: u16 = 4;
const CAP_MAX: u16 = 256;

/// Steps of [`ScaleRule::Fractional`] per octave.
const STEPS_PER_OCTAVE: f64 = 4.0;

/// Logarithms of powers of two must not fall short of the integer that they are. Relative 1e-9 of a
/// scale is no pixel.
const ROUNDING: f64 = 1e-9;

/// How scales fall over time, from the photos alone.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, try_from = "Unchecked")]
pub struct FrequencySchedule {
    /// Scale of the first stage.
    pub s_max: f64,
    /// Time as a fraction of T_r, and scale there; times rise from 0 to 1, scales fall to 1. Between
    /// nodes 1/s^2, the share of pixels, is linear in time. One node (0, 1): nothing to schedule.
    pub nodes: Vec<(f64, f64)>,
    /// Views that were analysed.
    pub views: usize,
    /// Standard deviation of the noise that was taken out, of channel values from 0 to 1 (median over
    /// views); 0 where none was looked for.
    pub noise: f64,
}

/// What a file says, before it is believed.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Unchecked {
    s_max: f64,
    nodes: Vec<(f64, f64)>,
    views: usize,
    noise: f64,
}

impl TryFrom<Unchecked> for FrequencySchedule {
    type Error = String;

    fn try_from(found: Unchecked) -> Result<Self, String> {
        let Unchecked { s_max, nodes, views, noise } = found;
        let ordered = nodes.windows(2).all(|n| n[0].0 <= n[1].0 && n[0].1 >= n[1].1);
        let ends = nodes.first().zip(nodes.last());
        let sound = ends.is_some_and(|(first, last)| {
            first.0 == 0.0 && first.1 == s_max && last.1 == 1.0 && (nodes.len() == 1 || last.0 == 1.0)
        });
        if !(ordered && sound) {
            return Err("nodes of a schedule must rise in time from 0 to 1 and fall in scale to 1".to_owned());
        }
        Ok(Self { s_max, nodes, views, noise })
    }
}

impl FrequencySchedule {
    /// The scheduler switched off: full size and the largest textures from the start.
    pub fn flat() -> Self {
        Self { s_max: 1.0, nodes: vec![(0.0, 1.0)], views: 0, noise: 0.0 }
    }

    /// The schedule for the training views of a capture. Deterministic for any number of threads.
    ///
    /// # Errors
    /// Settings that make no sense, and what reading the photos found.
    pub fn analyse(views: &dyn ViewSource, options: &FrequencyOptions) -> Result<Self> {
        analyse::analyse(views, options)
    }

    /// The continuous scale s(t), from `s_max` at t = 0 to 1 at t = 1 and after.
    pub fn scale(&self, t: f64) -> f64 {
        let Some((before, after, part)) = self.between(t) else { return 1.0 };
        let share = |s: f64| 1.0 / (s * s);
        let (low, high) = (share(before), share(after));
        (1.0 / (low + (high - low) * part)).sqrt().max(1.0)
    }

    /// Scale of the images to train with: at most s(t), so that they never show less than the stage
    /// asks for, and such that `smaller_side_px / scale` is at least [`SMALLEST_SIDE_PX`].
    pub fn render_scale(&self, t: f64, rule: ScaleRule, smaller_side_px: u32) -> f64 {
        let limit = f64::from(smaller_side_px) / f64::from(SMALLEST_SIDE_PX);
        let scale = self.scale(t).min(limit).max(1.0);
        match rule {
            ScaleRule::Off => 1.0,
            ScaleRule::Integer => (scale + ROUNDING).floor(),
            ScaleRule::Fractional => {
                ((scale.log2() * STEPS_PER_OCTAVE + ROUNDING).floor() / STEPS_PER_OCTAVE).exp2()
            }
        }
    }

    /// Cap of the texture resolution u(t); never falls.
    pub fn texture_cap(&self, t: f64, rule: CapRule) -> u16 {
        match rule {
            CapRule::Squared => {
                let wanted = f64::from(CAP_MAX) / self.scale(t).powi(2);
                let power = (wanted.log2() + ROUNDING).floor().exp2();
                (power as u16).clamp(CAP_MIN, CAP_MAX)
            }
            CapRule::Authors => {
                let linear = |(before, after, part): (f64, f64, f64)| before + (after - before) * part;
                let scale = self.between(t).map_or(1.0, linear);
                let wanted = (f64::from(CAP_MAX) / (scale - ROUNDING).ceil()).floor();
                (wanted as u16).clamp(CAP_MIN, CAP_MAX)
            }
        }
    }

    /// Scales of the nodes before and after a time, and how far between them it lies; `None` when
    /// everything is open.
    fn between(&self, t: f64) -> Option<(f64, f64, f64)> {
        let t = t.max(0.0);
        let next = self.nodes.partition_point(|node| node.0 <= t);
        let (before, after) = (self.nodes.get(next.wrapping_sub(1))?, self.nodes.get(next)?);
        Some((before.1, after.1, (t - before.0) / (after.0 - before.0)))
    }
}
