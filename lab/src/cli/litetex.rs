//! The program `litetex`: where it is, what it makes of arguments, and what it prints.

use clap::Parser;
use litetex_gs::run::{Profile, without_mark};
use litetex_gs::train::{Policy, TrainConfig};
use litetex_gs::{Error, Result};
use litetex_lab::matrix::Commands;
use std::cell::RefCell;
use std::collections::HashMap;
use std::ffi::OsStr;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

/// Hidden option of every command of `litetex`: parse the arguments and end.
const PARSE_ONLY: &str = "--parse-only";

/// Options that every run gets from the matrix, and why arguments must not contain them.
const TAKEN: [(&str, &str); 8] = [
    ("--out", "--out: every run has a folder of its own"),
    ("-o", "--out: every run has a folder of its own"),
    ("--force", "--force: bench skips finished runs; its own --force repeats all"),
    ("--resume", "--resume: every run starts from scratch"),
    ("--view", "--view: nobody looks at the runs of a benchmark"),
    ("--seed", "--seed: use --seeds of litetex-lab bench"),
    ("--help", "--help: nothing would be trained"),
    ("-h", "--help: nothing would be trained"),
];

/// The program, and what it has said about arguments.
pub struct Litetex {
    program: PathBuf,
    parsed: RefCell<HashMap<Vec<String>, Result<(), String>>>,
}

impl Litetex {
    /// The program at a path, or else the one beside this program.
    ///
    /// # Errors
    /// [`Error::Usage`] if there is none.
    pub fn find(binary: Option<&Path>) -> Result<Self> {
        let program = match binary {
            Some(path) => path.to_owned(),
            None => {
                let this = std::env::current_exe().map_err(|e| Error::io("litetex-lab", e))?;
                this.with_file_name(format!("litetex{}", std::env::consts::EXE_SUFFIX))
            }
        };
        if !program.is_file() {
            return Err(Error::Usage(format!(
                "{}: no such program; build it with cargo build --release, or name it with --binary",
                program.display()
            )));
        }
        Ok(Self { program, parsed: RefCell::default() })
    }

    /// Path of the program.
    pub fn program(&self) -> &Path {
        &self.program
    }

    /// CRC-32 of the program's file; empty if it cannot be read.
    pub fn build(&self) -> String {
        std::fs::read(&self.program).map_or(String::new(), |b| format!("{:08x}", crc32fast::hash(&b)))
    }

    /// Parses the arguments of a command that acts on `subject`, once.
    fn parse(&self, command: &str, subject: &str, args: &[String]) -> Result<(), String> {
        let head = [command, subject, "--quiet", PARSE_ONLY].map(str::to_owned);
        let words = [&head, args].concat();
        if let Some(known) = self.parsed.borrow().get(&words) {
            return known.clone();
        }
        let outcome = output(&self.program, &words).map(|_| ());
        // Without the usage of another command and the pointer to its help.
        let outcome = outcome.map_err(|e| e.split("\n\n").next().unwrap_or_default().trim().to_owned());
        self.parsed.borrow_mut().insert(words, outcome.clone());
        outcome
    }
}

/// What a program prints when it is run with these arguments.
///
/// # Errors
/// Its message if it fails.
pub fn output(program: &Path, args: &[impl AsRef<OsStr>]) -> Result<Vec<u8>, String> {
    let run = Command::new(program).args(args).stdin(Stdio::null()).output();
    let Output { status, stdout, stderr } = run.map_err(|e| Error::io(program, e).to_string())?;
    if status.success() {
        return Ok(stdout);
    }
    let said = String::from_utf8_lossy(&stderr);
    let said = said.trim();
    Err(without_mark(said).unwrap_or(said).to_owned())
}

impl Commands for Litetex {
    fn flag_of(&self, name: &str) -> Option<&'static str> {
        // The policy `cat` is part of the profile of that name.
        let is_profile = name.parse().is_ok_and(|profile: Profile| profile != Profile::Default);
        let is_policy = name.parse::<Policy>().is_ok();
        if is_profile { Some("--profile") } else { is_policy.then_some("--policy") }
    }

    fn default_seed(&self) -> u64 {
        TrainConfig::default().seed
    }

    fn check(&self, command: &str, args: &[String]) -> Result<(), String> {
        match command {
            "figures" => {
                let words =
                    ["litetex-lab", "figures", "run"].into_iter().chain(args.iter().map(String::as_str));
                let wrong = super::Cli::try_parse_from(words).err();
                wrong.map_or(Ok(()), |e| {
                    Err(e.render().to_string().trim_start_matches("error: ").trim().to_owned())
                })
            }
            "train" if let Some(what) = taken(args) => Err(format!("the arguments contain {what}")),
            "eval" => self.parse("eval", "run", args),
            _ => self.parse(command, "capture", args),
        }
    }
}

/// What the arguments must not contain, if they do.
fn taken(args: &[String]) -> Option<&'static str> {
    let is = |word: &str, option: &str| match word.strip_prefix(option) {
        Some(rest) => rest.is_empty() || rest.starts_with('=') || option.len() == 2,
        None => false,
    };
    TAKEN.iter().find(|(option, _)| args.iter().any(|word| is(word, option))).map(|(_, what)| *what)
}

#[cfg(test)]
mod tests {
    use super::*;
    use litetex_lab::words::split_words;

    fn words(text: &str) -> Vec<String> {
        split_words(text).unwrap()
    }

    #[test]
    fn arguments_that_a_run_gets_from_the_matrix_are_named() {
        for (args, part) in [
            ("--seed 3", "--seeds"),
            ("--seed=3", "--seeds"),
            ("-o x", "--out"),
            ("-ox", "--out"),
            ("--force", "--force"),
            ("--resume x", "--resume"),
            ("--view", "--view"),
        ] {
            assert!(taken(&words(args)).unwrap().contains(part), "{args}");
        }
        assert_eq!(taken(&words("--seeds-of x --steps 3")), None);
    }

    #[test]
    fn policies_and_profiles_are_known_by_name() {
        let litetex = Litetex { program: PathBuf::new(), parsed: RefCell::default() };
        for name in ["litetex", "plain", "none", "fixed:4"] {
            assert_eq!(litetex.flag_of(name), Some("--policy"), "{name}");
        }
        for name in ["paper", "cat", "authors"] {
            assert_eq!(litetex.flag_of(name), Some("--profile"), "{name}");
        }
        for name in ["default", "fixed:1", "Plain", "no growth"] {
            assert_eq!(litetex.flag_of(name), None, "{name}");
        }
    }
}
