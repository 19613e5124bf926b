//! What is added in a density-control step: the worst splats are split or get finer maps while the budget lasts,
//! then splats that were removed are made up for (method sections 6.2 and 7.3).

use super::candidate::Candidate;
use super::decide::{DensityCounts, Situation};
use super::draft::Draft;
use super::settings::{Budget, DensityConfig};
use super::split;

/// Splats of more than this many of the finest texels a side may be split to make up for removed ones.
const RESPAWN_TEXELS: f64 = 2.0;

/// The model as it grows in a step.
pub struct Spender<'a> {
    s: &'a Situation<'a>,
    config: &'a DensityConfig,
    budget: &'a Budget,
    /// By splat of the present model; `None`: removed.
    drafts: Vec<Option<Draft>>,
    /// Second halves of the splats that were split.
    children: Vec<Draft>,
    splats: usize,
    texels: usize,
    added: usize,
}

impl<'a> Spender<'a> {
    /// Begins with what is left of the present model.
    pub fn new(
        s: &'a Situation<'a>,
        config: &'a DensityConfig,
        budget: &'a Budget,
        drafts: Vec<Option<Draft>>,
    ) -> Self {
        let splats = drafts.iter().flatten().count();
        let texels = drafts.iter().flatten().map(|d| d.texels).sum();
        Self { s, config, budget, drafts, children: Vec::new(), splats, texels, added: 0 }
    }

    /// Goes through the candidates, best first. Returns those whose splat and map stayed as they were.
    pub fn spend<'c>(
        &mut self,
        candidates: &'c [Candidate],
        counts: &mut DensityCounts,
    ) -> Vec<&'c Candidate> {
        candidates.iter().filter(|candidate| !self.spend_on(candidate, counts)).collect()
    }

    /// Whether the splat was split or got a finer map.
    fn spend_on(&mut self, candidate: &Candidate, counts: &mut DensityCounts) -> bool {
        if let Some(pair) = candidate.split.filter(|_| self.added < self.s.max_added) {
            if self.split(candidate.splat, pair) {
                counts.split += 1;
                return true;
            }
            counts.over_budget += 1;
        }
        let (Some(old), Some(finer)) = (self.drafts[candidate.splat], candidate.finer) else { return false };
        let texels = self.texels - old.texels + finer.texels;
        if !self.budget.allows(self.splats, texels) {
            counts.over_budget += 1;
            return false;
        }
        self.texels = texels;
        self.drafts[candidate.splat] = Some(finer);
        let refined = finer.texels > old.texels;
        counts.refined += usize::from(refined);
        refined
    }

    /// Makes up for removed splats: shorter ones than usual are split until there are as many as there
    /// were at the start. Random starts lose most of their splats, for want of a surface near them.
    pub fn respawn(&mut self, rest: &[&Candidate], pixels: &[f64], counts: &mut DensityCounts) {
        for candidate in rest {
            if self.splats >= self.s.initial_splats || self.added >= self.s.max_added {
                return;
            }
            let Some(draft) = self.drafts[candidate.splat] else { continue };
            let pixel = pixels[candidate.splat];
            let halves = split::split(self.s, self.config, &draft, pixel, RESPAWN_TEXELS);
            let done = halves.is_some_and(|pair| self.split(candidate.splat, pair));
            counts.moved += usize::from(done);
        }
    }

    /// Replaces a splat by its halves if the budget allows it.
    fn split(&mut self, splat: usize, [first, second]: [Draft; 2]) -> bool {
        let without = self.texels - self.drafts[splat].map_or(0, |d| d.texels);
        let texels = without + first.texels + second.texels;
        if !self.budget.allows(self.splats + 1, texels) {
            return false;
        }
        (self.splats, self.texels, self.added) = (self.splats + 1, texels, self.added + 1);
        self.drafts[splat] = Some(first);
        self.children.push(second);
        true
    }

    /// The splats of the model to be.
    pub fn into_drafts(self) -> Vec<Draft> {
        self.drafts.into_iter().flatten().chain(self.children).collect()
    }
}
