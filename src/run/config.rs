//! `config.toml`: everything needed to repeat a run, as read from `--config` and as written, resolved, into the
//! run folder and every checkpoint.

use super::init_source::InitSource;
use super::profile::Profile;
use crate::capture::LoadOptions;
use crate::stand_in::bytes_for_scene;
use crate::train::{Exposure, Schedule, TrainConfig, inactive};
use crate::{Error, Result, input_file};
use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

/// Settings that do not shape the trained model, or follow from others.
const NOT_SHAPING: [&str; 12] = [
    "version",
    "profile",
    "save-images",
    "time-secs",
    "most-steps",
    "train.plan",
    "train.eval-every",
    "train.save-every",
    "train.save-secs",
    "capture.background",
    "capture.image-cache-bytes",
    "capture.photo-memory-bytes",
];

/// Smallest bound of the images' longer side that makes sense: SSIM's window is 11 pixels wide.
pub const MAX_RESOLUTION_MIN: u32 = 16;

/// Largest configuration file that is read.
pub(super) const FILE_BYTES_MAX: u64 = 1 << 20;

/// Settings of a run.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default, rename_all = "kebab-case")]
pub struct RunConfig {
    /// Version of the program that wrote the file; empty in files written by hand.
    #[serde(skip_serializing_if = "String::is_empty")]
    pub version: String,
    /// Folder of the capture.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub data: Option<PathBuf>,
    /// Profile that the settings below started from; a record, they are resolved already.
    pub profile: Profile,
    /// Time that the run was planned for, from start to exit; a run that was interrupted goes on with what is left of it.
    /// The settings of `--config` have none: their plan stands.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub time_secs: Option<f64>,
    /// With a time that nobody asked for: steps after which the run ends though there is time left.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub most_steps: Option<u32>,
    /// Where splats start.
    pub init: InitSource,
    /// At most this many points become splats; more are thinned at random.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub max_points: Option<usize>,
    /// Whether the run's `.ltgs` files begin with a stand-in. With a wanted size, the scene gets what that leaves.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub preview: bool,
    /// Which evaluations keep their images.
    pub save_images: SaveImages,
    /// How the capture is read.
    pub capture: LoadOptions,
    /// How it is trained.
    pub train: TrainConfig,
}

/// Which evaluations keep their images.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum SaveImages {
    /// None does.
    None,
    /// Only the latest evaluation.
    #[default]
    Last,
    /// Every evaluation.
    All,
}

/// Settings that follow from others, and these.
const DERIVED: [(&str, &str); 1] = [("capture.background", "background")];

impl RunConfig {
    /// Most bytes of the scene in the file of a run with a wanted size: what a stand-in leaves.
    pub fn scene_max_bytes(&self) -> Option<u64> {
        let scene = |max| if self.preview { bytes_for_scene(max) } else { max };
        self.train.max_bytes.map(scene)
    }

    /// Reads a file; what it does not say keeps the default.
    ///
    /// # Errors
    /// [`Error::Io`], [`Error::InvalidInput`] naming line and key.
    pub fn read(path: &Path) -> Result<Self> {
        Self::parse(path, &input_file::read_text(path, FILE_BYTES_MAX)?)
    }

    /// [`RunConfig::read`] from memory; `path` only names the file in errors.
    ///
    /// # Errors
    /// [`Error::InvalidInput`] naming line and key.
    pub fn parse(path: &Path, text: &str) -> Result<Self> {
        let mut config: Self =
            toml::from_str(text).map_err(|e| Error::invalid(path, e.to_string().trim_end().to_owned()))?;
        config.check().map_err(|what| Error::invalid(path, what))?;
        config.follow_background();
        Ok(config)
    }

    /// Takes the time of a run, and what it decided on its length after the checkpoint that these settings are of: a run
    /// that was killed repeats its decisions.
    ///
    /// # Errors
    /// [`Error::InvalidInput`] for settings of the run that cannot be read.
    pub fn follow_run(&mut self, run: &Path) -> Result<()> {
        let file = run.join("config.toml");
        if !file.exists() {
            return Ok(());
        }
        let run = Self::read(&file)?;
        // Another start, or another plan from some step on, is another run.
        if run.train.steps == self.train.steps && run.train.plan.starts_with(&self.train.plan) {
            self.train.plan = run.train.plan;
            (self.time_secs, self.most_steps) = (run.time_secs, run.most_steps);
        }
        Ok(())
    }

    /// Forgets the time of the run: its plan stands.
    pub fn forget_time(&mut self) {
        (self.time_secs, self.most_steps) = (None, None);
    }

