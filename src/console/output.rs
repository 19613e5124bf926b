//! What a command reports on standard output, as text or, with `--json`, as one object, and whether what it checked passed.

use crate::{Error, Result};
use serde_json::{Value, json};
use std::fmt::Display;
use std::io::Write;

/// The report of a command. Only the door prints it.
#[must_use]
#[derive(Default)]
pub struct Output {
    text: String,
    json: Value,
    failure: Option<Error>,
}

impl Output {
    /// A report: an object under the name and version of its schema, and the same for people.
    pub fn new(schema: &str, mut json: Value, text: impl Display) -> Self {
        json["schema"] = schema.into();
        Self { text: text.to_string(), json, failure: None }
    }

    /// Text that is no report but the result itself, such as a manual page.
    pub fn text(text: impl Display) -> Self {
        let text = text.to_string();
        Self { json: json!({ "schema": "litetex-text/1", "text": text }), text, failure: None }
    }

    /// The same with what it says about a part appended, under a key.
    pub fn with(mut self, key: &str, part: Self) -> Self {
        self.json[key] = part.json;
        if !(self.text.is_empty() || part.text.is_empty()) {
            self.text.push('\n');
        }
        self.text.push_str(&part.text);
        self.failure = self.failure.or(part.failure);
        self
    }

    /// The same with the error that the command ends with once it has reported.
    pub fn failing(mut self, failure: Option<Error>) -> Self {
        self.failure = failure;
        self
    }

    /// Prints the report, and returns the error that it ends with.
    ///
    /// # Errors
    /// [`Error::Io`], the failure.
    pub(super) fn print(self, as_json: bool) -> Result<()> {
        let text = match as_json {
            true if self.json.is_null() => String::new(),
            true => format!("{:#}\n", self.json),
            false => self.text,
        };
        let mut out = std::io::stdout().lock();
        let printed = out.write_all(text.as_bytes()).and_then(|()| out.flush());
        printed.map_err(|e| Error::io("standard output", e))?;
        self.failure.map_or(Ok(()), Err)
    }
}
