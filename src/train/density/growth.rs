//! What growth is worth: the share of its error that a splat loses if it is split, its map is refined or it gains an SH band,
//! measured against splats that are withheld, and whether more parameters would still pay (method 6.14).

use super::budget_allocator::WITHHELD_OF;
use super::candidate::Candidate;
use super::history::SplatHistory;
use super::outcome::{Outcome, Outcomes};
use super::rank_correlation::rank_correlation;
use super::score::Scores;
use super::situation::Situation;

/// What is left of the evidence of a window after the next one.
const KEPT_EVIDENCE: f64 = 0.7;

/// Checks in a row that must find growth not worth its parameters before it ends.
const IDLE_CHECKS: u32 = 2;

/// The growth of the parameters that must pay.
const PROMISED_GROWTH: f64 = 0.1;

/// Fewest withheld splats that tell what training alone does. Five once let growth end at its second check (fox, 80 pixels, 3,000
/// points, 600 steps).
pub const WITHHELD_MIN: f64 = 10.0;

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
    /// What became of the splats that grew, by kind; older windows are discounted.
    pub grown: [Outcome; KINDS],
    /// The same for those that were withheld.
    pub withheld: [Outcome; KINDS],
    /// For each kind, the sums over windows of (splats), and of (splats times the rank correlation of the error that they
    /// carried and of the error removed).
    pub ranked: [[f64; 2]; KINDS],
    /// Checks in a row that found that growth is not worth its parameters.
    pub idle_checks: u32,
    /// What the next 10 % of the parameters promised at the last check, and with shares two standard errors higher, dB of the
    /// training views; `None` before the first.
    pub promised_db: Option<[f64; 2]>,
    /// Step after which growth ended; 0: it has not.
    pub ended_step: u32,
}

impl Growth {
    /// Whether growth has ended.
    pub fn has_ended(&self) -> bool {
        self.ended_step > 0
    }

    /// Takes in what a window did to the splats that grew in the step before it, and to those withheld.
    pub fn observe(&mut self, window: &Outcomes, histories: &[SplatHistory], scores: &Scores) {
        for kind in 0..KINDS {
            self.grown[kind] = self.grown[kind].faded(KEPT_EVIDENCE).and(window.grown[kind]);
            self.withheld[kind] = self.withheld[kind].faded(KEPT_EVIDENCE).and(window.withheld[kind]);
        }
        for kind in [Kind::Split, Kind::Refined, Kind::Band] {
            if let Some(drift) = window.withheld[kind as usize].left() {
                self.rank(kind, drift, histories, scores);
            }
        }
    }

