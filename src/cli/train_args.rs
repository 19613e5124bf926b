//! Arguments of `litetex train`, and how they change the settings of a run.

use super::capture_args::{CaptureArgs, set, set_some};
use super::training_values::{View, parse_view};
use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use litetex_gs::console::values::{
    parse_bytes, parse_count, parse_decibels, parse_duration_secs, parse_shard, parse_whole, whole,
};
use litetex_gs::run::{InitSource, Profile, Purpose, RunConfig};
use litetex_gs::train::{Policy, policies};
use litetex_gs::{Error, Result, usage};
use std::path::PathBuf;

fn policy_help() -> String {
    format!("How splats and texels are allocated: {} [default: litetex]", policies())
}

/// The names of the profiles, with their help.
fn profile_parser() -> impl TypedValueParser<Value = Profile> {
    let names = Profile::ALL.map(|profile| PossibleValue::new(profile.name()).help(profile.help()));
    PossibleValuesParser::new(names).try_map(|name| name.parse::<Profile>())
}

/// The purposes, with their help.
fn purpose_parser() -> impl TypedValueParser<Value = Purpose> {
    let names = Purpose::ALL.map(|purpose| PossibleValue::new(purpose.name()).help(purpose.help()));
    PossibleValuesParser::new(names).try_map(|name| name.parse::<Purpose>())
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
    /// Folder or ZIP archive of the capture; several are trained one after the other, each in a process of its own
    #[arg(value_name = "CAPTURE")]
    pub captures: Vec<PathBuf>,
    /// Folder of the run; of several captures, the folder of the runs, named after the captures, and of their table
    #[arg(long, short, value_name = "RUN")]
    pub out: Option<PathBuf>,
    /// Replace the run in the folder and the files of --export; other files are kept. With --resume CHECKPOINT in the
    /// folder of its run: delete the later checkpoints and evaluations instead of the run
    #[arg(long)]
    pub force: bool,
    /// Continue a run from its last checkpoint, or from a given one [default: the run of --out]
    #[arg(long, value_name = "RUN|CHECKPOINT", num_args = 0..=1)]
    pub resume: Option<Option<PathBuf>>,
    /// Continue the run in the folder if it is unfinished, leave it if it is finished, else start it. The command of a batch may be
    /// repeated with this until all is done
    #[arg(long, conflicts_with_all = ["resume", "force"])]
    pub resume_or_start: bool,
    /// Train only this part of several captures: 1/3, 2/3 and 3/3 divide them among three machines
    #[arg(long, value_name = "PART/PARTS", value_parser = parse_shard)]
    pub shard: Option<(usize, usize)>,
    /// File of settings like a run's config.toml; flags override it, and it overrides the defaults
    #[arg(long, value_name = "FILE")]
    pub config: Option<PathBuf>,
    /// Also write the trained scene as an asset; several files may follow. {name} stands for the name of the run's folder, {run}
    /// for its path: pages/{name}.html. "litetex export" has more options
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
    /// run's config.toml repeats them without a clock [default, without --steps, --config and a published profile: at most 15m
    /// without a GPU, 5m with one]
    #[arg(long, value_name = "TIME", value_parser = parse_duration_secs, conflicts_with_all = ["steps", "config"])]
    pub time: Option<f64>,
    /// Seed of all random numbers [default: 42]
    #[arg(long, value_name = "N", value_parser = parse_whole::<u64>)]
    pub seed: Option<u64>,
    /// Named set of defaults [default: default]
    #[arg(long, value_name = "NAME", value_parser = profile_parser())]
    pub profile: Option<Profile>,
    /// Programs that shall show the scene [default: page]
    #[arg(long = "for", value_name = "USE", value_parser = purpose_parser(), conflicts_with = "policy")]
    pub purpose: Option<Purpose>,
    #[arg(long, alias = "texture", value_name = "POLICY", help = policy_help())]
    pub policy: Option<Policy>,
    /// Any setting of config.toml by name, such as sh-degree=2, background=white, exposure=affine, components.pruning=false,
    /// budget.max-splats=50000, eval-every=1000, save-every=5000, save-images=none, capture.masks=FOLDER or capture.mask-invert=true; may be repeated
    #[arg(long = "set", value_name = "KEY=VALUE")]
    pub settings: Vec<String>,
    /// Largest number of parameters, such as 500k or 5M: a splat has 58 at SH degree 3 and 22 at degree 1, a texture map 2 and 3 per texel
    #[arg(long, value_name = "N", value_parser = parse_count, help_heading = "Budget")]
    pub budget_params: Option<usize>,
    /// Size of the .ltgs file that the run ends with, RUN/scene.ltgs, such as 200kB: the model is pruned to fit and trained with
    /// rounded numbers
    #[arg(long, value_name = "SIZE", value_parser = parse_bytes, help_heading = "Budget")]
    pub max_size: Option<u64>,
    /// End growth, and prune, where 10 % of the parameters improve the training views by less than this, dB of PSNR; 0: neither
    #[arg(long, value_name = "DB", value_parser = parse_decibels, help_heading = "Budget")]
    pub need: Option<f64>,
    /// Initial points: auto (the capture's; where they are few, more found in the photos; random if none are found), sfm
    /// (the capture's only), ply:FILE, random:N [default: auto]
    #[arg(long, value_name = "SOURCE")]
    pub init: Option<InitSource>,
}

