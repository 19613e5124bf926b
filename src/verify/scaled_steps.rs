//! Steps by a factor on all of them: the coarsest for which something holds, and those of a file of a wanted size.

use crate::Result;
use litetex_exporters::ltgs::{LtgsOptions, PerSplat, Steps, encode};
use litetex_exporters::{Quality, SplatAsset};

/// Bounds of the factor on all steps, as powers of two.
pub(super) const FACTOR_LOG2: [f64; 2] = [-6.0, 6.0];
/// The factor is found to 3 %: `12 / 2^8` powers of two.
pub(super) const ROUNDS: u32 = 8;

/// Steps that a factor scales, and what is known of the splats.
#[derive(Clone, Copy)]
pub(super) struct Scaled<'a> {
    pub base: Steps,
    pub per_splat: PerSplat<'a>,
}

impl<'a> Scaled<'a> {
    /// Steps for a factor, given as a power of two.
    pub fn steps(&self, factor_log2: f64) -> Steps {
        self.base.scaled(factor_log2.exp2())
    }

    /// Options of a file with steps for a factor.
    pub fn options(&self, quality: Quality, factor_log2: f64) -> LtgsOptions<'a> {
        LtgsOptions {
            quality,
            steps: Some(self.steps(factor_log2)),
            per_splat: self.per_splat,
            ..LtgsOptions::default()
        }
    }
}

/// Bytes of a file with steps for a factor.
pub(super) fn size_of(
    asset: &SplatAsset,
    quality: Quality,
    scaled: Scaled<'_>,
    factor_log2: f64,
) -> Result<u64> {
    Ok(encode(asset, &scaled.options(quality, factor_log2))?.len() as u64)
}

/// The factor of the finest steps that make a file of this quality of at most `most` bytes; if there are none, the bytes of the
/// coarsest file.
pub(super) fn factor_of_size(
    asset: &SplatAsset,
    quality: Quality,
    scaled: Scaled<'_>,
    most: u64,
) -> Result<std::result::Result<f64, u64>> {
    let size = |factor_log2: f64| size_of(asset, quality, scaled, factor_log2);
    let factor = coarsest(|factor| Ok(size(factor)? > most))?;
    // One notch coarser than the last that is too large.
    let factor = factor.map_or(FACTOR_LOG2[0], |f| f + resolution());
    let bytes = size(factor)?;
    Ok(if bytes > most { Err(bytes) } else { Ok(factor) })
}

/// Powers of two between factors that are told apart.
pub(super) fn resolution() -> f64 {
    (FACTOR_LOG2[1] - FACTOR_LOG2[0]) / f64::from(1_u32 << ROUNDS)
}

/// The largest factor, as a power of two, for which `holds` is true; it must be monotonic. `None` if it never is.
pub(super) fn coarsest(mut holds: impl FnMut(f64) -> Result<bool>) -> Result<Option<f64>> {
    let (mut low, mut high) = (0_u32, 1_u32 << ROUNDS);
    let at = |i: u32| FACTOR_LOG2[0] + f64::from(i) * resolution();
    if !holds(at(0))? {
        return Ok(None);
    }
    while high - low > 1 {
        let middle = low.midpoint(high);
        if holds(at(middle))? {
            low = middle;
        } else {
            high = middle;
        }
    }
    Ok(Some(at(low)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_coarsest_steps_within_the_limit_are_found() {
        for limit in [-5.9, -0.3, 0.0, 2.22, 5.99] {
            let mut asked = 0;
            let found = coarsest(|factor| {
                asked += 1;
                Ok(factor <= limit)
            });
            let found = found.unwrap().unwrap();
            assert!(found <= limit && found > limit - resolution(), "{limit}: {found}");
            assert!(asked <= ROUNDS + 1);
        }
        assert_eq!(coarsest(|_| Ok(false)).unwrap(), None);
    }
}
