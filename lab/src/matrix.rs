//! The matrix of a benchmark: scenes x variants x budgets x seeds, from flags or a TOML file, expanded into cells
//! with the arguments of their `litetex train`.

use crate::checks::Check;
use litetex_gs::{Error, Result, input_file};
use serde::Deserialize;
use std::collections::{BTreeSet, HashMap, HashSet};
use std::path::{Path, PathBuf};

/// Longest name of a scene, variant or budget: names appear in tables and legends.
const NAME_CHARS_MAX: usize = 60;
/// Most cells of a matrix; more is probably a typing error.
const CELLS_MAX: usize = 100_000;
/// Largest matrix or settings file that is read.
const FILE_BYTES_MAX: u64 = 1 << 24;
/// The only variant or budget of a matrix that names none.
const DEFAULT_NAME: &str = "default";

/// What a matrix must know of the commands that its cells run.
pub trait Commands {
    /// The flag of `train` that takes a bare variant's name: `--policy` or `--profile`.
    fn flag_of(&self, name: &str) -> Option<&'static str>;

    /// Seed of a matrix that lists none.
    fn default_seed(&self) -> u64;

    /// Checks the arguments of `litetex train`, `sample` or `eval`, or of `litetex-lab figures`.
    ///
    /// # Errors
    /// A message that says which argument is wrong.
    fn check(&self, command: &str, args: &[String]) -> Result<(), String>;
}

/// A capture to train on.
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct SceneEntry {
    /// Name in the results; the file name of `path` if empty.
    pub name: String,
    /// The capture, relative to the working directory; empty for one that `sample` makes.
    pub path: PathBuf,
    /// Arguments of the command that makes the capture.
    pub sample: Vec<String>,
    /// Arguments for runs on this capture.
    pub args: Vec<String>,
    /// Arguments of the command that evaluates runs on this capture.
    pub eval: Vec<String>,
    /// Arguments of `litetex-lab figures` for runs on this capture.
    pub figures: Vec<String>,
    /// What is expected of runs on this capture.
    #[serde(rename = "check")]
    pub checks: Vec<Check>,
}

/// A variant or a budget: arguments under a name.
#[derive(Clone, Debug, PartialEq, Eq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct NamedArgs {
    /// Name in the results.
    pub name: String,
    /// Arguments of `litetex train`.
    #[serde(default)]
    pub args: Vec<String>,
}

/// What to run. Where an argument is repeated the last one wins, in the order common, scene, variant, budget.
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Matrix {
    /// Captures to train on.
    #[serde(rename = "scene")]
    pub scenes: Vec<SceneEntry>,
    /// What is compared. A bare name of a policy stands for that policy.
    #[serde(rename = "variant")]
    pub variants: Vec<NamedArgs>,
    /// Sizes or lengths at which variants are compared.
    #[serde(rename = "budget")]
    pub budgets: Vec<NamedArgs>,
    /// One repetition per seed.
    pub seeds: Vec<u64>,
    /// Arguments of all runs.
    pub common: Vec<String>,
    /// Arguments for making all captures that a command makes.
    pub sample: Vec<String>,
    /// Arguments for evaluating all runs.
    pub eval: Vec<String>,
}

/// One run of a matrix.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Cell {
    /// Position in the matrix.
    pub index: usize,
    /// Equal for runs that should give the same result.
    pub key: String,
    /// Name of the scene.
    pub scene: String,
    /// The capture to train on; empty for one that `sample` makes.
    pub path: PathBuf,
    /// Arguments of the command that makes the capture; empty if it exists.
    pub sample: Vec<String>,
    /// Name of the variant.
    pub variant: String,
    /// Name of the budget.
    pub budget: String,
    /// Seed for `litetex train`.
    pub seed: u64,
    /// Arguments besides capture, output folder and seed.
    pub args: Vec<String>,
    /// Arguments of the command that evaluates the run afterwards; empty if none does.
    pub eval: Vec<String>,
    /// Arguments of `litetex-lab figures`; empty if it is not run.
    pub figures: Vec<String>,
}

/// What stands for the folder of the capture in arguments.
pub const CAPTURE: &str = "{capture}";
/// What stands for the folder of the run in arguments of evaluations.
pub const RUN: &str = "{run}";

/// Replaces [`CAPTURE`] and [`RUN`].
pub fn with_folders(args: &[String], capture: &Path, run: &Path) -> Vec<String> {
    let [capture, run] = [capture, run].map(|path| path.display().to_string());
    args.iter().map(|arg| arg.replace(CAPTURE, &capture).replace(RUN, &run)).collect()
}

