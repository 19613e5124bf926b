//! Several captures, trained one after the other into a folder of runs: which run each becomes, and in what state it is.

use super::config::RunConfig;
use super::folder::{find_checkpoint, is_run};
use super::summary::Summary;
use crate::Result;
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

/// Names in the folder of runs that no run may have.
pub(super) const TABLE_MD: &str = "table.md";
pub(super) const TABLE_JSON: &str = "table.json";
pub(super) const RECORDS: &str = ".records";

/// One run of a batch.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct BatchRun {
    /// Name of its folder, unlike all others'.
    pub name: String,
    /// The capture, as the user named it.
    pub capture: PathBuf,
    /// Folder of the run.
    pub folder: PathBuf,
    /// Place in the whole list, from 0.
    pub index: usize,
}

/// The runs that captures become in the folder `out`: named after the capture's folder or archive and, where that name is
/// taken, with a number. Names depend on the list and its order alone, so that all parts of a batch agree on them.
pub fn batch_runs(captures: &[PathBuf], out: &Path) -> Vec<BatchRun> {
    // Not every file system tells capitals from small letters.
    let mut taken: BTreeSet<String> = [TABLE_MD, TABLE_JSON, RECORDS].map(str::to_owned).into();
    let run = |(index, capture): (usize, &PathBuf)| {
        let first = name_of(capture);
        let numbered = (2..).map(|n| format!("{first}-{n}"));
        let names = std::iter::once(first.clone()).chain(numbered);
        let name = names.into_iter().find(|name| taken.insert(name.to_lowercase())).unwrap_or(first.clone());
        BatchRun { folder: out.join(&name), name, capture: capture.clone(), index }
    };
    captures.iter().enumerate().map(run).collect()
}

/// The part of a list that is the share of one of `parts`: every `parts`th, from the `part`th on.
pub fn share<T>(list: Vec<T>, part: usize, parts: usize) -> Vec<T> {
    list.into_iter().skip(part - 1).step_by(parts).collect()
}

/// Name of a capture: of its folder, or of its archive without the extension. A file of poses and a sparse model (`fox/sparse/0`)
/// have the name of the folder around them.
fn name_of(capture: &Path) -> String {
    let resolved = capture.canonicalize().unwrap_or_else(|_| capture.to_owned());
    // A link names the capture, not what it points to; `.` and `..` name nothing.
    let named = if capture.file_name().is_some() { capture } else { &resolved };
    let path = std::path::absolute(named).unwrap_or_else(|_| named.to_owned());
    let is_archive =
        path.extension().is_some_and(|e| ["zip", "r3d"].iter().any(|kind| e.eq_ignore_ascii_case(kind)));
    if let Some(folder) = path.parent().filter(|_| !is_archive && resolved.is_file()) {
        return name_of(folder);
    }
    // A folder of this name may also hold captures.
    let is_model =
        |folder: &Path| ["images.bin", "images.txt"].iter().any(|file| folder.join(file).is_file());
    let sparse = path.ancestors().take(2).find(|folder| folder.ends_with("sparse"));
    let sparse = sparse.filter(|_| is_model(&path) || is_model(&path.join("0")));
    if let Some(folder) = sparse.and_then(Path::parent) {
        return name_of(folder);
    }
    let name = if is_archive { path.file_stem() } else { path.file_name() };
    name.map_or_else(|| "capture".to_owned(), |name| name.to_string_lossy().into_owned())
}

/// How far the run in a folder has come.
#[derive(Clone, Debug)]
pub enum RunState {
    /// There is none.
    None,
    /// It was killed or interrupted, after a checkpoint if `is_saved`.
    Unfinished {
        /// Its settings.
        config: Box<RunConfig>,
        /// Whether there is a checkpoint to continue from.
        is_saved: bool,
    },
    /// It has all steps of its settings, or all that its time allowed.
    Finished {
        /// Its settings.
        config: Box<RunConfig>,
        /// Its result.
        summary: Box<Summary>,
    },
}

impl RunState {
    /// The state of the run in a folder.
    ///
    /// # Errors
    /// [`crate::Error::InvalidInput`] for settings that cannot be read.
    pub fn of(folder: &Path) -> Result<Self> {
        if !is_run(folder) {
            return Ok(Self::None);
        }
        let config = Box::new(RunConfig::read(&folder.join("config.toml"))?);
        let summary = Summary::read(&folder.join("summary.json")).ok();
        // A finished run that is continued has the settings of its next end before it gets there.
        let is_last = |s: &Summary| !s.is_interrupted() && s.steps_planned == config.train.last_step();
        Ok(match summary.filter(is_last) {
            Some(summary) => Self::Finished { config, summary: Box::new(summary) },
            None => Self::Unfinished { config, is_saved: find_checkpoint(folder).is_ok() },
        })
    }

