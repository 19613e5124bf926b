//! Arguments of `litetex train` as typed. What they mean is `config_file`'s and `train`'s business.

use super::capture::InitSource;
use super::capture_args::{CaptureArgs, set};
use super::config_file::RunConfig;
use super::profile::Profile;
use super::values::{parse_colour, parse_count, parse_duration_secs};
use litetex_gs::train::density::Components;
use litetex_gs::train::{Policy, TrainConfig};
use litetex_gs::{Error, Result};
use serde::{Deserialize, Serialize};
use std::path::PathBuf;

/// Train a scene from a capture
///
/// Reads photos with poses (a COLMAP model or transforms.json), optimises textured 2D Gaussians, evaluates
/// them on held-out views and writes a run folder: config.toml, metrics.jsonl, summary.json, checkpoints
/// and images. Ctrl-C saves; --resume continues.
// Of a flag given twice the last holds: so a benchmark's variants win over what all its runs have in common.
#[derive(clap::Args, Clone, Debug, Default)]
#[command(args_override_self = true)]
pub struct TrainArgs {
    /// Folder of the capture
    pub capture: Option<PathBuf>,
    /// Folder of the run
    #[arg(long, short, value_name = "RUN")]
    pub out: Option<PathBuf>,
    /// Replace the run in a folder that is not empty; files that are not ours stay. With --resume CHECKPOINT
    /// inside its own run: delete the later checkpoints and evaluations
    #[arg(long)]
    pub force: bool,
    /// Continue a run from its last checkpoint, or from a given one [default: the run of --out]
    #[arg(long, value_name = "RUN|CHECKPOINT", num_args = 0..=1)]
    pub resume: Option<Option<PathBuf>>,
    /// Settings as in a run's config.toml; flags win over the file, the file over the defaults
    #[arg(long, value_name = "FILE")]
    pub config: Option<PathBuf>,
    /// Also write the trained scene as an asset; several may follow. "litetex export" has more options
    #[arg(long, value_name = "FILE", num_args = 1..)]
    pub export: Vec<PathBuf>,
    /// Stop at once when standard input ends: "litetex bench" starts its runs this way
    #[arg(long, hide = true)]
    pub end_with_stdin: bool,
    /// Where to compute: auto, gpu, or a name that "litetex devices" lists
    #[arg(long, value_name = "NAME", default_value = "auto", help_heading = "Device")]
    pub device: String,
    #[command(flatten)]
    pub training: TrainingArgs,
    #[command(flatten)]
    pub capture_args: CaptureArgs,
}

/// Flags that shape the optimisation.
#[derive(clap::Args, Clone, Debug, Default)]
#[command(next_help_heading = "Training")]
pub struct TrainingArgs {
    /// Steps; schedules are fractions of it [default: 30000]
    #[arg(long, visible_alias = "iterations", value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    pub steps: Option<u32>,
    /// Stop early after this much training time: 90s, 20m, 1h30m [default: no limit]
    #[arg(long, value_name = "TIME", value_parser = parse_duration_secs)]
    pub max_time: Option<f64>,
    /// Seed of everything random [default: 42]
    #[arg(long, value_name = "N")]
    pub seed: Option<u64>,
    /// Highest degree of the spherical harmonics, 0 to 3 [default: 3]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(0..=3))]
    pub sh_degree: Option<u32>,
    /// Set of defaults: default, paper (constants as published), authors, cat, fast [default: default]
    #[arg(long, value_name = "NAME")]
    pub profile: Option<Profile>,
    /// Who gets how many primitives and texels: litetex, cat, fixed:R (R x R texels each), plain (no
    /// textures, primitives by error) or none (no textures, primitives as with litetex) [default: litetex]
    #[arg(long, alias = "texture", value_name = "POLICY")]
    pub policy: Option<Policy>,
    /// Parts of the method to switch off: scheduler, pruning, growth, update-rule, splitting, coarsening
    #[arg(long, value_name = "PART,...", value_delimiter = ',', value_parser = Components::NAMES)]
    pub without: Vec<String>,
    /// Parts of the method to switch on again
    #[arg(long, value_name = "PART,...", value_delimiter = ',', value_parser = Components::NAMES)]
    pub with: Vec<String>,
    /// Any setting of config.toml by its name, such as density.quantile=0.8; may be repeated
    #[arg(long = "set", value_name = "KEY=VALUE")]
    pub settings: Vec<String>,
    /// Never have more primitives than this
    #[arg(long, value_name = "N", value_parser = parse_count, help_heading = "Budget")]
    pub max_splats: Option<usize>,
    /// Never have more texels than this
    #[arg(long, value_name = "N", value_parser = parse_count, help_heading = "Budget")]
    pub max_texels: Option<usize>,
    /// Never have more parameters than this: 59 a primitive and 3 a texel; 500k, 5M
    #[arg(long, value_name = "N", value_parser = parse_count, help_heading = "Budget")]
    pub budget_params: Option<usize>,
    /// Thin the points to start from to this many, at random
    #[arg(long, value_name = "N", value_parser = parse_count)]
    pub max_points: Option<usize>,
    /// Where primitives start: auto (points of the capture, else random), sfm, ply:FILE, random:N [default: auto]
    #[arg(long, value_name = "START")]
    pub init: Option<InitSource>,
    /// Colour behind everything: black, white, #rrggbb or r,g,b from 0 to 1 [default: black]
    #[arg(long, value_name = "COLOUR", value_parser = parse_colour)]
    pub background: Option<[f32; 3]>,
    /// Evaluate the test views each N steps, 0: only at the end [default: 0]
    #[arg(long, value_name = "N", help_heading = "Output")]
    pub eval_every: Option<u32>,
    /// Save a checkpoint each N steps, 0: only at the end [default: 0]
    #[arg(long, value_name = "N", help_heading = "Output")]
    pub save_every: Option<u32>,
    /// Keep the images of every evaluation, not only of the last
    #[arg(long, conflicts_with = "no_save_images", help_heading = "Output")]
    pub save_images: bool,
    /// Write no images of test views
    #[arg(long, help_heading = "Output")]
    pub no_save_images: bool,
}

