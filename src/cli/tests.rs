//! Unit tests of the command line: defaults stated in the help.

use clap::CommandFactory as _;
use litetex_gs::frequency::FrequencyOptions;
use litetex_gs::run::RunConfig;
use litetex_gs::train::TrainConfig;
use serde_json::Value;

#[test]
fn the_arguments_are_consistent() {
    super::Cli::command().debug_assert();
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
        ("--scale-rule", name(serde_json::to_value(options.scale_rule))),
        ("--cap-rule", name(serde_json::to_value(options.cap_rule))),
        ("--max-scale", options.max_scale.to_string()),
        ("--beta", options.beta.to_string()),
        ("--steps", TrainConfig::default().steps.to_string()),
    ] {
        assert_eq!(stated("schedule", flag), Some(default), "{flag}");
    }
    assert!(options.noise_robust, "--keep-noise switches it off");
}

#[test]
fn the_help_states_the_defaults() {
    let (train, run) = (TrainConfig::default(), RunConfig::default());
    for (flag, default) in [
        ("--steps", train.steps.to_string()),
        ("--seed", train.seed.to_string()),
        ("--sh-degree", train.sh_degree.to_string()),
        ("--policy", train.policy.to_string()),
        ("--eval-every", train.eval_every.to_string()),
        ("--save-every", train.save_every.to_string()),
        ("--init", run.init.to_string()),
        ("--max-resolution", run.capture.max_resolution.to_string()),
        ("--test-every", run.capture.test_every.to_string()),
        ("--image-cache", format!("{}GiB", run.capture.image_cache_bytes >> 30)),
    ] {
        assert_eq!(stated("train", flag), Some(default), "{flag}");
    }
    assert_eq!(train.background, [0.0; 3], "--background says black");
}