impl TrainArgs {
    /// Whether nothing says how long the training should be.
    pub fn says_no_length(&self) -> bool {
        let t = &self.training;
        let is_usual = t.profile.is_none_or(|profile| profile == Profile::Default);
        t.steps.is_none()
            && t.time.is_none()
            && self.config.is_none()
            && is_usual
            && self.set_length().is_none()
    }

    /// Whether the user chose the size of the images.
    pub fn says_size(&self) -> bool {
        self.capture_args.max_resolution.is_some()
            || self.set_key(&["capture.max-resolution", "capture"]).is_some()
    }

    /// The setting by which `--set` gives the run a length: its steps, changes of them, or all settings of the training.
    fn set_length(&self) -> Option<&str> {
        self.set_key(&["steps", "train.steps", "plan", "train.plan", "train"])
    }

    /// The first of these settings that `--set` gives.
    fn set_key(&self, keys: &[&str]) -> Option<&str> {
        let given = self.training.settings.iter().filter_map(|setting| setting.split('=').next());
        given.map(str::trim).find(|key| keys.contains(key))
    }

    /// Refuses a time beside what has a length of its own.
    fn check_time(&self, profile: Profile) -> Result<()> {
        if self.training.time.is_none() {
            return Ok(());
        }
        if profile != Profile::Default {
            let name = profile.name();
            return Err(usage!(
                "--time: the profile {name} has a published length and is not planned for a time: use --steps, or leave out \
                 the profile"
            ));
        }
        if let Some(key) = self.set_length() {
            return Err(usage!("--time: the steps follow from the time: leave out --set {key}"));
        }
        Ok(())
    }

