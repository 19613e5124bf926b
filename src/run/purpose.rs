//! What a scene is trained for: for pages, which draw textures, or for engines and viewers that know none.

use super::config::RunConfig;
use super::profile::Profile;
use crate::Result;
use crate::model::Filter;
use crate::train::{Policy, TrainConfig};
use std::str::FromStr;

/// Most splats of a scene for engines if no budget is given: the policy `plain` needs an end of its growth, and engines draw every
/// splat of a file. Measured: fox, 480 pixels, 1,000 steps, SPZ: 29.38 dB with 20,600 splats, 29.73 with 30,000, 29.33 with 50,000,
/// 28.88 with 100,000.
const ENGINE_SPLATS_MAX: usize = 30_000;

/// The programs that shall show a scene.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Purpose {
    /// Those that draw textures: ours, in pages and of our web package.
    #[default]
    Page,
    /// Those that know no textures: game engines and viewers of SPZ and PLY files.
    Engine,
}

impl Purpose {
    /// Both.
    pub const ALL: [Self; 2] = [Self::Page, Self::Engine];

    /// Name on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Page => "page",
            Self::Engine => "engine",
        }
    }

    /// One line for people.
    pub fn help(self) -> &'static str {
        match self {
            Self::Page => "Programs that draw textures: pages by litetex, its web package",
            Self::Engine => {
                "Programs without textures, such as game engines: policy plain, full SH, at most 30,000 splats unless a \
                 budget is given"
            }
        }
    }

    /// Replaces the settings that the purpose decides, of an earlier purpose too; all others stay.
    ///
    /// # Errors
    /// [`crate::Error::Usage`] if the settings are those of a profile with a policy of its own.
    pub fn apply(self, config: &mut RunConfig) -> Result<()> {
        if Profile::of(config.train.policy).is_some() {
            let (name, profile) = (self.name(), config.profile.name());
            return Err(usage!(
                "--for {name}: not with the profile {profile}, which has a policy of its own; leave one of them out"
            ));
        }
        let fresh = TrainConfig::default();
        let train = &mut config.train;
        (train.policy, train.filter) = (fresh.policy, fresh.filter);
        train.density.sh_below = fresh.density.sh_below;
        if self == Self::Engine {
            train.policy = Policy::Plain;
            // Files without textures have room for all bands of every splat. Those of no use are pruned after growth.
            train.density.sh_below = 0.0;
            train.filter = Filter::Ewa;
        }
        Ok(())
    }

    /// Removes the end of growth that an earlier purpose gave; comes before all that replaces its policy.
    pub fn unbound_growth(train: &mut TrainConfig) {
        let budget = &mut train.budget;
        let is_ours = budget.max_splats == Some(ENGINE_SPLATS_MAX) && budget.max_params.is_none();
        if train.policy == Policy::Plain && is_ours {
            budget.max_splats = None;
        }
    }

    /// Gives growth an end where the purpose needs one and there is none.
    pub fn bound_growth(self, train: &mut TrainConfig) {
        let budget = &mut train.budget;
        if self == Self::Engine && budget.max_params.is_none() {
            budget.max_splats.get_or_insert(ENGINE_SPLATS_MAX);
        }
    }
}

impl FromStr for Purpose {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let found = Self::ALL.into_iter().find(|purpose| purpose.name() == text);
        found.ok_or_else(|| format!("{text:?}: expected {}", Self::ALL.map(Self::name).join(" or ")))
    }
}
