//! Cuts the text of a `.usda` file into tokens.

use crate::{Error, Result};
use std::borrow::Cow;
use std::path::Path;

/// Longest string, as in metadata.
const STRING_BYTES_MAX: usize = crate::meta::META_BYTES_MAX;

/// A token.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Lexeme<'a> {
    /// Letters, digits, `_`, `:`, `.` and a trailing `[]`: names, types, keywords.
    Word(&'a str),
    /// A number as it stands.
    Number(&'a str),
    /// A quoted text, escapes resolved.
    Text(Cow<'a, str>),
    /// `@path@`
    Asset(&'a str),
    /// `<path>`
    Path(&'a str),
    /// `( ) [ ] { } = , ;`
    Mark(char),
    /// Behind the last.
    End,
}

/// Where it reads.
pub(super) struct Lexer<'a> {
    text: &'a str,
    at: usize,
    path: &'a Path,
    /// The next token, if somebody looked at it.
    next: Option<Lexeme<'a>>,
    /// Where it was before somebody looked.
    before_next: usize,
    /// Bytes of memory that the layer may still take.
    budget: u64,
    /// Path of the prim that is being read.
    pub(super) place: String,
    /// Path of a property and bytes of its text.
    pub(super) value_bytes: Vec<(String, u64)>,
}

impl<'a> Lexer<'a> {
    pub(super) fn new(text: &'a str, path: &'a Path, budget: u64) -> Self {
        Self {
            text,
            at: 0,
            path,
            next: None,
            before_next: 0,
            budget,
            place: String::new(),
            value_bytes: Vec::new(),
        }
    }

    /// Counts memory of what is kept; a few characters may become hundreds of bytes.
    pub(super) fn spend(&mut self, num_bytes: usize) -> Result<()> {
        self.budget = self.budget.checked_sub(num_bytes as u64).ok_or_else(|| {
            Error::too_large(self.path, "the text decodes to more bytes than the limit allows")
        })?;
        Ok(())
    }

    /// An error with the line of the place.
    pub(super) fn invalid(&self, what: impl std::fmt::Display) -> Error {
        Error::invalid(self.path, format!("line {}: {what}", self.line_number()))
    }

    /// An [`Error::Unsupported`] with the line of the place.
    pub(super) fn unsupported(&self, what: impl std::fmt::Display) -> Error {
        Error::unsupported(self.path, format!("line {}: {what}", self.line_number()))
    }

    /// Where the token that was taken last ends.
    pub(super) fn offset(&self) -> usize {
        if self.next.is_some() { self.before_next } else { self.at }
    }

    fn line_number(&self) -> usize {
        1 + self.text.as_bytes()[..self.at].iter().filter(|&&b| b == b'\n').count()
    }

    /// The next token, which stays.
    pub(super) fn peek(&mut self) -> Result<&Lexeme<'a>> {
        if self.next.is_none() {
            self.before_next = self.at;
            self.next = Some(self.scan()?);
        }
        Ok(self.next.as_ref().unwrap_or(&Lexeme::End))
    }

    /// Takes the next token.
    pub(super) fn take(&mut self) -> Result<Lexeme<'a>> {
        match self.next.take() {
            Some(lexeme) => Ok(lexeme),
            None => self.scan(),
        }
    }

    /// Takes a mark if it is the next.
    pub(super) fn take_if(&mut self, mark: char) -> Result<bool> {
        let is_next = *self.peek()? == Lexeme::Mark(mark);
        if is_next {
            self.next = None;
        }
        Ok(is_next)
    }

    /// Takes a mark that must be there.
    pub(super) fn expect(&mut self, mark: char) -> Result<()> {
        match self.take()? {
            Lexeme::Mark(found) if found == mark => Ok(()),
            found => Err(self.invalid(format!("{}, expected {mark:?}", shown(&found)))),
        }
    }

    /// Takes a word that must be there.
    pub(super) fn word(&mut self, what: &str) -> Result<&'a str> {
        match self.take()? {
            Lexeme::Word(word) => Ok(word),
            found => Err(self.invalid(format!("{}, expected {what}", shown(&found)))),
        }
    }

    /// Takes a text that must be there.
    pub(super) fn quoted(&mut self, what: &str) -> Result<String> {
        match self.take()? {
            Lexeme::Text(text) => {
                self.spend(text.len())?;
                Ok(text.into_owned())
            }
            found => Err(self.invalid(format!("{}, expected {what} in quotes", shown(&found)))),
        }
    }

    fn skip_blanks(&mut self) {
        let bytes = self.text.as_bytes();
        while let Some(&byte) = bytes.get(self.at) {
            match byte {
                b' ' | b'\t' | b'\r' | b'\n' => self.at += 1,
                b'#' => {
                    let rest = &bytes[self.at..];
                    self.at += rest.iter().position(|&b| b == b'\n').unwrap_or(rest.len());
                }
                _ => break,
            }
        }
    }

    fn scan(&mut self) -> Result<Lexeme<'a>> {
        self.skip_blanks();
        // Marks and blanks are ASCII: `at` lies between characters.
        let rest = &self.text[self.at..];
        let Some(first) = rest.chars().next() else {
            return Ok(Lexeme::End);
        };
        match first {
            '(' | ')' | '[' | ']' | '{' | '}' | '=' | ',' | ';' => {
                self.at += 1;
                Ok(Lexeme::Mark(first))
            }
            '"' | '\'' => self.scan_quoted(rest, first),
            '@' => {
                let fence = if rest.starts_with("@@@") { "@@@" } else { "@" };
                Ok(Lexeme::Asset(self.fenced(rest, fence, fence)?))
            }
            '<' => Ok(Lexeme::Path(self.fenced(rest, "<", ">")?)),
            '0'..='9' | '-' | '+' | '.' => {
                let is_part = |c: char| c.is_ascii_alphanumeric() || matches!(c, '.' | '-' | '+');
                Ok(Lexeme::Number(self.run(rest, is_part)))
            }
            c if c.is_alphabetic() || c == '_' => {
                let word = self.run(rest, |c| c.is_alphanumeric() || matches!(c, '_' | ':' | '.'));
                if rest[word.len()..].starts_with("[]") {
                    self.at += 2;
                    return Ok(Lexeme::Word(&rest[..word.len() + 2]));
                }
                Ok(Lexeme::Word(word))
            }
            c => Err(self.invalid(format!("unexpected character {c:?}"))),
        }
    }

    fn run(&mut self, rest: &'a str, is_part: impl Fn(char) -> bool) -> &'a str {
        let word = &rest[..rest.find(|c| !is_part(c)).unwrap_or(rest.len())];
        self.at += word.len();
        word
    }

    /// What stands between fences in one line.
    fn fenced(&mut self, rest: &'a str, open: &str, close: &str) -> Result<&'a str> {
        let inner = &rest[open.len()..];
        let line = &inner[..inner.find('\n').unwrap_or(inner.len())];
        let Some(end) = line.find(close) else {
            return Err(self.invalid(format!("{open:?} without {close:?}")));
        };
        self.at += open.len() + end + close.len();
        Ok(&inner[..end])
    }

    fn scan_quoted(&mut self, rest: &'a str, quote: char) -> Result<Lexeme<'a>> {
        let triple: String = std::iter::repeat_n(quote, 3).collect();
        let fence = if rest.starts_with(&triple) { triple.as_str() } else { &triple[..1] };
        let inner = &rest[fence.len()..];
        let bytes = inner.as_bytes();
        let (mut end, mut has_escapes) = (0, false);
        loop {
            match bytes.get(end) {
                _ if end > STRING_BYTES_MAX => {
                    let what = format!("a text of more than {STRING_BYTES_MAX} bytes");
                    return Err(Error::too_large(self.path, what));
                }
                None => return Err(self.invalid("a text without closing quote")),
                Some(b'\n') if fence.len() == 1 => return Err(self.invalid("a line ends within quotes")),
                Some(b'\\') => {
                    has_escapes = true;
                    end += 2;
                }
                _ if bytes[end..].starts_with(fence.as_bytes()) => break,
                Some(_) => end += 1,
            }
        }
        self.at += end + 2 * fence.len();
        let text = &inner[..end];
        if !has_escapes {
            return Ok(Lexeme::Text(Cow::Borrowed(text)));
        }
        Ok(Lexeme::Text(Cow::Owned(unescaped(text).map_err(|what| self.invalid(what))?)))
    }
}

fn unescaped(text: &str) -> std::result::Result<String, String> {
    let mut out = String::with_capacity(text.len());
    let mut rest = text.chars();
    while let Some(c) = rest.next() {
        if c != '\\' {
            out.push(c);
            continue;
        }
        out.push(match rest.next() {
            Some('n') => '\n',
            Some('r') => '\r',
            Some('t') => '\t',
            Some('x') => {
                let digits: String = rest.by_ref().take(2).collect();
                match u8::from_str_radix(&digits, 16) {
                    // Anything above would be a part of a character.
                    Ok(code) if code < 0x80 => code.into(),
                    _ => return Err(format!("escape \"\\x{digits}\"")),
                }
            }
            Some(c) if c.is_ascii_punctuation() => c,
            other => return Err(format!("escape {other:?} behind a backslash")),
        });
    }
    Ok(out)
}

/// A token in a message.
pub(super) fn shown(lexeme: &Lexeme) -> String {
    let cut = |text: &str| text.chars().take(40).collect::<String>();
    match lexeme {
        Lexeme::Word(text) | Lexeme::Number(text) => format!("{:?}", cut(text)),
        Lexeme::Text(text) => format!("the text {:?}", cut(text)),
        Lexeme::Asset(text) => format!("the asset @{}@", cut(text)),
        Lexeme::Path(text) => format!("the path <{}>", cut(text)),
        Lexeme::Mark(mark) => format!("{mark:?}"),
        Lexeme::End => "the end of the file".to_owned(),
    }
}
