//! What each splat could do without, and what that would cost.

use crate::backend::{Grid, MapChange};
use crate::constants::{SH_0, sh_coefficients};
use crate::model::{AdamState, Model, ModelSize, SplatGroup, texel_value, texel_value_slope};
use crate::train::density::{Coarsening, map_window};
use rayon::prelude::*;

/// Axes along which a map may be coarsened.
const AXES: [[bool; 2]; 3] = [[true, true], [true, false], [false, true]];

/// Probes that must have seen a splat before it is judged, unless all views are probed.
const SEEN_MIN: u32 = 4;

/// Degrees that a splat of degree 3 could fall to.
const LOWER_DEGREES: usize = 3;

/// Costs of a splat's offers, summed over probes: mean squared changes of the image.
#[derive(Clone, Copy, Debug, Default)]
struct Costs {
    /// Probes that saw the splat.
    seen: u32,
    /// Of its removal.
    removal: f64,
    /// Of a change of its colour by 1 in all channels.
    colour: f64,
    /// Of the loss of all SH bands above degree 0, 1 and 2.
    degrees: [f64; LOWER_DEGREES],
    /// Of the loss of its map.
    map: f64,
    /// Of a coarser map, by [`AXES`].
    coarser: [f64; AXES.len()],
}

impl Costs {
    fn add(&mut self, other: &Self) {
        self.seen += other.seen;
        self.removal += other.removal;
        self.colour += other.colour;
        self.map += other.map;
        self.degrees.iter_mut().zip(other.degrees).for_each(|(sum, cost)| *sum += cost);
        self.coarser.iter_mut().zip(other.coarser).for_each(|(sum, cost)| *sum += cost);
    }
}

/// What changes of a splat cost, mean squared changes of the images.
#[derive(Clone, Copy, Debug, Default)]
pub struct SplatCosts {
    /// Of its removal.
    pub removal: f64,
    /// Of a change of its colour by 1 in all channels.
    pub colour: f64,
}

/// What parameters are worth, in mean squared error, by the kind of offer: 0 for kinds that are not taken.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Prices {
    /// Of splats removed.
    pub removal: f64,
    /// Of SH bands.
    pub degrees: f64,
    /// Of texels.
    pub maps: f64,
}

impl Prices {
    /// The same for all kinds.
    pub fn all(price: f64) -> Self {
        Self { removal: price, degrees: price, maps: price }
    }

    /// Those of one kind alone: of removal, of SH bands or of texels.
    pub fn only(self, kind: usize) -> Self {
        let of = |this: usize, price: f64| if this == kind { price } else { 0.0 };
        Self { removal: of(0, self.removal), degrees: of(1, self.degrees), maps: of(2, self.maps) }
    }

    /// These, with the price of one kind replaced.
    pub fn with(self, kind: usize, price: f64) -> Self {
        match kind {
            0 => Self { removal: price, ..self },
            1 => Self { degrees: price, ..self },
            _ => Self { maps: price, ..self },
        }
    }
}

/// What a splat keeps.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Kept {
    /// Its SH degree.
    pub degree: u8,
    /// Its map.
    pub map: MapChange,
    /// Texels of that map.
    pub texels: usize,
}

/// The best offer of a splat at some price.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Accepted {
    /// What is left of the splat; `None`: nothing.
    pub kept: Option<Kept>,
    /// Parameters that it gives back.
    pub params: usize,
    /// Mean squared change of the images.
    pub cost: f64,
}

/// All offers of a model, with what probes have told of their costs.
pub struct Offers<'a> {
    model: &'a Model,
    costs: Vec<Costs>,
    probes: u32,
    seen_min: u32,
    keeps_maps: bool,
}

impl<'a> Offers<'a> {
    /// Offers of unknown cost. With a sample of the views, nothing is known of splats that hardly any of them sees. A policy
    /// that fixes the sizes of maps keeps them.
    pub fn new(model: &'a Model, is_sample: bool, keeps_maps: bool) -> Self {
        let seen_min = if is_sample { SEEN_MIN } else { 0 };
        Self { model, costs: vec![Costs::default(); model.num_splats()], probes: 0, seen_min, keeps_maps }
    }

    /// Adds the derivatives of a probe.
    pub fn observe(&mut self, derivatives: &AdamState) {
        let model = self.model;
        let each = self.costs.par_iter_mut().with_min_len(256).enumerate();
        each.for_each(|(splat, costs)| costs.add(&costs_of(model, derivatives, splat)));
        self.probes += 1;
    }

