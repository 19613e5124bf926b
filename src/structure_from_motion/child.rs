//! Programs that we start: their arguments, their output, how they end. No shell is involved.

use crate::text::shell_word;
use crate::{Error, Result};
use std::ffi::OsString;
use std::fs::File;
use std::io::{BufRead as _, BufReader, Read, Write as _};
use std::path::{Path, PathBuf};
use std::process::{Child, Stdio};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, sync_channel};
use std::time::Duration;

/// How often a running program is asked for, so that Ctrl-C ends it soon.
const PAUSE: Duration = Duration::from_millis(100);

/// Lines of a log that an error shows.
const LINES_SHOWN: usize = 6;

/// Who watches the work.
pub trait Observer {
    /// # Errors
    /// [`Error::Interrupted`] if the work is to stop.
    fn check(&self) -> Result<()>;
    /// A step has begun.
    fn step(&self, what: &str);
    /// `done` of `all` parts of the current step are done.
    fn progress(&self, done: usize, all: usize);
}

/// A program with its arguments.
#[derive(Clone, Debug)]
pub struct Command {
    program: PathBuf,
    arguments: Vec<OsString>,
}

/// What a program prints.
enum Printed {
    Line(String),
    Chunk(Vec<u8>),
}

impl Command {
    pub fn new(program: impl Into<PathBuf>) -> Self {
        Self { program: program.into(), arguments: Vec::new() }
    }

    pub fn arg(mut self, argument: impl Into<OsString>) -> Self {
        self.arguments.push(argument.into());
        self
    }

    pub fn args<T: Into<OsString>>(mut self, arguments: impl IntoIterator<Item = T>) -> Self {
        self.arguments.extend(arguments.into_iter().map(Into::into));
        self
    }

    /// An option with its value.
    pub fn option(self, name: &str, value: impl Into<OsString>) -> Self {
        self.arg(name).arg(value)
    }

    /// The command as one line of a POSIX shell.
    pub fn shell(&self) -> String {
        let program = shell_word(&self.program);
        let arguments = self.arguments.iter().map(|a| match a.to_string_lossy() {
            // An option, of which `shell_word` would make a path.
            text if text.starts_with('-')
                && text.chars().all(|c| c.is_ascii_alphanumeric() || "-_.:".contains(c)) =>
            {
                text.into_owned()
            }
            _ => shell_word(Path::new(a)),
        });
        std::iter::once(program).chain(arguments).collect::<Vec<_>>().join(" ")
    }

    fn spawn(&self) -> Result<Child> {
        let mut command = std::process::Command::new(&self.program);
        // COLMAP opens no window; without a display Qt would end it.
        command.args(&self.arguments).env("QT_QPA_PLATFORM", "offscreen");
        command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
        command.spawn().map_err(|e| Error::io(&self.program, e))
    }

    /// All that a short command prints, errors too; `None` if it does not start or fails.
    pub fn answer(&self) -> Option<String> {
        let mut command = std::process::Command::new(&self.program);
        command.args(&self.arguments).env("QT_QPA_PLATFORM", "offscreen").stdin(Stdio::null());
        let output = command.output().ok().filter(|o| o.status.success())?;
        Some(String::from_utf8_lossy(&[output.stdout, output.stderr].concat()).into_owned())
    }

    /// Runs the program to its end. Its output goes into `log`, line by line also to `on_line`.
    ///
    /// # Errors
    /// [`Error::Interrupted`]; [`Error::Device`] if it fails, with the end of its output; [`Error::Io`].
    pub fn run(&self, log: &Path, observer: &dyn Observer, mut on_line: impl FnMut(&str)) -> Result<()> {
        self.drive(log, observer, None, |printed| match printed {
            Printed::Line(line) => on_line(&line),
            Printed::Chunk(_) => {}
        })
    }

    /// The same for a program whose standard output consists of chunks of `size` bytes.
    ///
    /// # Errors
    /// As [`Self::run`].
    pub fn run_chunks(
        &self,
        log: &Path,
        observer: &dyn Observer,
        size: usize,
        mut on_chunk: impl FnMut(&[u8]),
    ) -> Result<()> {
        self.drive(log, observer, Some(size), |printed| match printed {
            Printed::Chunk(bytes) => on_chunk(&bytes),
            Printed::Line(_) => {}
        })
    }

    fn drive(
        &self,
        log: &Path,
        observer: &dyn Observer,
        chunk: Option<usize>,
        mut take: impl FnMut(Printed),
    ) -> Result<()> {
        let io = |e| Error::io(log, e);
        let mut file = File::options().create(true).append(true).open(log).map_err(io)?;
        writeln!(file, "$ {}", self.shell()).map_err(io)?;
        let mut child = self.spawn()?;
        // Kept open: the Python script ends when it closes, also if this process is killed.
        let held = child.stdin.take();
        let (sender, receiver) = sync_channel(64);
        if let Some(out) = child.stdout.take() {
            let sender = sender.clone();
            std::thread::spawn(move || match chunk {
                Some(size) => send_chunks(out, size, &sender),
                None => send_lines(out, &sender),
            });
        }
        if let Some(out) = child.stderr.take() {
            std::thread::spawn(move || send_lines(out, &sender));
        }
        let mut last = Vec::new();
        let outcome = receive(&receiver, observer, |printed| {
            if let Printed::Line(line) = &printed {
                let _ = writeln!(file, "{line}");
                if last.len() == LINES_SHOWN {
                    last.remove(0);
                }
                last.push(line.clone());
            }
            take(printed);
        });
        if outcome.is_err() {
            // It may have ended by itself.
            let _ = child.kill();
        }
        let status = child.wait().map_err(|e| Error::io(&self.program, e))?;
        drop(held);
        outcome?;
        if status.success() {
            return Ok(());
        }
        let end = if last.is_empty() { "it printed nothing".to_owned() } else { last.join("\n  ") };
        let (program, log) = (crate::text::path(&self.program), crate::text::path(log));
        Err(Error::Device(format!(
            "{program} failed ({status}). The end of its output:\n  {end}\nAll of it is in {log}. The same command again goes \
             on from here"
        )))
    }
}

fn receive(
    receiver: &Receiver<Printed>,
    observer: &dyn Observer,
    mut take: impl FnMut(Printed),
) -> Result<()> {
    loop {
        match receiver.recv_timeout(PAUSE) {
            Ok(printed) => take(printed),
            Err(RecvTimeoutError::Timeout) => {}
            Err(RecvTimeoutError::Disconnected) => return Ok(()),
        }
        observer.check()?;
    }
}

fn send_lines(from: impl Read, to: &SyncSender<Printed>) {
    let mut reader = BufReader::new(from);
    let mut bytes = Vec::new();
    while reader.read_until(b'\n', &mut bytes).is_ok_and(|n| n > 0) {
        let line = String::from_utf8_lossy(&bytes).trim_end().to_owned();
        bytes.clear();
        if to.send(Printed::Line(line)).is_err() {
            return;
        }
    }
}

fn send_chunks(mut from: impl Read, size: usize, to: &SyncSender<Printed>) {
    loop {
        let mut bytes = vec![0; size];
        if from.read_exact(&mut bytes).is_err() || to.send(Printed::Chunk(bytes)).is_err() {
            return;
        }
    }
}
