//! What the parts of a model count for against its bound.

use crate::constants::sh_coefficients;
use crate::model::{Model, ModelSize};

/// What a model is charged for: its parameters, or bytes of its file.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Charge {
    splat: f64,
    coefficient: f64,
    map: f64,
    texel: f64,
}

impl Charge {
    /// Parameters, as [`ModelSize::params`] counts them.
    pub const PARAMS: Self = Self { splat: 10.0, coefficient: 3.0, map: 2.0, texel: 3.0 };

    /// Bytes of a `.ltgs` file that is about as coarse as the format allows. Measured on a file of the fox, 300,000 parameters,
    /// 129 kB: 5.8, 0.46 and 0.72. With 6.5 for a splat bonsai fits, too; that of a map was not measured.
    pub const BYTES: Self = Self { splat: 6.5, coefficient: 0.46, map: 0.5, texel: 0.72 };

    /// The same of a model that nothing prunes: SH bands that were hardly trained are noise. Measured on random splats of the
    /// fox after 140 steps: 1.0 (lab/choices.md 24).
    pub const UNPRUNED_BYTES: Self = Self { coefficient: 1.1, ..Self::BYTES };

    /// What a model is charged for that is bounded by the size of its file, or else by its parameters.
    pub fn for_file(has_size: bool) -> Self {
        if has_size { Self::BYTES } else { Self::PARAMS }
    }

    /// Charge of a number of a colour channel: the least that a part of a model adds.
    pub fn least(&self) -> f64 {
        self.coefficient / 3.0
    }

    /// Charge of a splat.
    pub fn of(&self, degree: u8, texels: usize) -> f64 {
        let maps = usize::from(texels > 0);
        self.of_size(&ModelSize { splats: 1, sh_coefficients: sh_coefficients(degree.into()), maps, texels })
    }

    /// Charge of SH coefficients.
    pub fn of_coefficients(&self, coefficients: usize) -> f64 {
        self.coefficient * coefficients as f64
    }

    /// Charge of texels.
    pub fn of_texels(&self, texels: usize) -> f64 {
        self.texel * texels as f64
    }

    /// Charge of a model.
    pub fn of_model(&self, model: &Model) -> f64 {
        self.of_size(&model.size())
    }

    /// Charge of a model of this size.
    pub fn of_size(&self, size: &ModelSize) -> f64 {
        self.splat * size.splats as f64
            + self.of_coefficients(size.sh_coefficients)
            + self.map * size.maps as f64
            + self.of_texels(size.texels)
    }
}
