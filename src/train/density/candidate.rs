//! Candidates: what can be done for a high-error splat, and how candidates are ranked (method 6.6).

use super::history::SplatHistory;
use super::maps;
use super::planned_splat::{PlannedSplat, split_cost};
use super::settings::{Components, DensityConfig, Spending};
use super::situation::Situation;
use super::split;

/// A high-error splat for which growth is considered.
pub struct Candidate {
    /// Index of the splat.
    pub splat: usize,
    /// Error of the splat by the chosen measure.
    pub error: f64,
    /// Priority; the highest is served first.
    pub rank: f64,
    /// Parameters that a split would add, if it may be split.
    pub split_cost: Option<f64>,
    /// Parameters that refining its map would add, if it can be refined.
    pub refined_cost: Option<f64>,
    /// The two halves, if it is to be split.
    pub split: Option<[PlannedSplat; 2]>,
    /// What is done unless it is split: its map refined, or only its ceiling raised.
    pub refined: Option<PlannedSplat>,
}

impl Candidate {
    /// Weighs a split against a refined map, which removes `texel_gain` times as much of the error. `pixel` is the width of
    /// a pixel at the splat, local units.
    pub fn new(
        s: &Situation<'_>,
        config: &DensityConfig,
        components: &Components,
        planned: &PlannedSplat,
        error: f64,
        pixel: f64,
        texel_gain: f64,
    ) -> Self {
        let refined = maps::refined(s, config, components, planned);
        let may_split = components.splitting && !s.draws_growth;
        let split = may_split.then(|| split::split(s, config, planned, pixel, s.split_texels)).flatten();
        // In the paper the ceiling of every candidate doubles, also of one that is split.
        let split = match (config.spending, refined) {
            (Spending::SplitsFirst, Some(refined)) => split.map(|pair| {
                let ceiling = refined.history.ceiling;
                pair.map(|half| PlannedSplat { history: SplatHistory { ceiling, ..half.history }, ..half })
            }),
            _ => split,
        };
        let params = |planned: &PlannedSplat| planned.params() as f64;
        // A raised ceiling costs nothing and gains nothing yet.
        let refined_cost = refined.map_or(0.0, |d| params(&d) - params(planned));
        let refined_gain = if refined_cost > 0.0 { texel_gain / refined_cost } else { 0.0 };
        let split_cost = split.map(|pair| split_cost(planned, &pair));
        let split_gain = split_cost.map_or(0.0, |cost| 1.0 / cost);
        let (rank, may_split) = match config.spending {
            Spending::SplitsFirst => (error, true),
            Spending::Gain => (error * refined_gain.max(split_gain), split_gain > refined_gain),
        };
        Self {
            splat: planned.source as usize,
            error,
            rank,
            split_cost,
            refined_cost: (refined_cost > 0.0).then_some(refined_cost),
            split: split.filter(|_| may_split),
            refined,
        }
    }
}
