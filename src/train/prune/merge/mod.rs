//! Merging of neighbours that lie in one plane: the inverse of a split (method 6.16).

mod merged;
mod part;
mod surface;
#[cfg(test)]
mod tests;
pub mod trial;

use super::costs::SplatCosts;
use super::round::Limits;
use crate::Result;
use crate::constants::ADAM_BETA2;
use crate::knn::nearest;
use crate::model::{AdamState, Model, SplatArrays, SplatGroup, TextureMap, TexturePool};
use glam::DVec3;
use merged::merged;
use part::Part;
use rayon::prelude::*;
use std::collections::BTreeMap;

/// Neighbours of a splat with which it may merge.
const NEIGHBOURS: usize = 8;

/// Passes at a threshold: each merges pairs, also of splats that are merged already.
const PASSES: usize = 6;

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

/// All splats of a model, and the pairs of neighbours that could merge: found once, whatever the threshold.
pub struct Parts {
    all: Vec<Part>,
    neighbours: Vec<Vec<u32>>,
    /// Normals of the planes in which splats and their neighbours lie; `None`: in none.
    normals: Vec<Option<DVec3>>,
    joins: Vec<Join>,
    limits: Limits,
}

/// Two parts that could merge, by their slots.
#[derive(Clone, Copy)]
struct Join {
    slots: [u32; 2],
    /// Parameters saved.
    saved: f64,
    /// Mean squared change of the images, besides what earlier merges of both cost.
    cost: f64,
}

impl Parts {
    /// The splats of a model, with what changes of them cost, if that is known, and the width of a pixel at each.
    pub fn of(model: &Model, costs: &[Option<SplatCosts>], pixels: &[f64], limits: Limits) -> Self {
        let part = |splat: usize| Part::of(model, splat, costs[splat], pixels[splat]);
        let all: Vec<Part> = (0..model.num_splats()).into_par_iter().with_min_len(256).map(part).collect();
        let positions: Vec<[f32; 3]> = all.iter().map(|part| part.position.as_vec3().to_array()).collect();
        let neighbours: Vec<Vec<u32>> = nearest::<NEIGHBOURS>(&positions)
            .iter()
            .map(|found| found.iter().filter(|n| n.0.is_finite()).map(|&(_, j)| j).collect())
            .collect();
        let normal = |i: usize| {
            all[i].costs?;
            surface::normal(&all[i], &neighbours[i].iter().map(|&j| &all[j as usize]).collect::<Vec<_>>())
        };
        let normals = (0..all.len()).into_par_iter().map(normal).collect();
        let mut parts = Self { all, neighbours, normals, joins: Vec::new(), limits };
        let merging = Merged::none(&parts);
        let pairs: Vec<[u32; 2]> = (0..parts.all.len() as u32).flat_map(|i| merging.pairs(i)).collect();
        let joins = merging.joins(&pairs);
        parts.joins = joins;
        parts
    }

    /// Merges neighbours where a parameter saved costs less than this threshold, mean squared change of the images.
    pub fn merged_at(&self, threshold: f64) -> Merged<'_> {
        let mut merged = Merged::none(self);
        let mut joins = self.joins.clone();
        for _ in 0..PASSES {
            let changed = merged.pass(&joins, threshold);
            if changed.is_empty() {
                break;
            }
            let mut is_changed = vec![false; self.all.len()];
            changed.iter().for_each(|&slot| is_changed[slot as usize] = true);
            joins.retain(|join| {
                !join
                    .slots
                    .iter()
                    .any(|&slot| merged.slots[slot as usize] != slot || is_changed[slot as usize])
            });
            // Each pair once.
            let mut pairs: Vec<[u32; 2]> =
                changed.iter().flat_map(|&slot| merged.pairs_of_all(slot)).collect();
            pairs.sort_unstable();
            pairs.dedup();
            joins.extend(merged.joins(&pairs));
        }
        merged
    }

    /// Number of splats.
    pub fn len(&self) -> usize {
        self.all.len()
    }

    /// Parameters of all splats.
    pub fn params(&self) -> usize {
        self.all.iter().map(Part::params).sum()
    }
}

/// The splats of a model, some of them merged.
pub struct Merged<'a> {
    parts: &'a Parts,
    /// For each splat the slot of the part that it belongs to: the first of its splats.
    slots: Vec<u32>,
    /// The merged parts, by slot.
    wholes: BTreeMap<u32, Part>,
}

impl<'a> Merged<'a> {
    fn none(parts: &'a Parts) -> Self {
        Self { parts, slots: (0..parts.all.len() as u32).collect(), wholes: BTreeMap::new() }
    }

    fn part(&self, slot: u32) -> &Part {
        self.wholes.get(&slot).unwrap_or(&self.parts.all[slot as usize])
    }

