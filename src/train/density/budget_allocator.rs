//! The budget allocator: takes the offers that are drawn, or splits candidates and refines their maps in order, while the budget
//! lasts, and then respawns pruned splats (method 6.6, 6.8 and 6.10).

use super::candidate::Candidate;
use super::draw::{Offer, SPLIT_RATE, draw_order};
use super::growth::Kind;
use super::history::Trial;
use super::planned_splat::{PlannedSplat, size_of, with, without};
use super::settings::{Budget, DensityConfig};
use super::situation::{DensityCounts, Situation};
use super::split::{self, split_of_any_length};
use crate::model::ModelSize;
use rand::{RngExt as _, SeedableRng as _};
use rand_pcg::Pcg64Mcg;

/// Length in finest texels above which a splat may be split to replace a pruned one. Not measured.
const RESPAWN_TEXELS: f64 = 2.0;

/// Makes the seed of draws another than that of the splats withheld.
const DRAW_STREAM: u64 = 1;

/// One in this many splats that could grow is withheld where growth is measured.
pub const WITHHELD_OF: u32 = 10;

/// The planned splats, and what is left of the limits of a step.
pub struct BudgetAllocator<'a> {
    s: &'a Situation<'a>,
    config: &'a DensityConfig,
    budget: &'a Budget,
    /// One per splat of the current model; `None`: pruned. A split replaces it by the first half.
    planned_splats: Vec<Option<PlannedSplat>>,
    /// Second halves of the splats that were split.
    second_halves: Vec<PlannedSplat>,
    size: ModelSize,
    added: usize,
    /// Draws the splats that are withheld; `None`: none are.
    withhold: Option<Pcg64Mcg>,
}

impl<'a> BudgetAllocator<'a> {
    /// Begins with the splats that were not pruned.
    pub fn new(
        s: &'a Situation<'a>,
        config: &'a DensityConfig,
        budget: &'a Budget,
        planned_splats: Vec<Option<PlannedSplat>>,
    ) -> Self {
        let size = size_of(planned_splats.iter().flatten());
        let withhold = s.measures_growth(config).then(|| Pcg64Mcg::seed_from_u64(s.seed));
        Self { s, config, budget, planned_splats, second_halves: Vec::new(), size, added: 0, withhold }
    }

