//! Policies: how splats and texels are allocated. What the rest of the program asks of one is in its [`PolicySpec`].

use super::geometry::{TEXELS_MAX, first_texel_size};
use super::ops::map::Moments;
use super::rule::paper::Variant;
use super::sizes::MapRule;
use super::stats::ErrorMeasure;
use serde::{Deserialize, Serialize};
use std::fmt;
use std::str::FromStr;

/// How splats and texels are allocated.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub enum Policy {
    /// Splits, finer maps and SH bands compete by the error that they are expected to remove per parameter.
    Litetex,
    /// R x R texels for every splat; splats as with `litetex`.
    Fixed(u16),
    /// No textures; splats as with `litetex`.
    None,
    /// 2DGS-MCMC: no textures, splats are relocated and added by error (method 6.12).
    Plain,
    /// The published rule: high-error splats are split if they are long, else refined. Part of the profile of that name.
    Paper,
    /// The same as in the program behind the published tables. Part of the profile of that name.
    Authors,
    /// Content-aware texturing, the ancestor: as `paper`, without scheduler, ceilings, pruning by
    /// contribution and resolution-aware rates. Part of the profile of that name.
    Cat,
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
    /// The rule of its density-control steps.
    pub rule: Rule,
    /// Last step of the published timetable after which the model grows.
    pub densify_until: u32,
    /// Opacity below which splats fade, or are relocated: at step 0 and at the last.
    pub opacity_floor: [f64; 2],
    /// [Components](super::Components) that the policy does not have, by name.
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

/// The rule by which density-control steps are decided.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Rule {
    /// Growth by error per parameter.
    Litetex,
    /// Growth as published.
    Paper(Variant),
    /// Relocation and growth by splits.
    Plain,
}

impl Policy {
    /// Every policy; one with a parameter stands for all its values.
    const ALL: [Self; 7] =
        [Self::Litetex, Self::Fixed(2), Self::Plain, Self::None, Self::Paper, Self::Authors, Self::Cat];

    /// What the policy decides.
    pub fn spec(self) -> PolicySpec {
        let litetex = PolicySpec {
            name: "litetex",
            help: Some("splits, finer maps and SH bands compete by error removed per parameter"),
            map_rule: MapRule::Adaptive,
            // Method 5.1: maps are offered like all else.
            first_map: FirstMap::None,
            rule: Rule::Litetex,
            // Authors' configuration (method 6.1).
            densify_until: 15_000,
            // Authors' code (method 6.3).
            opacity_floor: [0.015, 0.04],
            without: &[],
        };
        let paper = Variant { error: ErrorMeasure::Mean, moments: Moments::Kept, first_ceiling: 2 };
        let authors = Variant { error: ErrorMeasure::Mass, moments: Moments::Zero, first_ceiling: 32 };
        match self {
            Self::Litetex => litetex,
            Self::Fixed(side) => PolicySpec {
                name: FIXED,
                help: Some("R x R texels for each splat, R from 2 to 256"),
                map_rule: MapRule::Fixed(side),
                first_map: FirstMap::Spanning(side),
                ..litetex
            },
            Self::None => PolicySpec {
                name: "none",
                help: Some("no textures, splats as with litetex"),
                map_rule: MapRule::None,
                ..litetex
            },
            Self::Plain => PolicySpec {
                name: "plain",
                help: Some(
                    "no textures: 2DGS-MCMC, 2D Gaussian splatting with MCMC-style relocation, the baseline",
                ),
                map_rule: MapRule::None,
                first_map: FirstMap::None,
                rule: Rule::Plain,
                // Method 6.12; 3DGS-MCMC: 25,000.
                densify_until: 20_000,
                // 3DGS-MCMC; not measured.
                opacity_floor: [0.005; 2],
                without: &["splitting", "growth", "pruning"],
            },
            Self::Paper => PolicySpec {
                name: "paper",
                help: None,
                first_map: FirstMap::Covering,
                rule: Rule::Paper(paper),
                ..litetex
            },
            Self::Authors => PolicySpec { name: "authors", rule: Rule::Paper(authors), ..Self::Paper.spec() },
            Self::Cat => PolicySpec {
                name: "cat",
                help: None,
                first_map: FirstMap::Spanning(8),
                rule: Rule::Paper(authors),
                densify_until: 25_000,
                opacity_floor: [1.0 / 255.0; 2],
                without: &["scheduler", "pruning", "growth", "update-rule"],
                ..litetex
            },
        }
    }

    /// Initial map ceiling, texels per side. Default 2 (paper, Adaptive Per-Gaussian Texture Optimization; method 6.7).
    pub fn first_ceiling(self, has_ceilings: bool) -> u16 {
        match self.spec().rule {
            _ if !has_ceilings => TEXELS_MAX,
            Rule::Paper(variant) => variant.first_ceiling,
            Rule::Litetex | Rule::Plain => 2,
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
    use super::super::Components;
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
