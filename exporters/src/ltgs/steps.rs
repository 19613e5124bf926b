//! How coarsely the numbers of a lossy file are rounded, and the few numbers of the whole scene to which the steps refer.
//! Both are stored in the file's metadata.

use crate::Result;
use crate::number::rounded;
use serde::{Deserialize, Serialize};

/// Digits of a step in a file, which change it by at most a two-thousandth. Not measured.
const DIGITS: usize = 4;

/// Bounds of steps.
const STEP_MIN: f64 = 1.0 / (1_u64 << 30) as f64;
const STEP_MAX: f64 = 16.0;

/// Quantisation steps. Each splat has an exponent x, chosen by the writer from how much the splat contributes to renders;
/// its steps are `2^x` times these.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "camelCase")]
pub struct Steps {
    /// Step of positions, as a share of the geometric mean of the splat's standard deviations.
    pub position: f64,
    /// Step of the components of the quaternion that turns the z axis to the splat's normal.
    pub tilt: f64,
    /// Step of the sine of half the splat's angle around its normal, times its anisotropy.
    pub twist: f64,
    /// Step of log2 of standard deviations.
    pub log2_scale: f64,
    /// Step of log2 of opacities.
    pub log2_opacity: f64,
    /// Step of luma of SH degree 0.
    pub sh0: f64,
    /// Steps of luma of SH degrees 1 to 3.
    pub sh_rest: [f64; 3],
    /// Step of luma of texels where the Gaussian is near 1; `2^k` times that where it is near `2^-k`, with k up to 4.
    pub texel: f64,
    /// Ratio of chroma steps to luma steps, for colours and texels.
    pub chroma: f64,
    /// Step of log2 of texel sizes and of their ratio for a map of one texel; 1 / N of that for maps of N texels per side.
    pub log2_texel_size: f64,
}

impl Steps {
    /// Steps for [`crate::Quality::Balanced`] where no renders tell how much each number counts: fine enough for
    /// scenes of random splats to keep within its limit.
    pub fn balanced() -> Self {
        Self {
            position: 0.002,
            tilt: 0.001,
            twist: 0.0015,
            log2_scale: 0.006,
            log2_opacity: 0.006,
            sh0: 0.0026,
            sh_rest: [0.0026; 3],
            texel: 0.0045,
            chroma: 2.5,
            log2_texel_size: 0.006,
        }
    }

    /// The same for [`crate::Quality::Tiny`].
    pub fn tiny() -> Self {
        Self::balanced().scaled(2.2)
    }

    /// All steps multiplied by a factor.
    pub fn scaled(&self, factor: f64) -> Self {
        Self { chroma: self.chroma, ..self.map(|step| step * factor) }
    }

    /// Valid steps with the few digits that files hold.
    pub(super) fn short(&self) -> Self {
        self.map(|step| rounded(step, DIGITS).clamp(STEP_MIN, STEP_MAX))
    }

    fn map(&self, of: impl Fn(f64) -> f64) -> Self {
        Self {
            position: of(self.position),
            tilt: of(self.tilt),
            twist: of(self.twist),
            log2_scale: of(self.log2_scale),
            log2_opacity: of(self.log2_opacity),
            sh0: of(self.sh0),
            sh_rest: self.sh_rest.map(&of),
            texel: of(self.texel),
            chroma: of(self.chroma),
            log2_texel_size: of(self.log2_texel_size),
        }
    }

    /// Checks that every step is usable.
    ///
    /// # Errors
    /// [`crate::Error::Invalid`] unless each step is in `[2^-30, 16]`.
    pub fn validate(&self) -> Result<()> {
        let Self { position, tilt, twist, log2_scale, log2_opacity, .. } = *self;
        let all =
            [position, tilt, twist, log2_scale, log2_opacity, self.sh0, self.texel, self.log2_texel_size];
        let range = STEP_MIN..=STEP_MAX;
        if all.iter().chain(&self.sh_rest).chain([&self.chroma]).all(|s| range.contains(s)) {
            return Ok(());
        }
        Err(invalid!("", "steps are not in [2^-30, 16]: {self:?}"))
    }
}

/// The numbers of a scene to which its steps refer.
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
    /// log2 of the standard deviation with code 0.
    pub log2_scale: f64,
    /// Offset of log2 of the geometric mean of texel sizes against its prediction at code 0.
    pub log2_texel_size: f64,
}

/// Most bits of a coordinate.
pub const GRID_BITS_MAX: u32 = 31;

/// Most bits of a cell's coordinate: three of them make a Morton number of 63 bits.
pub const CELL_COORDINATE_BITS_MAX: u32 = 21;

impl Grid {
    /// Checks that the grid is usable.
    ///
    /// # Errors
    /// [`crate::Error::Invalid`] showing the grid.
    pub fn validate(&self) -> Result<()> {
        let numbers = self.origin.iter().chain([&self.log2_scale, &self.log2_texel_size]);
        let valid = numbers.clone().all(|v| v.abs() <= f64::from(f32::MAX))
            && (f64::MIN_POSITIVE..=f64::from(f32::MAX)).contains(&self.reach)
            && self.bits <= GRID_BITS_MAX
            && self.cell_bits <= self.bits
            && self.bits - self.cell_bits <= CELL_COORDINATE_BITS_MAX;
        if valid { Ok(()) } else { Err(invalid!("", "{self:?} is out of bounds")) }
    }
}

/// Steps and grid: everything that turns codes into numbers.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "camelCase")]
pub struct Quantiser {
    /// Quantisation steps.
    pub steps: Steps,
    /// Numbers to which the steps refer.
    pub grid: Grid,
}

impl Quantiser {
    /// Checks that steps and grid are usable.
    ///
    /// # Errors
    /// [`crate::Error::Invalid`].
    pub fn validate(&self) -> Result<()> {
        self.steps.validate()?;
        self.grid.validate()
    }
}