    /// Takes offers as they are drawn, at most one for a splat, while the budget lasts. Returns the candidates that got none.
    pub fn take_drawn<'c>(
        &mut self,
        offers: &[Offer],
        candidates: &'c [Candidate],
        counts: &mut DensityCounts,
    ) -> Vec<&'c Candidate> {
        let mut is_served = vec![false; self.planned_splats.len()];
        let mut is_refused = is_served.clone();
        let mut splits_left = (SPLIT_RATE * self.size.splats as f64).ceil() as usize;
        for place in draw_order(offers.iter().map(|offer| offer.weight), self.s.seed ^ DRAW_STREAM) {
            let Offer { splat, grown, kind, .. } = offers[place];
            let Some(planned) = self.planned_splats[splat].filter(|_| !is_served[splat]) else { continue };
            if grown.is_none() && splits_left == 0 {
                continue;
            }
            let split = || split_of_any_length(self.s, self.config, &planned, self.config.split_profile);
            let parts = grown.map_or_else(|| split().to_vec(), |grown| vec![grown]);
            if !self.allows(splat, &parts) {
                is_refused[splat] = true;
                continue;
            }
            is_served[splat] = true;
            if self.withholds(splat, kind) {
                continue;
            }
            let (trial, count) = match (kind, grown) {
                (Kind::Refined, Some(grown)) => (Trial::of(&grown.change), &mut counts.refined),
                (Kind::Band, _) => (Trial::Raised, &mut counts.shaded_more),
                _ => (Trial::Split, &mut counts.split),
            };
            *count += 1;
            splits_left -= usize::from(grown.is_none());
            self.replace(splat, parts.into_iter().map(|part| tried(part, trial)));
        }
        let rest: Vec<_> = candidates.iter().filter(|candidate| !is_served[candidate.splat]).collect();
        counts.over_budget += rest.iter().filter(|candidate| is_refused[candidate.splat]).count();
        rest
    }

    /// Serves the candidates in order. Returns those that were neither split nor refined.
    pub fn allocate<'c>(
        &mut self,
        candidates: &'c [Candidate],
        counts: &mut DensityCounts,
    ) -> Vec<&'c Candidate> {
        candidates.iter().filter(|candidate| !self.serve(candidate, counts)).collect()
    }

    /// Splits the splat or refines its map, if the budget allows it; returns whether it did.
    fn serve(&mut self, candidate: &Candidate, counts: &mut DensityCounts) -> bool {
        if let Some(pair) = candidate.split.filter(|_| self.added < self.s.max_added) {
            if self.allows(candidate.splat, &pair) {
                if self.withholds(candidate.splat, Kind::Split) {
                    return true;
                }
                self.replace(candidate.splat, pair.map(|half| tried(half, Trial::Split)));
                self.added += 1;
                counts.split += 1;
                return true;
            }
            counts.over_budget += 1;
        }
        let (Some(old), Some(new)) = (self.planned_splats[candidate.splat], candidate.refined) else {
            return false;
        };
        if !self.allows(candidate.splat, &[new]) {
            counts.over_budget += 1;
            return false;
        }
        let refined = new.texels > old.texels;
        if refined && self.withholds(candidate.splat, Kind::Refined) {
            return true;
        }
        let trial = Trial::of(&new.change);
        self.replace(candidate.splat, [if refined { tried(new, trial) } else { new }]);
        counts.refined += usize::from(refined);
        refined
    }

    /// Replaces pruned splats: splits shorter ones than usual until there are as many as at initialisation. Random
    /// initialisation loses most of its splats, which have no surface near them.
    pub fn respawn(&mut self, rest: &[&Candidate], pixels: &[f64], counts: &mut DensityCounts) {
        for candidate in rest {
            if self.size.splats >= self.s.initial_splats || self.added >= self.s.max_added {
                return;
            }
            let Some(planned) = self.planned_splats[candidate.splat] else { continue };
            let pixel = pixels[candidate.splat];
            let halves = split::split(self.s, self.config, &planned, pixel, RESPAWN_TEXELS);
            if let Some(pair) = halves.filter(|pair| self.allows(candidate.splat, pair)) {
                self.replace(candidate.splat, pair);
                self.added += 1;
                counts.respawned += 1;
            }
        }
    }

    /// Whether the budget allows these, what a splat grows into or its two halves, in its place. None may replace a pruned one.
    fn allows(&self, splat: usize, parts: &[PlannedSplat]) -> bool {
        let size = |old: &PlannedSplat| parts.iter().fold(without(self.size, old), with);
        self.planned_splats[splat].as_ref().is_some_and(|old| self.budget.allows(&size(old)))
    }

    /// Replaces a splat by what [`Self::allows`] has allowed.
    fn replace(&mut self, splat: usize, parts: impl IntoIterator<Item = PlannedSplat>) {
        let Some(old) = self.planned_splats[splat].take() else { return };
        self.size = without(self.size, &old);
        for part in parts {
            self.size = with(self.size, &part);
            match &mut self.planned_splats[splat] {
                Some(_) => self.second_halves.push(part),
                first => *first = Some(part),
            }
        }
    }

    /// Whether a splat that could grow is withheld from it.
    fn withholds(&mut self, splat: usize, kind: Kind) -> bool {
        let is_drawn = self.withhold.as_mut().is_some_and(|rng| rng.random_range(0..WITHHELD_OF) == 0);
        if let Some(planned) = self.planned_splats[splat].as_mut().filter(|_| is_drawn) {
            planned.history.trial = Trial::Withheld(kind);
        }
        is_drawn
    }

    /// All planned splats.
    pub fn into_planned_splats(self) -> Vec<PlannedSplat> {
        self.planned_splats.into_iter().flatten().chain(self.second_halves).collect()
    }
}

/// The planned splat, marked by what was done with it.
fn tried(mut planned: PlannedSplat, trial: Trial) -> PlannedSplat {
    planned.history.trial = trial;
    planned
}
