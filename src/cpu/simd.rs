//! The instruction sets that the kernels can use on this machine. All are compiled in, and the best is chosen at run
//! time. `fearless_simd` guards the `unsafe` intrinsics by tokens that prove support, so that this crate needs no
//! `unsafe` of its own.

use fearless_simd::Level;

/// An instruction set that this machine supports.
#[derive(Clone, Copy, Debug)]
pub struct SimdLevel(pub(super) Level);

impl SimdLevel {
    /// The best instruction set of this machine.
    pub fn best() -> Self {
        Self(Level::new())
    }

    /// All instruction sets of this machine, best first. Results are bit-identical only at the same level.
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

    /// The only instruction set of this machine.
    #[cfg(not(target_arch = "x86_64"))]
    pub fn all() -> Vec<Self> {
        vec![Self::best()]
    }

    /// Name in lower case: "avx512", "avx2", "neon", ...
    pub fn name(self) -> String {
        let debug = format!("{:?}", self.0);
        debug.split('(').next().unwrap_or_default().to_lowercase()
    }
}
