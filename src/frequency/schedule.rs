//! The schedule: scale, image size and texture cap over time.

use super::options::{CapRule, ScaleRule};
use serde::{Deserialize, Serialize};

/// Least smaller side of a reduced image: the window of SSIM has 11 pixels, a tile 16 (method 7.4).
pub const SMALLEST_SIDE_PX: u32 = 64;

/// Bounds of the texture cap, in texels (method 7.4).
const CAP_MIN: u16 = 4;
const CAP_MAX: u16 = 256;

/// Steps of [`ScaleRule::Fractional`] per octave.
const STEPS_PER_OCTAVE: f64 = 4.0;

/// Added before rounding down, so that logarithms of powers of two reach their integer; far below a pixel.
const ROUNDING: f64 = 1e-9;

/// The scale over time, which depends only on the photos.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, try_from = "Unchecked")]
pub struct FrequencySchedule {
    /// Scale of the first stage.
    pub s_max: f64,
    /// Times as fractions of T_r, rising from 0 to 1, and the scales there, falling to 1. Between nodes 1/s^2, the
    /// share of pixels, is linear in time. A single node (0, 1) means full size throughout.
    pub nodes: Vec<(f64, f64)>,
    /// Number of views analysed.
    pub views: usize,
    /// Standard deviation of the noise removed, for channel values from 0 to 1 (median over views); 0 if noise is
    /// not estimated.
    pub noise: f64,
}

/// A schedule as read from a file, before its nodes are checked.
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
        let ends_match = ends.is_some_and(|(first, last)| {
            first.0 == 0.0 && first.1 == s_max && last.1 == 1.0 && (nodes.len() == 1 || last.0 == 1.0)
        });
        if !(ordered && ends_match) {
            return Err("nodes of a schedule must rise in time from 0 to 1 and fall in scale to 1".to_owned());
        }
        Ok(Self { s_max, nodes, views, noise })
    }
}

impl FrequencySchedule {
    /// The schedule that is off: full size and the largest texture cap throughout.
    pub fn flat() -> Self {
        Self { s_max: 1.0, nodes: vec![(0.0, 1.0)], views: 0, noise: 0.0 }
    }

    /// The continuous scale s(t), from `s_max` at t = 0 to 1 from t = 1 on.
    pub fn scale(&self, t: f64) -> f64 {
        let Some((before, after, part)) = self.between(t) else { return 1.0 };
        let share = |s: f64| 1.0 / (s * s);
        let (low, high) = (share(before), share(after));
        (1.0 / (low + (high - low) * part)).sqrt().max(1.0)
    }

    /// Render scale r(t): at most s(t), so that images never show less than the stage requires, and small enough
    /// for `smaller_side_px / scale` to be at least [`SMALLEST_SIDE_PX`].
    pub fn render_scale(&self, t: f64, rule: ScaleRule, smaller_side_px: u32) -> f64 {
        let limit = f64::from(smaller_side_px) / f64::from(SMALLEST_SIDE_PX);
        let scale = self.scale(t).min(limit).max(1.0);
        match rule {
            ScaleRule::Integer => (scale + ROUNDING).floor(),
            ScaleRule::Fractional => {
                ((scale.log2() * STEPS_PER_OCTAVE + ROUNDING).floor() / STEPS_PER_OCTAVE).exp2()
            }
        }
    }

    /// Texture cap u(t), in texels; never falls.
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

    /// Scales of the nodes before and after a time, and its position between them, 0 to 1; `None` after the last
    /// node.
    fn between(&self, t: f64) -> Option<(f64, f64, f64)> {
        let t = t.max(0.0);
        let next = self.nodes.partition_point(|node| node.0 <= t);
        let (before, after) = (self.nodes.get(next.wrapping_sub(1))?, self.nodes.get(next)?);
        Some((before.1, after.1, (t - before.0) / (after.0 - before.0)))
    }
}
