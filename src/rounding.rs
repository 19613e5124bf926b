//! Training with rounded numbers: the interface between the trainer and what rounds a model as its file will, and what the
//! trainer remembers between two roundings (method 10.2).

use crate::Result;
use crate::model::{Model, SplatArrays, SplatGroup};
use litetex_exporters::ltgs::{PerSplat, Steps};

/// How coarsely the numbers of a model are rounded.
#[derive(Clone, Debug, PartialEq)]
pub struct Quantisation {
    /// Quantisation steps but for a factor.
    pub base: Steps,
    /// The factor, as a power of two.
    pub factor_log2: f64,
    /// For each splat the power of two that multiplies its steps. `[n]`
    pub exponents: Vec<i8>,
    /// Blending weights of the splats, summed over views. `[n]`
    pub contributions: Vec<f32>,
}

impl Quantisation {
    /// Quantisation steps.
    pub fn steps(&self) -> Steps {
        self.base.scaled(self.factor_log2.exp2())
    }

    /// What is known of the splats.
    pub fn per_splat(&self) -> PerSplat<'_> {
        PerSplat { exponents: &self.exponents, contributions: &self.contributions }
    }
}

/// Rounds models as a file does.
pub trait Rounder {
    /// Bytes of the file that are for splats.
    fn splat_bytes(&self) -> f64;

    /// Chooses quantisation steps with which the file of a model has the size that is wanted. `before` are those chosen last for
    /// the same splats; `is_last` says that the file is made with these.
    ///
    /// # Errors
    /// What a device reports; [`crate::Error::Usage`] if no file is small enough.
    fn choose(&mut self, model: &Model, before: Option<&Quantisation>, is_last: bool)
    -> Result<Quantisation>;

    /// The model that a reader of the file gets, with its splats as they are. If it is the last, rounding it again changes nothing.
    ///
    /// # Errors
    /// [`crate::Error::Device`] for numbers that no file holds.
    fn round(&self, model: &Model, steps: &Quantisation, is_last: bool) -> Result<Model>;
}

/// A model in training is rounded, and what rounding added to its numbers. While the trainer changes the rounded numbers, that
/// stays the same: the exact numbers are the present ones less the offsets.
#[derive(Clone, Debug, PartialEq)]
pub struct LastRounding {
    /// How it was rounded.
    pub steps: Quantisation,
    /// Step after which it was rounded.
    pub step: u32,
    /// Whether that was the last step of the run: the numbers are those of the file.
    pub is_last: bool,
    /// What was added to parameters and texels.
    pub offsets: Offsets,
}

/// Differences between two models of the same splats and maps.
#[derive(Clone, Debug, PartialEq)]
pub struct Offsets {
    /// By parameter.
    pub splats: SplatArrays,
    /// By stored texel. `[num_texels, 3]`
    pub texels: Vec<f32>,
    /// By texel size. `[n, 2]`
    pub texel_sizes: Vec<f32>,
}

impl Offsets {
    /// No differences, for this model.
    pub fn zeros(model: &Model) -> Self {
        Self {
            splats: SplatArrays::zeros_of(model.splats.sh_degrees().to_vec()),
            texels: vec![0.0; model.textures.texels.len()],
            texel_sizes: vec![0.0; 2 * model.num_splats()],
        }
    }

    /// What is to be added to `from` to get `to`.
    pub fn between(from: &Model, to: &Model) -> Self {
        let mut offsets = Self::zeros(from);
        offsets.add(to, 1.0);
        offsets.add(from, -1.0);
        offsets
    }

    /// Adds the numbers of a model, times a factor.
    fn add(&mut self, model: &Model, factor: f32) {
        let add = |sums: &mut [f32], values: &[f32]| {
            sums.iter_mut().zip(values).for_each(|(sum, value)| *sum += factor * value);
        };
        for group in SplatGroup::ALL {
            add(self.splats.group_mut(group), model.splats.group(group));
        }
        add(&mut self.texels, &model.textures.texels);
        for (sums, map) in self.texel_sizes.chunks_exact_mut(2).zip(&model.textures.maps) {
            // Without texels, sizes mean nothing, and files hold none.
            if map.num_texels() > 0 {
                add(sums, &map.texel_sizes);
            }
        }
    }

    /// Adds the offsets to a model, times 1 or -1.
    pub fn apply(&self, model: &mut Model, factor: f32) {
        let add = |values: &mut [f32], offsets: &[f32]| {
            values.iter_mut().zip(offsets).for_each(|(value, offset)| *value += factor * offset);
        };
        for group in SplatGroup::ALL {
            add(model.splats.group_mut(group), self.splats.group(group));
        }
        add(&mut model.textures.texels, &self.texels);
        for (map, offsets) in model.textures.maps.iter_mut().zip(self.texel_sizes.chunks_exact(2)) {
            add(&mut map.texel_sizes, offsets);
        }
    }
}
