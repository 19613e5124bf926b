//! Arguments of `litetex train`, and how they change the settings of a run.

use super::capture_args::{CaptureArgs, set};
use super::training_values::{Background, parse_backdrop, parse_background, parse_exposure, parse_filter};
use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use litetex_gs::console::values::{parse_count, parse_duration_secs, parse_whole};
use litetex_gs::model::Filter;
use litetex_gs::run::{InitSource, Profile, RunConfig, SaveImages};
use litetex_gs::train::density::Components;
use litetex_gs::train::{Backdrop, Exposure, Policy, TrainConfig, policies};
use litetex_gs::{Error, Result};
use std::path::PathBuf;

fn policy_help() -> String {
    format!("How splats and texels are allocated: {} [default: litetex]", policies())
}

/// The names of the profiles, with their help.
fn profile_parser() -> impl TypedValueParser<Value = Profile> {
    let names = Profile::ALL.map(|profile| PossibleValue::new(profile.name()).help(profile.help()));
    PossibleValuesParser::new(names).try_map(|name| name.parse::<Profile>())
}

/// Train a scene from a capture
///
/// Reads photos with poses (a COLMAP model or transforms.json), optimises textured 2D Gaussian splats, evaluates them on
/// test views and writes a run folder: config.toml, metrics.jsonl, summary.json, checkpoints and images. Ctrl-C saves;
/// --resume continues.
// The last of repeated flags wins, so that the variants of a benchmark override what its runs have in common.
#[derive(clap::Args, Clone, Debug, Default)]
#[command(args_override_self = true)]
pub struct TrainArgs {
    /// Folder of the capture
    pub capture: Option<PathBuf>,
    /// Folder of the run
    #[arg(long, short, value_name = "RUN")]
    pub out: Option<PathBuf>,
    /// Replace the run in the folder and the files of --export; other files are kept. With --resume CHECKPOINT in the
    /// folder of its run: delete the later checkpoints and evaluations instead of the run
    #[arg(long)]
    pub force: bool,
    /// Continue a run from its last checkpoint, or from a given one [default: the run of --out]
    #[arg(long, value_name = "RUN|CHECKPOINT", num_args = 0..=1)]
    pub resume: Option<Option<PathBuf>>,
    /// File of settings like a run's config.toml; flags override it, and it overrides the defaults
    #[arg(long, value_name = "FILE")]
    pub config: Option<PathBuf>,
    /// Also write the trained scene as an asset; several files may follow. "litetex export" has more options
    #[arg(long, value_name = "FILE", num_args = 1..)]
    pub export: Vec<PathBuf>,
    /// Show the model in the browser while it trains, and its result until Ctrl-C; costs 3 % of the time at most
    #[arg(long, help_heading = "Viewer")]
    pub view: bool,
    /// Port of the page's address [default: any that is free]
    #[arg(long, value_name = "N", requires = "view", value_parser = clap::value_parser!(u16).range(1..), help_heading = "Viewer")]
    pub view_port: Option<u16>,
    /// Print the address without opening the browser, on whose command line other users of the machine may see it
    #[arg(long, requires = "view", help_heading = "Viewer")]
    pub no_open: bool,
    /// Stop at once when standard input ends: "litetex-lab bench" starts its runs this way
    #[arg(long, hide = true)]
    pub end_with_stdin: bool,
    /// Device to compute on: auto, gpu, or a name listed by "litetex devices"
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
    /// Number of steps; all schedules scale with it [default: 30000]
    #[arg(long, visible_alias = "iterations", value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    pub steps: Option<u32>,
    /// Stop early after this much training time: 90s, 20m, 1h30m [default: no limit]
    #[arg(long, value_name = "TIME", value_parser = parse_duration_secs)]
    pub max_time: Option<f64>,
    /// Seed of all random numbers [default: 42]
    #[arg(long, value_name = "N", value_parser = parse_whole::<u64>)]
    pub seed: Option<u64>,
    /// Highest degree of the spherical harmonics, 0 to 3 [default: 3]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(0..=3))]
    pub sh_degree: Option<u32>,
    /// Named set of defaults [default: default]
    #[arg(long, value_name = "NAME", value_parser = profile_parser())]
    pub profile: Option<Profile>,
    #[arg(long, alias = "texture", value_name = "POLICY", help = policy_help())]
    pub policy: Option<Policy>,
    /// Parts of the method to switch off: scheduler, pruning, growth, update-rule, splitting, coarsening
    #[arg(long, value_name = "PART,...", value_delimiter = ',', value_parser = Components::NAMES)]
    pub without: Vec<String>,
    /// Parts of the method to switch on again
    #[arg(long, value_name = "PART,...", value_delimiter = ',', value_parser = Components::NAMES)]
    pub with: Vec<String>,
    /// Any setting of config.toml by name, such as density.quantile=0.8; may be repeated
    #[arg(long = "set", value_name = "KEY=VALUE")]
    pub settings: Vec<String>,
    /// Largest number of splats
    #[arg(long, value_name = "N", value_parser = parse_count, help_heading = "Budget")]
    pub max_splats: Option<usize>,
    /// Largest number of texels
    #[arg(long, value_name = "N", value_parser = parse_count, help_heading = "Budget")]
    pub max_texels: Option<usize>,
    /// Largest number of parameters, such as 500k or 5M: a splat has 58 at SH degree 3 and 22 at degree 1, a texture map 2 and 3 per texel
    #[arg(long, value_name = "N", value_parser = parse_count, help_heading = "Budget")]
    pub budget_params: Option<usize>,
    /// End growth, and give parameters back, where 10 % of them improve the training views by less than this, dB of PSNR; 0: neither
    #[arg(long, value_name = "DB", help_heading = "Budget")]
    pub need: Option<f64>,
    /// Initialise from at most this many points, chosen at random
    #[arg(long, value_name = "N", value_parser = parse_count)]
    pub max_points: Option<usize>,
    /// Initial points: auto (the capture's; where they are few, more found in the photos; random if none are found), sfm
    /// (the capture's only), ply:FILE, random:N [default: auto]
    #[arg(long, value_name = "SOURCE")]
    pub init: Option<InitSource>,
    /// Large splats behind the points, where rays of the training views meet none, such as the sky: auto (not if photos
    /// have transparent pixels) or none [default: auto]
    #[arg(long, value_name = "WHERE", value_parser = parse_backdrop)]
    pub backdrop: Option<Backdrop>,
    /// Photos of different exposure or white balance: affine (estimate an affine colour map for each training photo) or
    /// none [default: none]
    #[arg(long, value_name = "HOW", value_parser = parse_exposure)]
    pub exposure: Option<Exposure>,
    /// Low-pass filter in the image, which keeps splats narrower than a pixel from aliasing: ewa or none [default: ewa]
    #[arg(long, value_name = "NAME", value_parser = parse_filter)]
    pub filter: Option<Filter>,
    /// Colour of the background: black, white, #rrggbb, r,g,b from 0 to 1, or random (a new colour in each step, so that
    /// transparent parts of photos stay empty; test images and exports have black) [default: black]
    #[arg(long, value_name = "COLOUR", value_parser = parse_background)]
    pub background: Option<Background>,
    /// Evaluate the test views every N steps; 0: only at the end [default: 0]
    #[arg(long, value_name = "N", help_heading = "Output")]
    pub eval_every: Option<u32>,
    /// Save a checkpoint every N steps; 0: only at the end [default: 0]
    #[arg(long, value_name = "N", help_heading = "Output")]
    pub save_every: Option<u32>,
    /// Keep the images of every evaluation, not only of the last
    #[arg(long, conflicts_with = "no_save_images", help_heading = "Output")]
    pub save_images: bool,
    /// Write no images of test views
    #[arg(long, help_heading = "Output")]
    pub no_save_images: bool,
}

