//! The budget allocator: splits candidates or refines their maps while the budget lasts, then respawns pruned
//! splats (method 6.6 and 6.10).

use super::candidate::Candidate;
use super::planned_splat::{PlannedSplat, size_of, with, without};
use super::settings::{Budget, DensityConfig};
use super::situation::{DensityCounts, Situation};
use super::split;
use crate::model::ModelSize;

/// Length in finest texels above which a splat may be split to replace a pruned one. Not measured.
const RESPAWN_TEXELS: f64 = 2.0;

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
        Self { s, config, budget, planned_splats, second_halves: Vec::new(), size, added: 0 }
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
            if self.split(candidate.splat, pair) {
                counts.split += 1;
                return true;
            }
            counts.over_budget += 1;
        }
        let (Some(old), Some(new)) = (self.planned_splats[candidate.splat], candidate.refined) else {
            return false;
        };
        let size = with(without(self.size, &old), &new);
        if !self.budget.allows(&size) {
            counts.over_budget += 1;
            return false;
        }
        self.size = size;
        self.planned_splats[candidate.splat] = Some(new);
        let refined = new.texels > old.texels;
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
            let done = halves.is_some_and(|pair| self.split(candidate.splat, pair));
            counts.respawned += usize::from(done);
        }
    }

    /// Replaces a splat by its halves if the budget allows it.
    fn split(&mut self, splat: usize, [first, second]: [PlannedSplat; 2]) -> bool {
        let Some(whole) = &self.planned_splats[splat] else { return false };
        let size = with(with(without(self.size, whole), &first), &second);
        if !self.budget.allows(&size) {
            return false;
        }
        (self.size, self.added) = (size, self.added + 1);
        self.planned_splats[splat] = Some(first);
        self.second_halves.push(second);
        true
    }

    /// All planned splats.
    pub fn into_planned_splats(self) -> Vec<PlannedSplat> {
        self.planned_splats.into_iter().flatten().chain(self.second_halves).collect()
    }
}
