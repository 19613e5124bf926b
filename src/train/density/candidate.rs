//! What may be done for one of the worst splats, and who comes first.

use super::decide::Situation;
use super::draft::Draft;
use super::maps;
use super::settings::{Components, DensityConfig, Spending};
use super::split;
use crate::model::num_params;

/// One of the worst splats.
pub struct Candidate {
    /// Its number.
    pub splat: usize,
    /// Its error.
    pub error: f64,
    /// The largest comes first.
    pub rank: f64,
    /// The two halves, if it is to be split.
    pub split: Option<[Draft; 2]>,
    /// Its map refined, or only its ceiling raised: what is done if it is not split.
    pub finer: Option<Draft>,
}

impl Candidate {
    /// Weighs both ways of spending on a splat with some error and width of a pixel, local units.
    pub fn new(
        s: &Situation<'_>,
        config: &DensityConfig,
        components: &Components,
        draft: &Draft,
        error: f64,
        pixel: f64,
    ) -> Self {
        let finer = maps::grown(s, config, components, draft);
        let split =
            components.splitting.then(|| split::split(s, config, draft, pixel, s.split_texels)).flatten();
        let cost = |splats: f64, texels: usize| num_params(splats, texels as f64 - draft.texels as f64);
        // A raised ceiling costs nothing, and gains nothing yet.
        let finer_cost = finer.map_or(0.0, |d| cost(0.0, d.texels));
        let finer_gain = if finer_cost > 0.0 { config.texel_gain / finer_cost } else { 0.0 };
        // Halves may together need fewer texels than the whole: still a splat more.
        let halves = |pair: [Draft; 2]| cost(1.0, pair[0].texels + pair[1].texels).max(1.0);
        let split_gain = split.map_or(0.0, |pair| 1.0 / halves(pair));
        let (rank, may_split) = match config.spending {
            Spending::SplitsFirst => (error, true),
            Spending::Gain => (error * finer_gain.max(split_gain), split_gain > finer_gain),
        };
        Self { splat: draft.source as usize, error, rank, split: split.filter(|_| may_split), finer }
    }
}
