//! What a splat's parts show of the images: what their loss would change, from the derivatives of a probe (twin of
//! `shaders/probe_costs.wgsl`).

use crate::constants::{SH_0, sh_coefficients};
use crate::model::{Coarsening, Model, SplatArrays, texel_value, texel_value_slope};

/// Axes along which a map may be coarsened.
pub const AXES: [[bool; 2]; 3] = [[true, true], [true, false], [false, true]];

/// Degrees that a splat of degree 3 could fall to.
const LOWER_DEGREES: usize = 3;

/// Numbers of rows or columns on offer at each side of a map.
const DEPTHS: usize = 3;

/// Rows or columns that a crop takes off one side, of this many: one, a quarter and half of them. Those of short maps may be
/// the same.
pub fn depths(texels: usize) -> [usize; DEPTHS] {
    [1, texels / 4, texels / 2].map(|depth| depth.max(1))
}

/// What a splat without some of its parts costs, summed over probes: mean squared changes of the image.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Costs {
    /// Probes that saw the splat.
    pub seen: u32,
    /// Of its removal.
    pub removal: f64,
    /// Of a change of its colour by 1 in all channels.
    pub colour: f64,
    /// Of the loss of all SH bands above degree 0, 1 and 2.
    pub degrees: [f64; LOWER_DEGREES],
    /// Of the loss of its map.
    pub map: f64,
    /// Of a coarser map, by [`AXES`].
    pub coarser: [f64; AXES.len()],
    /// Of a map cropped at one side, by [`depths`]: along u and along v, at the first and at the last texel.
    pub crops: [[[f64; DEPTHS]; 2]; 2],
}

impl Costs {
    /// Adds those of another probe.
    pub fn add(&mut self, other: &Self) {
        self.seen += other.seen;
        self.removal += other.removal;
        self.colour += other.colour;
        self.map += other.map;
        self.degrees.iter_mut().zip(other.degrees).for_each(|(sum, cost)| *sum += cost);
        self.coarser.iter_mut().zip(other.coarser).for_each(|(sum, cost)| *sum += cost);
        let crops = self.crops.as_flattened_mut().as_flattened_mut().iter_mut();
        crops.zip(other.crops.as_flattened().as_flattened()).for_each(|(sum, cost)| *sum += cost);
    }
}

/// Derivatives of one probe with respect to the stored numbers of a model, up to a factor.
#[derive(Clone, Copy)]
pub struct Derivatives<'a> {
    /// By those of the splats.
    pub splats: &'a SplatArrays,
    /// By texels. `[num_texels, 3]`
    pub texels: &'a [f32],
    /// The factor.
    pub scale: f32,
}

/// Squares of the derivatives in the directions in which a splat loses a part.
pub fn costs_of(model: &Model, derivatives: &Derivatives<'_>, splat: usize) -> Costs {
    let derivative = |stored: &f32| f64::from(stored * derivatives.scale);
    let transparency = 1.0 / (1.0 + f64::from(model.splats.opacity_logits[splat]).exp());
    let by_logit = derivative(&derivatives.splats.opacity_logits[splat]);
    let seen = u32::from(by_logit != 0.0);
    if seen == 0 {
        return Costs::default();
    }
    let mut costs = Costs { seen, removal: (by_logit / transparency).powi(2), ..Costs::default() };

    let [sh, by_sh] = [&model.splats, derivatives.splats].map(|splats| splats.sh_of(splat));
    costs.colour = by_sh[..3].iter().map(|d| (derivative(d) / SH_0).powi(2)).sum();
    for (degree, cost) in costs.degrees.iter_mut().enumerate() {
        let first = (3 * sh_coefficients(degree as u32)).min(sh.len());
        *cost = dot(sh[first..].iter().zip(&by_sh[first..]).map(|(&c, d)| (c.into(), derivative(d)))).powi(2);
    }

    let map = &model.textures.maps[splat];
    if map.rows == 0 {
        return costs;
    }
    let cols = usize::from(map.cols);
    let coarser = AXES.map(|axes| Coarsening::new(map, axes));
    // Changes of the probe's sum: if one texel goes, by row and by column, and if the map is coarsened.
    let mut lines = [map.rows, map.cols].map(|texels| vec![0.0; texels.into()]);
    let mut changes = [0.0; AXES.len()];
    for channel in 0..3 {
        let [stored, by_stored] = [&model.textures.texels[..], derivatives.texels]
            .map(|all| all[map.floats()].iter().skip(channel).step_by(3));
        let values: Vec<f64> = stored.map(|&stored| texel_value(stored.into())).collect();
        let by_value: Vec<f64> =
            by_stored.zip(&values).map(|(d, &value)| derivative(d) / texel_value_slope(value)).collect();
        for (t, (value, by_value)) in values.iter().zip(&by_value).enumerate() {
            lines[0][t / cols] += value * by_value;
            lines[1][t % cols] += value * by_value;
        }
        for (change, coarser) in changes.iter_mut().zip(&coarser) {
            let Some(coarser) = coarser else { continue };
            let sampled = coarser.sampled(&values).into_iter().zip(&values).map(|(s, v)| s - v);
            *change += dot(sampled.zip(by_value.iter().copied()));
        }
    }
    costs.map = lines[0].iter().sum::<f64>().powi(2);
    costs.coarser = changes.map(|change| change.powi(2));
    // Outside of its texels a map is 0, as are texels whose residual is lost.
    costs.crops = lines.map(|lines| {
        let depths = depths(lines.len());
        [depths.map(|depth| &lines[..depth]), depths.map(|depth| &lines[lines.len() - depth..])]
            .map(|side| side.map(|dropped| dropped.iter().sum::<f64>().powi(2)))
    });
    costs
}

fn dot(pairs: impl Iterator<Item = (f64, f64)>) -> f64 {
    pairs.map(|(a, b)| a * b).sum()
}