    /// Photos with alpha are composited on the background of the images, or keep it for changing backgrounds.
    pub fn follow_background(&mut self) {
        self.capture.background = self.train.background;
        self.capture.keep_alpha = self.train.random_background;
    }

    /// The resolved settings as a file that `--config` accepts.
    ///
    /// # Errors
    /// [`Error::Usage`] if a value has no form in TOML: a path that is not Unicode.
    pub fn to_toml(&self) -> Result<String> {
        let mut config = self.clone();
        config.version = env!("CARGO_PKG_VERSION").to_owned();
        let body = toml::to_string_pretty(&config)
            .map_err(|e| usage!("the settings cannot be written as TOML: {e}"))?;
        Ok(format!(
            "# Settings of this run, resolved. Repeat it: litetex train --config config.toml -o <RUN>\n{body}"
        ))
    }

    /// Changes one setting, given as `key=value` with a key as in the file. Keys that are not at the top of the
    /// file are looked up in `train`.
    ///
    /// # Errors
    /// [`Error::Usage`] naming the setting and what was expected.
    pub fn set(&mut self, setting: &str) -> Result<()> {
        let wrong = |what: String| usage!("--set {setting}: {what}");
        let (key, value) = setting
            .split_once('=')
            .ok_or_else(|| wrong("expected KEY=VALUE, such as density.quantile=0.6".to_owned()))?;
        let mut table = toml::Table::try_from(&*self)
            .map_err(|e| wrong(format!("the settings have no TOML form: {e}")))?;
        let mut path: Vec<&str> = key.trim().split('.').collect();
        if !["train", "capture", "init", "max-points", "preview", "save-images"].contains(&path[0]) {
            path.insert(0, "train");
        }
        if let Some((_, source)) = DERIVED.iter().find(|(key, _)| *key == path.join(".")) {
            return Err(wrong(format!("it follows from {source}: set that")));
        }
        let value = value.trim();
        let parsed: toml::Table = toml::from_str(&format!("v = {value}"))
            .or_else(|_| toml::from_str(&format!("v = {value:?}")))
            .map_err(|_| wrong(format!("{value:?} is not a value")))?;
        let (last, parents) = path.split_last().expect("split yields at least one part");
        let mut at = &mut table;
        for part in parents {
            at = at.get_mut(*part).and_then(toml::Value::as_table_mut).ok_or_else(|| {
                wrong(format!("there is no section {part:?}; config.toml of a run lists all settings"))
            })?;
        }
        at.insert((*last).to_owned(), parsed["v"].clone());
        *self = table.try_into().map_err(|e: toml::de::Error| wrong(in_words(e.message())))?;
        self.check().map_err(wrong)
    }

    /// Settings that cannot act in this run, with the reason: [`inactive`], and those of the points that splats start at.
    pub fn inactive(&self, schedule: &Schedule) -> Vec<String> {
        let unchanged = self.profile.settings();
        let mut out = inactive(schedule, &self.train, &unchanged);
        if self.init != InitSource::Auto && self.train.sweep != unchanged.sweep {
            out.push(format!("sweep: not used with --init {}", self.init));
        }
        out
    }

    /// The capture's folder.
    ///
    /// # Errors
    /// [`Error::Usage`] if none was named.
    pub fn data(&self) -> Result<&Path> {
        self.data.as_deref().ok_or_else(|| usage!("no capture given: litetex train <CAPTURE> -o <RUN>"))
    }

    /// Keys, as `set` takes them, of the settings that differ and shape the result: all but those in `NOT_SHAPING`.
    ///
    /// # Errors
    /// As [`RunConfig::to_toml`].
    pub fn shaping_differences(&self, other: &Self) -> Result<Vec<String>> {
        let [mine, others] = [self.shaping_settings()?, other.shaping_settings()?];
        let names: BTreeSet<&String> = mine.keys().chain(others.keys()).collect();
        let differing = names.into_iter().filter(|name| mine.get(*name) != others.get(*name));
        Ok(differing.map(|name| name.strip_prefix("train.").unwrap_or(name).to_owned()).collect())
    }

    /// Settings by key, those in sections as `section.key`.
    fn shaping_settings(&self) -> Result<BTreeMap<String, toml::Value>> {
        let mut settings = BTreeMap::new();
        flatten("", self.to_table()?, &mut settings);
        NOT_SHAPING.iter().for_each(|name| drop(settings.remove(*name)));
        if let Some(name) = self.data.as_deref().and_then(Path::file_name).and_then(|name| name.to_str()) {
            // A capture may have moved.
            settings.insert("data".to_owned(), name.into());
        }
        Ok(settings)
    }

