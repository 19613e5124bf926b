//! Policies: how splats and texels are allocated. What the rest of the program asks of one is in its [`PolicySpec`].

use super::density::{DensityConfig, MapRule, first_texel_size};
use serde::{Deserialize, Serialize};
use std::fmt;
use std::str::FromStr;

/// How splats and texels are allocated.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub enum Policy {
    /// High-error splats are refined or split (LiteTex-GS).
    Litetex,
    /// Content-aware texturing, the ancestor: as `litetex`, without scheduler, ceilings, pruning by
    /// contribution and resolution-aware rates. Part of the profile of that name.
    Cat,
    /// R x R texels for every splat; splats as with `litetex`.
    Fixed(u16),
    /// 2DGS-MCMC: no textures, splats are relocated and added by error (method 6.12).
    Plain,
    /// No textures; splats as with `litetex`.
    None,
}

/// What a policy decides.
#[derive(Clone, Copy, Debug)]
pub struct PolicySpec {
    /// Its name; that of a policy with a parameter ends before it.
    pub name: &'static str,
    /// What the help says of it; `None`: it is part of a profile and not offered.
    pub help: Option<&'static str>,
    /// The rule that sets the sizes of maps.
    pub map_rule: MapRule,
    /// The initial maps.
    pub first_map: FirstMap,
    /// What a density-control step does.
    pub step: DensityStep,
    /// [Components](super::density::Components) that the policy does not have, by name.
    pub without: &'static [&'static str],
}

/// The initial map of a splat.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FirstMap {
    /// None.
    None,
    /// 2 x 2 texels that reach beyond the support (paper, Adaptive Per-Gaussian Texture Optimization).
    Covering,
    /// A square of this side, whose outermost texel centres lie at the ends of the support (CAT).
    Spanning(u16),
}

impl FirstMap {
    /// Side, in texels.
    pub fn side(self) -> u16 {
        match self {
            Self::None => 0,
            Self::Covering => 2,
            Self::Spanning(side) => side,
        }
    }

    /// Edge of a texel on a splat whose support has this half extent, in its unit.
    pub fn texel_size(self, half_extent: f64) -> f64 {
        match self {
            Self::None => 0.0,
            Self::Covering => first_texel_size([half_extent; 2]),
            Self::Spanning(side) => 2.0 * half_extent / f64::from(side - 1),
        }
    }
}

/// What a density-control step does.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DensityStep {
    /// Prunes, refines, coarsens, splits.
    Decide,
    /// Relocates splats and adds some, up to the budget.
    Relocate,
}

/// Fewest steps between steps that decide, but at most a thirtieth of the run: an epoch of fewer views would let maps grow
/// more often (measured: choices 13). Where growth is drawn, half as many.
const FEWEST_STEPS: u32 = 35;

impl DensityStep {
    /// The published interval, and the lower bound to which a run of `steps` shortens it: an epoch, within bounds. Growth that
    /// `is_drawn` is as frequent as that of `plain`, except with few views.
    pub fn interval(
        self,
        is_drawn: bool,
        config: &DensityConfig,
        steps: u32,
        train_views: usize,
    ) -> (u32, u32) {
        let fewest = (steps / 30).clamp(1, FEWEST_STEPS);
        let (published, fewest, most) = match self {
            Self::Decide if is_drawn => (config.relocate_interval, fewest.div_ceil(2), 25),
            Self::Decide => (config.interval, fewest, 50),
            Self::Relocate => (config.relocate_interval, 1, 25),
        };
        (published, (train_views as u32).clamp(fewest, most).min(published.max(1)))
    }

    /// Last step of the published timetable after which splats are added.
    pub fn until(self, config: &DensityConfig) -> u32 {
        match self {
            Self::Decide => config.densify_until,
            Self::Relocate => config.relocate_until,
        }
    }

    /// How far growth may exceed a budget of parameters, as a factor.
    pub fn overshoot(self, config: &DensityConfig) -> f64 {
        match self {
            Self::Decide => config.overshoot,
            Self::Relocate => config.relocate_overshoot,
        }
    }
}

impl Policy {
    /// Every policy; one with a parameter stands for all its values.
    const ALL: [Self; 5] = [Self::Litetex, Self::Fixed(2), Self::Plain, Self::None, Self::Cat];