impl Matrix {
    /// Reads a TOML file.
    ///
    /// # Errors
    /// [`Error::Io`]; [`Error::InvalidInput`] naming line and key.
    pub fn read(path: &Path) -> Result<Self> {
        let text = input_file::read_text(path, FILE_BYTES_MAX)?;
        toml::from_str(&text).map_err(|e| Error::invalid(path, e.to_string().trim_end().to_owned()))
    }

    /// Lists all runs. Seeds vary slowest and variants fastest, so that an interrupted benchmark has complete pairs
    /// and a machine that slows down affects all variants alike.
    ///
    /// # Errors
    /// [`Error::Usage`] naming what is missing, duplicated or not understood; [`Error::Io`] for a settings file
    /// among the arguments.
    pub fn cells(&self, command: &impl Commands) -> Result<Vec<Cell>> {
        let matrix = self.completed(command)?;
        let mut cells = Vec::new();
        for &seed in &matrix.seeds {
            for scene in &matrix.scenes {
                for budget in &matrix.budgets {
                    for variant in &matrix.variants {
                        cells.push(matrix.cell(cells.len(), scene, variant, budget, seed, command)?);
                    }
                }
            }
        }
        check_distinct(&cells)?;
        Ok(cells)
    }

    fn cell(
        &self,
        index: usize,
        scene: &SceneEntry,
        variant: &NamedArgs,
        budget: &NamedArgs,
        seed: u64,
        command: &impl Commands,
    ) -> Result<Cell> {
        let args = [&*self.common, &scene.args, &variant.args, &budget.args].concat();
        let sample =
            if scene.sample.is_empty() { Vec::new() } else { [&*self.sample, &scene.sample].concat() };
        let eval = [&*self.eval, &scene.eval].concat();
        for (name, args) in
            [("train", &args), ("sample", &sample), ("eval", &eval), ("figures", &scene.figures)]
        {
            let (scene, variant, budget) = (&scene.name, &variant.name, &budget.name);
            let names = match name {
                "train" => format!("scene {scene:?}, variant {variant:?}, budget {budget:?}"),
                _ => format!("scene {scene:?}"),
            };
            // Without arguments only `train` is run.
            if name == "train" || !args.is_empty() {
                command.check(name, args).map_err(|e| Error::Usage(format!("{names}: {e}")))?;
            }
        }
        Ok(Cell {
            index,
            key: key(&scene.name, &args, &sample, &[&*eval, &scene.figures].concat(), seed)?,
            scene: scene.name.clone(),
            path: scene.path.clone(),
            sample,
            variant: variant.name.clone(),
            budget: budget.name.clone(),
            seed,
            args,
            eval,
            figures: scene.figures.clone(),
        })
    }

    /// The matrix with its defaults filled in, after all checks that need no run.
    fn completed(&self, command: &impl Commands) -> Result<Self> {
        let mut matrix = self.clone();
        if matrix.scenes.is_empty() {
            return Err(Error::Usage(
                "no scene given: litetex-lab bench --scene <CAPTURE>... -o <FOLDER>, or [[scene]] in --config"
                    .to_owned(),
            ));
        }
        for scene in &matrix.scenes {
            if scene.path.as_os_str().is_empty() == scene.sample.is_empty() {
                return Err(Error::Usage(format!(
                    "scene {:?}: expected either path, a capture, or sample, the arguments that make one",
                    scene.name
                )));
            }
            if !scene.sample.is_empty() && scene.name.is_empty() {
                return Err(Error::Usage("a scene with sample needs a name".to_owned()));
            }
        }
        for scene in matrix.scenes.iter_mut().filter(|s| s.name.is_empty()) {
            let absolute = std::path::absolute(&scene.path).map_err(|e| Error::io(&scene.path, e))?;
            scene.name = absolute.file_name().unwrap_or_default().to_string_lossy().into_owned();
        }
        // "fixed:4" is meant as the policy, not as the default settings under this name.
        for variant in matrix.variants.iter_mut().filter(|v| v.args.is_empty()) {
            if let Some(flag) = command.flag_of(&variant.name) {
                variant.args = [flag, &variant.name].map(ToOwned::to_owned).into();
            }
        }
        for settings in [&mut matrix.variants, &mut matrix.budgets] {
            if settings.is_empty() {
                settings.push(NamedArgs { name: DEFAULT_NAME.to_owned(), args: Vec::new() });
            }
        }
        if matrix.seeds.is_empty() {
            matrix.seeds.push(command.default_seed());
        }
        check_names("scene", matrix.scenes.iter().map(|s| &s.name))?;
        check_names("variant", matrix.variants.iter().map(|s| &s.name))?;
        check_names("budget", matrix.budgets.iter().map(|s| &s.name))?;
        matrix.check_seeds_and_size()?;
        matrix.check_checks()?;
        Ok(matrix)
    }

