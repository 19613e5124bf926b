//! Arguments of `litetex-lab bench`.

use litetex_gs::console::values::{parse_duration_secs, parse_shard, whole};
use litetex_lab::matrix::{NamedArgs, SceneEntry};
use litetex_lab::words;
use std::path::PathBuf;

/// Train a matrix of scenes, variants, budgets and seeds, and collect the results
///
/// Every run is a "litetex train" of its own and adds one line to results.jsonl, even if it fails. Called again with
/// the same folder, bench skips finished runs, and so continues an interrupted benchmark. Results of several folders
/// or machines are merged by concatenating the files. "litetex-lab chart" makes charts and tables of them.
#[derive(clap::Args)]
pub struct BenchArgs {
    /// Folder for the results
    #[arg(long, short, value_name = "FOLDER")]
    pub(super) out: PathBuf,
    /// Matrix as a TOML file with tables scene (path), variant and budget (name), each with args, and the lists seeds
    /// and common; lab/results-schema.md shows one. Flags replace what the file says
    #[arg(long, value_name = "FILE", help_heading = "Matrix")]
    pub(super) config: Option<PathBuf>,
    /// Captures: CAPTURE or "NAME: CAPTURE"
    #[arg(long, value_name = "SCENE", num_args = 1.., value_parser = words::parse_scene, help_heading = "Matrix")]
    pub(super) scene: Vec<SceneEntry>,
    /// What to compare: "NAME: ARGUMENTS of litetex train", or just the name of a policy such as fixed:4; may be
    /// repeated
    #[arg(long, value_name = "VARIANT", value_parser = words::parse_named_args, help_heading = "Matrix")]
    pub(super) variant: Vec<NamedArgs>,
    /// Model size or run length at which to compare: "NAME: ARGUMENTS"; may be repeated
    #[arg(long, value_name = "BUDGET", value_parser = words::parse_named_args, help_heading = "Matrix")]
    pub(super) budget: Vec<NamedArgs>,
    /// Seeds, one repetition each: numbers and ranges like 1,2,5-8 [default: 42]
    #[arg(long, value_name = "SEEDS", help_heading = "Matrix")]
    pub(super) seeds: Option<String>,
    /// Arguments of all runs; those of variants and budgets take precedence
    #[arg(long, value_name = "ARGUMENTS", allow_hyphen_values = true, value_parser = parse_words, help_heading = "Matrix")]
    pub(super) common: Option<Words>,
    /// Run only this part of the matrix: 1/3, 2/3 and 3/3 divide it among three machines
    #[arg(long, value_name = "PART/PARTS", value_parser = parse_shard, default_value = "1/1")]
    pub(super) shard: (usize, usize),
    /// Number of concurrent runs; with more than 1, their times do not count
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = whole::<u16>(1..=256))]
    pub(super) jobs: u16,
    /// Stop a run after this time and count it as failed: 90s, 20m, 1h30m [default: no limit]
    #[arg(long, value_name = "TIME", value_parser = parse_duration_secs)]
    pub(super) timeout: Option<f64>,
    /// Continue with the unfinished runs; the default if the folder contains results
    #[arg(long, conflicts_with = "force")]
    pub(super) resume: bool,
    /// Repeat failed runs
    #[arg(long)]
    pub(super) retry_failed: bool,
    /// Stop at the first failed run instead of continuing with the others
    #[arg(long)]
    pub(super) fail_fast: bool,
    /// Keep checkpoints, images and metrics of the runs, not only summary.json and config.toml
    #[arg(long)]
    pub(super) keep_runs: bool,
    /// Do not measure the size of the .ltgs file that "litetex export --quality tiny" writes of each run
    #[arg(long)]
    pub(super) no_export: bool,
    /// Delete the results and runs of an earlier benchmark in the folder and start from scratch
    #[arg(long)]
    pub(super) force: bool,
    /// The litetex program that trains [default: the one beside this program]
    #[arg(long, value_name = "FILE")]
    pub(super) binary: Option<PathBuf>,
    /// Run nothing: list the runs, which are done, and how long the others should take, estimated from similar runs
    #[arg(long, visible_alias = "estimate")]
    pub(super) dry_run: bool,
}

/// Words of one argument.
#[derive(Clone)]
pub struct Words(pub(super) Vec<String>);

fn parse_words(text: &str) -> Result<Words, String> {
    words::split_words(text).map(Words)
}
