//! What each splat could do without, and what that would cost.

use super::costs::SplatCosts;
use super::prices::Prices;
use crate::backend::{AXES, Costs, Grid, MapChange, depths};
use crate::constants::sh_coefficients;
use crate::model::{Coarsening, Model, ModelSize};
use crate::train::charge::Charge;
use crate::train::density::{coarsened, cropped_map, map_window};

/// Probes that must have seen a splat before it may lose anything, unless all views are probed.
const SEEN_MIN: u32 = 4;

/// Kinds of offers: removal, SH bands and texels.
pub const KINDS: usize = 3;

/// Mean squared error per unit of the price below which offers are taken, by their kind: 0 for kinds that are not taken.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Thresholds([f64; KINDS]);

impl Thresholds {
    /// The same for all kinds.
    pub fn all(threshold: f64) -> Self {
        Self([threshold; KINDS])
    }

    /// Those of one kind alone: of removal, of SH bands or of texels.
    pub fn only(self, kind: usize) -> Self {
        Self::default().with(kind, self.0[kind])
    }

    /// These, with the threshold of one kind replaced.
    pub fn with(mut self, kind: usize, threshold: f64) -> Self {
        self.0[kind] = threshold;
        self
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

/// The best offer of a splat at some threshold.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Accepted {
    /// What is left of the splat; `None`: nothing.
    pub kept: Option<Kept>,
    /// Parameters that it saves.
    pub params: usize,
    /// What it saves of the charge.
    pub charge: f64,
    /// What it saves of the price.
    pub price: f64,
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
    charge: Charge,
    prices: Prices,
}

impl<'a> Offers<'a> {
    /// Offers of a model as it was probed, with their costs summed over that many probes. With a sample of the views, nothing is
    /// known of splats that hardly any of them sees. A policy that fixes the sizes of maps keeps them.
    pub fn new(
        model: &'a Model,
        (costs, probes): (Vec<Costs>, u32),
        is_sample: bool,
        keeps_maps: bool,
    ) -> Self {
        let seen_min = if is_sample { SEEN_MIN } else { 0 };
        Self { model, costs, probes, seen_min, keeps_maps, charge: Charge::PARAMS, prices: Prices::NONE }
    }

    /// These, charged for something else than parameters.
    pub fn with_charge(self, charge: Charge) -> Self {
        Self { charge, ..self }
    }

    /// These, whose rasterised fragments, per pixel of a view, count together `price` times as much as the charge of the model.
    pub fn with_fragments(self, price: f64, fragments: Vec<f64>) -> Self {
        let prices = Prices::new(price, self.charge.of_model(self.model), fragments);
        Self { prices, ..self }
    }

    /// The model as it was probed.
    pub fn model(&self) -> &'a Model {
        self.model
    }

    /// What changes of a splat cost; `None` if too few probes saw it.
    pub fn costs(&self, splat: usize) -> Option<SplatCosts> {
        let (costs, probes) = (&self.costs[splat], f64::from(self.probes.max(1)));
        let known = SplatCosts { removal: costs.removal / probes, colour: costs.colour / probes };
        (costs.seen >= self.seen_min).then_some(known)
    }

