//! Messages on standard error, as text or as one JSON object a line. Results belong to standard
//! output and are none of this module's business.

use indicatif::ProgressBar;
use serde_json::{Value, json};
use std::cell::RefCell;
use std::io::Write;

/// Form of the messages.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum LogFormat {
    /// Sentences for people
    Text,
    /// One JSON object a line
    Json,
}

/// Where messages go.
pub struct Log {
    format: LogFormat,
    quiet: bool,
    verbosity: u8,
    /// A bar that must step aside while a message is written.
    bar: RefCell<Option<ProgressBar>>,
}

impl Log {
    /// Messages in one form; quiet leaves errors and warnings.
    pub fn new(format: LogFormat, quiet: bool, verbosity: u8) -> Self {
        Self { format, quiet, verbosity, bar: RefCell::new(None) }
    }

    /// Whether messages are JSON.
    pub fn is_json(&self) -> bool {
        self.format == LogFormat::Json
    }

    /// Whether only errors and warnings are told.
    pub fn is_quiet(&self) -> bool {
        self.quiet
    }

    /// Lets a bar share the terminal.
    pub fn attach_bar(&self, bar: Option<ProgressBar>) {
        *self.bar.borrow_mut() = bar;
    }

    /// What went wrong, once, at the end.
    pub fn error(&self, message: &str) {
        self.write("error", &format!("error: {message}"), json!({ "message": message }));
    }

    /// What the user should know but does not stop us.
    pub fn warn(&self, code: &str, message: &str, count: usize) {
        let text = format!("warning: {message}");
        self.write("warning", &text, json!({ "code": code, "message": message, "count": count }));
    }

    /// All warnings of a report.
    pub fn report(&self, report: &litetex_gs::Report) {
        for w in &report.warnings {
            self.warn(&w.code, &w.message, w.count);
        }
    }

    /// What is going on.
    pub fn info(&self, message: &str) {
        self.event("info", message, json!({ "message": message }));
    }

    /// What is going on in detail (`-v`).
    pub fn detail(&self, message: &str) {
        if self.verbosity > 0 {
            self.info(message);
        }
    }

    /// A typed event: `text` for people, `fields` for machines.
    pub fn event(&self, event: &str, text: &str, fields: Value) {
        if !self.quiet {
            self.write(event, text, fields);
        }
    }

    fn write(&self, event: &str, text: &str, mut fields: Value) {
        let line = match self.format {
            LogFormat::Text => text.to_owned(),
            LogFormat::Json => {
                fields["event"] = json!(event);
                fields.to_string()
            }
        };
        // Standard error may be closed; there is nobody to tell.
        let print = || drop(writeln!(std::io::stderr(), "{line}"));
        match &*self.bar.borrow() {
            Some(bar) => bar.suspend(print),
            None => print(),
        }
    }
}
