//! How coarsely the numbers of a lossy file are rounded, and the few numbers of a whole scene that the steps refer to.
//! Both stand in the file's metadata.

use crate::{Error, Result};
use serde::{Deserialize, Serialize};

/// Sizes of steps. Each splat has an exponent x of its own, chosen by the writer from what the splat matters for the
/// images; its steps are `2^x` times these.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "camelCase")]
pub struct Steps {
    /// Of positions, as a share of the splat's reach: its smaller standard deviation, or two texels if that is less.
    pub position: f64,
    /// Of quaternions' components, for splats whose larger standard deviation is their reach; less for longer ones.
    pub rotation: f64,
    /// Of log2 of standard deviations.
    pub log2_scale: f64,
    /// Of opacities.
    pub opacity: f64,
    /// Of SH degree 0, luma.
    pub sh0: f64,
    /// Of SH degrees 1 to 3, luma.
    pub sh_rest: [f64; 3],
    /// Of texels, luma, where the Gaussian is near 1; `2^k` times that where it is near `2^-k`, k up to 4.
    pub texel: f64,
    /// Chroma steps over luma steps, of colours and texels.
    pub chroma: f64,
    /// Of log2 of texel sizes, for a map of one texel; maps of N texels a side have 1 / N of that.
    pub log2_texel_size: f64,
}

impl Steps {
    /// Where to start for [`crate::Quality::Balanced`]: about 0.02 dB of a capture at 31 dB. The shares of the attributes
    /// are those at which a bit buys the same error everywhere, measured by images of a trained scene.
    pub fn balanced(_asset: &crate::SplatAsset) -> Self {
        Self {
            position: 0.01,
            rotation: 0.0033,
            log2_scale: 0.018,
            opacity: 0.005,
            sh0: 0.0045,
            sh_rest: [0.0045; 3],
            texel: 0.0082,
            chroma: 2.5,
            log2_texel_size: 0.03,
        }
    }

    /// Where to start for [`crate::Quality::Tiny`].
    pub fn tiny(asset: &crate::SplatAsset) -> Self {
        Self::balanced(asset).scaled(2.2)
    }

    /// All steps times a factor.
    pub fn scaled(&self, factor: f64) -> Self {
        Self {
            position: self.position * factor,
            rotation: self.rotation * factor,
            log2_scale: self.log2_scale * factor,
            opacity: self.opacity * factor,
            sh0: self.sh0 * factor,
            sh_rest: self.sh_rest.map(|s| s * factor),
            texel: self.texel * factor,
            chroma: self.chroma,
            log2_texel_size: self.log2_texel_size * factor,
        }
    }

    /// Checks that every step can be used.
    ///
    /// # Errors
    /// [`Error::Invalid`] with the steps: each lies in `[2^-30, 16]`, opacity's in `[2^-30, 1]`.
    pub fn validate(&self) -> Result<()> {
        let all = [self.position, self.rotation, self.log2_scale, self.sh0, self.texel, self.log2_texel_size];
        let range = two_to_minus_30()..=16.0;
        let sound = all.iter().chain(&self.sh_rest).chain([&self.chroma]).all(|s| range.contains(s));
        if sound && range.contains(&self.opacity) && self.opacity <= 1.0 {
            return Ok(());
        }
        Err(Error::invalid("", format!("steps are not in [2^-30, 16] (opacity: at most 1): {self:?}")))
    }
}

const fn two_to_minus_30() -> f64 {
    1.0 / (1_u64 << 30) as f64
}

/// What the steps refer to.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "camelCase", deny_unknown_fields)]
pub struct Grid {
    /// Corner of the cube of positions, local frame.
    pub origin: [f64; 3],
    /// The finest step of positions is `steps.position * reach`, local units.
    pub reach: f64,
    /// The cube's edge is `2^bits` finest steps.
    pub bits: u32,
    /// Edge of a cell, whose Morton number is stored, is `2^cell_bits` finest steps.
    pub cell_bits: u32,
    /// Codes of log2 standard deviations count from here.
    pub log2_scale: f64,
    /// Codes of log2 texel sizes count from here.
    pub log2_texel_size: f64,
}

/// Most bits of a coordinate.
pub const GRID_BITS_MAX: u32 = 31;

/// Most bits of a cell's coordinate: three make a Morton number of 63 bits.
pub const CELL_COORDINATE_BITS_MAX: u32 = 21;

impl Grid {
    /// Checks that it can be used.
    ///
    /// # Errors
    /// [`Error::Invalid`] with the grid.
    pub fn validate(&self) -> Result<()> {
        let numbers = self.origin.iter().chain([&self.log2_scale, &self.log2_texel_size]);
        let sound = numbers.clone().all(|v| v.abs() <= f64::from(f32::MAX))
            && (f64::MIN_POSITIVE..=f64::from(f32::MAX)).contains(&self.reach)
            && self.bits <= GRID_BITS_MAX
            && self.cell_bits <= self.bits
            && self.bits - self.cell_bits <= CELL_COORDINATE_BITS_MAX;
        if sound { Ok(()) } else { Err(Error::invalid("", format!("{self:?} is out of bounds"))) }
    }
}

/// Steps and what they refer to: all that turns codes into numbers.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "camelCase")]
pub struct Quantiser {
    /// Sizes of steps.
    pub steps: Steps,
    /// What they refer to.
    pub grid: Grid,
}

impl Quantiser {
    /// Checks both.
    ///
    /// # Errors
    /// [`Error::Invalid`].
    pub fn validate(&self) -> Result<()> {
        self.steps.validate()?;
        self.grid.validate()
    }
}
