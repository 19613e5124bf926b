//! Merging of neighbours that lie in one plane: the inverse of a split (method 6.16).

mod merged;
mod part;
mod surface;
#[cfg(test)]
mod tests;
mod trial;

use super::costs::SplatCosts;
use crate::Result;
use crate::constants::ADAM_BETA2;
use crate::knn::nearest;
use crate::model::{AdamState, Model, SplatArrays, SplatGroup, TextureMap, TexturePool};
use merged::merged;
use part::Part;
use rayon::prelude::*;
pub use trial::{TRIALS, Trial};

/// Neighbours of a splat with which it may merge.
const NEIGHBOURS: usize = 8;

/// Passes of one round: each merges pairs, also of splats that are merged already.
const PASSES: usize = 3;

/// Bounds of merged splats.
#[derive(Clone, Copy, Debug)]
pub struct Limits {
    /// Largest standard deviation, pixels of the nearest view: large splats suffer from the order by centres.
    pub widest_px: f64,
    /// Finest texel, pixels of the nearest view.
    pub finest_px: f64,
    /// Alpha at which maps end.
    pub alpha_texture: f64,
}

/// A model with merged splats.
pub struct Merging {
    /// The model.
    pub model: Model,
    /// Its optimiser state: that of merged splats has no first moments.
    pub adam: AdamState,
    /// For each splat the one that it was; of merged ones, the first.
    pub sources: Vec<u32>,
    /// Whether each was merged.
    pub is_merged: Vec<bool>,
}

/// All splats of a model, to be merged.
pub struct Parts(Vec<Part>);

impl Parts {
    /// The splats of a model, with what changes of them cost, if that is known, and the width of a pixel at each.
    pub fn of(model: &Model, costs: &[Option<SplatCosts>], pixels: &[f64]) -> Self {
        let part = |splat: usize| Part::of(model, splat, costs[splat], pixels[splat]);
        Self((0..model.num_splats()).into_par_iter().with_min_len(256).map(part).collect())
    }

    /// Merges neighbours where a parameter saved costs less than `price`, mean squared change of the images.
    pub fn merged_at(&self, price: f64, limits: &Limits) -> Self {
        let mut parts = self.0.clone();
        for _ in 0..PASSES {
            let before = parts.len();
            parts = pass(&self.0, parts, price, limits);
            if parts.len() == before {
                break;
            }
        }
        Self(parts)
    }

    /// Number of splats.
    pub fn len(&self) -> usize {
        self.0.len()
    }

    /// Parameters of all splats.
    pub fn params(&self) -> usize {
        self.0.iter().map(Part::params).sum()
    }

    /// What the merges were predicted to cost, mean squared change of the images.
    pub fn cost(&self) -> f64 {
        self.0.iter().map(|part| part.cost).sum()
    }

    /// The model, whose unmerged splats are those of `model`, and its state.
    ///
    /// # Errors
    /// As [`TexturePool::neutral`].
    pub fn build(&self, model: &Model, adam: &AdamState) -> Result<Merging> {
        let sources: Vec<u32> = self.0.iter().map(|part| part.members[0]).collect();
        let degrees: Vec<u8> = self.0.iter().map(|part| part.sh_degree).collect();
        let gathered = |splats: &SplatArrays| splats.gathered(&sources, degrees.clone());
        let maps = self.0.iter().map(|part| part.map);
        let mut built =
            Model { splats: gathered(&model.splats), textures: TexturePool::neutral(maps)?, ..*model };
        let num_floats = built.textures.texels.len();
        let mut state = AdamState {
            splats_m: gathered(&adam.splats_m),
            splats_v: gathered(&adam.splats_v),
            texels_m: vec![0.0; num_floats],
            texels_v: vec![0.0; num_floats],
            last_step: sources.iter().map(|&source| adam.last_step[source as usize]).collect(),
            ..*adam
        };
        for (splat, part) in self.0.iter().enumerate() {
            let map = built.textures.maps[splat];
            if let [only] = part.members[..] {
                let old = &model.textures.maps[only as usize];
                for (to, from) in [
                    (&mut built.textures.texels, &model.textures.texels),
                    (&mut state.texels_m, &adam.texels_m),
                    (&mut state.texels_v, &adam.texels_v),
                ] {
                    to[map.floats()].copy_from_slice(&from[old.floats()]);
                }
                continue;
            }
            write(part, splat, &mut built.splats);
            let texels = &mut built.textures.texels[map.floats()];
            texels.iter_mut().zip(&part.residuals).for_each(|(t, value)| *t = (2.0 * value.atanh()) as f32);
            state.last_step[splat] = adam.step;
            merge_moments(part, splat, adam, &mut state);
            let maps = part.members.iter().map(|&member| &model.textures.maps[member as usize]);
            let mean = mean_moments(maps.zip(part.members.iter().map(|&m| decay(adam, m))), &adam.texels_v);
            state.texels_v[map.floats()].chunks_exact_mut(3).for_each(|v| v.copy_from_slice(&mean));
        }
        let is_merged = self.0.iter().map(|part| part.members.len() > 1).collect();
        Ok(Merging { model: built, adam: state, sources, is_merged })
    }
}

