//! Numbers and names as people read them in messages and tables.

use std::borrow::Cow;
use std::path::Path;

/// Characters of a name from a file that a message quotes at most.
const QUOTED_CHARS_MAX: usize = 72;

/// Characters of a path that a message shows at most.
const PATH_CHARS_MAX: usize = 400;

/// Characters of a message at most.
const MESSAGE_CHARS_MAX: usize = 4000;

/// A name from a file in double quotes, escaped and cut: files may hold names of megabytes.
pub fn quoted(name: &str) -> String {
    format!("{:?}", shortened(name, QUOTED_CHARS_MAX))
}

/// A number of things: "1 view", "2 views".
pub fn counted(count: usize, noun: &str) -> String {
    if count == 1 { format!("1 {noun}") } else { format!("{count} {noun}s") }
}

/// The first `chars_max` characters, with an ellipsis if any were cut.
pub fn shortened(text: &str, chars_max: usize) -> Cow<'_, str> {
    match text.char_indices().nth(chars_max) {
        Some((end, _)) => Cow::Owned(format!("{}…", &text[..end])),
        None => Cow::Borrowed(text),
    }
}

/// Text of which the middle is left out if it has more than `chars_max` characters: the beginning says what it is about,
/// the end where it was found.
fn abridged(text: &str, chars_max: usize) -> Cow<'_, str> {
    let count = text.chars().count();
    if count <= chars_max {
        return Cow::Borrowed(text);
    }
    let (head, tail) = (chars_max.div_ceil(2), chars_max / 2);
    let at = |index| text.char_indices().nth(index).map_or(text.len(), |(at, _)| at);
    Cow::Owned(format!("{} … {}", &text[..at(head)], &text[at(count - tail)..]))
}

/// A path, abridged if it is longer than those that people use: files may state paths of megabytes.
pub fn path(path: &Path) -> String {
    abridged(&path.to_string_lossy(), PATH_CHARS_MAX).into_owned()
}

/// A whole message, abridged if it is longer than those that people read: it may repeat what a file holds.
pub fn message(text: &str) -> Cow<'_, str> {
    abridged(text, MESSAGE_CHARS_MAX)
}

/// A path as one word of a POSIX shell; a path that begins like an option gets a folder before it.
pub fn shell_word(path: &Path) -> String {
    let mut text = path.display().to_string();
    if text.starts_with('-') {
        text.insert_str(0, "./");
    }
    let is_plain = |c: char| c.is_ascii_alphanumeric() || "/._-+%:@".contains(c);
    if !text.is_empty() && text.chars().all(is_plain) {
        text
    } else {
        format!("'{}'", text.replace('\'', r"'\''"))
    }
}

/// Text that a terminal shows and does not obey: control characters and those that reverse the direction of
/// writing are escaped, but for those in `kept`.
pub fn printable<'a>(text: &'a str, kept: &[char]) -> Cow<'a, str> {
    let escapes = |c: char| {
        (c.is_control() || matches!(c, '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}'))
            && !kept.contains(&c)
    };
    if !text.contains(escapes) {
        return Cow::Borrowed(text);
    }
    let mut out = String::with_capacity(text.len());
    for c in text.chars() {
        if escapes(c) {
            out.extend(c.escape_default());
        } else {
            out.push(c);
        }
    }
    Cow::Owned(out)
}

/// "4.0 GiB".
pub fn format_bytes(bytes: u64) -> String {
    match bytes as f64 {
        b if b >= 1_073_741_824.0 => format!("{:.1} GiB", b / 1_073_741_824.0),
        b if b >= 1_048_576.0 => format!("{:.1} MiB", b / 1_048_576.0),
        b if b >= 1024.0 => format!("{:.1} KiB", b / 1024.0),
        b => format!("{b} B"),
    }
}

/// "45 s", "12 min", "3 h 20 min".
pub fn format_duration(secs: f64) -> String {
    let secs = secs.max(0.0);
    if secs < 10.0 {
        format!("{secs:.1} s")
    } else if secs < 120.0 {
        format!("{secs:.0} s")
    } else if secs < 7200.0 {
        format!("{:.0} min", secs / 60.0)
    } else {
        let minutes = (secs / 60.0).round() as u64;
        format!("{} h {:02} min", minutes / 60, minutes % 60)
    }
}

/// "1,234,567".
pub fn format_count(n: u64) -> String {
    let digits = n.to_string();
    let mut out = String::new();
    for (i, digit) in digits.chars().enumerate() {
        if i > 0 && (digits.len() - i).is_multiple_of(3) {
            out.push(',');
        }
        out.push(digit);
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counts_and_durations_are_readable() {
        assert_eq!(format_count(0), "0");
        assert_eq!(format_count(1_234_567), "1,234,567");
        assert_eq!(format_duration(3.25), "3.2 s");
        assert_eq!(format_duration(12_000.0), "3 h 20 min");
        assert_eq!(format_bytes(4 << 30), "4.0 GiB");
    }

    #[test]
    fn names_from_files_are_escaped_and_shortened() {
        assert_eq!(printable("füchse 1\n", &['\n']), "füchse 1\n");
        assert_eq!(printable("a\u{1b}[31mb\u{9b}\n\u{202e}", &[]), "a\\u{1b}[31mb\\u{9b}\\n\\u{202e}");
        assert_eq!(quoted("a\"\u{1b}"), "\"a\\\"\\u{1b}\"");
        let long = quoted(&"é".repeat(1 << 20));
        assert!(long.chars().count() == QUOTED_CHARS_MAX + 3 && long.ends_with("é…\""), "{long}");
        assert_eq!(shortened("abc", 3), "abc");
        assert_eq!((abridged("äbcdé", 5), abridged("äbcdéf", 5)), ("äbcdé".into(), "äbc … éf".into()));
        let long = path(Path::new(&format!("/captures/{}/a.png", "x".repeat(1 << 20))));
        assert!(long.starts_with("/captures/x") && long.ends_with("x/a.png") && long.len() < 500, "{long}");
        assert_eq!(path(Path::new("/captures/a.png")), "/captures/a.png");
    }

    #[test]
    fn paths_are_quoted_for_the_shell() {
        for (path, word) in [("a/b-1.jpg", "a/b-1.jpg"), ("-x", "./-x"), ("a b", "'a b'"), ("$(x)", "'$(x)'")]
        {
            assert_eq!(shell_word(Path::new(path)), word);
        }
    }
}
