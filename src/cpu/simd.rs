//! The instruction sets that the kernels can use on this machine. All are compiled in, and the best is chosen at run
//! time. `fearless_simd` guards the `unsafe` intrinsics by tokens that prove support, so that this crate needs no
//! `unsafe` of its own.

use fearless_simd::Level;

/// Runs a kernel that is generic over [`Simd`](fearless_simd::Simd) at a [`Level`]. In place of
/// `fearless_simd::dispatch`, which would also compile every kernel for SSE4.2: hardly any processor stops there, and
/// those that do run the kernels for SSE2.
#[cfg(target_arch = "x86_64")]
macro_rules! dispatch {
    ($level:expr, $simd:pat => $op:expr) => {{
        let level: ::fearless_simd::Level = $level;
        if let Some(token) = level.as_avx512() {
            $crate::cpu::simd::dispatch!(@run token, $simd => $op)
        } else if let Some(token) = level.as_avx2() {
            $crate::cpu::simd::dispatch!(@run token, $simd => $op)
        } else if let Some(token) = level.as_sse2() {
            $crate::cpu::simd::dispatch!(@run token, $simd => $op)
        } else {
            unreachable!("x86-64 includes SSE2")
        }
    }};
    (@run $token:ident, $simd:pat => $op:expr) => {
        ::fearless_simd::Simd::vectorize(
            $token,
            #[inline(always)]
            || {
                let $simd = $token;
                $op
            },
        )
    };
}
#[cfg(not(target_arch = "x86_64"))]
pub(crate) use fearless_simd::dispatch;

#[cfg(target_arch = "x86_64")]
pub(crate) use dispatch;

/// An instruction set that this machine supports.
#[derive(Clone, Copy, Debug)]
pub struct SimdLevel(pub(super) Level);

impl SimdLevel {
    /// The best instruction set of this machine.
    pub fn best() -> Self {
        Self::all()[0]
    }

    /// All instruction sets of this machine, best first; at least one. Results are bit-identical only at the same
    /// level.
    #[cfg(target_arch = "x86_64")]
    pub fn all() -> Vec<Self> {
        let best = Level::new();
        let levels = [
            best.as_avx512().map(Level::Avx512),
            best.as_avx2().map(Level::Avx2),
            best.as_sse2().map(Level::Sse2),
        ];
        levels.into_iter().flatten().map(Self).collect()
    }

    /// The only instruction set of this machine.
    #[cfg(not(target_arch = "x86_64"))]
    pub fn all() -> Vec<Self> {
        vec![Self(Level::new())]
    }

    /// Name in lower case: "avx512", "avx2", "neon", ...
    pub fn name(self) -> String {
        let debug = format!("{:?}", self.0);
        debug.split('(').next().unwrap_or_default().to_lowercase()
    }
}
