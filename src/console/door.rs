//! The door through which a process enters and leaves: it parses the command line, runs the command, and turns its error into
//! a message and an exit code. The table of exit codes is in `docs/commands.md`.

use super::common_args::CommonArgs;
use super::log::Log;
use super::output::Output;
use crate::{Error, Result};
use clap::builder::StyledStr;
use clap::error::{ContextKind, ContextValue, ErrorKind};
use clap::{CommandFactory, FromArgMatches};
use std::ffi::OsString;
use std::path::Path;
use std::process::ExitCode;

/// A program with commands.
pub trait Program: CommandFactory + FromArgMatches {
    /// Tips for options that do not exist or have a wrong value: the option, and what its user may have wanted.
    const TIPS: &'static [(&'static str, &'static str)] = &[];

    /// The options that all its commands have.
    fn common(&self) -> &CommonArgs;

    /// Whether the arguments make one run and no batch, which is asked for with `--parse-only`.
    ///
    /// # Errors
    /// [`Error::Usage`].
    fn check_single(&self) -> Result<()> {
        Ok(())
    }

    /// Runs the command and returns its report.
    ///
    /// # Errors
    /// What ended it.
    fn run(self, log: &Log) -> Result<Output>;
}

/// Parses the arguments, runs the command and returns the exit code of its error's family.
pub fn enter<P: Program>() -> ExitCode {
    let matches = P::command().try_get_matches_from(with_values_joined(std::env::args_os()));
    let program = match matches.and_then(|matches| P::from_arg_matches(&matches)) {
        Ok(program) => program,
        // Help and version arrive here too; clap knows their stream.
        Err(e) => {
            let code = if e.use_stderr() { 2 } else { 0 };
            let _ = with_tip(without_useless_tip(e), P::TIPS).print();
            return ExitCode::from(code);
        }
    };
    let common = program.common();
    let log = Log::new(common.log_format, common.quiet, common.verbose).with_json(common.json);
    let outcome = match common.parse_only {
        true => program.check_single(),
        false => set_threads(common.threads).and_then(|()| log.print(program.run(&log)?)),
    };
    match outcome {
        Ok(()) => ExitCode::SUCCESS,
        // The reader closed the pipe, as `head` does.
        Err(Error::Io { cause, .. }) if cause.kind() == std::io::ErrorKind::BrokenPipe => ExitCode::SUCCESS,
        Err(Error::Interrupted) => {
            // The command has said where to continue.
            log.detail("interrupted");
            ExitCode::from(Error::Interrupted.exit_code())
        }
        Err(error) => {
            log.error(&error);
            ExitCode::from(error.exit_code())
        }
    }
}

/// The arguments with values like "-1" and "-5m" joined to the option before them, as "--time=-5m", so that the option's parser
/// rejects them with its own message; alone they look like options.
fn with_values_joined(arguments: impl Iterator<Item = OsString>) -> Vec<OsString> {
    let is_option = |word: &[u8]| word.len() > 2 && word.starts_with(b"--") && !word.contains(&b'=');
    let is_value = |word: &[u8]| matches!(word, [b'-', b'0'..=b'9' | b'.', ..]);
    let mut joined: Vec<OsString> = Vec::new();
    let mut are_files = false;
    for argument in arguments {
        // Behind "--" everything is a file.
        are_files |= argument == "--";
        match joined.last_mut().filter(|before| !are_files && is_option(before.as_encoded_bytes())) {
            Some(option) if is_value(argument.as_encoded_bytes()) => {
                option.push("=");
                option.push(argument);
            }
            _ => joined.push(argument),
        }
    }
    joined
}

/// Puts a tip of the program in place of clap's, which compares letters.
fn with_tip(mut error: clap::Error, tips: &[(&str, &'static str)]) -> clap::Error {
    let Some(ContextValue::String(argument)) = error.get(ContextKind::InvalidArg) else { return error };
    let option = argument.split([' ', '=']).next();
    let is_meant = matches!(error.kind(), ErrorKind::UnknownArgument | ErrorKind::InvalidValue);
    if let Some((_, tip)) = tips.iter().find(|(name, _)| is_meant && option == Some(*name)) {
        // The line of usage has clap's guess as well.
        for guess in [ContextKind::SuggestedArg, ContextKind::SuggestedValue, ContextKind::Usage] {
            error.remove(guess);
        }
        error.insert(ContextKind::Suggested, ContextValue::StyledStrs(vec![StyledStr::from(*tip)]));
    }
    error
}

/// Drops the tip to pass an unknown option as a value (`-- --seed`), unless there is a file of that name to pass.
fn without_useless_tip(mut error: clap::Error) -> clap::Error {
    let is_file =
        |name: &ContextValue| matches!(name, ContextValue::String(name) if Path::new(name).exists());
    if error.kind() == ErrorKind::UnknownArgument && !error.get(ContextKind::InvalidArg).is_some_and(is_file)
    {
        error.remove(ContextKind::Suggested);
    }
    error
}

fn set_threads(threads: Option<u16>) -> Result<()> {
    let Some(threads) = threads else { return Ok(()) };
    let pool = rayon::ThreadPoolBuilder::new().num_threads(usize::from(threads));
    pool.build_global().map_err(|e| Error::Device(format!("--threads {threads}: {e}")))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_are_joined_to_the_option_before_them() {
        let joined = |line: &str| {
            let words = with_values_joined(line.split(' ').map(OsString::from));
            words.join(std::ffi::OsStr::new(" ")).into_string().unwrap()
        };
        assert_eq!(joined("train x --time -5m --seed -1"), "train x --time=-5m --seed=-1");
        assert_eq!(joined("train x --need -.5dB -q"), "train x --need=-.5dB -q");
        // Negative controls: other options, options that have a value, and files.
        for line in ["x --time --seed 1", "x --seed 1 -5", "x --seed=1 -5", "x -5 -o -5", "x --force -- -5"] {
            assert_eq!(joined(line), line);
        }
    }
}
