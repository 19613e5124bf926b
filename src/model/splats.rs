//! Structure of arrays of per-splat quantities. The same type holds parameters, gradients and moments, so that
//! loops over all parameters are written once.

use crate::constants::sh_coefficients;

/// One array per group of parameters; the entries of a splat are contiguous.
#[derive(Clone, Debug, PartialEq)]
pub struct SplatArrays {
    /// Largest SH degree of any splat, that of `sh`.
    pub sh_degree: u32,
    /// SH degree of each splat. Entries of `sh` above it are 0. `[n]`
    pub sh_degrees: Vec<u8>,
    /// Centres, local frame. `[n, 3]`
    pub positions: Vec<f32>,
    /// Rotations local_from_surfel as quaternions wxyz, not normalised. `[n, 4]`
    pub quaternions: Vec<f32>,
    /// Natural logarithms of the standard deviations along the surfel's axes, local units. `[n, 2]`
    pub log_scales: Vec<f32>,
    /// Opacities before the sigmoid. `[n]`
    pub opacity_logits: Vec<f32>,
    /// SH coefficients, display space. `[n, (sh_degree + 1)^2, 3]`
    pub sh: Vec<f32>,
}

/// A group of parameters with its own learning rate.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum SplatGroup {
    /// Centres, 3 floats.
    Position,
    /// Rotations, 4 floats.
    Quaternion,
    /// Logarithms of the standard deviations, 2 floats.
    LogScale,
    /// Opacity before the sigmoid, 1 float.
    Opacity,
    /// SH coefficients, 3 floats each.
    Sh,
}

impl SplatGroup {
    /// All groups, in storage order.
    pub const ALL: [Self; 5] = [Self::Position, Self::Quaternion, Self::LogScale, Self::Opacity, Self::Sh];

    /// Floats per splat.
    pub const fn width(self, sh_degree: u32) -> usize {
        match self {
            Self::Position => 3,
            Self::Quaternion => 4,
            Self::LogScale => 2,
            Self::Opacity => 1,
            Self::Sh => 3 * sh_coefficients(sh_degree),
        }
    }
}

impl SplatArrays {
    /// `n` splats of degree `sh_degree` with all values zero.
    pub fn zeros(n: usize, sh_degree: u32) -> Self {
        let array = |g: SplatGroup| vec![0.0; n * g.width(sh_degree)];
        Self {
            sh_degree,
            sh_degrees: vec![sh_degree as u8; n],
            positions: array(SplatGroup::Position),
            quaternions: array(SplatGroup::Quaternion),
            log_scales: array(SplatGroup::LogScale),
            opacity_logits: array(SplatGroup::Opacity),
            sh: array(SplatGroup::Sh),
        }
    }

    /// Number of splats.
    pub fn len(&self) -> usize {
        self.opacity_logits.len()
    }

    /// Whether the number of splats is 0.
    pub fn is_empty(&self) -> bool {
        self.opacity_logits.is_empty()
    }

    /// The array of one group. `[n, width]`
    pub fn group(&self, group: SplatGroup) -> &Vec<f32> {
        match group {
            SplatGroup::Position => &self.positions,
            SplatGroup::Quaternion => &self.quaternions,
            SplatGroup::LogScale => &self.log_scales,
            SplatGroup::Opacity => &self.opacity_logits,
            SplatGroup::Sh => &self.sh,
        }
    }

    /// The array of one group, mutable. `[n, width]`
    pub fn group_mut(&mut self, group: SplatGroup) -> &mut Vec<f32> {
        match group {
            SplatGroup::Position => &mut self.positions,
            SplatGroup::Quaternion => &mut self.quaternions,
            SplatGroup::LogScale => &mut self.log_scales,
            SplatGroup::Opacity => &mut self.opacity_logits,
            SplatGroup::Sh => &mut self.sh,
        }
    }

    /// The splats with the indices `sources`, in that order.
    pub fn gathered(&self, sources: &[u32]) -> Self {
        let mut out = Self::zeros(0, self.sh_degree);
        out.sh_degrees = sources.iter().map(|&s| self.sh_degrees[s as usize]).collect();
        for group in SplatGroup::ALL {
            let width = group.width(self.sh_degree);
            let from = self.group(group);
            *out.group_mut(group) = sources
                .iter()
                .flat_map(|&s| &from[s as usize * width..(s as usize + 1) * width])
                .copied()
                .collect();
        }
        out
    }

    /// Changes the degrees of the splats; coefficients above them become 0.
    pub fn set_sh_degrees(&mut self, degrees: &[u8]) {
        self.sh_degrees = degrees.to_vec();
        let width = SplatGroup::Sh.width(self.sh_degree);
        for (sh, &degree) in self.sh.chunks_exact_mut(width).zip(degrees) {
            sh[SplatGroup::Sh.width(degree.into())..].fill(0.0);
        }
    }
}