/// Which evaluations leave images.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum SaveImages {
    /// None.
    None,
    /// The latest.
    #[default]
    Last,
    /// All.
    All,
}

impl TrainArgs {
    /// Writes what was given over `config`.
    ///
    /// # Errors
    /// [`litetex_gs::Error::Usage`] for a setting that there is not.
    pub fn apply(&self, config: &mut RunConfig) -> Result<()> {
        let t = &self.training;
        if let Some(profile) = t.profile {
            config.profile = profile;
            profile.apply(&mut config.train);
        }
        for setting in &t.settings {
            config.set(setting)?;
        }
        let budget = &mut config.train.budget;
        for (to, from) in [
            (&mut budget.max_splats, t.max_splats),
            (&mut budget.max_texels, t.max_texels),
            (&mut budget.max_params, t.budget_params),
            (&mut config.max_points, t.max_points),
        ] {
            *to = from.or(*to);
        }
        set(&mut config.train.steps, t.steps);
        set(&mut config.train.seed, t.seed);
        set(&mut config.train.sh_degree, t.sh_degree);
        set(&mut config.train.policy, t.policy);
        self.switch_components(&mut config.train)?;
        set(&mut config.train.background, t.background);
        set(&mut config.train.eval_every, t.eval_every);
        set(&mut config.train.save_every, t.save_every);
        set(&mut config.init, t.init.clone());
        if t.max_time.is_some() {
            config.train.max_time_secs = t.max_time;
        }
        if t.save_images {
            config.save_images = SaveImages::All;
        }
        if t.no_save_images {
            config.save_images = SaveImages::None;
        }
        if self.capture.is_some() {
            config.data.clone_from(&self.capture);
        }
        self.capture_args.apply(&mut config.capture);
        // Alpha is composited on the colour that is rendered behind everything.
        config.capture.background = config.train.background;
        Ok(())
    }

    fn switch_components(&self, config: &mut TrainConfig) -> Result<()> {
        let t = &self.training;
        for (names, on) in [(&t.without, false), (&t.with, true)] {
            for name in names {
                if on && t.without.contains(name) {
                    return Err(Error::Usage(format!("{name:?} is given to both --with and --without")));
                }
                if let Some(switch) = config.components.switch(name) {
                    *switch = on;
                }
                if on && config.active_components().switch(name) == Some(&mut false) {
                    let policy = config.policy;
                    return Err(Error::Usage(format!(
                        "--with {name}: the policy {policy} is without it; choose another policy, such as litetex"
                    )));
                }
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::Parser as _;
    use litetex_gs::train::density::DensityConfig;

    #[derive(clap::Parser)]
    struct Line {
        #[command(flatten)]
        args: TrainArgs,
    }

    /// What flags make of settings.
    fn over(mut config: RunConfig, flags: &str) -> Result<RunConfig> {
        let line = Line::try_parse_from(["train"].into_iter().chain(flags.split_whitespace())).unwrap();
        line.args.apply(&mut config)?;
        Ok(config)
    }

    #[test]
    fn a_profile_leaves_nothing_of_another() {
        let fresh = |flags: &str| over(RunConfig::default(), flags).unwrap();
        for first in ["paper", "authors", "cat", "fast"] {
            let before = fresh(&format!("--profile {first} --without pruning --steps 77 --budget-params 5k"));
            assert_ne!(before.train, fresh("--steps 77 --budget-params 5k").train, "{first} is no default");
            for then in ["default", "paper", "cat"] {
                let after = over(before.clone(), &format!("--profile {then}")).unwrap();
                let expected = fresh(&format!("--profile {then} --steps 77 --budget-params 5k"));
                assert_eq!(after, expected, "{then} over {first}");
            }
        }
        let paper = fresh("--profile paper").train;
        assert!(!paper.density.respawn && paper.rates.position_random == paper.rates.position);
        assert_eq!(fresh("").train.density, DensityConfig::default());
    }

    #[test]
    fn switches_that_would_do_nothing_are_refused() {
        let refused = |flags: &str, part: &str| {
            let error = over(RunConfig::default(), flags).unwrap_err();
            assert!(error.exit_code() == 2 && error.to_string().contains(part), "{error}");
        };
        refused("--policy cat --with scheduler", "the policy cat is without it");
        refused("--profile cat --with pruning", "the policy cat is without it");
        refused("--policy plain --with splitting", "the policy plain is without it");
        refused("--with growth --without growth", "both --with and --without");
        assert!(over(RunConfig::default(), "--with growth --without pruning").is_ok());
        let cat = over(RunConfig::default(), "--policy cat").unwrap();
        assert!(over(cat, "--policy litetex --with scheduler").is_ok());
    }
}