/// Merges the pairs that gain most, made of splats among `all`; each part is in at most one of them.
fn pass(all: &[Part], parts: Vec<Part>, price: f64, limits: &Limits) -> Vec<Part> {
    let positions: Vec<[f32; 3]> = parts.iter().map(|part| part.position.as_vec3().to_array()).collect();
    let neighbours = nearest::<NEIGHBOURS>(&positions);
    let found = |i: usize| neighbours[i].iter().filter(|n| n.0.is_finite()).map(|&(_, j)| j as usize);
    let normal = |i: usize| {
        parts[i].costs?;
        surface::normal(&parts[i], &found(i).map(|j| &parts[j]).collect::<Vec<_>>())
    };
    let normals: Vec<_> = (0..parts.len()).into_par_iter().map(normal).collect();
    let join = |i: usize, j: usize| merged(all, [&parts[i], &parts[j]], [normals[i]?, normals[j]?], limits);
    let mut pairs: Vec<(f64, usize, usize)> = (0..parts.len())
        .into_par_iter()
        .flat_map_iter(|i| found(i).map(move |j| (i, j)))
        // Each pair once.
        .filter(|&(i, j)| i < j || !found(j).any(|k| k == i))
        .filter_map(|(i, j)| {
            let whole = join(i, j)?;
            let saved = (parts[i].params() + parts[j].params() - whole.params()) as f64;
            let gain = price * saved - (whole.cost - parts[i].cost - parts[j].cost);
            (gain > 0.0).then_some((gain, i, j))
        })
        .collect();
    pairs.sort_by(|a, b| b.0.total_cmp(&a.0).then((a.1, a.2).cmp(&(b.1, b.2))));
    let mut is_merged = vec![false; parts.len()];
    pairs.retain(|&(_, i, j)| {
        !is_merged[i] && !is_merged[j] && {
            (is_merged[i], is_merged[j]) = (true, true);
            true
        }
    });
    // Kept apart from their gains above, since there are many pairs and few are taken.
    let wholes: Vec<_> = pairs.par_iter().map(|&(_, i, j)| join(i, j)).collect();
    let mut kept: Vec<Option<Part>> = parts.into_iter().map(Some).collect();
    for ((_, i, j), whole) in pairs.into_iter().zip(wholes) {
        (kept[i.min(j)], kept[i.max(j)]) = (whole, None);
    }
    kept.into_iter().flatten().collect()
}

/// Writes a merged splat.
fn write(part: &Part, splat: usize, splats: &mut SplatArrays) {
    let rotation = glam::DQuat::from_mat3(&part.axes);
    let logit = (part.opacity / (1.0 - part.opacity)).ln();
    splats.positions[3 * splat..][..3].copy_from_slice(&part.position.as_vec3().to_array());
    let wxyz = [rotation.w, rotation.x, rotation.y, rotation.z].map(|q| q as f32);
    splats.quaternions[4 * splat..][..4].copy_from_slice(&wxyz);
    splats.log_scales[2 * splat..][..2].copy_from_slice(&part.sigmas.map(|sigma| sigma.ln() as f32));
    splats.opacity_logits[splat] = logit as f32;
    splats.sh_of_mut(splat).iter_mut().zip(&part.sh).for_each(|(to, &from)| *to = from as f32);
}

/// Gives a merged splat no first moments, and the mean second moments of its members.
fn merge_moments(part: &Part, splat: usize, adam: &AdamState, state: &mut AdamState) {
    for group in SplatGroup::ALL {
        let range = state.splats_v.range(group, splat);
        state.splats_m.group_mut(group)[range.clone()].fill(0.0);
        for (k, at) in range.enumerate() {
            // Of a coefficient that a member does not have: as of a new one.
            let of = |&member: &u32| {
                let decay = if group == SplatGroup::Sh { decay(adam, member) } else { 1.0 };
                let held = &adam.splats_v.group(group)[adam.splats_v.range(group, member as usize)];
                decay * held.get(k).copied().unwrap_or(held[k % 3])
            };
            let mean = part.members.iter().map(of).sum::<f32>() / part.members.len() as f32;
            state.splats_v.group_mut(group)[at] = mean;
        }
    }
}

/// Mean of the moments of all texels of some maps, each with its decay, by channel.
fn mean_moments<'a>(maps: impl Iterator<Item = (&'a TextureMap, f32)>, moments: &[f32]) -> [f32; 3] {
    let (mut sum, mut count) = ([0.0; 3], 0.0_f32);
    for (map, decay) in maps {
        for texel in moments[map.floats()].chunks_exact(3) {
            sum.iter_mut().zip(texel).for_each(|(sum, value)| *sum += decay * value);
            count += 1.0;
        }
    }
    sum.map(|sum| sum / count.max(1.0))
}

/// What the lazily updated second moments of a splat have yet to be multiplied by.
fn decay(adam: &AdamState, splat: u32) -> f32 {
    match adam.last_step[splat as usize] {
        0 => 1.0,
        last => ADAM_BETA2.powi((adam.step - last) as i32) as f32,
    }
}
