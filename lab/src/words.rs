//! Parses what users type for a matrix: names with arguments, seeds.

use crate::matrix::{NamedArgs, SceneEntry};

/// Most seeds of a matrix; more is probably a typing error.
const SEEDS_MAX: u64 = 1000;

/// Parses "NAME: ARGUMENTS" or "NAME".
///
/// # Errors
/// A message that says what was expected.
pub fn parse_named_args(text: &str) -> Result<NamedArgs, String> {
    let (name, args) = match text.split_once(": ") {
        Some((name, args)) => (name, args),
        None => (text.strip_suffix(':').unwrap_or(text), ""),
    };
    if name.trim().is_empty() || name.trim_start().starts_with('-') {
        return Err(format!(
            "{text:?}: expected \"NAME: ARGUMENTS\", for example \"small: --policy fixed:4 --budget-params 50k\""
        ));
    }
    Ok(NamedArgs { name: name.trim().to_owned(), args: split_words(args)? })
}

/// Parses "CAPTURE" or "NAME: CAPTURE".
///
/// # Errors
/// A message that says what was expected.
pub fn parse_scene(text: &str) -> Result<SceneEntry, String> {
    let (name, path) = text.split_once(": ").unwrap_or(("", text));
    if path.trim().is_empty() {
        return Err(format!("{text:?}: expected a capture, or \"NAME: CAPTURE\""));
    }
    Ok(SceneEntry { name: name.trim().to_owned(), path: path.trim().into(), ..SceneEntry::default() })
}

/// Parses a list such as "1,2,5-8".
///
/// # Errors
/// A message that says what was expected.
pub fn parse_seeds(text: &str) -> Result<Vec<u64>, String> {
    let wrong = || format!("{text:?}: expected numbers and ranges like 1,2,5-8, at most {SEEDS_MAX} in all");
    let mut seeds = Vec::new();
    for part in text.split(',') {
        let number = |t: &str| t.trim().parse::<u64>().map_err(|_| wrong());
        let (from, to) = match part.split_once('-') {
            Some((from, to)) => (number(from)?, number(to)?),
            None => (number(part)?, number(part)?),
        };
        if from > to || to - from >= SEEDS_MAX {
            return Err(wrong());
        }
        seeds.extend(from..=to);
    }
    if seeds.len() as u64 > SEEDS_MAX { Err(wrong()) } else { Ok(seeds) }
}

/// Splits at blanks; single or double quotes keep them. Backslashes are ordinary characters, for the sake of Windows
/// paths.
///
/// # Errors
/// A message about a quote that is not closed.
pub fn split_words(text: &str) -> Result<Vec<String>, String> {
    let mut words = Vec::new();
    let mut word: Option<String> = None;
    let mut quote = None;
    for c in text.chars() {
        match quote {
            Some(q) if c == q => quote = None,
            Some(_) => word.get_or_insert_default().push(c),
            None if c == '"' || c == '\'' => {
                quote = Some(c);
                word.get_or_insert_default();
            }
            None if c.is_whitespace() => words.extend(word.take()),
            None => word.get_or_insert_default().push(c),
        }
    }
    if quote.is_some() {
        return Err(format!("{text:?}: a quote is not closed"));
    }
    words.extend(word);
    Ok(words)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quotes_preserve_spaces() {
        assert_eq!(split_words("").unwrap(), [""; 0]);
        assert_eq!(split_words("  --a  b ").unwrap(), ["--a", "b"]);
        assert_eq!(split_words(r#"--images "my photos" ''"#).unwrap(), ["--images", "my photos", ""]);
        assert_eq!(split_words(r"C:\a --x='1 2'").unwrap(), [r"C:\a", "--x=1 2"]);
        assert!(split_words("it's").unwrap_err().contains("not closed"));
    }

    #[test]
    fn named_arguments_and_scenes() {
        let bare = parse_named_args("no maps: --policy none").unwrap();
        assert_eq!(
            (bare.name.as_str(), bare.args),
            ("no maps", vec!["--policy".to_owned(), "none".to_owned()])
        );
        assert_eq!(parse_named_args("fixed:4").unwrap().name, "fixed:4");
        assert_eq!(parse_named_args("fixed:4: --steps 1").unwrap().name, "fixed:4");
        assert_eq!(parse_named_args("bare:").unwrap().name, "bare");
        for wrong in ["", ": --steps 1", "--policy none", "a: 'b"] {
            assert!(parse_named_args(wrong).is_err(), "{wrong}");
        }
        let scene = parse_scene("fox: captures/1").unwrap();
        assert_eq!((scene.name.as_str(), scene.path.to_str()), ("fox", Some("captures/1")));
        assert_eq!(parse_scene(r"C:\fox").unwrap().path.to_str(), Some(r"C:\fox"));
        assert!(parse_scene("fox: ").is_err());
    }

    #[test]
    fn seeds() {
        assert_eq!(parse_seeds("3, 1,5-7"), Ok(vec![3, 1, 5, 6, 7]));
        for wrong in ["", "1,", "a", "5-3", "-1", "0-18446744073709551615", "1-1000,2000"] {
            assert!(parse_seeds(wrong).is_err(), "{wrong}");
        }
    }
}
