//! What is typed for a benchmark's matrix: names with arguments, seeds, shards. Text in, values out.

use super::matrix::{Scene, Setting};
use litetex_gs::train::Policy;

/// Most seeds of a matrix.
const SEEDS_MAX: u64 = 1000;

/// "NAME: ARGS" or "NAME".
pub fn parse_setting(text: &str) -> Result<Setting, String> {
    let (name, args) = match text.split_once(": ") {
        Some((name, args)) => (name, args),
        None => (text.strip_suffix(':').unwrap_or(text), ""),
    };
    if name.trim().is_empty() || name.trim_start().starts_with('-') {
        return Err(format!(
            "{text:?}: expected \"NAME: ARGUMENTS\", for example \"small: --policy fixed:4 --max-splats 5000\""
        ));
    }
    Ok(Setting { name: name.trim().to_owned(), args: split_words(args)? })
}

/// A variant without arguments that is called as a policy is that policy: nobody who writes "fixed:4" wants the
/// default under this name.
pub fn with_policy(variant: &mut Setting) {
    if variant.args.is_empty() && variant.name.parse::<Policy>().is_ok() {
        variant.args = ["--policy", &variant.name].map(ToOwned::to_owned).into();
    }
}

/// "DIR" or "NAME: DIR".
pub fn parse_scene(text: &str) -> Result<Scene, String> {
    let (name, path) = text.split_once(": ").unwrap_or(("", text));
    if path.trim().is_empty() {
        return Err(format!("{text:?}: expected the folder of a capture, or \"NAME: FOLDER\""));
    }
    Ok(Scene { name: name.trim().to_owned(), path: path.trim().into(), args: Vec::new() })
}

/// "1,2,5-8".
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

/// "2/5".
pub fn parse_shard(text: &str) -> Result<(usize, usize), String> {
    let parts = text.split_once('/').and_then(|(i, n)| Some((i.parse().ok()?, n.parse().ok()?)));
    match parts {
        Some((i, n)) if (1..=n).contains(&i) => Ok((i, n)),
        _ => Err(format!("{text:?}: expected PART/PARTS with PART from 1 to PARTS, for example 1/3")),
    }
}

/// Words at blanks; quotation marks, single or double, keep blanks. Backslashes are letters: Windows has
/// them in paths.
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
        return Err(format!("{text:?}: a quotation mark is not closed"));
    }
    words.extend(word);
    Ok(words)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_keep_what_is_quoted() {
        assert_eq!(split_words("").unwrap(), [""; 0]);
        assert_eq!(split_words("  --a  b ").unwrap(), ["--a", "b"]);
        assert_eq!(split_words(r#"--images "my photos" ''"#).unwrap(), ["--images", "my photos", ""]);
        assert_eq!(split_words(r"C:\a --x='1 2'").unwrap(), [r"C:\a", "--x=1 2"]);
        assert!(split_words("it's").unwrap_err().contains("not closed"));
    }

    #[test]
    fn settings_and_scenes() {
        let bare = parse_setting("no maps: --policy none").unwrap();
        assert_eq!(
            (bare.name.as_str(), bare.args),
            ("no maps", vec!["--policy".to_owned(), "none".to_owned()])
        );
        assert_eq!(parse_setting("fixed:4").unwrap().name, "fixed:4");
        assert_eq!(parse_setting("fixed:4: --steps 1").unwrap().name, "fixed:4");
        assert_eq!(parse_setting("bare:").unwrap().name, "bare");
        for wrong in ["", ": --steps 1", "--policy none", "a: 'b"] {
            assert!(parse_setting(wrong).is_err(), "{wrong}");
        }
        let scene = parse_scene("fox: captures/1").unwrap();
        assert_eq!((scene.name.as_str(), scene.path.to_str()), ("fox", Some("captures/1")));
        assert_eq!(parse_scene(r"C:\fox").unwrap().path.to_str(), Some(r"C:\fox"));
        assert!(parse_scene("fox: ").is_err());
    }

    #[test]
    fn bare_names_of_policies_mean_them() {
        let args = |text: &str| {
            let mut setting = parse_setting(text).unwrap();
            with_policy(&mut setting);
            setting.args.join(" ")
        };
        for name in ["litetex", "cat", "plain", "none", "fixed:4"] {
            assert_eq!(args(name), format!("--policy {name}"));
        }
        // Negative controls: other names, and names whose arguments say what is meant.
        for (text, meant) in [("fixed:1", ""), ("Plain", ""), ("plain: --steps 3", "--steps 3")] {
            assert_eq!(args(text), meant, "{text}");
        }
    }

    #[test]
    fn seeds_and_shards() {
        assert_eq!(parse_seeds("3, 1,5-7"), Ok(vec![3, 1, 5, 6, 7]));
        for wrong in ["", "1,", "a", "5-3", "-1", "0-18446744073709551615", "1-1000,2000"] {
            assert!(parse_seeds(wrong).is_err(), "{wrong}");
        }
        assert_eq!(parse_shard("2/3"), Ok((2, 3)));
        for wrong in ["", "0/3", "4/3", "1", "1/0", "a/b"] {
            assert!(parse_shard(wrong).is_err(), "{wrong}");
        }
    }
}