    fn to_table(&self) -> Result<toml::Table> {
        let not_text = |e| usage!("the settings cannot be written as TOML: {e}");
        toml::Table::try_from(self).map_err(not_text)
    }

    /// Checks bounds, which flags check by themselves and other sources must be held to, and that the settings make sense together.
    ///
    /// # Errors
    /// A message that names the setting, what was found and what was expected.
    pub fn check(&self) -> Result<(), String> {
        let t = &self.train;
        if t.steps == 0 {
            return Err("train.steps: found 0, expected at least 1".to_owned());
        }
        if t.sh_degree > 3 {
            return Err(format!("train.sh-degree: found {}, expected 0 to 3", t.sh_degree));
        }
        if t.background.iter().any(|x| !(0.0..=1.0).contains(x)) {
            return Err(format!("train.background: found {:?}, expected numbers from 0 to 1", t.background));
        }
        if let Some(profile) = Profile::of(t.policy).filter(|&profile| profile != self.profile) {
            // Other settings of these methods are the profile's.
            let name = profile.name();
            return Err(format!(
                "train.policy: {name} is part of the profile of that name: choose --profile {name}"
            ));
        }
        if t.random_background && t.background != [0.0; 3] {
            return Err("train.random-background: needs train.background = [0, 0, 0]".to_owned());
        }
        if t.random_background && t.exposure != Exposure::None {
            // The photo's exposure acts on what lies before the background only.
            return Err("train.random-background: not with train.exposure".to_owned());
        }
        t.check_plan()?;
        if self.time_secs.is_some_and(|secs| !secs.is_finite() || secs <= 0.0) {
            return Err("time-secs: expected a positive number".to_owned());
        }
        let r = &t.rates;
        let positions = [("position", r.position), ("position-end", r.position_end)];
        for (key, rate) in positions {
            // The schedule between them is logarithmic.
            if !rate.is_finite() || rate <= 0.0 {
                return Err(format!("train.rates.{key}: found {rate}, expected a finite number above 0"));
            }
        }
        check_not_negative("rates", &t.rates)?;
        check_not_negative("loss", &t.loss)?;
        t.density.check().map_err(|what| format!("train.{what}"))?;
        if self.capture.max_resolution < MAX_RESOLUTION_MIN {
            return Err(format!(
                "capture.max-resolution: found {}, expected at least {MAX_RESOLUTION_MIN}",
                self.capture.max_resolution
            ));
        }
        Ok(())
    }
}

/// Adds the values of a table and of the tables in it, by their keys joined with dots.
fn flatten(prefix: &str, table: toml::Table, out: &mut BTreeMap<String, toml::Value>) {
    for (key, value) in table {
        match value {
            toml::Value::Table(inner) => flatten(&format!("{prefix}{key}."), inner, out),
            value => drop(out.insert(format!("{prefix}{key}"), value)),
        }
    }
}

/// A message of the TOML reader without Rust's names of types.
fn in_words(message: &str) -> String {
    let types = [
        ("f64", "a number"),
        ("f32", "a number"),
        ("u64", "a whole number"),
        ("u32", "a whole number"),
        ("u16", "a whole number"),
        ("u8", "a whole number"),
        ("usize", "a whole number"),
        ("a boolean", "true or false"),
    ];
    types.iter().fold(message.to_owned(), |text, (name, words)| {
        text.replace(&format!("expected {name}"), &format!("expected {words}"))
    })
}

