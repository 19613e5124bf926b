//! The matrix of a benchmark: scenes x variants x budgets x seeds, from flags or a TOML file, as a list of
//! cells with the arguments of their `litetex train`. Nothing here runs anything.

use super::words::with_policy;
use crate::cli::train_args::TrainArgs;
use crate::cli::{Cli, Command};
use clap::Parser;
use litetex_gs::{Error, Result};
use serde::Deserialize;
use std::collections::{HashMap, HashSet};
use std::path::{Path, PathBuf};

/// Longest name of a scene, variant or budget: names stand in tables and legends.
const NAME_CHARS_MAX: usize = 60;
/// Most runs of a matrix; more is a slip of the keyboard.
const CELLS_MAX: usize = 100_000;
/// The one variant or budget of a matrix that names none.
const DEFAULT_NAME: &str = "default";

/// A capture.
#[derive(Clone, Debug, PartialEq, Eq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Scene {
    /// Name in results; the folder's if empty.
    #[serde(default)]
    pub name: String,
    /// Folder, relative to the working folder.
    pub path: PathBuf,
    /// Arguments that go with it.
    #[serde(default)]
    pub args: Vec<String>,
}

/// A variant or a budget.
#[derive(Clone, Debug, PartialEq, Eq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Setting {
    /// Name in results.
    pub name: String,
    /// Arguments.
    #[serde(default)]
    pub args: Vec<String>,
}

/// What is to be run. Of an argument that is given more than once the last holds: common, then the scene's,
/// the variant's, the budget's.
#[derive(Clone, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Matrix {
    /// Captures.
    #[serde(rename = "scene")]
    pub scenes: Vec<Scene>,
    /// What is compared; a bare name of a policy is that policy.
    #[serde(rename = "variant")]
    pub variants: Vec<Setting>,
    /// At which sizes or lengths.
    #[serde(rename = "budget")]
    pub budgets: Vec<Setting>,
    /// Repetitions.
    pub seeds: Vec<u64>,
    /// Arguments of all runs.
    pub common: Vec<String>,
}

/// One run.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Cell {
    /// Position in the matrix.
    pub index: usize,
    /// Equal for runs that are meant to be the same.
    pub key: String,
    /// Name of the scene.
    pub scene: String,
    /// Folder of the capture.
    pub path: PathBuf,
    /// Name of the variant.
    pub variant: String,
    /// Name of the budget.
    pub budget: String,
    /// Seed.
    pub seed: u64,
    /// Arguments besides capture, folder and seed.
    pub args: Vec<String>,
}

impl Matrix {
    /// Reads a file.
    ///
    /// # Errors
    /// [`Error::Io`], [`Error::InvalidInput`] naming line and key.
    pub fn read(path: &Path) -> Result<Self> {
        let text = std::fs::read_to_string(path).map_err(|e| Error::io(path, e))?;
        toml::from_str(&text).map_err(|e| Error::invalid(path, e.to_string().trim_end().to_owned()))
    }

    /// All runs. Repetitions are outermost and variants innermost, so that an interrupted benchmark has whole
    /// pairs to compare and a machine that gets busier slows all variants alike.
    ///
    /// # Errors
    /// [`Error::Usage`] naming what is missing, double or not understood; [`Error::Io`] for a file among the
    /// arguments.
    pub fn cells(&self) -> Result<Vec<Cell>> {
        let matrix = self.checked()?;
        let mut cells = Vec::new();
        for &seed in &matrix.seeds {
            for scene in &matrix.scenes {
                for budget in &matrix.budgets {
                    for variant in &matrix.variants {
                        let parts = [&matrix.common, &scene.args, &variant.args, &budget.args];
                        let args: Vec<String> = parts.into_iter().flatten().cloned().collect();
                        let what = format!(
                            "scene {:?}, variant {:?}, budget {:?}",
                            scene.name, variant.name, budget.name
                        );
                        let parsed = parse_train(&args).map_err(|e| Error::Usage(format!("{what}: {e}")))?;
                        cells.push(Cell {
                            index: cells.len(),
                            key: key(&scene.name, &args, seed, parsed.config.as_deref())?,
                            scene: scene.name.clone(),
                            path: scene.path.clone(),
                            variant: variant.name.clone(),
                            budget: budget.name.clone(),
                            seed,
                            args,
                        });
                    }
                }
            }
        }
        let mut keys = HashSet::new();
        if let Some(cell) = cells.iter().find(|c| !keys.insert(&c.key)) {
            return Err(Error::Usage(format!(
                "scene {:?}, variant {:?}, budget {:?}: the same arguments as another variant and budget: {}; \
                 leave one out",
                cell.scene,
                cell.variant,
                cell.budget,
                cell.args.join(" ")
            )));
        }
        Ok(cells)
    }