    fn normal(&self, slot: u32) -> Option<DVec3> {
        self.wholes.get(&slot).map_or(self.parts.normals[slot as usize], |whole| Some(whole.axes.z_axis))
    }

    /// The pairs of a splat and its neighbours, each once.
    fn pairs(&self, splat: u32) -> impl Iterator<Item = [u32; 2]> {
        let neighbours = &self.parts.neighbours;
        let is_first = move |j: u32| splat < j || !neighbours[j as usize].contains(&splat);
        neighbours[splat as usize].iter().filter(move |&&j| is_first(j)).map(move |&j| [splat, j])
    }

    /// The pairs of a merged part and the neighbours of its splats.
    fn pairs_of_all(&self, slot: u32) -> impl Iterator<Item = [u32; 2]> {
        let members = self.part(slot).members.iter();
        let neighbours = members.flat_map(|&member| &self.parts.neighbours[member as usize]);
        neighbours
            .map(|&splat| self.slots[splat as usize])
            .filter(move |&other| other != slot)
            .map(move |other| [slot.min(other), slot.max(other)])
    }

    fn join(&self, [i, j]: [u32; 2]) -> Option<Part> {
        let normals = [self.normal(i)?, self.normal(j)?];
        merged(&self.parts.all, [self.part(i), self.part(j)], normals, &self.parts.limits)
    }

    /// Those of these pairs that could merge.
    fn joins(&self, pairs: &[[u32; 2]]) -> Vec<Join> {
        let join = |&slots: &[u32; 2]| {
            let [a, b] = slots.map(|slot| self.part(slot));
            let whole = self.join(slots)?;
            let saved = (a.params() + b.params() - whole.params()) as f64;
            Some(Join { slots, saved, cost: whole.cost - a.cost - b.cost })
        };
        pairs.par_iter().filter_map(join).collect()
    }

    /// Merges the pairs that gain most; each part is in at most one of them. Returns the slots of what is merged.
    fn pass(&mut self, joins: &[Join], threshold: f64) -> Vec<u32> {
        let gain = |join: &Join| threshold * join.saved - join.cost;
        let mut order: Vec<(f64, [u32; 2])> =
            joins.iter().map(|join| (gain(join), join.slots)).filter(|(gain, _)| *gain > 0.0).collect();
        order.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
        let mut is_taken = vec![false; self.slots.len()];
        order.retain(|(_, slots)| {
            let is_free = slots.iter().all(|&slot| !is_taken[slot as usize]);
            slots.iter().for_each(|&slot| is_taken[slot as usize] |= is_free);
            is_free
        });
        // Joined anew, since there are many pairs and few are taken.
        let wholes: Vec<Option<Part>> = order.par_iter().map(|(_, slots)| self.join(*slots)).collect();
        let mut changed = Vec::new();
        for ((_, [i, j]), whole) in order.into_iter().zip(wholes) {
            let Some(whole) = whole else { continue };
            let slot = i.min(j);
            self.wholes.remove(&i.max(j));
            whole.members.iter().for_each(|&member| self.slots[member as usize] = slot);
            self.wholes.insert(slot, whole);
            changed.push(slot);
        }
        changed
    }

    /// The parts, in the order of their slots.
    fn all(&self) -> Vec<&Part> {
        (0..)
            .zip(&self.slots)
            .filter(|&(splat, &slot)| splat == slot)
            .map(|(slot, _)| self.part(slot))
            .collect()
    }

    /// Number of splats.
    pub fn len(&self) -> usize {
        self.all().len()
    }

    /// Parameters of all splats.
    pub fn params(&self) -> usize {
        self.all().into_iter().map(Part::params).sum()
    }

    /// What the merges were predicted to cost, mean squared change of the images.
    pub fn cost(&self) -> f64 {
        self.wholes.values().map(|part| part.cost).sum()
    }

    /// The model, whose unmerged splats are those of `model`, and its state.
    ///
    /// # Errors
    /// As [`TexturePool::neutral`].
    pub fn build(&self, model: &Model, adam: &AdamState) -> Result<Merging> {
        let parts = self.all();
        let sources: Vec<u32> = parts.iter().map(|part| part.members[0]).collect();
        let degrees: Vec<u8> = parts.iter().map(|part| part.sh_degree).collect();
        let gathered = |splats: &SplatArrays| splats.gathered(&sources, degrees.clone());
        let maps = parts.iter().map(|part| part.map);
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
        for (splat, part) in parts.iter().enumerate() {
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
        let is_merged = parts.iter().map(|part| part.members.len() > 1).collect();
        Ok(Merging { model: built, adam: state, sources, is_merged })
    }
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
