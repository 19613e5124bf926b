//! Which instruction sets the kernels can use on this machine. All of them are compiled in; the best is
//! chosen at run time. `fearless_simd` keeps the `unsafe` of intrinsics behind proofs of support, so that
//! this crate needs none of its own.

use fearless_simd::Level;

/// An instruction set that this machine has.
#[derive(Clone, Copy, Debug)]
pub struct SimdLevel(pub(super) Level);

impl SimdLevel {
    /// The best one.
    pub fn best() -> Self {
        Self(Level::new())
    }

    /// All, the best first: results are equal only within one of them.
    #[cfg(target_arch = "x86_64")]
    pub fn all() -> Vec<Self> {
        let best = Level::new();
        let levels = [
            best.as_avx512().map(Level::Avx512),
            best.as_avx2().map(Level::Avx2),
            best.as_sse4_2().map(Level::Sse4_2),
            best.as_sse2().map(Level::Sse2),
        ];
        levels.into_iter().flatten().map(Self).collect()
    }

    /// All: there is one.
    #[cfg(not(target_arch = "x86_64"))]
    pub fn all() -> Vec<Self> {
        vec![Self::best()]
    }

    /// Lower-case name: "avx512", "avx2", "neon", ...
    pub fn name(self) -> String {
        let debug = format!("{:?}", self.0);
        debug.split('(').next().unwrap_or_default().to_lowercase()
    }
}