    /// Compares, splat by splat, the error that it carried, by which growth is ranked, with what growth removed of it.
    /// `drift` is the share of it that training alone leaves.
    fn rank(&mut self, kind: Kind, drift: f64, histories: &[SplatHistory], scores: &Scores) {
        let pairs: Vec<(f64, f64)> = histories
            .iter()
            .zip(&scores.total)
            .filter(|(history, _)| history.trial.grown() == Some(kind) && history.error > 0.0)
            .map(|(history, after)| (history.error.into(), f64::from(history.error) - after / drift))
            .collect();
        if let Some(correlation) = rank_correlation(&pairs) {
            let weight = pairs.len() as f64;
            let [splats, weighted] = &mut self.ranked[kind as usize];
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
        let left = |outcomes: &[Outcome; KINDS]| outcomes[kind as usize].left();
        Some((1.0 - left(&self.grown)? / left(&self.withheld)?).clamp(0.0, 1.0))
    }

    /// The share that this kind of growth may remove at most: two standard errors above [`Self::share`].
    fn share_at_most(&self, kind: Kind) -> Option<f64> {
        let [grown, withheld] = [&self.grown, &self.withheld].map(|outcomes| &outcomes[kind as usize]);
        let ratio = grown.left()? / withheld.left()?;
        let error = ratio * (grown.relative_variance()? + withheld.relative_variance()?).sqrt();
        Some((1.0 - ratio + 2.0 * error).clamp(0.0, 1.0))
    }

    /// Whether so many splats were withheld from this kind of growth that its share means something.
    fn is_measured(&self, kind: Kind) -> bool {
        self.withheld[kind as usize].splats >= WITHHELD_MIN
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
    /// only where images have full size, and growth was measured on splats enough: at least one kind, and each that so many
    /// candidates prefer that enough of them are withheld. Growth ends only where even shares two standard errors higher promise
    /// too little.
    pub fn judge(
        &mut self,
        s: &Situation<'_>,
        candidates: &[Candidate],
        scores: &Scores,
        params: usize,
        need_db: f64,
    ) {
        let kinds = [Kind::Split, Kind::Refined];
        let measured = |share: Option<f64>, kind| share.filter(|_| self.is_measured(kind));
        let shares = kinds.map(|kind| measured(self.share(kind), kind));
        let at_most = kinds.map(|kind| measured(self.share_at_most(kind), kind).unwrap_or(0.0));
        let is_split = |c: &&Candidate| c.split.is_some();
        let is_refined = |c: &&Candidate| c.split.is_none() && c.refined_cost.is_some();
        let preferred =
            [candidates.iter().filter(is_split).count(), candidates.iter().filter(is_refined).count()];
        let is_unknown = |kind: usize| {
            shares[kind].is_none() && preferred[kind] as f64 >= WITHHELD_MIN * f64::from(WITHHELD_OF)
        };
        let is_known = shares != [None; 2] && !(0..2).any(is_unknown);
        if !s.densify || self.has_ended() || s.render_scale > 1.0 || !is_known {
            return;
        }
        let shares = shares.map(|share| share.unwrap_or(0.0));
        let promised_db = [shares, at_most].map(|shares| promised_db(shares, candidates, scores, params));
        self.promised_db = Some(promised_db);
        self.idle_checks = if promised_db[1] < need_db { self.idle_checks + 1 } else { 0 };
        if self.idle_checks >= IDLE_CHECKS {
            self.ended_step = s.step;
        }
    }
}

/// What the best candidates for a tenth more parameters promise if splits and refined maps remove these shares of their
/// losses, dB of the training views.
fn promised_db(shares: [f64; 2], candidates: &[Candidate], scores: &Scores, params: usize) -> f64 {
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
    // The loss is mostly an absolute error: its square makes the PSNR. Without the sign of -log10(1).
    (-20.0 * (1.0 - share).log10()).max(0.0)
}

#[cfg(test)]
mod tests {
    use super::super::history::Trial;
    use super::super::settings::ErrorMeasure;
    use super::*;
    use crate::backend::WindowStatistics;

    fn window(errors: &[f32]) -> WindowStatistics {
        let n = errors.len();
        let ones = vec![0.1; n];
        let (seen, contribution) = (vec![4; n], ones.clone());
        WindowStatistics { views: 4, seen, area: ones, contribution, error: errors.to_vec() }
    }

    /// Splats with a loss of 1 before, and what became of them.
    fn observe(growth: &mut Growth, splats: &[(Trial, f32)]) {
        let of = |&(trial, _): &(Trial, f32)| SplatHistory { trial, error: 1.0, ..SplatHistory::first(2) };
        let histories: Vec<SplatHistory> = splats.iter().map(of).collect();
        let errors: Vec<f32> = splats.iter().map(|splat| splat.1).collect();
        let scores = Scores::new(&window(&errors), 4, ErrorMeasure::Mass, 0.0);
        growth.observe(&Outcomes::new(&histories, &scores), &histories, &scores);
    }

    #[test]
    fn shares_are_measured_against_splats_withheld_from_the_same_growth() {
        use Trial::{Raised, RefinedV, Split, Withheld};
        let [no_split, no_refined, no_band] = [Kind::Split, Kind::Refined, Kind::Band].map(Withheld);
        // Training alone leaves a half of the loss, and 0.8 of that of splats whose maps could be refined.
        let first = [
            (no_split, 0.5),
            (Split, 0.3),
            (Split, 0.3),
            (no_refined, 0.8),
            (RefinedV, 0.6),
            (no_band, 0.5),
            (Raised, 0.45),
            (Trial::None, 9.0),
        ];
        let mut growth = Growth::default();
        observe(&mut growth, &first);
        let shares =
            |growth: &Growth| [Kind::Split, Kind::Refined, Kind::Band].map(|k| growth.share(k).unwrap());
        let [split, refined, band] = shares(&growth);
        assert!((split - 0.4).abs() < 1e-6 && (refined - 0.25).abs() < 1e-6, "{split} {refined}");
        assert!((band - 0.1).abs() < 1e-6, "{band}");
        let [refined, band] = [Kind::Refined, Kind::Band].map(|kind| growth.gain(kind, 2.0));
        assert!((refined - 0.625).abs() < 1e-6 && (band - 0.25).abs() < 1e-6, "{refined} {band}");
        let left = |after| Outcome { splats: 1.0, before: 1.0, after, squares: [0.0; 3] };
        for (split, refined, gain) in [(1.0, 0.9, 8.0), (1.0, 1.0, 0.25), (0.9, 1.0, 0.25)] {
            let grown = [left(split), left(refined), left(1.0)];
            let other = Growth { grown, withheld: [left(1.0); KINDS], ..growth };
            assert_eq!(other.gain(Kind::Refined, 2.0), gain);
        }
        // Older evidence fades.
        observe(&mut growth, &[(no_split, 0.5), (Split, 0.5), (Split, 0.5)]);
        let [split, refined, _] = shares(&growth);
        let expected = 1.0 - (0.7 * 0.6 + 1.0) / (0.7 * 2.0 + 2.0) / 0.5;
        assert!((split - expected).abs() < 1e-6 && (refined - 0.25).abs() < 1e-6, "{split} {refined}");
        // Nothing is learnt without withheld splats.
        let mut none = Growth::default();
        observe(&mut none, &[(no_split, 0.5), (RefinedV, 0.4)]);
        assert_eq!((none.share(Kind::Refined), none.gain(Kind::Refined, 2.0)), (None, 2.0));
    }
}
