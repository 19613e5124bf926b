//! `config.toml`: everything that repeats a run, as read from `--config` and as written, resolved, into
//! the run folder and every checkpoint.

use super::capture::{InitSource, LoadOptions};
use super::capture_args::MAX_RESOLUTION_MIN;
use super::profile::Profile;
use super::train_args::SaveImages;
use litetex_gs::train::TrainConfig;
use litetex_gs::{Error, Result, input_file};
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

/// Larger files are no settings.
const FILE_BYTES_MAX: u64 = 1 << 20;

/// Settings of a run.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default, rename_all = "kebab-case")]
pub struct RunConfig {
    /// Version of the program that wrote this; empty in files that people write.
    #[serde(skip_serializing_if = "String::is_empty")]
    pub version: String,
    /// Folder of the capture.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub data: Option<PathBuf>,
    /// Profile that the settings below started from; what they say counts.
    pub profile: Profile,
    /// Where primitives start.
    pub init: InitSource,
    /// More points than this are thinned at random before the start.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub max_points: Option<usize>,
    /// Which evaluations leave images.
    pub save_images: SaveImages,
    /// How the capture is read.
    pub capture: LoadOptions,
    /// How it is trained.
    pub train: TrainConfig,
}

impl RunConfig {
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
        config.check(path)?;
        config.capture.background = config.train.background;
        Ok(config)
    }

    /// The resolved settings as a file that `--config` accepts.
    ///
    /// # Errors
    /// [`Error::Usage`] if a value has no form in TOML (a path that is not text).
    pub fn to_toml(&self) -> Result<String> {
        let mut config = self.clone();
        config.version = env!("CARGO_PKG_VERSION").to_owned();
        let body = toml::to_string_pretty(&config)
            .map_err(|e| Error::Usage(format!("the settings cannot be written as TOML: {e}")))?;
        Ok(format!(
            "# Settings of this run, resolved. Repeat it: litetex train --config config.toml -o <RUN>\n{body}"
        ))
    }

    /// Changes one setting, given as `key=value` with a key as in the file; what is not at the top of the
    /// file is looked for in `train`.
    ///
    /// # Errors
    /// [`Error::Usage`] naming the setting and what was expected.
    pub fn set(&mut self, setting: &str) -> Result<()> {
        let wrong = |what: String| Error::Usage(format!("--set {setting}: {what}"));
        let (key, value) = setting
            .split_once('=')
            .ok_or_else(|| wrong("expected KEY=VALUE, such as density.quantile=0.6".to_owned()))?;
        let mut table = toml::Table::try_from(&*self)
            .map_err(|e| wrong(format!("the settings have no TOML form: {e}")))?;
        let mut path: Vec<&str> = key.trim().split('.').collect();
        if !["train", "capture", "init", "max-points", "save-images"].contains(&path[0]) {
            path.insert(0, "train");
        }
        let value = value.trim();
        let parsed: toml::Table = toml::from_str(&format!("v = {value}"))
            .or_else(|_| toml::from_str(&format!("v = {value:?}")))
            .map_err(|_| wrong(format!("{value:?} is no value")))?;
        let (last, parents) = path.split_last().expect("split yields at least one part");
        let mut at = &mut table;
        for part in parents {
            at = at.get_mut(*part).and_then(toml::Value::as_table_mut).ok_or_else(|| {
                wrong(format!("there is no section {part:?}; config.toml of a run lists all"))
            })?;
        }
        at.insert((*last).to_owned(), parsed["v"].clone());
        *self = table.try_into().map_err(|e: toml::de::Error| wrong(e.message().to_owned()))?;
        self.check(Path::new("--set"))
    }

    /// The capture's folder.
    ///
    /// # Errors
    /// [`Error::Usage`] if none was named.
    pub fn data(&self) -> Result<&Path> {
        self.data
            .as_deref()
            .ok_or_else(|| Error::Usage("no capture given: litetex train <CAPTURE> -o <RUN>".to_owned()))
    }

    /// Bounds that flags check by themselves and a file must be held to.
    fn check(&self, path: &Path) -> Result<()> {
        let t = &self.train;
        let refuse = |what: String| Err(Error::invalid(path, what));
        if t.steps == 0 {
            return refuse("train.steps: found 0, expected at least 1".to_owned());
        }
        if t.sh_degree > 3 {
            return refuse(format!("train.sh-degree: found {}, expected 0 to 3", t.sh_degree));
        }
        if t.background.iter().any(|x| !(0.0..=1.0).contains(x)) {
            return refuse(format!(
                "train.background: found {:?}, expected numbers from 0 to 1",
                t.background
            ));
        }
        if t.max_time_secs.is_some_and(|s| !s.is_finite() || s <= 0.0) {
            return refuse("train.max-time-secs: expected a positive number".to_owned());
        }
        let r = &t.rates;
        let positions = [
            ("position", r.position),
            ("position-random", r.position_random),
            ("position-end", r.position_end),
        ];
        for (key, rate) in positions {
            // The schedule between the two is logarithmic.
            if !rate.is_finite() || rate <= 0.0 {
                return refuse(format!("train.rates.{key}: found {rate}, expected a finite number above 0"));
            }
        }
        if let Err(what) = t.density.check() {
            return refuse(format!("train.{what}"));
        }
        let l = &t.loss;
        for (key, number) in [
            ("rates.quaternion", r.quaternion),
            ("rates.log-scale", r.log_scale),
            ("rates.opacity", r.opacity),
            ("rates.sh-dc", r.sh_dc),
            ("rates.sh-rest", r.sh_rest),
            ("rates.texel", r.texel),
            ("rates.texel-growth", r.texel_growth),
            ("rates.texel-growth-limit", r.texel_growth_limit),
            ("loss.l1", l.l1),
            ("loss.dssim", l.dssim),
            ("loss.mse", l.mse),
            ("loss.opacity", l.opacity),
            ("loss.texture", l.texture),
            ("loss.texture-hidden", l.texture_hidden),
            ("loss.distortion", l.distortion),
            ("loss.normal", l.normal),
        ] {
            if !number.is_finite() || number < 0.0 {
                return refuse(format!("train.{key}: found {number}, expected a finite number, 0 or above"));
            }
        }
        if self.capture.max_resolution < MAX_RESOLUTION_MIN {
            return refuse(format!(
                "capture.max-resolution: found {}, expected at least {MAX_RESOLUTION_MIN}",
                self.capture.max_resolution
            ));
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use litetex_gs::backend::LossWeights;
    use litetex_gs::train::Policy;

    fn parse(text: &str) -> Result<RunConfig> {
        RunConfig::parse(Path::new("c.toml"), text)
    }

    #[test]
    fn written_settings_read_back_alike() {
        let mut config = RunConfig {
            data: Some("/captures/füchse 1".into()),
            init: InitSource::Random(500),
            ..RunConfig::default()
        };
        config.train.max_time_secs = Some(0.1);
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
    fn a_file_may_say_little() {
        let config = parse("[train]\nsteps = 300\npolicy = \"none\"\n").unwrap();
        assert_eq!(config.train.steps, 300);
        assert_eq!(config.train.seed, TrainConfig::default().seed);
        assert_eq!(parse("").unwrap(), RunConfig::default());
        let loss = parse("[train.loss]\nmse = 0.5\n").unwrap().train.loss;
        assert_eq!(loss, LossWeights { mse: 0.5, ..LossWeights::default() });
    }

    #[test]
    fn mistakes_are_named() {
        for (text, part) in [
            ("[train]\nstps = 3", "stps"),
            ("[train]\nsteps = 0", "train.steps"),
            ("[train]\nsh-degree = 4", "train.sh-degree"),
            ("[train]\nbackground = [0, 2, 0]", "train.background"),
            ("[train]\nmax-time-secs = -1", "max-time-secs"),
            ("[train]\npolicy = \"fixed:1\"", "fixed:R"),
            ("init = \"magic\"", "random:COUNT"),
            ("init = \"random:0\"", "10,000,000"),
            ("[capture]\nmax-resolution = 15", "capture.max-resolution: found 15"),
            ("[train.rates]\nposition = 0.0", "train.rates.position: found 0"),
            ("[train.rates]\nposition-end = inf", "train.rates.position-end: found inf"),
            ("[train.rates]\ntexel = -1e-3", "train.rates.texel: found -0.001"),
            ("[train.rates]\nopacity = 1e300", "train.rates.opacity: found inf"),
            ("[train.density]\nquantile = 1.2", "train.density.quantile: found 1.2"),
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