impl TrainArgs {
    /// Overwrites the settings of `config` whose flags were given.
    ///
    /// # Errors
    /// [`Error::Usage`] for an unknown setting or a contradiction.
    pub fn apply(&self, config: &mut RunConfig) -> Result<()> {
        let t = &self.training;
        if let Some(profile) = t.profile {
            config.profile = profile;
            profile.apply(&mut config.train);
        }
        for setting in &t.settings {
            config.set(setting)?;
        }
        if let Some(need) = t.need {
            config.train.density.need_db = need;
            config.train.density.give_back_db = need;
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
        set(&mut config.train.backdrop, t.backdrop);
        set(&mut config.train.exposure, t.exposure);
        set(&mut config.train.filter, t.filter);
        if let Some(background) = t.background {
            config.train.random_background = background == Background::Random;
            config.train.background = background.in_images();
        }
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
        config.follow_background();
        config.check().map_err(Error::Usage)
    }

    fn switch_components(&self, config: &mut TrainConfig) -> Result<()> {
        let t = &self.training;
        for (names, on) in [(&t.without, false), (&t.with, true)] {
            for name in names {
                if on && t.without.contains(name) {
                    return Err(Error::Usage(format!("--with and --without both name {name:?}")));
                }
                if let Some(switch) = config.components.switch(name) {
                    *switch = on;
                }
                if on && config.active_components().switch(name) == Some(&mut false) {
                    let policy = config.policy;
                    return Err(Error::Usage(format!(
                        "--with {name}: the policy {policy} has no such part; choose another policy, such as litetex"
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
    fn a_profile_resets_settings_of_an_earlier_profile() {
        let fresh = |flags: &str| over(RunConfig::default(), flags).unwrap();
        for first in ["paper", "authors", "cat", "fast"] {
            let before = fresh(&format!("--profile {first} --without pruning --steps 77 --budget-params 5k"));
            assert_ne!(
                before.train,
                fresh("--steps 77 --budget-params 5k").train,
                "{first} equals the default"
            );
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
    fn switches_without_effect_are_refused() {
        let refused = |flags: &str, part: &str| {
            let error = over(RunConfig::default(), flags).unwrap_err();
            assert!(error.exit_code() == 2 && error.to_string().contains(part), "{error}");
        };
        refused("--policy cat", "--profile cat");
        refused("--profile cat --with pruning", "the policy cat has no such part");
        refused("--policy plain --with splitting", "the policy plain has no such part");
        refused("--with growth --without growth", "--with and --without both");
        assert!(over(RunConfig::default(), "--with growth --without pruning").is_ok());
        let cat = over(RunConfig::default(), "--profile cat").unwrap();
        assert!(over(cat, "--policy litetex --with scheduler").is_ok());
    }
}
