//! Candidates: what can be done for a high-error splat, and how candidates are ranked (method 6.6).

use super::draft::Draft;
use super::maps;
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
    /// The two halves, if it is to be split.
    pub split: Option<[Draft; 2]>,
    /// What is done unless it is split: its map refined, or only its ceiling raised.
    pub refined: Option<Draft>,
}

impl Candidate {
    /// Weighs a split against a refined map. `pixel` is the width of a pixel at the splat, local units.
    pub fn new(
        s: &Situation<'_>,
        config: &DensityConfig,
        components: &Components,
        draft: &Draft,
        error: f64,
        pixel: f64,
    ) -> Self {
        let refined = maps::refined(s, config, components, draft);
        let split =
            components.splitting.then(|| split::split(s, config, draft, pixel, s.split_texels)).flatten();
        let params = |draft: &Draft| draft.params(s.model.splats.sh_degree) as f64;
        // A raised ceiling costs nothing and gains nothing yet.
        let refined_cost = refined.map_or(0.0, |d| params(&d) - params(draft));
        let refined_gain = if refined_cost > 0.0 { config.texel_gain / refined_cost } else { 0.0 };
        // The halves together may need fewer texels than the whole, but they are one splat more.
        let split_cost = |[a, b]: [Draft; 2]| (params(&a) + params(&b) - params(draft)).max(1.0);
        let split_gain = split.map_or(0.0, |pair| 1.0 / split_cost(pair));
        let (rank, may_split) = match config.spending {
            Spending::SplitsFirst => (error, true),
            Spending::Gain => (error * refined_gain.max(split_gain), split_gain > refined_gain),
        };
        Self { splat: draft.source as usize, error, rank, split: split.filter(|_| may_split), refined }
    }
}
