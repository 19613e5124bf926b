//! Tokenises `.usda` text on demand, in a single pass.

use crate::{Error, Result, quoted};
use std::path::Path;
use std::str::FromStr;

/// Longest text in quotation marks: the metadata.
const STRING_BYTES_MAX: usize = crate::asset::meta::META_BYTES_MAX;

/// A position in a text, and how much memory its contents may still take.
pub(super) struct Lexer<'a> {
    text: &'a str,
    at: usize,
    path: &'a Path,
    budget_bytes: u64,
}

impl<'a> Lexer<'a> {
    pub(super) fn new(text: &'a str, path: &'a Path, budget_bytes: u64) -> Self {
        Self { text, at: 0, path, budget_bytes }
    }

    /// Counts memory that is about to be taken: a few characters may become hundreds of bytes.
    pub(super) fn spend(&mut self, num_bytes: usize) -> Result<()> {
        self.budget_bytes = self.budget_bytes.checked_sub(num_bytes as u64).ok_or_else(|| {
            Error::too_large(self.path, "the text decodes to more bytes than the limit allows")
        })?;
        Ok(())
    }

    /// An [`Error::Invalid`] with the line: the text breaks the grammar.
    pub(super) fn invalid(&self, what: impl std::fmt::Display) -> Error {
        invalid!(self.path, "line {}: {what}", self.line_number())
    }

    /// An [`Error::Unsupported`] with the line: other programs may write this, ours does not.
    pub(super) fn unsupported(&self, what: impl std::fmt::Display) -> Error {
        let line = self.line_number();
        unsupported!(self.path, "line {line}: {what}, which files of this program do not have")
    }

    fn line_number(&self) -> usize {
        1 + self.text.as_bytes()[..self.at].iter().filter(|&&b| b == b'\n').count()
    }

    /// An [`Error::Invalid`] that shows what follows instead of what was expected.
    fn expected(&self, what: &str) -> Error {
        let line = self.rest().lines().next().unwrap_or_default();
        let found = if self.rest().is_empty() { "the end of the file".to_owned() } else { quoted(line) };
        self.invalid(format!("{found}, expected {what}"))
    }

    /// Where the piece that was taken last ends.
    pub(super) fn offset(&self) -> usize {
        self.at
    }

    fn rest(&self) -> &'a str {
        &self.text[self.at..]
    }

    /// The next byte that is not blank, and where it is.
    fn next(&self) -> (usize, Option<u8>) {
        let blank = self.rest().bytes().take_while(|b| matches!(b, b' ' | b'\t' | b'\r' | b'\n')).count();
        (self.at + blank, self.text.as_bytes().get(self.at + blank).copied())
    }

    /// The next byte that is not blank.
    pub(super) fn peek(&self) -> Option<u8> {
        self.next().1
    }

    /// Takes an ASCII mark if it comes next.
    pub(super) fn take_if(&mut self, mark: u8) -> bool {
        let (at, found) = self.next();
        let is_next = found == Some(mark);
        if is_next {
            self.at = at + 1;
        }
        is_next
    }

    /// Takes blanks; returns the byte behind them.
    fn skip_blanks(&mut self) -> Option<u8> {
        let (at, found) = self.next();
        self.at = at;
        found
    }

    /// Takes a mark that must come next.
    pub(super) fn expect(&mut self, mark: u8) -> Result<()> {
        if self.take_if(mark) {
            return Ok(());
        }
        self.skip_blanks();
        Err(self.expected(&format!("\"{}\"", char::from(mark))))
    }

    /// Takes the longest run of bytes of a kind, which must not be empty. They are ASCII.
    fn run(&mut self, what: &str, is_part: impl Fn(u8) -> bool) -> Result<&'a str> {
        match self.skip_blanks() {
            Some(b'#') => return Err(self.unsupported("a comment")),
            Some(b'\'') => return Err(self.unsupported("a text in single quotation marks")),
            _ => {}
        }
        let rest = self.rest();
        let length = rest.bytes().take_while(|&b| is_part(b)).count();
        if length == 0 {
            return Err(self.expected(what));
        }
        self.at += length;
        Ok(&rest[..length])
    }

    /// Takes a name, a keyword or a type: letters, digits, `_`, `:`, `.` and `[]`.
    pub(super) fn word(&mut self, what: &str) -> Result<&'a str> {
        let word = self.run(what, |b| b.is_ascii_alphanumeric() || matches!(b, b'_' | b':' | b'.'))?;
        if !self.rest().starts_with("[]") {
            return Ok(word);
        }
        self.at += 2;
        Ok(&self.text[self.at - word.len() - 2..self.at])
    }

    /// Takes a number, also `inf` and `nan`.
    pub(super) fn number<T: FromStr>(&mut self, what: &str) -> Result<T> {
        let number = self.run(what, |b| b.is_ascii_alphanumeric() || matches!(b, b'.' | b'-' | b'+'))?;
        if number == "None" {
            return Err(self.unsupported("a blocked value (None)"));
        }
        number.parse().map_err(|_| self.invalid(format!("{}, expected {what}", quoted(number))))
    }

    /// Takes what stands between two marks on one line: `@path@`, `<path>`.
    pub(super) fn fenced(&mut self, open: u8, close: char) -> Result<String> {
        self.expect(open)?;
        let rest = self.rest();
        let end = rest.find([close, '\n']).filter(|&end| rest[end..].starts_with(close));
        let end = end.ok_or_else(|| self.invalid(format!("no closing {close:?} on this line")))?;
        self.spend(end)?;
        self.at += end + 1;
        Ok(rest[..end].to_owned())
    }

    /// Takes a text in quotation marks.
    pub(super) fn quoted(&mut self, what: &str) -> Result<String> {
        if self.skip_blanks() != Some(b'"') {
            return Err(self.expected(&format!("{what} in quotation marks")));
        }
        if self.rest().starts_with("\"\"\"") {
            return Err(self.unsupported("a text of several lines"));
        }
        self.at += 1;
        let (mut out, start) = (String::new(), self.at);
        loop {
            let rest = self.rest();
            let length = rest.find(['"', '\\', '\n']).unwrap_or(rest.len());
            if self.at + length - start > STRING_BYTES_MAX {
                let what =
                    format!("line {}: a text of more than {STRING_BYTES_MAX} bytes", self.line_number());
                return Err(Error::too_large(self.path, what));
            }
            self.spend(length)?;
            out.push_str(&rest[..length]);
            self.at += length + 1;
            match rest.as_bytes().get(length) {
                Some(b'"') => return Ok(out),
                Some(b'\\') => out.push(self.escape()?),
                _ => {
                    self.at = self.at.min(self.text.len()) - 1;
                    return Err(self.invalid("a text without closing quotation mark"));
                }
            }
        }
    }

    /// Takes an escape, behind its backslash.
    fn escape(&mut self) -> Result<char> {
        let rest = self.rest().as_bytes();
        let (length, c) = match rest {
            [b'n', ..] => (1, '\n'),
            [b'r', ..] => (1, '\r'),
            [b't', ..] => (1, '\t'),
            [c @ (b'"' | b'\\'), ..] => (1, char::from(*c)),
            [b'x', high, low, ..] => match (char::from(*high).to_digit(16), char::from(*low).to_digit(16)) {
                // Anything above would be a part of a character.
                (Some(high @ 0..8), Some(low)) => (3, char::from((16 * high + low) as u8)),
                _ => return Err(self.expected("an escape")),
            },
            _ => return Err(self.expected("an escape")),
        };
        self.at += length;
        Ok(c)
    }
}