    /// The matrix with its defaults, held to what names must be.
    fn checked(&self) -> Result<Self> {
        let mut matrix = self.clone();
        if matrix.scenes.is_empty() {
            return Err(Error::Usage(
                "no scene given: litetex bench --scene <CAPTURE>... -o <FOLDER>, or [[scene]] in --config"
                    .to_owned(),
            ));
        }
        for scene in &mut matrix.scenes {
            if scene.name.is_empty() {
                let absolute = std::path::absolute(&scene.path).map_err(|e| Error::io(&scene.path, e))?;
                scene.name = absolute.file_name().unwrap_or_default().to_string_lossy().into_owned();
            }
        }
        matrix.variants.iter_mut().for_each(with_policy);
        for settings in [&mut matrix.variants, &mut matrix.budgets] {
            if settings.is_empty() {
                settings.push(Setting { name: DEFAULT_NAME.to_owned(), args: Vec::new() });
            }
        }
        if matrix.seeds.is_empty() {
            matrix.seeds.push(litetex_gs::train::TrainConfig::default().seed);
        }
        check_names("scene", matrix.scenes.iter().map(|s| &s.name))?;
        check_names("variant", matrix.variants.iter().map(|s| &s.name))?;
        check_names("budget", matrix.budgets.iter().map(|s| &s.name))?;
        let mut seen = HashSet::new();
        if let Some(seed) = matrix.seeds.iter().find(|s| !seen.insert(**s)) {
            return Err(Error::Usage(format!(
                "seed {seed} is given twice; the same run would be counted twice"
            )));
        }
        let sizes = [matrix.scenes.len(), matrix.variants.len(), matrix.budgets.len(), matrix.seeds.len()];
        let count = sizes.iter().try_fold(1_usize, |n, &m| n.checked_mul(m)).unwrap_or(usize::MAX);
        if count > CELLS_MAX {
            return Err(Error::Usage(format!("the matrix has {count} runs, expected at most {CELLS_MAX}")));
        }
        Ok(matrix)
    }
}

fn check_names<'a>(kind: &str, names: impl Iterator<Item = &'a String>) -> Result<()> {
    let mut seen = HashSet::new();
    for name in names {
        let chars = name.chars().count();
        if chars == 0 || chars > NAME_CHARS_MAX || name.chars().any(char::is_control) || name.trim() != name {
            return Err(Error::Usage(format!(
                "{kind} {name:?}: expected a name of 1 to {NAME_CHARS_MAX} characters on one line, with no blanks \
                 around it"
            )));
        }
        if !seen.insert(name) {
            return Err(Error::Usage(format!(
                "two {kind}s are called {name:?}; give them names of their own (\"NAME: ...\")"
            )));
        }
    }
    Ok(())
}

/// Understands arguments as `litetex train` does, and refuses what every run gets from the matrix.
fn parse_train(args: &[String]) -> Result<TrainArgs, String> {
    // Quiet, as the runs will be: what contradicts it is found here.
    let words = ["litetex", "train", "--quiet"].into_iter().chain(args.iter().map(String::as_str));
    let cli = Cli::try_parse_from(words).map_err(|e| {
        let text = e.render().to_string();
        // Without the usage of another command and the pointer to its help.
        let head = text.split("\n\n").next().unwrap_or_default();
        head.trim_start_matches("error: ").trim().to_owned()
    })?;
    let Command::Train(parsed) = cli.command else {
        return Err("not arguments of litetex train".to_owned());
    };
    for (given, what) in [
        (parsed.capture.is_some(), "a capture: name it as a scene"),
        (parsed.out.is_some(), "--out: every run has its own folder"),
        (parsed.force, "--force: finished runs are not made again, or all with --force of litetex bench"),
        (parsed.resume.is_some(), "--resume: every run starts anew"),
        (parsed.training.seed.is_some(), "--seed: give --seeds"),
    ] {
        if given {
            return Err(format!("the arguments hold {what}"));
        }
    }
    Ok(*parsed)
}

/// FNV-1a over everything that makes the result, as text.
fn key(scene: &str, args: &[String], seed: u64, config: Option<&Path>) -> Result<String> {
    let config = match config {
        None => String::new(),
        Some(path) => std::fs::read_to_string(path).map_err(|e| Error::io(path, e))?,
    };
    let whole = serde_json::json!([scene, args, seed, config, env!("CARGO_PKG_VERSION")]).to_string();
    let hash = whole
        .bytes()
        .fold(0xcbf2_9ce4_8422_2325_u64, |h, b| (h ^ u64::from(b)).wrapping_mul(0x0100_0000_01b3));
    Ok(format!("{hash:016x}"))
}

/// Runs that belong to one part of `of`. All variants of a seed, scene and budget stay together: they are
/// compared with each other and so must run on the same machine.
pub fn shard(cells: Vec<Cell>, part: usize, of: usize) -> Vec<Cell> {
    let mut groups: HashMap<(u64, String, String), usize> = HashMap::new();
    let mut mine = Vec::new();
    for cell in cells {
        let next = groups.len();
        let group = (cell.seed, cell.scene.clone(), cell.budget.clone());
        if *groups.entry(group).or_insert(next) % of == part - 1 {
            mine.push(cell);
        }
    }
    mine
}

#[cfg(test)]
mod tests {
    use super::*;

