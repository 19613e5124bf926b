//! The door through which a process enters and leaves: it parses the command line, runs the command, and turns its error into
//! a message and an exit code. The table of exit codes is in `docs/commands.md`.

use super::common_args::CommonArgs;
use super::log::Log;
use super::output::Output;
use crate::{Error, Result};
use clap::error::{ContextKind, ContextValue, ErrorKind};
use clap::{CommandFactory, FromArgMatches};
use std::path::Path;
use std::process::ExitCode;

/// A program with commands.
pub trait Program: CommandFactory + FromArgMatches {
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
    let command = with_numbers_as_values(P::command());
    let program = match command.try_get_matches().and_then(|matches| P::from_arg_matches(&matches)) {
        Ok(program) => program,
        // Help and version arrive here too; clap knows their stream.
        Err(e) => {
            let code = if e.use_stderr() { 2 } else { 0 };
            let _ = without_useless_tip(e).print();
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

/// The command line with options that take "-1" as a value, so that each option's parser rejects it with its own message.
fn with_numbers_as_values(command: clap::Command) -> clap::Command {
    command
        .mut_args(|arg| match arg.get_action().takes_values() && !arg.is_positional() {
            true => arg.allow_negative_numbers(true),
            false => arg,
        })
        .mut_subcommands(with_numbers_as_values)
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
