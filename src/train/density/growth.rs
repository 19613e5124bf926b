//! What growth is worth: the share of its error that a splat loses if it is split, its map is refined or it gains an SH band,
//! measured against splats that are withheld, and whether more parameters would still pay (method 6.14).

use super::candidate::Candidate;
use super::history::{SplatHistory, Trial};
use super::rank_correlation::rank_correlation;
use super::score::Scores;
use super::situation::Situation;

/// What is left of the evidence of a window after the next one.
const KEPT_EVIDENCE: f64 = 0.7;

/// Checks in a row that must find growth not worth its parameters before it ends.
const IDLE_CHECKS: u32 = 2;

/// The growth of the parameters that must pay.
const PROMISED_GROWTH: f64 = 0.1;

/// Range of what other growth may be worth compared to a split: few splats in a window give odd ratios.
const GAIN_RANGE: [f64; 2] = [0.25, 8.0];

/// A kind of growth.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// A splat is split.
    Split,
    /// Its map is refined, or it gets its first one.
    Refined,
    /// It gains an SH band.
    Band,
}

/// Number of kinds.
pub const KINDS: usize = 3;

/// Measured worth of growth; part of a run's state.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Growth {
    /// Summed errors, before the last step, of the splats that it withheld, and of those that grew, by kind.
    pub before: [f64; 1 + KINDS],
    /// Summed errors of splats that grew, by kind, those of older windows discounted.
    pub tried: [f64; KINDS],
    /// How much less of it was left than with withheld splats.
    pub removed: [f64; KINDS],
    /// For each kind, the sums over windows of (splats), and of (splats times the rank correlation of the error that they
    /// carried and of the error removed).
    pub ranked: [[f64; 2]; KINDS],
    /// Checks in a row that found that growth is not worth its parameters.
    pub idle_checks: u32,
    /// What the next 10 % of the parameters promised at the last check, dB of the training views.
    pub promised_db: f64,
    /// Step after which growth ended; 0: it has not.
    pub ended_step: u32,
}

impl Growth {
    /// Whether growth has ended.
    pub fn has_ended(&self) -> bool {
        self.ended_step > 0
    }

    /// Compares the errors of a window with those before the last step.
    pub fn observe(&mut self, histories: &[SplatHistory], scores: &Scores) {
        let mut after = [0.0; 1 + KINDS];
        for (history, error) in histories.iter().zip(&scores.total) {
            if let Some(group) = history.trial.group() {
                after[group] += error;
            }
        }
        let [withheld, tried @ ..] = std::mem::take(&mut self.before);
        if withheld <= 0.0 || after[0] <= 0.0 {
            return;
        }
        // What training alone does to the error of a splat.
        let drift = after[0] / withheld;
        for kind in 0..KINDS {
            if tried[kind] > 0.0 {
                self.tried[kind] = KEPT_EVIDENCE * self.tried[kind] + tried[kind];
                self.removed[kind] =
                    KEPT_EVIDENCE * self.removed[kind] + tried[kind] - after[1 + kind] / drift;
            }
            self.rank(kind, drift, histories, scores);
        }
    }

    /// Compares, splat by splat, the error that it carried, by which growth is ranked, with what growth removed of it.
    fn rank(&mut self, kind: usize, drift: f64, histories: &[SplatHistory], scores: &Scores) {
        let pairs: Vec<(f64, f64)> = histories
            .iter()
            .zip(&scores.total)
            .filter(|(history, _)| history.trial.group() == Some(1 + kind) && history.error > 0.0)
            .map(|(history, after)| (history.error.into(), f64::from(history.error) - after / drift))
            .collect();
        if let Some(correlation) = rank_correlation(&pairs) {
            let weight = pairs.len() as f64;
            let [splats, weighted] = &mut self.ranked[kind];
            (*splats, *weighted) = (*splats + weight, *weighted + weight * correlation);
        }
    }

    /// Rank correlations, by kind, of the error that a splat carried with what growth removed of it:
    /// means over the windows. `None` where none could be compared.
    pub fn rank_correlations(&self) -> [Option<f64>; KINDS] {
        self.ranked.map(|[splats, weighted]| (splats > 0.0).then(|| weighted / splats))
    }

    /// The share of a splat's error that this kind of growth removes; `None` before it was measured.
    pub fn share(&self, kind: Kind) -> Option<f64> {
        let [tried, removed] = [self.tried, self.removed].map(|errors| errors[kind as usize]);
        (tried > 0.0).then(|| (removed / tried).clamp(0.0, 1.0))
    }

    /// The share of a splat's error that this kind of growth removes, over the share that a split removes; `set` before both
    /// were measured.
    pub fn gain(&self, kind: Kind, set: f64) -> f64 {
        let [least, most] = GAIN_RANGE;
        match (self.share(Kind::Split), self.share(kind)) {
            (Some(split), Some(share)) if share > 0.0 => (share / split).clamp(least, most),
            (Some(_), Some(_)) => least,
            _ => set,
        }
    }

