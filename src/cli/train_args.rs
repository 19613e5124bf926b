//! Arguments of `litetex train`, and how they change the settings of a run.

use super::capture_args::{CaptureArgs, set, set_some};
use super::training_values::{Background, View, parse_background, parse_view};
use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use litetex_gs::console::values::{parse_count, parse_decibels, parse_duration_secs, parse_whole, whole};
use litetex_gs::run::{InitSource, Profile, RunConfig};
use litetex_gs::train::density::Components;
use litetex_gs::train::{Policy, policies};
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
    /// Show the model in the browser while it trains, and its result until Ctrl-C; costs 3 % of the time at most. With "=no-open",
    /// only print the address, since other users of the machine may see the browser's command line; with "=PORT", the same on
    /// this port
    #[arg(long, value_name = "no-open|PORT", num_args = 0..=1, require_equals = true, default_missing_value = "open", value_parser = parse_view)]
    pub view: Option<View>,
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
    #[arg(long, visible_alias = "iterations", value_name = "N", value_parser = whole::<u32>(1..=u64::MAX))]
    pub steps: Option<u32>,
    /// Time from start to exit, --export not counted: 90s, 20m, 1h30m. Steps and image size are chosen for this device; the
    /// run's config.toml repeats them without a clock [default, without --steps, --config and a published profile: 15m
    /// without a GPU, 5m with one]
    #[arg(long, value_name = "TIME", value_parser = parse_duration_secs, conflicts_with_all = ["steps", "config"])]
    pub time: Option<f64>,
    /// Seed of all random numbers [default: 42]
    #[arg(long, value_name = "N", value_parser = parse_whole::<u64>)]
    pub seed: Option<u64>,
    /// Named set of defaults [default: default]
    #[arg(long, value_name = "NAME", value_parser = profile_parser())]
    pub profile: Option<Profile>,
    #[arg(long, alias = "texture", value_name = "POLICY", help = policy_help())]
    pub policy: Option<Policy>,
    /// Parts of the method to switch off: scheduler, pruning, growth, update-rule, splitting, coarsening
    #[arg(long, value_name = "PART,...", value_delimiter = ',', value_parser = Components::NAMES)]
    pub without: Vec<String>,
    /// Any setting of config.toml by name, such as sh-degree=2, exposure=affine, budget.max-splats=50000, save-every=5000,
    /// save-images=none, capture.mask-invert=true or density.quantile=0.8; may be repeated
    #[arg(long = "set", value_name = "KEY=VALUE")]
    pub settings: Vec<String>,
    /// Largest number of parameters, such as 500k or 5M: a splat has 58 at SH degree 3 and 22 at degree 1, a texture map 2 and 3 per texel
    #[arg(long, value_name = "N", value_parser = parse_count, help_heading = "Budget")]
    pub budget_params: Option<usize>,
    /// End growth, and prune, where 10 % of the parameters improve the training views by less than this, dB of PSNR; 0: neither
    #[arg(long, value_name = "DB", value_parser = parse_decibels, help_heading = "Budget")]
    pub need: Option<f64>,
    /// Initial points: auto (the capture's; where they are few, more found in the photos; random if none are found), sfm
    /// (the capture's only), ply:FILE, random:N [default: auto]
    #[arg(long, value_name = "SOURCE")]
    pub init: Option<InitSource>,
    /// Colour of the background: black, white, #rrggbb, r,g,b from 0 to 1, or random (a new colour in each step, so that
    /// transparent parts of photos stay empty; test images and exports have black) [default: black]
    #[arg(long, value_name = "COLOUR", value_parser = parse_background)]
    pub background: Option<Background>,
    /// Evaluate the test views every N steps; 0: only at the end [default: 0]
    #[arg(long, value_name = "N", value_parser = parse_whole::<u32>, help_heading = "Output")]
    pub eval_every: Option<u32>,
}

impl TrainArgs {
    /// Whether nothing says how long the training should be.
    pub fn says_no_length(&self) -> bool {
        let t = &self.training;
        let is_usual = t.profile.is_none_or(|profile| profile == Profile::Default);
        let sets_steps = t.settings.iter().any(|setting| setting.trim_start().starts_with("steps"));
        t.steps.is_none() && t.time.is_none() && self.config.is_none() && is_usual && !sets_steps
    }

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
        if let Some(need) = t.need {
            config.train.density.need_db = need;
            config.train.density.prune_db = need;
        }
        set_some(&mut config.train.budget.max_params, &t.budget_params);
        if let Some(steps) = t.steps {
            // A number of steps is a plan of its own.
            config.train.steps = steps;
            config.train.plan.clear();
            config.time_secs = None;
        }
        set_some(&mut config.time_secs, &t.time);
        set(&mut config.train.seed, t.seed);
        set(&mut config.train.policy, t.policy);
        for name in &t.without {
            if let Some(switch) = config.train.components.switch(name) {
                *switch = false;
            }
        }
        if let Some(background) = t.background {
            config.train.random_background = background == Background::Random;
            config.train.background = background.in_images();
        }
        set(&mut config.train.eval_every, t.eval_every);
        set(&mut config.init, t.init.clone());
        if self.capture.is_some() {
            config.data.clone_from(&self.capture);
        }
        self.capture_args.apply(&mut config.capture);
        for setting in &t.settings {
            config.set(setting)?;
        }
        config.follow_background();
        config.check().map_err(Error::Usage)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::Parser as _;
    use litetex_gs::model::Filter;
    use litetex_gs::run::SaveImages;
    use litetex_gs::train::density::DensityConfig;
    use litetex_gs::train::{Backdrop, Exposure};

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
        for first in ["paper", "authors", "cat"] {
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
        assert!(paper.policy == Policy::Paper && paper.rates.position_random == paper.rates.position);
        assert_eq!(fresh("").train.density, DensityConfig::default());
    }

    #[test]
    fn parts_are_switched_off() {
        let refused = |flags: &str, part: &str| {
            let error = over(RunConfig::default(), flags).unwrap_err();
            assert!(error.exit_code() == 2 && error.to_string().contains(part), "{error}");
        };
        refused("--policy cat", "--profile cat");
        let without = over(RunConfig::default(), "--without growth,pruning").unwrap().train.components;
        assert!(!without.growth && !without.pruning && without.splitting);
    }

    #[test]
    fn set_reaches_what_has_no_flag() {
        let settings = "sh-degree=1 max-points=5 budget.max-splats=9 budget.max-texels=8 filter=none backdrop=none \
                        exposure=affine save-every=3 save-images=none capture.mask-invert=true \
                        capture.format=colmap capture.image-cache-bytes=1024";
        let flags: String = settings.split_whitespace().map(|setting| format!("--set {setting} ")).collect();
        let RunConfig { train, capture, max_points, save_images, .. } =
            over(RunConfig::default(), &flags).unwrap();
        assert_eq!((train.sh_degree, train.save_every, max_points), (1, 3, Some(5)));
        assert_eq!((train.budget.max_splats, train.budget.max_texels), (Some(9), Some(8)));
        assert_eq!(
            (train.filter, train.backdrop, train.exposure),
            (Filter::None, Backdrop::None, Exposure::Affine)
        );
        assert_eq!((capture.mask_invert, capture.image_cache_bytes), (true, 1024));
        assert!(capture.format.is_some() && save_images == SaveImages::None);
    }
}