    /// The model.
    pub fn model(&self) -> &'a Model {
        self.model
    }

    /// What changes of a splat cost.
    pub fn costs(&self, splat: usize) -> SplatCosts {
        let (costs, probes) = (&self.costs[splat], f64::from(self.probes.max(1)));
        SplatCosts { removal: costs.removal / probes, colour: costs.colour / probes }
    }

    /// The offer of a splat that saves most at these prices; `None` if all cost more than they save. Only splats that
    /// `may_go` are removed.
    pub fn best(&self, splat: usize, prices: &Prices, may_go: bool) -> Option<Accepted> {
        let costs = &self.costs[splat];
        if costs.seen < self.seen_min {
            return None;
        }
        let probes = f64::from(self.probes.max(1));
        let held = self.model.splats.sh_degrees[splat];
        let map = &self.model.textures.maps[splat];
        let mut best = Accepted {
            kept: Some(Kept { degree: held, map: MapChange::Keep, texels: map.num_texels() }),
            params: 0,
            cost: 0.0,
        };
        let mut saved = 0.0;

        let by_degree = (0..held).map(|degree| {
            let [kept, all] = [degree, held].map(|degree| 3 * sh_coefficients(degree.into()));
            let cost = costs.degrees[usize::from(degree)] / probes;
            (degree, all - kept, cost, prices.degrees * (all - kept) as f64 - cost)
        });
        let kept = best.kept.as_mut()?;
        if let Some((degree, params, cost, gain)) = by_degree.max_by(|a, b| a.3.total_cmp(&b.3))
            && gain > 0.0
        {
            kept.degree = degree;
            best.params += params;
            best.cost += cost;
            saved += gain;
        }
        let gain = |offer: &Accepted, price: f64| price * offer.params as f64 - offer.cost;
        let by_map = (map.rows > 0 && !self.keeps_maps).then(|| self.map_offers(splat)).into_iter().flatten();
        let best_map = by_map.max_by(|a, b| gain(a, prices.maps).total_cmp(&gain(b, prices.maps)));
        if let Some(offer) = best_map
            && gain(&offer, prices.maps) > 0.0
        {
            let smaller = offer.kept?;
            (kept.map, kept.texels) = (smaller.map, smaller.texels);
            best.params += offer.params;
            best.cost += offer.cost;
            saved += gain(&offer, prices.maps);
        }
        let removal =
            Accepted { kept: None, params: params_of(held, map.num_texels()), cost: costs.removal / probes };
        if may_go && gain(&removal, prices.removal) > saved {
            return Some(removal);
        }
        (saved > 0.0).then_some(best)
    }

    /// What the map of a splat could become.
    fn map_offers(&self, splat: usize) -> Vec<Accepted> {
        let (costs, probes) = (&self.costs[splat], f64::from(self.probes.max(1)));
        let map = &self.model.textures.maps[splat];
        let degree = self.model.splats.sh_degrees[splat];
        let offer = |map: MapChange, texels: usize, params: usize, cost: f64| Accepted {
            kept: Some(Kept { degree, map, texels }),
            params,
            cost: cost / probes,
        };
        let none = map_window(map, [Grid::Same; 2], [0; 2], [0; 2], [0; 2], [1.0; 2]);
        let mut offers =
            vec![offer(none, 0, params_of(degree, map.num_texels()) - params_of(degree, 0), costs.map)];
        for (axes, cost) in AXES.into_iter().zip(costs.coarser) {
            let Some(coarser) = Coarsening::new(map, axes) else { continue };
            let texels = coarser.num_texels();
            if texels < map.num_texels() {
                let params = params_of(degree, map.num_texels()) - params_of(degree, texels);
                offers.push(offer(coarser.change(map), texels, params, cost));
            }
        }
        offers
    }
}

/// Parameters of a splat.
pub fn params_of(degree: u8, texels: usize) -> usize {
    let maps = usize::from(texels > 0);
    ModelSize { splats: 1, sh_coefficients: sh_coefficients(degree.into()), maps, texels }.params()
}

/// Squares of the derivatives of one probe in the directions of a splat's offers.
fn costs_of(model: &Model, derivatives: &AdamState, splat: usize) -> Costs {
    let transparency = 1.0 / (1.0 + f64::from(model.splats.opacity_logits[splat]).exp());
    let by_logit = f64::from(derivatives.splats_m.opacity_logits[splat]);
    let seen = u32::from(by_logit != 0.0);
    let mut costs = Costs { seen, removal: (by_logit / transparency).powi(2), ..Costs::default() };

    let width = SplatGroup::Sh.width(model.splats.sh_degree);
    let held = 3 * sh_coefficients(model.splats.sh_degrees[splat].into());
    let [sh, by_sh] = [&model.splats.sh, &derivatives.splats_m.sh].map(|sh| &sh[splat * width..][..held]);
    costs.colour = by_sh[..3].iter().map(|&d| (f64::from(d) / SH_0).powi(2)).sum();
    for (degree, cost) in costs.degrees.iter_mut().enumerate() {
        let first = (3 * sh_coefficients(degree as u32)).min(held);
        *cost = dot(sh[first..].iter().zip(&by_sh[first..]).map(|(&c, &d)| (c.into(), d.into()))).powi(2);
    }

    let map = &model.textures.maps[splat];
    if map.rows == 0 {
        return costs;
    }
    let values: Vec<f64> =
        model.textures.texels[map.floats()].iter().map(|&stored| texel_value(stored.into())).collect();
    let by_value: Vec<f64> = derivatives.texels_m[map.floats()]
        .iter()
        .zip(&values)
        .map(|(&d, &value)| f64::from(d) / texel_value_slope(value))
        .collect();
    costs.map = dot(values.iter().copied().zip(by_value.iter().copied())).powi(2);
    for (axes, cost) in AXES.into_iter().zip(&mut costs.coarser) {
        if let Some(coarser) = Coarsening::new(map, axes) {
            let change = (0..3).map(|channel| {
                let of = |all: &[f64]| all.iter().skip(channel).step_by(3).copied().collect::<Vec<_>>();
                let (fine, by_value) = (of(&values), of(&by_value));
                let sampled = coarser.sampled(&fine);
                dot(sampled.into_iter().zip(fine).map(|(s, f)| s - f).zip(by_value))
            });
            *cost = change.sum::<f64>().powi(2);
        }
    }
    costs
}

fn dot(pairs: impl Iterator<Item = (f64, f64)>) -> f64 {
    pairs.map(|(a, b)| a * b).sum()
}