    /// Judges whether more parameters would pay: `need_db` or more of the training views for 10 % of `params`. Counts
    /// only where images have full size, and growth was measured.
    pub fn judge(
        &mut self,
        s: &Situation<'_>,
        candidates: &[Candidate],
        scores: &Scores,
        params: usize,
        need_db: f64,
    ) {
        let shares = [Kind::Split, Kind::Refined].map(|kind| self.share(kind));
        if !s.densify || self.has_ended() || s.render_scale > 1.0 || shares == [None; 2] {
            return;
        }
        let shares = shares.map(|share| share.unwrap_or(0.0));
        let offer = |candidate: &Candidate| {
            let error = scores.total[candidate.splat];
            let offers = [candidate.split_cost, candidate.refined_cost];
            let per_cost = |kind: usize| offers[kind].map_or(0.0, |cost| shares[kind] * error / cost);
            let best = usize::from(per_cost(1) > per_cost(0));
            (per_cost(best), offers[best].unwrap_or(0.0))
        };
        let mut offers: Vec<(f64, f64)> = candidates.iter().map(offer).collect();
        offers.sort_by(|a, b| b.0.total_cmp(&a.0));
        let mut left = PROMISED_GROWTH * params as f64;
        let mut gain = 0.0;
        for (per_cost, cost) in offers {
            gain += per_cost * cost.min(left);
            left -= cost.min(left);
        }
        let share = (gain / scores.total.iter().sum::<f64>().max(1e-300)).min(0.99);
        // The loss is mostly an absolute error: its square makes the PSNR.
        self.promised_db = -20.0 * (1.0 - share).log10();
        self.idle_checks = if self.promised_db < need_db { self.idle_checks + 1 } else { 0 };
        if self.idle_checks >= IDLE_CHECKS {
            self.ended_step = s.step;
        }
    }
}

impl Trial {
    /// Its place in [`Growth::before`].
    pub fn group(self) -> Option<usize> {
        match self {
            Self::None => None,
            Self::Withheld => Some(0),
            Self::Split => Some(1 + Kind::Split as usize),
            Self::RefinedU | Self::RefinedV | Self::RefinedBoth => Some(1 + Kind::Refined as usize),
            Self::Raised => Some(1 + Kind::Band as usize),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::settings::ErrorMeasure;
    use super::*;
    use crate::backend::WindowStatistics;

    fn scores(errors: &[f32]) -> Scores {
        let n = errors.len();
        let window = WindowStatistics {
            views: 4,
            seen: vec![4; n],
            area: vec![0.1; n],
            contribution: vec![0.1; n],
            error: errors.to_vec(),
        };
        Scores::new(&window, 4, ErrorMeasure::Mass, 0.0)
    }

    fn histories(trials: &[Trial]) -> Vec<SplatHistory> {
        trials.iter().map(|&trial| SplatHistory { trial, ..SplatHistory::first(2) }).collect()
    }

    #[test]
    fn shares_are_measured_against_withheld_candidates() {
        let trials =
            [Trial::Withheld, Trial::Split, Trial::Split, Trial::RefinedV, Trial::Raised, Trial::None];
        let after = scores(&[0.5, 0.15, 0.15, 0.4, 0.45, 9.0]);
        let mut growth = Growth { before: [1.0; 4], ..Growth::default() };
        growth.observe(&histories(&trials), &after);
        // Training alone halves the error: 0.3 of 0.5 are left after a split, 0.4 after refining, 0.45 with another band.
        let shares =
            |growth: &Growth| [Kind::Split, Kind::Refined, Kind::Band].map(|k| growth.share(k).unwrap());
        let [split, refined, band] = shares(&growth);
        assert!((split - 0.4).abs() < 1e-6 && (refined - 0.2).abs() < 1e-6, "{split} {refined}");
        assert!((band - 0.1).abs() < 1e-6, "{band}");
        let [refined, band] = [Kind::Refined, Kind::Band].map(|kind| growth.gain(kind, 2.0));
        assert!((refined - 0.5).abs() < 1e-6 && (band - 0.25).abs() < 1e-6, "{refined} {band}");
        for (split, refined, gain) in [(0.0, 0.1, 8.0), (0.0, 0.0, 0.25), (0.1, 0.0, 0.25)] {
            let mut other = growth;
            other.removed = [split, refined, 0.0];
            assert_eq!(other.gain(Kind::Refined, 2.0), gain);
        }
        // What was compared once is not compared again; older evidence fades.
        assert_eq!(growth.before, [0.0; 4]);
        growth.observe(&histories(&trials), &after);
        assert_eq!(growth.tried, [1.0; 3]);
        growth.before = [1.0, 1.0, 0.0, 0.0];
        growth.observe(&histories(&trials), &scores(&[0.5, 0.25, 0.25, 0.4, 0.45, 9.0]));
        let [split, refined, _] = shares(&growth);
        assert!((split - 0.28 / 1.7).abs() < 1e-6 && (refined - 0.2).abs() < 1e-6, "{split} {refined}");
        // Nothing is learnt without withheld candidates.
        let mut none = Growth { before: [0.0, 1.0, 1.0, 1.0], ..Growth::default() };
        none.observe(&histories(&trials), &after);
        assert_eq!((none.share(Kind::Split), none.gain(Kind::Refined, 2.0)), (None, 2.0));
    }
}
