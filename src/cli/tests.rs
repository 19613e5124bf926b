//! Unit tests of the command line: defaults stated in the help.

use clap::CommandFactory as _;
use litetex_gs::Error;
use litetex_gs::frequency::FrequencyOptions;
use litetex_gs::run::{Purpose, RunConfig};
use litetex_gs::train::TrainConfig;
use serde_json::Value;

#[test]
fn the_arguments_are_consistent() {
    super::Cli::command().debug_assert();
}

/// Numbers and meanings of a list of exit codes.
fn codes(rows: impl Iterator<Item = impl AsRef<str>>) -> Vec<u8> {
    rows.filter_map(|row| row.as_ref().trim_start_matches("| ").split_whitespace().next()?.parse().ok())
        .collect()
}

#[test]
fn the_documentation_and_the_help_list_all_exit_codes() {
    use std::io::ErrorKind;
    let missing = |kind: ErrorKind| Error::io("x", kind.into());
    let mut of_errors: Vec<u8> = [
        Error::CheckFailed(String::new()),
        Error::Usage(String::new()),
        Error::invalid("x", ""),
        Error::unsupported("x", ""),
        Error::Device(String::new()),
        missing(ErrorKind::NotFound),
        missing(ErrorKind::PermissionDenied),
        Error::Interrupted,
    ]
    .iter()
    .map(Error::exit_code)
    .chain([0])
    .collect();
    of_errors.sort_unstable();
    of_errors.dedup();
    let documented = include_str!("../../docs/commands.md").split("## Exit codes").nth(1).unwrap();
    assert_eq!(codes(documented.lines()), of_errors);
    let help = super::Cli::command().render_long_help().to_string();
    let flat = help.split_whitespace().collect::<Vec<_>>().join(" ");
    let listed = flat.split("Exit codes: ").nth(1).unwrap();
    assert_eq!(codes(listed.split(", ")), of_errors);
}

/// The default of a flag as the command's help states it.
fn stated(command: &str, flag: &str) -> Option<String> {
    let mut all = super::Cli::command();
    all.build();
    let help = all.find_subcommand_mut(command).unwrap().render_long_help().to_string();
    let flat = help.split_whitespace().collect::<Vec<_>>().join(" ");
    let at = flat.find(&format!("{flag} <")).unwrap_or_else(|| panic!("{flag} is not in the help"));
    let default = flat[at..].split("[default: ").nth(1).and_then(|s| s.split(']').next());
    default.map(str::to_owned)
}

#[test]
fn the_help_of_schedule_states_the_defaults() {
    let options = FrequencyOptions::default();
    let name = |value: serde_json::Result<Value>| value.unwrap().as_str().unwrap().to_owned();
    for (flag, default) in [
        ("--rules", name(serde_json::to_value(options.rules))),
        ("--max-scale", options.max_scale.to_string()),
        ("--beta", options.beta.to_string()),
        ("--steps", TrainConfig::default().steps.to_string()),
    ] {
        assert_eq!(stated("schedule", flag), Some(default), "{flag}");
    }
}

#[test]
fn the_help_states_the_defaults() {
    let (train, run) = (TrainConfig::default(), RunConfig::default());
    for (flag, default) in [
        ("--steps", train.steps.to_string()),
        ("--seed", train.seed.to_string()),
        ("--policy", train.policy.to_string()),
        ("--for", Purpose::default().name().to_owned()),
        ("--init", run.init.to_string()),
        ("--max-resolution", run.capture.max_resolution.to_string()),
        ("--test-every", run.capture.test_every.to_string()),
    ] {
        assert_eq!(stated("train", flag), Some(default), "{flag}");
    }
}

#[test]
fn train_has_at_most_30_options() {
    let mut all = super::Cli::command();
    all.build();
    let train = all.find_subcommand("train").unwrap();
    let options: Vec<&str> = train
        .get_arguments()
        .filter(|arg| !(arg.is_hide_set() || arg.is_positional()))
        .map(|arg| arg.get_id().as_str())
        .collect();
    assert!((20..=30).contains(&options.len()), "{}: {options:?}", options.len());
    // Those of every command count too.
    assert!(options.contains(&"help") && options.contains(&"threads"), "{options:?}");
}