    fn setting(text: &str) -> Setting {
        super::super::words::parse_setting(text).unwrap()
    }

    fn matrix() -> Matrix {
        Matrix {
            scenes: ["captures/a", "captures/b"]
                .map(|p| crate::cli::bench::words::parse_scene(p).unwrap())
                .into(),
            variants: vec![setting("plain"), setting("textured")],
            budgets: vec![setting("short: --steps 10"), setting("long: --steps 20")],
            seeds: vec![1, 2, 3],
            common: vec!["--steps".to_owned(), "5".to_owned()],
        }
    }

    #[test]
    fn cells_pair_variants_and_later_arguments_win() {
        let cells = matrix().cells().unwrap();
        assert_eq!(cells.len(), 24);
        let names: Vec<_> =
            cells[..3].iter().map(|c| format!("{} {} {}", c.scene, c.budget, c.variant)).collect();
        assert_eq!(names, ["a short plain", "a short textured", "a long plain"]);
        assert_eq!(cells[0].args, ["--steps", "5", "--policy", "plain", "--steps", "10"]);
        assert_eq!(parse_train(&cells[0].args).unwrap().training.steps, Some(10));
        assert!(cells[..8].iter().all(|c| c.seed == 1) && cells[23].seed == 3);
        // The same matrix, the same keys; another seed, others.
        assert_eq!(cells, matrix().cells().unwrap());
        let others = Matrix { seeds: vec![4], ..matrix() }.cells().unwrap();
        assert!(others.iter().all(|c| cells.iter().all(|d| d.key != c.key)));
    }

    #[test]
    fn shards_are_disjoint_whole_and_keep_pairs_together() {
        let all = matrix().cells().unwrap();
        let shards: Vec<Vec<Cell>> = (1..=5).map(|i| shard(all.clone(), i, 5)).collect();
        let mut merged: Vec<Cell> = shards.concat();
        merged.sort_by_key(|c| c.index);
        assert_eq!(merged, all);
        for cells in &shards {
            let plain = cells.iter().filter(|c| c.variant == "plain").count();
            assert!(!cells.is_empty() && 2 * plain == cells.len());
        }
        assert_eq!(shard(all.clone(), 1, 1), all);
    }

    #[test]
    fn slips_are_named_before_anything_runs() {
        let base = matrix();
        let variants =
            |v: &[&str]| Matrix { variants: v.iter().map(|t| setting(t)).collect(), ..base.clone() };
        for (matrix, part) in [
            (Matrix { scenes: vec![], ..base.clone() }, "--scene"),
            (Matrix { seeds: vec![1, 1], ..base.clone() }, "seed 1 is given twice"),
            (variants(&["a: --colour blue"]), "--colour"),
            (variants(&["a: --policy fixed:1"]), "fixed:R"),
            (variants(&["a", "a: --policy none"]), "two variants are called \"a\""),
            (variants(&["a", "b"]), "the same arguments"),
            (variants(&["a: --seed 3"]), "--seeds"),
            (variants(&["a: -o x"]), "--out"),
            (variants(&["a: --force"]), "--force"),
            (variants(&["a: --resume x"]), "--resume"),
            (variants(&["a: captures/c"]), "a capture"),
            (variants(&["a: --help"]), "variant \"a\""),
            (Matrix { scenes: vec![base.scenes[0].clone(); 2], ..base.clone() }, "two scenes"),
        ] {
            let error = matrix.cells().unwrap_err();
            assert_eq!(error.exit_code(), 2, "{error}");
            assert!(error.to_string().contains(part), "{part}: {error}");
        }
    }

    #[test]
    fn a_file_says_the_same_as_flags() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("m.toml");
        let text = r#"
            seeds = [1, 2, 3]
            common = ["--steps", "5"]
            [[scene]]
            path = "captures/a"
            [[scene]]
            path = "captures/b"
            [[variant]]
            name = "plain"
            [[variant]]
            name = "textured"
            [[budget]]
            name = "short"
            args = ["--steps", "10"]
            [[budget]]
            name = "long"
            args = ["--steps", "20"]
        "#;
        std::fs::write(&path, text).unwrap();
        assert_eq!(Matrix::read(&path).unwrap(), matrix());
        std::fs::write(&path, "[[varian]]\nname = 'x'").unwrap();
        let error = Matrix::read(&path).unwrap_err();
        assert!(error.exit_code() == 3 && error.to_string().contains("varian"), "{error}");
    }

    #[test]
    fn a_changed_configuration_file_is_another_run() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("c.toml");
        let mut matrix = matrix();
        matrix.common = vec!["--config".to_owned(), path.to_str().unwrap().to_owned()];
        assert_eq!(matrix.cells().unwrap_err().exit_code(), 3);
        std::fs::write(&path, "[train]\nsteps = 3\n").unwrap();
        let before = matrix.cells().unwrap();
        std::fs::write(&path, "[train]\nsteps = 4\n").unwrap();
        let after = matrix.cells().unwrap();
        assert!(before.iter().zip(&after).all(|(b, a)| b.key != a.key && b.args == a.args));
    }
}
