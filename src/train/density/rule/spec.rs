//! What the trainer must know of a rule.

/// Share of the splats that a step may split where splats of any length are (method 6.6; 3DGS-MCMC: 0.05).
pub const SPLIT_RATE: f64 = 0.16;

/// How many splats a step may split.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum SplitShare {
    /// This share of the splats.
    Fixed(f64),
    /// What the frequency schedule asks for.
    Scheduled,
}

/// What the trainer must know of a rule besides its decisions.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RuleSpec {
    /// Settings of density control that it does not use, by name.
    pub unused: &'static [&'static str],
    /// Steps of the published timetable between density-control steps.
    pub interval: u32,
    /// Bounds of the steps between density-control steps, which last an epoch where that is within them.
    pub epoch: [u32; 2],
    /// How many splats a step may split.
    pub split_share: SplitShare,
    /// Whether splats of any length are split, or only those above [`DensityConfig::split_texels`](crate::train::density::DensityConfig::split_texels).
    pub splits_any_length: bool,
    /// Whether the user's budget is spent evenly until densification ends.
    pub is_paced: bool,
    /// Whether growth ends by need where that is asked for.
    pub ends_by_need: bool,
    /// Whether maps are cropped and padded between density-control steps.
    pub crops_between: bool,
}
