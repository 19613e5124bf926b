//! Sanitises text from files and other libraries for messages: short, on one line, without control characters.

use std::fmt::Write as _;
use std::path::Path;

/// Longest quotation, characters.
const QUOTED_CHARS_MAX: usize = 60;

/// Longest message, characters. Ours stay far below; this bounds those of other libraries, which quote whole inputs.
const MESSAGE_CHARS_MAX: usize = 1000;

/// Text in quotation marks for a message: at most 60 characters, then an ellipsis; control characters escaped.
///
/// Names and titles come from files that anyone may have written. Unescaped they could carry escape codes to a terminal,
/// uncut they could be megabytes long.
pub fn quoted(text: &str) -> String {
    let (start, is_cut) = cut(text, QUOTED_CHARS_MAX);
    format!("{start:?}{}", if is_cut { "\u{2026}" } else { "" })
}

/// A whole message, cut and escaped if need be; ordinary ones pass unchanged.
pub(crate) fn message(text: String) -> String {
    let (start, is_cut) = cut(&text, MESSAGE_CHARS_MAX);
    if !is_cut && !text.chars().any(is_unsafe) {
        return text;
    }
    let mut out = escaped(start);
    if is_cut {
        out.push('\u{2026}');
    }
    out
}

/// A path for a message. Names of files may hold control characters, too.
pub(crate) fn path(path: &Path) -> String {
    escaped(&path.to_string_lossy())
}

/// The first characters of a text, and whether it has more.
fn cut(text: &str, chars_max: usize) -> (&str, bool) {
    let end = text.char_indices().nth(chars_max).map(|(at, _)| at);
    (&text[..end.unwrap_or(text.len())], end.is_some())
}

/// Control characters, and those that change the direction of the text around them.
fn is_unsafe(c: char) -> bool {
    c.is_control() || matches!(c, '\u{200e}' | '\u{200f}' | '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}')
}

fn escaped(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for c in text.chars() {
        if is_unsafe(c) {
            // Writing to a string cannot fail.
            let _ = write!(out, "{}", c.escape_unicode());
        } else {
            out.push(c);
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Error, Issue, Severity};

    #[test]
    fn quotations_are_short_and_escaped() {
        assert_eq!(quoted("a \"name\""), "\"a \\\"name\\\"\"");
        assert_eq!(quoted("\x1b[31mred\u{202e}\n"), "\"\\u{1b}[31mred\\u{202e}\\n\"");
        assert_eq!(quoted(&"ü".repeat(60)), format!("\"{}\"", "ü".repeat(60)));
        assert_eq!(quoted(&"ü".repeat(1 << 20)), format!("\"{}\"\u{2026}", "ü".repeat(60)));
    }

    #[test]
    fn no_error_or_issue_is_long_or_carries_escape_codes() {
        let hostile = format!("\x1b]0;title\x07{}", "x".repeat(1 << 20));
        let path = Path::new("a\x1b[2Jb");
        for error in [
            Error::invalid(path, &hostile),
            Error::unsupported(path, &hostile),
            Error::too_large(path, &hostile),
            Error::io(path, std::io::Error::other("cut")),
        ] {
            let text = error.to_string();
            assert!(text.chars().count() < 1100 && !text.chars().any(char::is_control), "{text:?}");
        }
        let issue = Issue::new("LT9001", Severity::Error, &hostile, &hostile);
        assert!(!issue.place.chars().chain(issue.message.chars()).any(char::is_control));
        assert!(issue.place.len() + issue.message.len() < 3000);
        // Negative control: ordinary messages are untouched.
        assert_eq!(message("Größe 3 x 4, \"ok\"".to_owned()), "Größe 3 x 4, \"ok\"");
    }
}
