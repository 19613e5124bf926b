//! What a matrix needs from `litetex train`, `sample` and `eval`: their arguments, policies and the default seed.

use crate::cli::common_args::CommonArgs;
use crate::cli::eval::EvalArgs;
use crate::cli::profile::Profile;
use crate::cli::sample::SampleArgs;
use crate::cli::train_args::TrainArgs;
use clap::{Parser, ValueEnum as _};
use litetex_gs::sample::SampleOptions;
use litetex_gs::train::{Policy, TrainConfig};
use litetex_lab::matrix::TrainCommand;
use std::path::PathBuf;

/// `litetex train` of this program.
pub struct Training;

impl TrainCommand for Training {
    fn flag_of(&self, name: &str) -> Option<&'static str> {
        // The policy `cat` is part of the profile of that name.
        let is_profile = Profile::from_str(name, false).is_ok_and(|profile| profile != Profile::Default);
        let is_policy = name.parse::<Policy>().is_ok();
        if is_profile { Some("--profile") } else { is_policy.then_some("--policy") }
    }

    fn default_seed(&self) -> u64 {
        TrainConfig::default().seed
    }

    fn check(&self, args: &[String]) -> Result<Option<PathBuf>, String> {
        parse(args).map(|parsed| parsed.config)
    }

    fn check_sample(&self, args: &[String]) -> Result<(), String> {
        sample_options(args).map(|_| ())
    }

    fn check_eval(&self, args: &[String]) -> Result<(), String> {
        line::<EvalLine>(["litetex eval", "run"], args).map(|_| ())
    }
}

/// The options of a capture that `litetex sample` makes with these arguments.
///
/// # Errors
/// A message that says which argument is wrong.
pub fn sample_options(args: &[String]) -> Result<SampleOptions, String> {
    line::<SampleLine>(["litetex sample", "capture"], args).map(|line| line.sample.options())
}

/// The command line of `litetex train`.
#[derive(Parser)]
struct TrainLine {
    #[command(flatten)]
    _common: CommonArgs,
    #[command(flatten)]
    train: TrainArgs,
}

/// The command line of `litetex sample`.
#[derive(Parser)]
struct SampleLine {
    #[command(flatten)]
    sample: SampleArgs,
}

/// The command line of `litetex eval`.
#[derive(Parser)]
struct EvalLine {
    #[command(flatten)]
    _eval: EvalArgs,
}

/// Parses a command line, with the message of its error alone.
fn line<T: Parser>(head: [&str; 2], args: &[String]) -> Result<T, String> {
    let words = head.into_iter().chain(args.iter().map(String::as_str));
    T::try_parse_from(words).map_err(|e| {
        if !e.use_stderr() {
            return "the arguments ask for help or the version".to_owned();
        }
        let text = e.render().to_string();
        // Without the usage of another command and the pointer to its help.
        let head = text.split("\n\n").next().unwrap_or_default();
        head.trim_start_matches("error: ").trim().to_owned()
    })
}

/// Parses arguments as `litetex train` does, and refuses those that every run gets from the matrix.
fn parse(args: &[String]) -> Result<TrainArgs, String> {
    // With --quiet, as the runs will be: what contradicts it is found here.
    let line = line::<TrainLine>(["litetex train", "--quiet"], args)?;
    let parsed = line.train;
    for (given, what) in [
        (parsed.capture.is_some(), "a capture: name it as a scene"),
        (parsed.out.is_some(), "--out: every run has a folder of its own"),
        (parsed.force, "--force: bench skips finished runs; its own --force repeats all"),
        (parsed.resume.is_some(), "--resume: every run starts from scratch"),
        (parsed.view, "--view: nobody looks at the runs of a benchmark"),
        (parsed.training.seed.is_some(), "--seed: use --seeds of litetex bench"),
    ] {
        if given {
            return Err(format!("the arguments contain {what}"));
        }
    }
    Ok(parsed)
}

#[cfg(test)]
mod tests {
    use super::*;
    use litetex_lab::words::split_words;

    fn check(args: &str) -> Result<Option<PathBuf>, String> {
        Training.check(&split_words(args).unwrap())
    }

    #[test]
    fn the_last_of_a_repeated_argument_wins() {
        let args = split_words("--steps 5 --policy plain --steps 10").unwrap();
        assert_eq!(parse(&args).unwrap().training.steps, Some(10));
        assert_eq!(check("--config a.toml").unwrap(), Some("a.toml".into()));
    }

    #[test]
    fn arguments_that_train_or_bench_cannot_take_are_named() {
        for (args, part) in [
            ("--colour blue", "--colour"),
            ("--policy fixed:1", "fixed:R"),
            ("--seed 3", "--seeds"),
            ("-o x", "--out"),
            ("--force", "--force"),
            ("--resume x", "--resume"),
            ("--view", "--view"),
            ("captures/c", "a capture"),
            ("--help", "ask for help"),
        ] {
            let error = check(args).unwrap_err();
            assert!(error.contains(part), "{part}: {error}");
        }
    }

    #[test]
    fn policies_and_profiles_are_known_by_name() {
        for name in ["litetex", "plain", "none", "fixed:4"] {
            assert_eq!(Training.flag_of(name), Some("--policy"), "{name}");
        }
        for name in ["paper", "cat", "fast"] {
            assert_eq!(Training.flag_of(name), Some("--profile"), "{name}");
        }
        for name in ["default", "fixed:1", "Plain", "no growth"] {
            assert_eq!(Training.flag_of(name), None, "{name}");
        }
    }
}
