//! Planned splats, the bookkeeping of a revision's budget and limits, and the plan made of them.

use super::geometry::morton_codes;
use super::history::SplatHistory;
use super::settings::Bound;
use super::situation::{DensityCounts, Revision};
use super::sizes::Sizes;
use crate::backend::{DensityPlan, MapChange, SplatEdit};
use crate::constants::sh_coefficients;
use crate::model::{Model, ModelSize};
use crate::train::charge::Charge;

/// New parameters of a half.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Change {
    pub position: [f32; 3],
    pub log_scales: [f32; 2],
    pub opacity_logit: f32,
}

/// A planned splat: one of the model after the revision.
#[derive(Clone, Copy, Debug)]
pub struct PlannedSplat {
    /// Index of the splat that it is or comes from.
    pub source: u32,
    /// What happens to the source's map.
    pub change: MapChange,
    /// New parameters, if it is a half.
    pub edit: Option<Change>,
    /// History of the splat.
    pub history: SplatHistory,
    /// Bounds of its map.
    pub sizes: Sizes,
    /// Number of texels of its map.
    pub texels: usize,
    /// SH degree.
    pub sh_degree: u8,
}

/// Charge of what these add to the splat that they replace, at least that of one number: halves may need fewer texels than the whole.
pub fn cost(charge: &Charge, whole: &PlannedSplat, parts: &[PlannedSplat]) -> f64 {
    let of = |planned: &PlannedSplat| charge.of(planned.sh_degree, planned.texels);
    (parts.iter().map(of).sum::<f64>() - of(whole)).max(charge.least())
}

/// Size of the planned model.
pub fn size_of<'a>(planned_splats: impl IntoIterator<Item = &'a PlannedSplat>) -> ModelSize {
    planned_splats.into_iter().fold(ModelSize::default(), with)
}

/// The size with one more splat.
pub fn with(size: ModelSize, planned: &PlannedSplat) -> ModelSize {
    ModelSize {
        splats: size.splats + 1,
        sh_coefficients: size.sh_coefficients + sh_coefficients(planned.sh_degree.into()),
        maps: size.maps + usize::from(planned.texels > 0),
        texels: size.texels + planned.texels,
    }
}

/// The size without one of the splats.
pub fn without(size: ModelSize, planned: &PlannedSplat) -> ModelSize {
    ModelSize {
        splats: size.splats - 1,
        sh_coefficients: size.sh_coefficients - sh_coefficients(planned.sh_degree.into()),
        maps: size.maps - usize::from(planned.texels > 0),
        texels: size.texels - planned.texels,
    }
}

/// What a revision has planned so far, within its bound.
pub struct Plan {
    /// One per splat of the current model; `None`: pruned. A split replaces it by the first half.
    splats: Vec<Option<PlannedSplat>>,
    /// Second halves of the splats that were split.
    second_halves: Vec<PlannedSplat>,
    size: ModelSize,
    bound: Bound,
}

impl Plan {
    /// Begins with the splats that were not pruned.
    pub fn new(splats: Vec<Option<PlannedSplat>>, bound: Bound) -> Self {
        let size = size_of(splats.iter().flatten());
        Self { splats, second_halves: Vec::new(), size, bound }
    }

    /// The planned splat in the place of one of the model; `None`: it was pruned.
    pub fn splat(&self, splat: usize) -> Option<&PlannedSplat> {
        self.splats[splat].as_ref()
    }

    /// Number of planned splats.
    pub fn num_splats(&self) -> usize {
        self.size.splats
    }

    /// Puts what a splat grows into, or its two halves, in its place, if the bound allows it; returns whether it did.
    pub fn replace(&mut self, splat: usize, parts: &[PlannedSplat]) -> bool {
        let Some(old) = &self.splats[splat] else { return false };
        let size = parts.iter().fold(without(self.size, old), with);
        let [first, second @ ..] = parts else { return false };
        if !self.bound.allows(&size) {
            return false;
        }
        self.size = size;
        self.splats[splat] = Some(*first);
        self.second_halves.extend(second);
        true
    }

    /// The revision.
    pub fn finish(self, model: &Model, counts: DensityCounts) -> Revision {
        let (plan, histories) =
            finish(model, self.splats.into_iter().flatten().chain(self.second_halves).collect());
        Revision { plan, histories, counts }
    }
}

/// The plan, and the histories in its order; no plan if nothing changes. New splats are stored along a Morton
/// curve (method 6.11).
fn finish(model: &Model, mut planned_splats: Vec<PlannedSplat>) -> (Option<DensityPlan>, Vec<SplatHistory>) {
    let n = model.num_splats();
    let same_splats = planned_splats.len() == n && planned_splats.iter().all(|d| d.edit.is_none());
    let same_maps = planned_splats.iter().all(|d| d.change == MapChange::Keep);
    let same_degrees =
        planned_splats.iter().all(|d| d.sh_degree == model.splats.sh_degrees()[d.source as usize]);
    if same_splats && same_maps && same_degrees {
        return (None, planned_splats.iter().map(|d| d.history).collect());
    }
    if !same_splats {
        let positions: Vec<f32> = planned_splats.iter().flat_map(|d| position(model, d)).collect();
        let codes = morton_codes(&positions);
        let mut order: Vec<(u64, usize)> = codes.into_iter().zip(0..).collect();
        order.sort_unstable();
        planned_splats = order.into_iter().map(|(_, i)| planned_splats[i]).collect();
    }
    let edit = |(i, planned): (usize, &PlannedSplat)| {
        planned.edit.map(|e| SplatEdit {
            splat: i as u32,
            position: e.position,
            log_scales: e.log_scales,
            opacity_logit: e.opacity_logit,
        })
    };
    let plan = DensityPlan {
        sources: planned_splats.iter().map(|d| d.source).collect(),
        maps: planned_splats.iter().map(|d| d.change).collect(),
        sh_degrees: planned_splats.iter().map(|d| d.sh_degree).collect(),
        edits: planned_splats.iter().enumerate().filter_map(edit).collect(),
    };
    (Some(plan), planned_splats.iter().map(|d| d.history).collect())
}

fn position(model: &Model, planned: &PlannedSplat) -> [f32; 3] {
    let at = 3 * planned.source as usize;
    let p = &model.splats.positions;
    planned.edit.map_or([p[at], p[at + 1], p[at + 2]], |e| e.position)
}
