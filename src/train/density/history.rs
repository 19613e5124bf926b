//! The history of a splat: what the trainer keeps of it besides its parameters.

use super::growth::Kind;
use crate::backend::{Grid, MapChange};

/// Density-control steps during which a half is fresh.
pub const FRESH_CHECKS: u16 = 2;

/// What the last density-control step did with a splat that could grow.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Trial {
    /// It could not grow, or nothing was to be measured.
    #[default]
    None,
    /// Nothing, so that others that grew in this way can be compared with it.
    Withheld(Kind),
    /// Split: this is one of the halves.
    Split,
    /// Refined its map along u.
    RefinedU,
    /// Refined its map along v.
    RefinedV,
    /// Refined its map along both axes, or gave it its first map.
    RefinedBoth,
    /// Gave it another SH band.
    Raised,
}

impl Trial {
    /// All, in the order of their numbers in checkpoints.
    pub const ALL: [Self; 9] = [
        Self::None,
        Self::Withheld(Kind::Split),
        Self::Withheld(Kind::Refined),
        Self::Withheld(Kind::Band),
        Self::Split,
        Self::RefinedU,
        Self::RefinedV,
        Self::RefinedBoth,
        Self::Raised,
    ];

    /// A change of a map.
    pub fn of(change: &MapChange) -> Self {
        match change {
            MapChange::Regrid { grids: [Grid::Finer, Grid::Same], .. } => Self::RefinedU,
            MapChange::Regrid { grids: [Grid::Same, Grid::Finer], .. } => Self::RefinedV,
            _ => Self::RefinedBoth,
        }
    }

    /// The axes along which the map was refined, if it was.
    pub fn refined_axes(self) -> Option<[bool; 2]> {
        match self {
            Self::RefinedU => Some([true, false]),
            Self::RefinedV => Some([false, true]),
            Self::RefinedBoth => Some([true; 2]),
            Self::None | Self::Withheld(_) | Self::Split | Self::Raised => None,
        }
    }

    /// How the splat grew; `None` if it did not.
    pub fn grown(self) -> Option<Kind> {
        match self {
            Self::None | Self::Withheld(_) => None,
            Self::Split => Some(Kind::Split),
            Self::RefinedU | Self::RefinedV | Self::RefinedBoth => Some(Kind::Refined),
            Self::Raised => Some(Kind::Band),
        }
    }

    /// Its number in checkpoints.
    pub fn number(self) -> u16 {
        Self::ALL.iter().position(|&trial| trial == self).unwrap_or(0) as u16
    }
}

/// History of a splat.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SplatHistory {
    /// Largest side that its map may have, in texels.
    pub ceiling: u16,
    /// Checks in a row that found it useless.
    pub prune_count: u16,
    /// Checks since it was made; saturates.
    pub checks: u16,
    /// What the last density-control step did with it.
    pub trial: Trial,
    /// Checks for which it is no candidate, since growth did not help it.
    pub rest: u16,
    /// Checks since it gained its highest SH band; `u16::MAX` if it began with it.
    pub band_checks: u16,
    /// Whether it has given back SH bands, and gains no more.
    pub bands_settled: bool,
    /// Where growth is measured: loss that it carried at the last check; 0: unknown.
    pub error: f32,
}

impl SplatHistory {
    /// A splat of the initial model, which is never fresh.
    pub fn first(ceiling: u16) -> Self {
        Self {
            ceiling,
            prune_count: 0,
            checks: FRESH_CHECKS,
            trial: Trial::None,
            rest: 0,
            band_checks: u16::MAX,
            bands_settled: false,
            error: 0.0,
        }
    }

    /// The history of a half of this splat.
    pub fn half(self) -> Self {
        Self { prune_count: 0, checks: 0, error: self.error / 2.0, ..self }
    }

    /// Whether it is too young for its statistics to be used.
    pub fn is_fresh(self) -> bool {
        self.checks < FRESH_CHECKS
    }
}
