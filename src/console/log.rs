//! Messages on standard error, as text or as one JSON object per line. Reports go to standard output, see `output`.

use super::output::Output;
use crate::text::printable;
use indicatif::ProgressBar;
use serde_json::{Value, json};
use std::collections::BTreeSet;
use std::io::Write;
use std::sync::{Mutex, PoisonError};

/// Form of the messages.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum LogFormat {
    /// Plain text
    Text,
    /// One JSON object per line
    Json,
}

/// Writer of messages.
pub struct Log {
    format: LogFormat,
    quiet: bool,
    verbosity: u8,
    prints_json: bool,
    /// Codes and messages of the warnings so far: two readings of one capture find the same.
    warned: Mutex<BTreeSet<(String, String)>>,
    /// A progress bar that is hidden while a message is written.
    bar: Mutex<Option<ProgressBar>>,
}

impl Log {
    /// A log of messages in one form; `quiet` leaves errors and warnings.
    pub fn new(format: LogFormat, quiet: bool, verbosity: u8) -> Self {
        let warned = Mutex::new(BTreeSet::new());
        Self { format, quiet, verbosity, prints_json: false, warned, bar: Mutex::new(None) }
    }

    /// The same, whose reports are JSON.
    pub fn with_json(self, prints_json: bool) -> Self {
        Self { prints_json, ..self }
    }

    /// Prints a report now, for commands that go on after it.
    ///
    /// # Errors
    /// [`crate::Error::Io`], and the error that the report ends with.
    pub fn print(&self, output: Output) -> crate::Result<()> {
        output.print(self.prints_json)
    }

    /// Form of the messages.
    pub fn format(&self) -> LogFormat {
        self.format
    }

    /// Whether messages are JSON.
    pub fn is_json(&self) -> bool {
        self.format == LogFormat::Json
    }

    /// Whether only errors and warnings are written.
    pub fn is_quiet(&self) -> bool {
        self.quiet
    }

    /// Shares the terminal with a progress bar, or with none any more.
    pub fn attach_bar(&self, bar: Option<ProgressBar>) {
        *self.bar.lock().unwrap_or_else(PoisonError::into_inner) = bar;
    }

    /// Writes what ended the command.
    pub fn error(&self, error: &crate::Error) {
        let (kind, message) = (error.kind(), error.to_string());
        let text = format!("error[{kind}]: {message}");
        self.write("error", &text, json!({ "code": kind, "message": message }));
    }

    /// Writes a problem that does not end the command, if it is not known already.
    pub fn warn(&self, code: &str, message: &str, count: usize) {
        if !self.is_new(code, message) {
            return;
        }
        let text = format!("warning[{code}]: {message}");
        self.write("warning", &text, json!({ "code": code, "message": message, "count": count }));
    }

    /// Whether a warning has not been written yet; from now on it counts as written.
    fn is_new(&self, code: &str, message: &str) -> bool {
        let mut warned = self.warned.lock().unwrap_or_else(PoisonError::into_inner);
        warned.insert((code.to_owned(), message.to_owned()))
    }

    /// Writes all warnings of a report.
    pub fn report(&self, report: &crate::Report) {
        for w in &report.warnings {
            self.warn(&w.code, &w.message, w.count);
        }
    }

    /// Writes what is going on.
    pub fn info(&self, message: &str) {
        self.event("info", message, json!({ "message": message }));
    }

    /// Writes what is going on in detail (`-v`).
    pub fn detail(&self, message: &str) {
        if self.verbosity > 0 {
            self.info(message);
        }
    }

    /// Writes a typed event: `text` for people, `fields` for machines.
    pub fn event(&self, event: &str, text: &str, fields: Value) {
        if !self.quiet {
            self.write(event, text, fields);
        }
    }

    /// Passes on a line that the process of a run has written, under the name of the run.
    pub fn relay(&self, run: &str, line: &str) {
        write_line(&relayed(self.format, run, line));
    }

    fn write(&self, event: &str, text: &str, mut fields: Value) {
        let line = match self.format {
            // Errors of parsers have several lines; nothing else may move the cursor.
            LogFormat::Text => printable(text, &['\n']).into_owned(),
            LogFormat::Json => {
                fields["event"] = json!(event);
                fields.to_string()
            }
        };
        let print = || write_line(&line);
        match &*self.bar.lock().unwrap_or_else(PoisonError::into_inner) {
            Some(bar) => bar.suspend(print),
            None => print(),
        }
    }
}

/// A line of another process, with the name of the run that it is about.
fn relayed(format: LogFormat, run: &str, line: &str) -> String {
    let text = || format!("[{}] {line}", printable(run, &[]));
    match (format, serde_json::from_str::<Value>(line)) {
        (LogFormat::Json, Ok(mut event)) if event.is_object() => {
            event["run"] = json!(run);
            event.to_string()
        }
        // What a crash writes is no JSON.
        (LogFormat::Json, _) => json!({ "event": "said", "run": run, "message": line }).to_string(),
        (LogFormat::Text, _) => text(),
    }
}

/// Writes a line to standard error; if that is closed there is no one to report it to.
pub fn write_line(line: &str) {
    let _ = writeln!(std::io::stderr(), "{line}");
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_warning_is_written_once() {
        let log = Log::new(LogFormat::Text, true, 0);
        let warnings = [("a", "x"), ("a", "x"), ("a", "y"), ("b", "x"), ("a", "y")];
        assert_eq!(warnings.map(|(code, what)| log.is_new(code, what)), [true, false, true, true, false]);
    }

    #[test]
    fn lines_of_other_processes_name_their_run() {
        assert_eq!(relayed(LogFormat::Text, "fox", "step 1/3"), "[fox] step 1/3");
        let json =
            |line: &str| serde_json::from_str::<Value>(&relayed(LogFormat::Json, "fox", line)).unwrap();
        assert_eq!(
            json(r#"{"event":"progress","step":1}"#),
            json!({"event":"progress","step":1,"run":"fox"})
        );
        assert_eq!(json("thread panicked"), json!({"event":"said","run":"fox","message":"thread panicked"}));
    }
}