    /// The offer of a splat that saves most at these thresholds; `None` if all cost more than they save. Only splats that
    /// `may_go` are removed.
    pub fn best(&self, splat: usize, thresholds: &Thresholds, may_go: bool) -> Option<Accepted> {
        let (costs, &Thresholds([by_removal, by_bands, by_texels])) = (&self.costs[splat], thresholds);
        if costs.seen < self.seen_min {
            return None;
        }
        let probes = f64::from(self.probes.max(1));
        let held = self.model.splats.sh_degrees()[splat];
        let map = &self.model.textures.maps[splat];
        let mut best = Accepted {
            kept: Some(Kept { degree: held, map: MapChange::Keep, texels: map.num_texels() }),
            params: 0,
            charge: 0.0,
            price: 0.0,
            cost: 0.0,
        };
        let mut saved = 0.0;

        let by_degree = (0..held).map(|degree| {
            let [kept, all] = [degree, held].map(|degree| sh_coefficients(degree.into()));
            let cost = costs.degrees[usize::from(degree)] / probes;
            let price = self.prices.of_charge(self.charge.of_coefficients(all - kept));
            (degree, all - kept, cost, by_bands * price - cost)
        });
        let kept = best.kept.as_mut()?;
        if let Some((degree, coefficients, cost, gain)) = by_degree.max_by(|a, b| a.3.total_cmp(&b.3))
            && gain > 0.0
        {
            kept.degree = degree;
            best.params += 3 * coefficients;
            best.charge += self.charge.of_coefficients(coefficients);
            best.price += self.prices.of_charge(self.charge.of_coefficients(coefficients));
            best.cost += cost;
            saved += gain;
        }
        let gain = |offer: &Accepted, threshold: f64| threshold * offer.price - offer.cost;
        let by_map = (map.rows > 0 && !self.keeps_maps)
            .then(|| self.map_offers(splat, by_texels))
            .into_iter()
            .flatten();
        let best_map = by_map.max_by(|a, b| gain(a, by_texels).total_cmp(&gain(b, by_texels)));
        if let Some(offer) = best_map
            && gain(&offer, by_texels) > 0.0
        {
            let smaller = offer.kept?;
            (kept.map, kept.texels) = (smaller.map, smaller.texels);
            best.params += offer.params;
            best.charge += offer.charge;
            best.price += offer.price;
            best.cost += offer.cost;
            saved += gain(&offer, by_texels);
        }
        let charge = self.charge.of(held, map.num_texels());
        let removal = Accepted {
            kept: None,
            params: params_of(held, map.num_texels()),
            charge,
            price: self.prices.of_removal(splat, charge),
            cost: costs.removal / probes,
        };
        if may_go && gain(&removal, by_removal) > saved {
            return Some(removal);
        }
        (saved > 0.0).then_some(best)
    }

    /// What the map of a splat could become; of crops, the best at this threshold.
    fn map_offers(&self, splat: usize, threshold: f64) -> Vec<Accepted> {
        let (costs, map) = (&self.costs[splat], &self.model.textures.maps[splat]);
        let none = map_window(map, [Grid::Same; 2], [0; 2], [0; 2], [0; 2], [1.0; 2]);
        let coarser = AXES.into_iter().zip(costs.coarser).filter_map(|(axes, cost)| {
            let coarser = Coarsening::new(map, axes)?;
            (coarser.num_texels() < map.num_texels())
                .then(|| self.map_offer(splat, coarsened(map, &coarser), cost))
        });
        let mut offers = vec![self.map_offer(splat, none, costs.map)];
        offers.extend(coarser);
        offers.extend(self.crop(splat, threshold));
        offers
    }

    /// The crop of a splat's map that is best at a threshold. Side after side is cropped, the one that saves most first, since
    /// there are few rounds. What they cost adds up: they have no texels in common but those at corners, which count twice.
    pub fn crop(&self, splat: usize, threshold: f64) -> Option<Accepted> {
        let (costs, probes) = (&self.costs[splat], f64::from(self.probes.max(1)));
        let map = &self.model.textures.maps[splat];
        let held = [map.rows, map.cols].map(usize::from);
        let (mut left, mut off, mut total) = (held, [[0; 2]; 2], 0.0);
        loop {
            let mut best = (0.0, None);
            for (axis, end) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
                for (depth, cost) in depths(held[axis]).into_iter().zip(costs.crops[axis][end]) {
                    let price = self.prices.of_charge(self.charge.of_texels(depth * left[1 - axis]));
                    let gain = threshold * price - cost / probes;
                    if off[axis][end] == 0 && depth < left[axis] && gain > best.0 {
                        best = (gain, Some((axis, end, depth, cost)));
                    }
                }
            }
            let Some((axis, end, depth, cost)) = best.1 else { break };
            off[axis][end] = depth;
            left[axis] -= depth;
            total += cost;
        }
        (left != held).then(|| self.map_offer(splat, cropped_map(map, off), total))
    }

    /// The offer to change a splat's map, at a cost summed over probes.
    fn map_offer(&self, splat: usize, change: MapChange, cost: f64) -> Accepted {
        let map = &self.model.textures.maps[splat];
        let degree = self.model.splats.sh_degrees()[splat];
        let texels = change.applied_to(map).num_texels();
        let charge = self.charge.of(degree, map.num_texels()) - self.charge.of(degree, texels);
        Accepted {
            kept: Some(Kept { degree, map: change, texels }),
            params: params_of(degree, map.num_texels()) - params_of(degree, texels),
            charge,
            price: self.prices.of_charge(charge),
            cost: cost / f64::from(self.probes.max(1)),
        }
    }
}

/// Parameters of a splat.
pub fn params_of(degree: u8, texels: usize) -> usize {
    let maps = usize::from(texels > 0);
    ModelSize { splats: 1, sh_coefficients: sh_coefficients(degree.into()), maps, texels }.params()
}
