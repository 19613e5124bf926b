//! `docs/troubleshooting.md` has an entry for each warning and kind of error, and no others.
#![allow(clippy::unwrap_used, reason = "a failing test may panic")]

use litetex_gs::Error;
use std::collections::BTreeSet;
use std::path::Path;

/// Text of all sources below a folder.
fn sources(folder: &Path, text: &mut String) {
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            sources(&path, text);
        } else {
            text.push_str(&std::fs::read_to_string(path).unwrap());
        }
    }
}

/// Codes that stand literally after a mark.
fn literals(text: &str, mark: &str) -> BTreeSet<String> {
    let after = text.split(mark).skip(1).filter_map(|rest| rest.trim_start().strip_prefix('"'));
    let codes = after.filter_map(|rest| Some(rest.split_once('"')?.0.to_owned()));
    codes.filter(|code| code.bytes().all(|b| b.is_ascii_lowercase() || b == b'-')).collect()
}

/// Codes that stand after a mark as the name of a constant.
fn constants(text: &str, mark: &str) -> BTreeSet<String> {
    let name = |rest: &str| {
        let end = rest.find(|c: char| !(c.is_ascii_uppercase() || c == '_')).unwrap_or(rest.len());
        rest[..end].to_owned()
    };
    let after = text.split(mark).skip(1).map(|rest| name(rest.trim_start()));
    let used = after.filter(|name| !name.is_empty()).collect::<BTreeSet<_>>();
    used.iter().flat_map(|name| literals(text, &format!("const {name}: &str ="))).collect()
}

fn entries(section: &str) -> Vec<String> {
    let page = include_str!("../docs/troubleshooting.md");
    let part = page.split("\n## ").find(|part| part.starts_with(section)).unwrap();
    part.lines().filter_map(|l| Some(l.strip_prefix("### `")?.strip_suffix('`')?.to_owned())).collect()
}

#[test]
fn each_warning_and_kind_of_error_has_an_entry() {
    let mut text = String::new();
    sources(Path::new("src"), &mut text);
    sources(Path::new("lab/src"), &mut text);
    let entries_of_warnings = entries("Warnings");
    let mut codes = &literals(&text, "warn(") | &literals(&text, "code: ");
    let of_constants = ["warn(", "add_warning(", "code: "].map(|mark| constants(&text, mark));
    codes.extend(of_constants.into_iter().flatten());
    assert!(["no-snapshot", "growth-ended-by-device"].iter().all(|code| codes.contains(*code)));
    assert!(codes.len() > 40 && literals("x.warn(\n \"a-b\", 1)", "warn(").contains("a-b"));
    let verdicts = literals(&text, "reason(");
    assert!(verdicts.contains("few-views"));
    assert_eq!(entries("Verdicts"), verdicts.iter().cloned().collect::<Vec<_>>());
    let has_entry = |code: &&String| entries_of_warnings.contains(code) || verdicts.contains(*code);
    let missing: Vec<_> = codes.iter().filter(|code| !has_entry(code)).collect();
    assert!(missing.is_empty(), "no entry in docs/troubleshooting.md: {missing:?}");
    let nouns = literals(&text, "finish(path,");
    assert_eq!(nouns.iter().map(String::as_str).collect::<Vec<_>>(), ["points", "views"]);
    assert!(nouns.iter().all(|noun| entries_of_warnings.contains(&format!("{noun}-left-out"))));
    // Codes that are chosen from a list are literals elsewhere; "-left-out" follows a noun.
    let is_known = |entry: &&String| text.contains(&format!("\"{entry}\"")) || entry.ends_with("-left-out");
    let unknown: Vec<_> = entries_of_warnings.iter().filter(|entry| !is_known(entry)).collect();
    assert!(unknown.is_empty(), "entries of no code: {unknown:?}");
    assert!(entries_of_warnings.is_sorted(), "entries are in order");
    assert_eq!(entries("Errors"), Error::KINDS);
}

/// The text of an entry.
fn entry(code: &str) -> &'static str {
    let page = include_str!("../docs/troubleshooting.md");
    let after = page.split(&format!("### `{code}`\n\n")).last().unwrap();
    after.split("\n\n#").next().unwrap()
}

#[test]
fn entries_say_what_the_warnings_say() {
    for (code, said, not_said) in [
        (
            "photos-turned-by-exif",
            &["taken as stored", "exif=apply`\nturns", "exif=ignore` confirms"][..],
            "were turned",
        ),
        ("no-test-figures", &["masks leave out every pixel"], "No view was held out"),
        ("different-repetitions", &["differ in more than the seed"], "different seeds"),
        ("cameras-left-out", &["no view uses"], "Export the poses again"),
    ] {
        let text = entry(code);
        assert!(said.iter().all(|words| text.contains(words)) && !text.contains(not_said), "{code}: {text}");
    }
    assert!(entry("views-left-out").starts_with("The poses"), "an entry ends where the next begins");
    assert!(!entry("views-left-out").contains("###"));
}