    /// Refuses checks that make no sense, or refer to scenes or variants that are not in the matrix.
    ///
    /// # Errors
    /// [`Error::Usage`] naming the check.
    pub fn check_checks(&self) -> Result<()> {
        let is_scene = |name: &String| self.scenes.iter().any(|s| s.name == *name);
        let is_variant = |name: &String| self.variants.iter().any(|v| v.name == *name);
        for (scene, check) in self.scenes.iter().flat_map(|s| s.checks.iter().map(move |c| (s, c))) {
            let of_scene = |what: String| Error::Usage(format!("scene {:?}: {what}", scene.name));
            check.validate().map_err(of_scene)?;
            let scenes = [&check.from_scene, &check.over_scene];
            let variants = [&check.from_variant, &check.over_variant, &check.times_variant];
            let unknown = (scenes.into_iter().flatten().find(|name| !is_scene(name)))
                .or_else(|| variants.into_iter().flatten().find(|name| !is_variant(name)));
            if let Some(name) = unknown {
                return Err(of_scene(format!("check {:?}: {name:?} is not in the matrix", check.title())));
            }
        }
        Ok(())
    }

    fn check_seeds_and_size(&self) -> Result<()> {
        let mut seen = HashSet::new();
        if let Some(seed) = self.seeds.iter().find(|s| !seen.insert(**s)) {
            return Err(Error::Usage(format!(
                "seed {seed} is given twice; the same run would be counted twice"
            )));
        }
        let sizes = [self.scenes.len(), self.variants.len(), self.budgets.len(), self.seeds.len()];
        let count = sizes.iter().try_fold(1_usize, |n, &m| n.checked_mul(m)).unwrap_or(usize::MAX);
        if count > CELLS_MAX {
            return Err(Error::Usage(format!("the matrix has {count} runs, expected at most {CELLS_MAX}")));
        }
        Ok(())
    }
}

/// Refuses names that do not fit into tables and legends, and duplicates.
fn check_names<'a>(kind: &str, names: impl Iterator<Item = &'a String>) -> Result<()> {
    let mut seen = HashSet::new();
    for name in names {
        let chars = name.chars().count();
        if chars == 0 || chars > NAME_CHARS_MAX || name.chars().any(char::is_control) || name.trim() != name {
            return Err(Error::Usage(format!(
                "{kind} {name:?}: expected a name of 1 to {NAME_CHARS_MAX} characters on one line, without blanks \
                 at either end"
            )));
        }
        if !seen.insert(name) {
            return Err(Error::Usage(format!(
                "two {kind}s are called {name:?}; name them differently (\"NAME: ...\")"
            )));
        }
    }
    Ok(())
}

/// Refuses cells that would repeat the same run under another name.
fn check_distinct(cells: &[Cell]) -> Result<()> {
    let mut keys = HashSet::new();
    match cells.iter().find(|c| !keys.insert(&c.key)) {
        None => Ok(()),
        Some(cell) => Err(Error::Usage(format!(
            "scene {:?}, variant {:?}, budget {:?}: the same arguments as another variant and budget: {}; leave one \
             out",
            cell.scene,
            cell.variant,
            cell.budget,
            cell.args.join(" ")
        ))),
    }
}

/// FNV-1a over everything that shapes the result, as text, with the last settings file among the arguments.
fn key(scene: &str, args: &[String], sample: &[String], eval: &[String], seed: u64) -> Result<String> {
    let file_of = |(at, word): (usize, &String)| match word.strip_prefix("--config")? {
        "" => args.get(at + 1).map(PathBuf::from),
        rest => rest.strip_prefix('=').map(PathBuf::from),
    };
    let config = match args.iter().enumerate().filter_map(file_of).next_back() {
        None => String::new(),
        Some(path) => input_file::read_text(&path, FILE_BYTES_MAX)?,
    };
    let whole =
        serde_json::json!([scene, args, sample, eval, seed, config, env!("CARGO_PKG_VERSION")]).to_string();
    let hash = whole
        .bytes()
        .fold(0xcbf2_9ce4_8422_2325_u64, |h, b| (h ^ u64::from(b)).wrapping_mul(0x0100_0000_01b3));
    Ok(format!("{hash:016x}"))
}

