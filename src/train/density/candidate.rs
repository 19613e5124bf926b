//! Candidates: what can be done for a high-error splat, and how candidates are ranked (method 6.6).

use super::draft::Draft;
use super::maps;
use super::settings::{Components, DensityConfig, Spending};
use super::situation::Situation;
use super::split;
use crate::model::num_params;

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
        let cost = |splats: f64, texels: usize| num_params(splats, texels as f64 - draft.texels as f64);
        // A raised ceiling costs nothing and gains nothing yet.
        let refined_cost = refined.map_or(0.0, |d| cost(0.0, d.texels));
        let refined_gain = if refined_cost > 0.0 { config.texel_gain / refined_cost } else { 0.0 };
        // The halves together may need fewer texels than the whole, but they are one splat more.
        let halves = |pair: [Draft; 2]| cost(1.0, pair[0].texels + pair[1].texels).max(1.0);
        let split_gain = split.map_or(0.0, |pair| 1.0 / halves(pair));
        let (rank, may_split) = match config.spending {
            Spending::SplitsFirst => (error, true),
            Spending::Gain => (error * refined_gain.max(split_gain), split_gain > refined_gain),
        };
        Self { splat: draft.source as usize, error, rank, split: split.filter(|_| may_split), refined }
    }
}
