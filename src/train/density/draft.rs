//! Planned splats, and the plan made of them.

use super::geometry::morton_codes;
use super::life::Life;
use super::sizes::Sizes;
use crate::backend::{DensityPlan, MapChange, SplatEdit};
use crate::model::{Model, ModelSize};

/// New parameters of a half.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Change {
    pub position: [f32; 3],
    pub log_scales: [f32; 2],
    pub opacity_logit: f32,
}

/// A planned splat: one of the model after the revision.
#[derive(Clone, Copy, Debug)]
pub struct Draft {
    /// Index of the splat that it is or comes from.
    pub source: u32,
    /// What happens to the source's map.
    pub change: MapChange,
    /// New parameters, if it is a half.
    pub edit: Option<Change>,
    /// History of the splat.
    pub life: Life,
    /// Bounds of its map.
    pub sizes: Sizes,
    /// Number of texels of its map.
    pub texels: usize,
}

impl Draft {
    /// Parameters of the splat with its map.
    pub fn params(&self, sh_degree: u32) -> usize {
        ModelSize::uniform(1, self.texels, sh_degree).params()
    }
}

/// Size of the planned model.
pub fn size_of<'a>(drafts: impl Iterator<Item = &'a Draft>, sh_degree: u32) -> ModelSize {
    let empty = ModelSize { sh_degree, ..ModelSize::default() };
    drafts.fold(empty, |size, draft| with(size, draft))
}

/// The size with one more splat.
pub fn with(size: ModelSize, draft: &Draft) -> ModelSize {
    ModelSize {
        splats: size.splats + 1,
        maps: size.maps + usize::from(draft.texels > 0),
        texels: size.texels + draft.texels,
        ..size
    }
}

/// The size without one of the splats.
pub fn without(size: ModelSize, draft: &Draft) -> ModelSize {
    ModelSize {
        splats: size.splats - 1,
        maps: size.maps - usize::from(draft.texels > 0),
        texels: size.texels - draft.texels,
        ..size
    }
}

/// The plan, and the histories in its order; no plan if nothing changes. New splats are stored along a Morton
/// curve (method 6.11).
pub fn finish(model: &Model, mut drafts: Vec<Draft>) -> (Option<DensityPlan>, Vec<Life>) {
    let n = model.num_splats();
    let same_splats = drafts.len() == n && drafts.iter().all(|d| d.edit.is_none());
    let same_maps = drafts.iter().all(|d| d.change == MapChange::Keep);
    if same_splats && same_maps {
        return (None, drafts.iter().map(|d| d.life).collect());
    }
    if !same_splats {
        let positions: Vec<f32> = drafts.iter().flat_map(|d| position(model, d)).collect();
        let codes = morton_codes(&positions);
        let mut order: Vec<(u64, usize)> = codes.into_iter().zip(0..).collect();
        order.sort_unstable();
        drafts = order.into_iter().map(|(_, i)| drafts[i]).collect();
    }
    let edit = |(i, draft): (usize, &Draft)| {
        draft.edit.map(|e| SplatEdit {
            splat: i as u32,
            position: e.position,
            log_scales: e.log_scales,
            opacity_logit: e.opacity_logit,
        })
    };
    let plan = DensityPlan {
        sources: drafts.iter().map(|d| d.source).collect(),
        maps: drafts.iter().map(|d| d.change).collect(),
        edits: drafts.iter().enumerate().filter_map(edit).collect(),
    };
    (Some(plan), drafts.iter().map(|d| d.life).collect())
}

fn position(model: &Model, draft: &Draft) -> [f32; 3] {
    let at = 3 * draft.source as usize;
    let p = &model.splats.positions;
    draft.edit.map_or([p[at], p[at + 1], p[at + 2]], |e| e.position)
}