    /// Refuses to take the run of another capture for that of this one. A capture may have moved.
    ///
    /// # Errors
    /// [`crate::Error::Usage`].
    pub fn check_capture(&self, folder: &Path, capture: &Path) -> Result<()> {
        let (Self::Unfinished { config, .. } | Self::Finished { config, .. }) = self else { return Ok(()) };
        let Some(before) = config.data.as_deref().and_then(|data| data.canonicalize().ok()) else {
            return Ok(());
        };
        if capture.canonicalize().is_ok_and(|now| now != before) {
            return Err(usage!(
                "{}: the run in this folder is of another capture, {}; choose another folder, or replace it with --force",
                folder.display(),
                before.display()
            ));
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn runs_have_names_of_their_own() {
        let dir = tempfile::tempdir().unwrap();
        let here = |name: &str| dir.path().join(name);
        std::fs::create_dir_all(here("scan.v2/in")).unwrap();
        let captures =
            ["a/fox", "b/fox/", "c/FOX", "d/fox.zip", "toy", "toy", "x/table.md", "x/toy-2"].map(here);
        let inner = [here("scan.v2"), here("scan.v2/in/..")];
        let runs = batch_runs(&[&captures[..], &inner].concat(), Path::new("runs"));
        let names: Vec<&str> = runs.iter().map(|run| &*run.name).collect();
        let expected = [
            "fox",
            "fox-2",
            "FOX-3",
            "fox-4",
            "toy",
            "toy-2",
            "table.md-2",
            "toy-2-2",
            "scan.v2",
            "scan.v2-2",
        ];
        assert_eq!(names, expected);
        assert_eq!((runs[3].folder.clone(), runs[3].index), (PathBuf::from("runs/fox-4"), 3));
    }

    #[test]
    fn files_of_poses_name_the_folder_of_their_capture() {
        let dir = tempfile::tempdir().unwrap();
        let file = |name: &str| {
            let path = dir.path().join(name);
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            std::fs::write(&path, "").unwrap();
            path
        };
        let mut captures = [
            "fox/transforms.json",
            "toy/transforms.json",
            "fox/cams.xml",
            "elf/sparse/0/images.bin",
            "bear.r3d",
            "toy/in/../cams.csv",
        ]
        .map(file)
        .to_vec();
        captures.push(dir.path().join("elf/sparse/0"));
        // Negative controls: a folder has its own name, whatever it looks like.
        for folder in ["cams.json", "sparse/wolf"] {
            captures.push(dir.path().join(folder));
            std::fs::create_dir_all(captures.last().unwrap()).unwrap();
        }
        let names: Vec<String> =
            batch_runs(&captures, Path::new("runs")).into_iter().map(|run| run.name).collect();
        assert_eq!(names, ["fox", "toy", "fox-2", "elf", "bear", "toy-2", "elf-2", "cams.json", "wolf"]);
    }

    #[test]
    fn shares_are_disjoint_and_complete() {
        let list: Vec<u32> = (0..10).collect();
        let shares: Vec<Vec<u32>> = (1..=3).map(|part| share(list.clone(), part, 3)).collect();
        assert_eq!(shares, [vec![0, 3, 6, 9], vec![1, 4, 7], vec![2, 5, 8]]);
        assert_eq!(share(list.clone(), 1, 1), list);
        assert_eq!(share(list, 12, 12), [0; 0]);
    }

    #[test]
    fn settings_in_a_run_folder_tell_what_a_killed_run_decided_after_its_checkpoint() {
        let dir = tempfile::tempdir().unwrap();
        let mut saved = RunConfig::default();
        (saved.train.steps, saved.train.plan) = (100, vec![[12, 120]]);
        let follow = |plan: &[[u32; 2]], steps: u32| {
            let mut then = RunConfig { time_secs: Some(60.0), most_steps: Some(150), ..saved.clone() };
            (then.train.plan, then.train.steps) = (plan.to_vec(), steps);
            std::fs::write(dir.path().join("config.toml"), then.to_toml().unwrap()).unwrap();
            let mut config = saved.clone();
            config.follow_run(dir.path()).unwrap();
            assert_eq!(config.most_steps.is_some(), config.time_secs.is_some());
            (config.train.plan, config.time_secs)
        };
        let longer = [[12, 120], [40, 130]];
        assert_eq!(follow(&longer, 100), (longer.to_vec(), Some(60.0)));
        // Another run has been started there since.
        assert_eq!(follow(&[[12, 119], [40, 130]], 100), (saved.train.plan.clone(), None));
        assert_eq!(follow(&longer, 101), (saved.train.plan.clone(), None));
        std::fs::remove_file(dir.path().join("config.toml")).unwrap();
        let mut config = saved.clone();
        config.follow_run(dir.path()).unwrap();
        assert_eq!(config, saved);
    }

    #[test]
    fn an_empty_folder_has_no_run() {
        let dir = tempfile::tempdir().unwrap();
        assert!(matches!(RunState::of(dir.path()).unwrap(), RunState::None));
        std::fs::write(dir.path().join("config.toml"), "version = \"0.1.0\"\n[train]\n").unwrap();
        let state = RunState::of(dir.path()).unwrap();
        assert!(matches!(state, RunState::Unfinished { is_saved: false, .. }));
        assert!(state.check_capture(dir.path(), dir.path()).is_ok());
        let text = format!("version = \"0.1.0\"\ndata = {:?}\n[train]\n", dir.path());
        std::fs::write(dir.path().join("config.toml"), text).unwrap();
        let state = RunState::of(dir.path()).unwrap();
        assert!(state.check_capture(dir.path(), dir.path()).is_ok());
        let other = tempfile::tempdir().unwrap();
        assert_eq!(state.check_capture(dir.path(), other.path()).unwrap_err().exit_code(), 2);
    }
}