    /// What the policy decides.
    pub fn spec(self) -> PolicySpec {
        let litetex = PolicySpec {
            name: "litetex",
            help: Some("high-error splats are refined or split"),
            map_rule: MapRule::Adaptive,
            first_map: FirstMap::Covering,
            step: DensityStep::Decide,
            without: &[],
        };
        match self {
            Self::Litetex => litetex,
            Self::Cat => PolicySpec {
                name: "cat",
                help: None,
                first_map: FirstMap::Spanning(8),
                without: &["scheduler", "pruning", "growth", "update-rule"],
                ..litetex
            },
            Self::Fixed(side) => PolicySpec {
                name: FIXED,
                help: Some("R x R texels for each splat, R from 2 to 256"),
                map_rule: MapRule::Fixed(side),
                first_map: FirstMap::Spanning(side),
                ..litetex
            },
            Self::Plain => PolicySpec {
                name: "plain",
                help: Some(
                    "no textures: 2DGS-MCMC, 2D Gaussian splatting with MCMC-style relocation, the baseline",
                ),
                map_rule: MapRule::None,
                first_map: FirstMap::None,
                step: DensityStep::Relocate,
                without: &["splitting", "growth", "pruning"],
            },
            Self::None => PolicySpec {
                name: "none",
                help: Some("no textures, splats as with litetex"),
                map_rule: MapRule::None,
                first_map: FirstMap::None,
                ..litetex
            },
        }
    }

    /// Texels of each initial splat.
    pub fn first_texels_each(self) -> usize {
        usize::from(self.spec().first_map.side()).pow(2)
    }
}

/// Name of [`Policy::Fixed`] up to its parameter.
const FIXED: &str = "fixed:";

/// The policies on offer, with what the help says of them.
pub fn policies() -> String {
    let spec = |policy: Policy| (policy, policy.spec());
    let all = Policy::ALL.map(spec).into_iter();
    let each = all.filter_map(|(policy, spec)| Some(format!("{} ({})", name_on_offer(policy), spec.help?)));
    each.collect::<Vec<_>>().join("; ")
}

/// The name of a policy, with R for a parameter.
fn name_on_offer(policy: Policy) -> String {
    match policy {
        Policy::Fixed(_) => format!("{FIXED}R"),
        _ => policy.to_string(),
    }
}

impl FromStr for Policy {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let found = match text.strip_prefix(FIXED) {
            Some(side) => side.parse().ok().filter(|side| (2..=256).contains(side)).map(Self::Fixed),
            None => Self::ALL.into_iter().find(|policy| policy.spec().name == text),
        };
        if let Some(policy) = found {
            return Ok(policy);
        }
        let on_offer = Self::ALL.into_iter().filter(|policy| policy.spec().help.is_some());
        let names: Vec<String> = on_offer.map(name_on_offer).collect();
        Err(format!("{text:?}: expected one of {}, with R from 2 to 256", names.join(", ")))
    }
}

impl fmt::Display for Policy {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Fixed(side) => write!(f, "{FIXED}{side}"),
            _ => f.write_str(self.spec().name),
        }
    }
}

impl TryFrom<String> for Policy {
    type Error = String;

    fn try_from(text: String) -> Result<Self, String> {
        text.parse()
    }
}

impl From<Policy> for String {
    fn from(policy: Policy) -> Self {
        policy.to_string()
    }
}

#[cfg(test)]
mod tests {
    use super::super::density::Components;
    use super::*;

    #[test]
    fn names_round_trip_and_excluded_components_exist() {
        for policy in Policy::ALL.into_iter().chain([Policy::Fixed(256)]) {
            assert_eq!(policy.to_string().parse(), Ok(policy));
            for name in policy.spec().without {
                assert!(Components::default().switch(name).is_some(), "{policy}: {name}");
            }
        }
        for wrong in ["fixed:1", "fixed:257", "fixed:", "Litetex", ""] {
            let error = wrong.parse::<Policy>().unwrap_err();
            assert!(
                ["litetex", "fixed:R", "plain", "none"].iter().all(|name| error.contains(name)),
                "{error}"
            );
            assert!(!error.contains(" cat"), "{error}");
        }
    }
}