/// Checks that the captures of these cells exist, so that a missing one is reported once and not by every run.
///
/// # Errors
/// [`Error::InvalidInput`] naming the first that is missing, and all scenes without one.
pub fn check_captures(cells: &[&Cell]) -> Result<()> {
    let missing: Vec<_> = cells.iter().filter(|c| c.sample.is_empty() && !c.path.exists()).collect();
    let Some(first) = missing.first() else { return Ok(()) };
    let scenes: BTreeSet<String> = missing.iter().map(|c| format!("{:?}", c.scene)).collect();
    let scenes = scenes.into_iter().collect::<Vec<_>>().join(", ");
    let what = format!(
        "no such capture; {} runs need the captures of {scenes}: correct the paths, or leave these scenes out",
        missing.len()
    );
    Err(Error::invalid(&first.path, what))
}

/// The runs of one part of `of`. All variants of a seed, scene and budget stay together: they are compared with each
/// other and so must run on the same machine.
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
    use crate::words::{parse_named_args, parse_scene};

    /// Knows two policies and refuses flags that begin with `--x`.
    struct Command;

    impl Commands for Command {
        fn flag_of(&self, name: &str) -> Option<&'static str> {
            ["plain", "fixed:4"].contains(&name).then_some("--policy")
        }

        fn default_seed(&self) -> u64 {
            42
        }

        fn check(&self, _: &str, args: &[String]) -> Result<(), String> {
            args.iter()
                .find(|a| a.starts_with("--x"))
                .map_or(Ok(()), |wrong| Err(format!("{wrong}: unknown")))
        }
    }

    fn named(text: &str) -> NamedArgs {
        parse_named_args(text).unwrap()
    }

    fn matrix() -> Matrix {
        Matrix {
            scenes: ["captures/a", "captures/b"].map(|p| parse_scene(p).unwrap()).into(),
            variants: vec![named("plain"), named("textured")],
            budgets: vec![named("short: --steps 10"), named("long: --steps 20")],
            seeds: vec![1, 2, 3],
            common: vec!["--steps".to_owned(), "5".to_owned()],
            ..Matrix::default()
        }
    }

    #[test]
    fn cells_pair_variants_and_later_arguments_come_last() {
        let cells = matrix().cells(&Command).unwrap();
        assert_eq!(cells.len(), 24);
        let names: Vec<_> =
            cells[..3].iter().map(|c| format!("{} {} {}", c.scene, c.budget, c.variant)).collect();
        assert_eq!(names, ["a short plain", "a short textured", "a long plain"]);
        assert_eq!(cells[0].args, ["--steps", "5", "--policy", "plain", "--steps", "10"]);
        assert!(cells[..8].iter().all(|c| c.seed == 1) && cells[23].seed == 3);
        // The same matrix has the same keys, another seed others.
        assert_eq!(cells, matrix().cells(&Command).unwrap());
        let others = Matrix { seeds: vec![4], ..matrix() }.cells(&Command).unwrap();
        assert!(others.iter().all(|c| cells.iter().all(|d| d.key != c.key)));
        let default = Matrix { seeds: vec![], ..matrix() }.cells(&Command).unwrap();
        assert!(default.iter().all(|c| c.seed == 42));
    }

    #[test]
    fn bare_policy_names_select_that_policy() {
        let args = |variant: &str| {
            let matrix = Matrix {
                variants: vec![named(variant)],
                budgets: vec![],
                seeds: vec![],
                common: vec![],
                ..matrix()
            };
            matrix.cells(&Command).unwrap()[0].args.join(" ")
        };
        for name in ["plain", "fixed:4"] {
            assert_eq!(args(name), format!("--policy {name}"));
        }
        // Negative controls: other names, and names with arguments of their own.
        for (text, meant) in [("fixed:1", ""), ("Plain", ""), ("plain: --steps 3", "--steps 3")] {
            assert_eq!(args(text), meant, "{text}");
        }
    }

    #[test]
    fn shards_are_disjoint_complete_and_keep_pairs_together() {
        let all = matrix().cells(&Command).unwrap();
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
    fn mistakes_are_named_before_anything_runs() {
        let base = matrix();
        let variants = |v: &[&str]| Matrix { variants: v.iter().map(|t| named(t)).collect(), ..base.clone() };
        for (matrix, part) in [
            (Matrix { scenes: vec![], ..base.clone() }, "--scene"),
            (Matrix { seeds: vec![1, 1], ..base.clone() }, "seed 1 is given twice"),
            (variants(&["a: --xyz blue"]), "variant \"a\", budget \"short\": --xyz: unknown"),
            (variants(&["a", "a: --policy none"]), "two variants are called \"a\""),
            (variants(&["a", "b"]), "the same arguments"),
            (Matrix { seeds: (0..100_000).collect(), ..base.clone() }, "has 800000 runs"),
            (Matrix { scenes: vec![base.scenes[0].clone(); 2], ..base.clone() }, "two scenes"),
        ] {
            let error = matrix.cells(&Command).unwrap_err();
            assert!(matches!(error, Error::Usage(_)) && error.to_string().contains(part), "{part}: {error}");
        }
    }

    #[test]
    fn missing_captures_are_named_once_with_the_runs_that_need_them() {
        let dir = tempfile::tempdir().unwrap();
        let scene = |name: &str| SceneEntry {
            name: name.to_owned(),
            path: dir.path().join(name),
            ..SceneEntry::default()
        };
        std::fs::create_dir(dir.path().join("here")).unwrap();
        let cells = |scenes: &[&str]| {
            let scenes = scenes.iter().map(|s| scene(s)).collect();
            Matrix { scenes, ..matrix() }.cells(&Command).unwrap()
        };
        let check = |cells: &[Cell]| check_captures(&cells.iter().collect::<Vec<_>>());
        let error = check(&cells(&["lost", "here", "gone"])).unwrap_err().to_string();
        assert!(
            error.contains("lost: no such capture; 24 runs need the captures of \"gone\", \"lost\":"),
            "{error}"
        );
        assert_eq!(error.matches("no such capture").count(), 1, "{error}");
        // Negative control.
        check(&cells(&["here"])).unwrap();
    }

    #[test]
    fn a_file_and_flags_give_the_same_matrix() {
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
        assert!(
            matches!(error, Error::InvalidInput { .. }) && error.to_string().contains("varian"),
            "{error}"
        );
    }

    #[test]
    fn captures_may_be_made_and_runs_evaluated_with_arguments_of_the_matrix() {
        let text = r#"
            sample = ["--views", "8"]
            eval = ["--worst", "{run}/worst.jpg"]
            [[scene]]
            name = "made"
            sample = ["--stress", "noise"]
            figures = ["--regions", "{capture}/regions"]
            check = [{ measure = "/quality/psnr", from-scene = "found", at-most = 1.0 }]
            [[scene]]
            name = "found"
            path = "captures/a"
        "#;
        let matrix: Matrix = toml::from_str(text).unwrap();
        let cells = matrix.cells(&Command).unwrap();
        assert_eq!(cells[0].sample, ["--views", "8", "--stress", "noise"]);
        assert!(cells[1].sample.is_empty() && cells[1].eval == ["--worst", "{run}/worst.jpg"]);
        let placed = |args: &[String]| with_folders(args, Path::new("c"), Path::new("r"));
        assert_eq!(placed(&cells[0].eval), ["--worst", "r/worst.jpg"]);
        assert_eq!(placed(&cells[0].figures), ["--regions", "c/regions"]);
        for (from, to, part) in [
            ("\"found\", at", "\"lost\", at", "\"lost\" is not in the matrix"),
            ("path = \"captures/a\"", "", "expected either path"),
            ("name = \"made\"", "", "needs a name"),
            ("\"--stress\"", "\"--xstress\"", "scene \"made\": --xstress: unknown"),
            ("\"--regions\"", "\"--xregions\"", "scene \"made\": --xregions: unknown"),
        ] {
            let wrong: Matrix = toml::from_str(&text.replace(from, to)).unwrap();
            let error = wrong.cells(&Command).unwrap_err().to_string();
            assert!(error.contains(part), "{part}: {error}");
        }
    }

    #[test]
    fn a_change_of_the_last_settings_file_changes_the_key() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("c.toml");
        let mut matrix = matrix();
        matrix.common =
            ["--config", "unread.toml", &format!("--config={}", path.display())].map(str::to_owned).into();
        assert!(matches!(matrix.cells(&Command), Err(Error::Io { .. })));
        std::fs::write(&path, "[train]\nsteps = 3\n").unwrap();
        let before = matrix.cells(&Command).unwrap();
        std::fs::write(&path, "[train]\nsteps = 4\n").unwrap();
        let after = matrix.cells(&Command).unwrap();
        assert!(before.iter().zip(&after).all(|(b, a)| b.key != a.key && b.args == a.args));
    }
}