/// Checks that each number of a section is finite and not negative.
fn check_not_negative(section: &str, settings: &impl Serialize) -> Result<(), String> {
    let table = toml::Table::try_from(settings).map_err(|e| format!("train.{section}: {e}"))?;
    for (key, value) in table {
        // Shown as the f32 that it is.
        if let Some(number) = value.as_float().map(|number| number as f32)
            && (!number.is_finite() || number < 0.0)
        {
            return Err(format!(
                "train.{section}.{key}: found {number}, expected a finite number, 0 or above"
            ));
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::backend::LossWeights;
    use crate::train::Policy;

    fn parse(text: &str) -> Result<RunConfig> {
        RunConfig::parse(Path::new("c.toml"), text)
    }

    #[test]
    fn settings_round_trip() {
        let mut config = RunConfig {
            data: Some("/captures/füchse 1".into()),
            init: InitSource::Random(500),
            ..RunConfig::default()
        };
        config.train.plan = vec![[3, 40], [5, 60]];
        config.train.background = [0.1, 0.2, 1.0];
        config.capture.background = config.train.background;
        config.train.policy = Policy::None;
        config.train.seed = 1 << 60;
        let mut read = parse(&config.to_toml().unwrap()).unwrap();
        assert_eq!(read.version, env!("CARGO_PKG_VERSION"));
        read.version.clear();
        assert_eq!(read, config);
    }

    #[test]
    fn missing_settings_take_their_defaults() {
        let config = parse("[train]\nsteps = 300\npolicy = \"none\"\n").unwrap();
        assert_eq!(config.train.steps, 300);
        assert_eq!(config.train.seed, TrainConfig::default().seed);
        assert_eq!(parse("").unwrap(), RunConfig::default());
        let loss = parse("[train.loss]\nmse = 0.5\n").unwrap().train.loss;
        assert_eq!(loss, LossWeights { mse: 0.5, ..LossWeights::default() });
    }

    #[test]
    fn only_settings_that_shape_the_model_count_as_changes() {
        let before = RunConfig { data: Some("/a/fox".into()), ..RunConfig::default() };
        let differences = |settings: &[&str]| {
            let mut now = before.clone();
            settings.iter().for_each(|setting| now.set(setting).unwrap());
            now.shaping_differences(&before).unwrap()
        };
        let others = ["eval-every=7", "save-every=7", "save-secs=7", "capture.image-cache-bytes=7"];
        assert_eq!(differences(&others), [""; 0]);
        for setting in ["seed=7", "policy=plain", "sh-degree=1", "rates.texel=1.0", "capture.test-every=7"] {
            assert_eq!(differences(&[setting]), [setting.split('=').next().unwrap()]);
        }
        assert_eq!(differences(&["max-points=7", "init=random:7"]), ["init", "max-points"]);
        let moved = RunConfig { data: Some("/b/fox".into()), ..before.clone() };
        assert_eq!(moved.shaping_differences(&before).unwrap(), [""; 0]);
        let other = RunConfig { data: Some("/a/toy".into()), ..before.clone() };
        assert_eq!(other.shaping_differences(&before).unwrap(), ["data"]);
    }

    #[test]
    fn an_invalid_set_flag_is_a_usage_error() {
        for setting in [
            "density.quantile=1.2",
            "rates.texel=-1.0",
            "steps=many",
            "stps=3",
            "a.b=1",
            "steps",
            "capture.background=[1, 1, 1]",
        ] {
            let error = RunConfig::default().set(setting).unwrap_err();
            assert!(error.exit_code() == 2 && error.to_string().contains(setting), "{error}");
        }
        for (setting, expected) in [
            ("density.quantile=x", "expected a number"),
            ("steps=1.5", "expected a whole number"),
            ("sweep=3", "expected true or false"),
        ] {
            let error = RunConfig::default().set(setting).unwrap_err().to_string();
            assert!(error.ends_with(expected), "{error}");
        }
    }

    #[test]
    fn errors_name_the_setting() {
        for (text, part) in [
            ("[train]\nstps = 3", "stps"),
            ("[train]\nsteps = 0", "train.steps"),
            ("[train]\nsh-degree = 4", "train.sh-degree"),
            ("[train]\nbackground = [0, 2, 0]", "train.background"),
            ("[train]\nrandom-background = true\nbackground = [1, 1, 1]", "train.background"),
            ("[train]\nrandom-background = true\nexposure = \"affine\"", "train.exposure"),
            ("[train]\nsteps = 9\nplan = [[9, 12]]", "train.plan"),
            ("[train]\npolicy = \"fixed:1\"", "fixed:R"),
            ("init = \"magic\"", "random:COUNT"),
            ("init = \"random:0\"", "10,000,000"),
            ("[capture]\nmax-resolution = 15", "capture.max-resolution: found 15"),
            ("[train.rates]\nposition = 0.0", "train.rates.position: found 0"),
            ("[train.rates]\nposition-end = inf", "train.rates.position-end: found inf"),
            ("[train.rates]\ntexel = -1e-3", "train.rates.texel: found -0.001"),
            ("[train.rates]\nopacity = 1e300", "train.rates.opacity: found inf"),
            ("[train.density]\nquantile = 1.2", "train.density.quantile: found 1.2"),
            (
                "[train.density]\novershoot = 0.5",
                "train.density.overshoot: found 0.5, expected a number from 1 to 1000",
            ),
            ("[train.rates]\ntexel-growth = nan", "train.rates.texel-growth: found NaN"),
            ("[train.loss]\nl1 = nan", "train.loss.l1: found NaN"),
            ("[train.loss]\nl2 = 1.0", "l2"),
            ("[train", "c.toml"),
        ] {
            let error = parse(text).unwrap_err();
            assert_eq!(error.exit_code(), 3);
            assert!(error.to_string().contains(part), "{error}");
        }
    }
}
