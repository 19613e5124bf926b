//! Structure of arrays of per-splat quantities. The same type holds parameters, gradients and moments, so that
//! loops over all parameters are written once.

use crate::constants::sh_coefficients;
use std::ops::Range;

/// One array per group of parameters; the entries of a splat are contiguous. SH coefficients are a jagged pool: a splat has
/// those of its own degree.
#[derive(Clone, Debug, PartialEq)]
pub struct SplatArrays<V = f32> {
    /// SH degree of each splat. `[n]`
    sh_degrees: Vec<u8>,
    /// First float of each splat in `sh`, and the end of the last one. `[n + 1]`
    sh_offsets: Vec<u32>,
    /// Centres, local frame. `[n, 3]`
    pub positions: Vec<V>,
    /// Rotations local_from_surfel as quaternions wxyz, not normalised. `[n, 4]`
    pub quaternions: Vec<V>,
    /// Natural logarithms of the standard deviations along the surfel's axes, local units. `[n, 2]`
    pub log_scales: Vec<V>,
    /// Opacities before the sigmoid. `[n]`
    pub opacity_logits: Vec<V>,
    /// SH coefficients, display space, splat after splat. `[num_sh_coefficients, 3]`
    pub sh: Vec<V>,
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

    /// Floats of a splat of this SH degree.
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

impl<V> SplatArrays<V> {
    /// Number of splats.
    pub fn len(&self) -> usize {
        self.opacity_logits.len()
    }

    /// Whether the number of splats is 0.
    pub fn is_empty(&self) -> bool {
        self.opacity_logits.is_empty()
    }

    /// SH degree of each splat. `[n]`
    pub fn sh_degrees(&self) -> &[u8] {
        &self.sh_degrees
    }

    /// Largest SH degree of a splat; 0 without splats.
    pub fn sh_degree(&self) -> u32 {
        self.sh_degrees.iter().copied().max().unwrap_or(0).into()
    }

    /// First float of each splat in the pool of SH coefficients, and its end. `[n + 1]`
    pub fn sh_offsets(&self) -> &[u32] {
        &self.sh_offsets
    }

    /// The floats of a splat in the array of a group.
    pub fn range(&self, group: SplatGroup, splat: usize) -> Range<usize> {
        match group {
            SplatGroup::Sh => self.sh_offsets[splat] as usize..self.sh_offsets[splat + 1] as usize,
            _ => splat * group.width(0)..(splat + 1) * group.width(0),
        }
    }

    /// The SH coefficients of a splat. `[(degree + 1)^2, 3]`
    pub fn sh_of(&self, splat: usize) -> &[V] {
        &self.sh[self.range(SplatGroup::Sh, splat)]
    }

    /// The SH coefficients of a splat, mutable. `[(degree + 1)^2, 3]`
    pub fn sh_of_mut(&mut self, splat: usize) -> &mut [V] {
        let range = self.range(SplatGroup::Sh, splat);
        &mut self.sh[range]
    }

    /// The array of one group. `[n, width]`; SH is the jagged pool
    pub fn group(&self, group: SplatGroup) -> &Vec<V> {
        match group {
            SplatGroup::Position => &self.positions,
            SplatGroup::Quaternion => &self.quaternions,
            SplatGroup::LogScale => &self.log_scales,
            SplatGroup::Opacity => &self.opacity_logits,
            SplatGroup::Sh => &self.sh,
        }
    }

    /// The array of one group, mutable; its length must stay. `[n, width]`; SH is the jagged pool
    pub fn group_mut(&mut self, group: SplatGroup) -> &mut Vec<V> {
        match group {
            SplatGroup::Position => &mut self.positions,
            SplatGroup::Quaternion => &mut self.quaternions,
            SplatGroup::LogScale => &mut self.log_scales,
            SplatGroup::Opacity => &mut self.opacity_logits,
            SplatGroup::Sh => &mut self.sh,
        }
    }

    /// The arrays of all groups, in the order of [`SplatGroup::ALL`], mutable, with [`Self::sh_offsets`].
    pub fn groups_mut(&mut self) -> ([&mut Vec<V>; 5], &[u32]) {
        let Self { positions, quaternions, log_scales, opacity_logits, sh, sh_offsets, .. } = self;
        ([positions, quaternions, log_scales, opacity_logits, sh], sh_offsets)
    }

    /// The same splats with every value replaced.
    pub fn map<W>(&self, value: impl Fn(&V) -> W) -> SplatArrays<W> {
        let array = |values: &[V]| values.iter().map(&value).collect();
        SplatArrays {
            sh_degrees: self.sh_degrees.clone(),
            sh_offsets: self.sh_offsets.clone(),
            positions: array(&self.positions),
            quaternions: array(&self.quaternions),
            log_scales: array(&self.log_scales),
            opacity_logits: array(&self.opacity_logits),
            sh: array(&self.sh),
        }
    }
}

impl SplatArrays {
    /// `n` splats of degree `sh_degree` with all values zero.
    pub fn zeros(n: usize, sh_degree: u32) -> Self {
        Self::zeros_of(vec![sh_degree as u8; n])
    }

