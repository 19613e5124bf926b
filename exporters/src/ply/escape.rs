//! Text in comments of a PLY header. The format asks for lines of ASCII, and a widely used reader in Python refuses others.
//! Other characters are escaped: `\\u{fc}` for a character, `\\\\` for a backslash.

/// Turns a text into a line of ASCII without blanks at its ends.
pub(super) fn escaped(text: &str) -> String {
    let last = text.chars().count().saturating_sub(1);
    let mut out = String::with_capacity(text.len());
    for (i, c) in text.chars().enumerate() {
        match c {
            '\\' => out.push_str("\\\\"),
            // Readers trim blanks.
            ' ' if i > 0 && i < last => out.push(c),
            '!'..='~' => out.push(c),
            c => out.extend(c.escape_unicode()),
        }
    }
    out
}

/// The inverse of [`escaped`]; leaves alone what is not an escape.
pub(super) fn unescaped(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    let mut rest = text;
    while let Some((before, after)) = rest.split_once('\\') {
        out.push_str(before);
        rest = match after.strip_prefix('\\') {
            Some(after) => {
                out.push('\\');
                after
            }
            None => match code(after) {
                Some((c, after)) => {
                    out.push(c);
                    after
                }
                None => {
                    out.push('\\');
                    after
                }
            },
        };
    }
    out + rest
}

/// The character of `u{CODE}` at the front, and the text behind it.
fn code(text: &str) -> Option<(char, &str)> {
    let (digits, after) = text.strip_prefix("u{")?.split_once('}')?;
    let is_hex = (1..=6).contains(&digits.len()) && digits.bytes().all(|b| b.is_ascii_hexdigit());
    let code = is_hex.then(|| u32::from_str_radix(digits, 16).ok()).flatten()?;
    Some((char::from_u32(code)?, after))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn any_text_round_trips_as_one_line_of_ascii() {
        for text in [
            "",
            "plain text",
            "M\u{fc}ller",
            "a\nb\r\tc",
            " blanks ",
            " ",
            "C:\\u{41}\\n",
            "\u{1f600}\\",
            "\0\u{7f}",
        ] {
            let line = escaped(text);
            assert!(line.bytes().all(|b| (b' '..=b'~').contains(&b)) && line.trim() == line, "{line:?}");
            assert_eq!(unescaped(&line), text);
        }
        assert_eq!(escaped("M\u{fc}ller"), "M\\u{fc}ller");
        // What others wrote.
        for text in ["\\n", "\\u{}", "\\u{110000}", "\\u{41", "\\u{+41}", "\\"] {
            assert_eq!(unescaped(text), text);
        }
    }
}