    /// Overwrites the settings of `config` whose flags were given.
    ///
    /// # Errors
    /// [`Error::Usage`] for an unknown setting or a contradiction.
    pub fn apply(&self, config: &mut RunConfig) -> Result<()> {
        let t = &self.training;
        if t.purpose.is_some() {
            Purpose::unbound_growth(&mut config.train);
        }
        if let Some(profile) = t.profile {
            config.profile = profile;
            profile.apply(&mut config.train);
        }
        self.check_time(config.profile)?;
        if let Some(purpose) = t.purpose {
            purpose.apply(config)?;
        }
        if let Some(need) = t.need {
            config.train.density.need_db = need;
            config.train.density.prune_db = need;
        }
        if t.max_size.is_some() && config.train.max_bytes != t.max_size {
            config.train.max_bytes = t.max_size;
            // Unless given, it follows from the size.
            config.train.budget.max_params = None;
        }
        set_some(&mut config.train.budget.max_params, &t.budget_params);
        set(&mut config.train.steps, t.steps);
        if t.steps.is_some() || self.set_length().is_some() {
            // A number of steps is a plan of its own.
            config.train.plan.clear();
            config.forget_time();
        }
        if t.time.is_some() {
            (config.time_secs, config.most_steps) = (t.time, None);
        }
        set(&mut config.train.seed, t.seed);
        set(&mut config.train.policy, t.policy);
        set(&mut config.init, t.init.clone());
        if let Some(capture) = self.captures.first() {
            config.data = Some(capture.clone());
        }
        self.capture_args.apply(&mut config.capture);
        for setting in &t.settings {
            config.set(setting)?;
        }
        if let Some(purpose) = t.purpose {
            purpose.bound_growth(&mut config.train);
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
            let before = fresh(&format!(
                "--profile {first} --set components.pruning=false --steps 77 --budget-params 5k"
            ));
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
        assert!(paper.policy == Policy::Paper && paper.rates.raise == 0.5 && paper.rates.fall == 1.0);
        assert_eq!(fresh("").train.density, DensityConfig::default());
    }

    #[test]
    fn a_time_is_refused_beside_another_length() {
        for flags in [
            "--time 1m --profile paper",
            "--profile cat --time 1m",
            "--time 1m --set steps=9",
            "--time 1m --set train.plan=[[1,2]]",
            "--set plan=[] --time 1m",
            "--time 1m --set train={steps=9}",
        ] {
            let error = over(RunConfig::default(), flags).unwrap_err();
            assert!(error.exit_code() == 2 && error.to_string().starts_with("--time: "), "{error}");
        }
        let time_secs = |flags: &str| over(RunConfig::default(), flags).unwrap().time_secs;
        assert_eq!(time_secs("--time 1m --profile default --set save-every=9"), Some(60.0));
        // A number of steps ends a plan.
        let mut planned = RunConfig { time_secs: Some(60.0), most_steps: Some(70), ..RunConfig::default() };
        planned.train.plan = vec![[9, 40]];
        for flags in ["--steps 50", "--set steps=50", "--set train.steps=50"] {
            let config = over(planned.clone(), flags).unwrap();
            let found = (config.time_secs, config.most_steps, config.train.last_step());
            assert_eq!(found, (None, None, 50), "{flags}");
        }
        assert_eq!(over(planned.clone(), "--set seed=7").unwrap().train.last_step(), 40);
        // A time that the user asks for is used.
        let asked = over(planned.clone(), "--time 2m").unwrap();
        assert_eq!((asked.time_secs, asked.most_steps), (Some(120.0), None));
        let says_no_length = |flags: &str| {
            let line = Line::try_parse_from(["train"].into_iter().chain(flags.split_whitespace())).unwrap();
            line.args.says_no_length()
        };
        assert!(says_no_length("--seed 7") && says_no_length("--profile default"));
        for flags in [
            "--steps 7",
            "--time 1m",
            "--config c.toml",
            "--profile paper",
            "--set train.steps=7",
            "--set train.plan=[[1,2]]",
        ] {
            assert!(!says_no_length(flags), "{flags}");
        }
    }

    #[test]
    fn a_size_is_the_users_however_it_is_given() {
        let says_size = |flags: &str| {
            let line = Line::try_parse_from(["train"].into_iter().chain(flags.split_whitespace())).unwrap();
            line.args.says_size()
        };
        for flags in
            ["--max-resolution 160", "--set capture.max-resolution=160", "--set capture={max-resolution=160}"]
        {
            assert!(says_size(flags), "{flags}");
        }
        assert!(!says_size("") && !says_size("--time 1m --set capture.mask-invert=true"));
    }

    #[test]
    fn parts_are_switched_off() {
        let refused = |flags: &str, part: &str| {
            let error = over(RunConfig::default(), flags).unwrap_err();
            assert!(error.exit_code() == 2 && error.to_string().contains(part), "{error}");
        };
        refused("--policy cat", "--profile cat");
        let without =
            over(RunConfig::default(), "--set components.growth=false --set components.pruning=false")
                .unwrap()
                .train
                .components;
        assert!(!without.growth && !without.pruning && without.splitting);
    }

    #[test]
    fn a_purpose_chooses_the_policy_and_what_it_needs() {
        let fresh = |flags: &str| over(RunConfig::default(), flags).unwrap();
        let engine = fresh("--for engine --steps 7");
        assert_eq!(
            (engine.train.policy, engine.train.density.sh_below, engine.train.filter),
            (Policy::Plain, 0.0, Filter::Ewa)
        );
        assert!(engine.train.budget.max_splats.is_some(), "plain grows up to a budget only");
        assert_eq!(fresh("--for page --steps 7"), fresh("--steps 7"));
        for budget in ["--budget-params 5k", "--set budget.max-splats=9"] {
            let found = fresh(&format!("--for engine {budget}")).train.budget;
            assert_eq!(found, fresh(budget).train.budget, "a given budget is the only one");
        }
        // A later purpose undoes an earlier one; settings by name win.
        assert_eq!(over(engine.clone(), "--for page").unwrap(), fresh("--steps 7"));
        assert_eq!(over(engine.clone(), "--for engine").unwrap(), engine);
        let bounded = |flags: &str| over(fresh(flags), "--for page").unwrap().train.budget.max_splats;
        assert_eq!(bounded("--for engine --set budget.max-splats=9"), Some(9), "the user's bound stays");
        assert_eq!(bounded("--for page --set budget.max-splats=30000"), Some(30_000));
        assert_eq!(over(engine.clone(), "--for page --profile default").unwrap(), fresh("--steps 7"));
        for purpose in ["page", "engine"] {
            let flags = format!("--for {purpose} --steps 7");
            assert_eq!(
                fresh(&format!("{flags} --profile default")),
                fresh(&flags),
                "the profile changes nothing"
            );
        }
        assert_eq!(fresh("--for engine --set density.sh-below=0.01").train.density.sh_below, 0.01);
        for (before, then) in [
            (fresh("--profile paper"), "--for engine"),
            (RunConfig::default(), "--for page --profile paper"),
            (RunConfig::default(), "--profile paper --for engine"),
        ] {
            let error = over(before, then).unwrap_err();
            assert!(error.exit_code() == 2 && error.to_string().contains("profile paper"), "{error}");
        }
        for wrong in ["--for games", "--for engine --policy plain"] {
            let parsed = Line::try_parse_from(["train"].into_iter().chain(wrong.split_whitespace()));
            assert!(parsed.is_err(), "{wrong}");
        }
    }

    #[test]
    fn backgrounds_have_names() {
        let of = |setting: &str| {
            over(RunConfig::default(), &format!("--set {setting}")).map(|c| c.train.background)
        };
        for (setting, colour) in [
            ("background=white", [1.0; 3]),
            ("background=#ff0000", [1.0, 0.0, 0.0]),
            ("background=[0.5,0.5,0.5]", [0.5; 3]),
            ("background=0.5,0.5,0.5", [0.5; 3]),
        ] {
            assert_eq!(of(setting).unwrap(), colour, "{setting}");
        }
        for wrong in ["background=mauve", "background=[0,2,0]", "background=3"] {
            assert_eq!(of(wrong).unwrap_err().exit_code(), 2, "{wrong}");
        }
        assert!(over(RunConfig::default(), "--set random-background=true").unwrap().capture.keep_alpha);
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