    /// Splats of these SH degrees with all values zero.
    pub fn zeros_of(sh_degrees: Vec<u8>) -> Self {
        let n = sh_degrees.len();
        let sh_offsets = sh_offsets(&sh_degrees);
        let array = |g: SplatGroup| vec![0.0; n * g.width(0)];
        Self {
            positions: array(SplatGroup::Position),
            quaternions: array(SplatGroup::Quaternion),
            log_scales: array(SplatGroup::LogScale),
            opacity_logits: array(SplatGroup::Opacity),
            sh: vec![0.0; sh_offsets[n] as usize],
            sh_degrees,
            sh_offsets,
        }
    }

    /// The splats with the indices `sources`, in that order, each with its new SH degree: higher coefficients are dropped,
    /// missing ones are 0.
    pub fn gathered(&self, sources: &[u32], sh_degrees: Vec<u8>) -> Self {
        let mut out = Self::zeros_of(sh_degrees);
        for group in SplatGroup::ALL {
            for (splat, &source) in sources.iter().enumerate() {
                let (to, from) = (out.range(group, splat), self.range(group, source as usize));
                let floats = to.len().min(from.len());
                let from = &self.group(group)[from.start..][..floats];
                out.group_mut(group)[to.start..][..floats].copy_from_slice(from);
            }
        }
        out
    }

    /// As [`Self::gathered`], for second moments: those of new coefficients are those of DC in the same channel. All basis
    /// functions have the same mean square over the directions, so their gradients are of that size.
    pub fn gathered_second_moments(&self, sources: &[u32], sh_degrees: Vec<u8>) -> Self {
        let mut out = self.gathered(sources, sh_degrees);
        for (splat, &source) in sources.iter().enumerate() {
            let held = self.sh_of(source as usize).len();
            let (dc, bands) = out.sh_of_mut(splat).split_at_mut(3);
            let new = bands.iter_mut().enumerate().skip(held - 3);
            new.for_each(|(k, v)| *v = dc[k % 3]);
        }
        out
    }

    /// Changes the degrees of the splats, as [`Self::gathered`] does.
    pub fn set_sh_degrees(&mut self, degrees: &[u8]) {
        let all: Vec<u32> = (0..self.len() as u32).collect();
        *self = self.gathered(&all, degrees.to_vec());
    }
}

/// First float of each splat in a pool of SH coefficients, and its end.
fn sh_offsets(degrees: &[u8]) -> Vec<u32> {
    let mut end = 0;
    std::iter::once(0)
        .chain(degrees.iter().map(|&degree| {
            end += SplatGroup::Sh.width(degree.into()) as u32;
            end
        }))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn coefficients_above_a_splats_degree_take_no_room() {
        let mut splats = SplatArrays::zeros(3, 2);
        splats.sh.iter_mut().enumerate().for_each(|(i, c)| *c = i as f32);
        splats.opacity_logits = vec![0.5, 1.5, 2.5];
        splats.set_sh_degrees(&[1, 2, 0]);
        assert_eq!((splats.sh_offsets(), splats.sh_degree()), (&[0, 12, 39, 42][..], 2));
        assert_eq!(splats.sh_of(0), (0..12).map(|i| i as f32).collect::<Vec<_>>());
        assert_eq!(splats.sh_of(1), (27..54).map(|i| i as f32).collect::<Vec<_>>());
        assert_eq!(splats.sh_of(2), [54.0, 55.0, 56.0]);
        let twice = splats.gathered(&[2, 1, 2], vec![0, 0, 1]);
        assert_eq!(
            twice.sh,
            [54.0, 55.0, 56.0, 27.0, 28.0, 29.0, 54.0, 55.0, 56.0, 0., 0., 0., 0., 0., 0., 0., 0., 0.]
        );
        assert_eq!(twice.opacity_logits, [2.5, 1.5, 2.5]);
        // New coefficients are 0; as second moments, those of DC.
        let grown = splats.gathered_second_moments(&[2, 0], vec![1, 0]);
        assert_eq!(grown.sh[..12], [54.0, 55.0, 56.0].repeat(4));
        assert_eq!(grown.sh[12..], [0.0, 1.0, 2.0]);
        splats.set_sh_degrees(&[2, 2, 2]);
        assert!(splats.sh_of(0)[12..].iter().all(|c| *c == 0.0));
    }
}
