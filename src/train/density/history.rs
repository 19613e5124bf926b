//! The history of a splat: what the trainer keeps of it besides its parameters.

/// Density-control steps during which a half is fresh.
pub const FRESH_CHECKS: u16 = 2;

/// History of a splat.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SplatHistory {
    /// Largest side that its map may have, in texels.
    pub ceiling: u16,
    /// Checks in a row that found it useless.
    pub prune_count: u16,
    /// Checks since it was made; saturates.
    pub checks: u16,
    /// Checks since it gained its highest SH band; `u16::MAX` if it began with it.
    pub band_checks: u16,
    /// Whether it has lost SH bands, and gains no more.
    pub bands_settled: bool,
}

impl SplatHistory {
    /// A splat of the initial model, which is never fresh.
    pub fn first(ceiling: u16) -> Self {
        Self { ceiling, prune_count: 0, checks: FRESH_CHECKS, band_checks: u16::MAX, bands_settled: false }
    }

    /// The history of a half of this splat.
    pub fn half(self) -> Self {
        Self { prune_count: 0, checks: 0, ..self }
    }

    /// Whether it is too young for its statistics to be used.
    pub fn is_fresh(self) -> bool {
        self.checks < FRESH_CHECKS
    }
}
