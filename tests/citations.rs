//! Citations in comments and documents lead somewhere: "method 6.2" and "gltf.md, section 9" name
//! numbered sections that exist, paths and links name files and headings that exist.
#![allow(clippy::unwrap_used, reason = "a failing test may panic")]

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

/// A document that is cited by section.
struct Document {
    /// The word that cites it.
    name: &'static str,
    path: &'static str,
    /// Whether the name and a number are a citation without the word "section".
    is_short: bool,
    /// About two thirds of the citations when this was written: a search that finds fewer is broken.
    least: usize,
}

const DOCUMENTS: [Document; 2] = [
    Document { name: "method", path: "docs/method.md", is_short: true, least: 60 },
    Document { name: "gltf.md", path: "exporters/schema/gltf.md", is_short: false, least: 7 },
];

/// A cited section: index in [`DOCUMENTS`], and number.
type Citation = (usize, String);

fn root() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR"))
}

/// A notebook: its citations of the method are those of its time.
const NOTEBOOK: &str = "lab/choices.md";

/// Sources and documents, except for this file, whose examples lead nowhere.
fn files() -> Vec<(PathBuf, String)> {
    let mut folders: Vec<PathBuf> = [
        "src",
        "shaders",
        "tests",
        "benches",
        "docs",
        "samples",
        "scripts",
        "exporters/src",
        "exporters/schema",
        "lab",
    ]
    .map(|folder| root().join(folder))
    .into();
    let mut files: Vec<PathBuf> = ["README.md", "ARCHITECTURE.md", "CONTRIBUTING.md", "RELEASING.md"]
        .map(|file| root().join(file))
        .into();
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(&folder).unwrap() {
            let path = entry.unwrap().path();
            let extension = path.extension().and_then(|e| e.to_str()).unwrap_or("");
            if path.is_dir() {
                if !path.ends_with("node_modules") {
                    folders.push(path);
                }
            } else if ["rs", "wgsl", "md", "py", "mjs", "sh"].contains(&extension) {
                files.push(path);
            }
        }
    }
    files.retain(|path| !path.ends_with("tests/citations.rs"));
    files.into_iter().map(|path| (path.clone(), std::fs::read_to_string(path).unwrap())).collect()
}

/// The words of a file, without the marks that begin lines of comments: citations may be wrapped.
fn words(text: &str) -> Vec<&str> {
    let marks: &[char] = &['/', '!', '#', '*'];
    text.lines().flat_map(|line| line.trim_start().trim_start_matches(marks).split_whitespace()).collect()
}

/// A section number at the start of a word, and what follows it: `6.2`, `)` of `6.2).`
fn number(word: &str) -> Option<(&str, &str)> {
    let word = word.trim_start_matches('(');
    let end = word.find(|c: char| !(c.is_ascii_digit() || c == '.')).unwrap_or(word.len());
    let number = word[..end].trim_end_matches('.');
    let rest = &word[number.len()..];
    let is_number = !number.is_empty() && !rest.starts_with(|c: char| c.is_alphanumeric() || c == '_');
    is_number.then_some((number, rest))
}

/// "method 1.2", "method section 1.2", "method, sections 1.2 and 3", "method 1.2, 1.3 and 3", "`gltf.md`, section 9".
fn citations(text: &str) -> Vec<Citation> {
    let words = words(text);
    let mut found = Vec::new();
    for (at, word) in words.iter().enumerate() {
        let name = word.trim_start_matches(|c: char| !c.is_alphanumeric()).trim_end_matches(['`', ',', ']']);
        let name = name.to_lowercase();
        let Some(document) = DOCUMENTS.iter().position(|d| d.name == name) else { continue };
        let is_explicit = words.get(at + 1).is_some_and(|w| ["section", "sections"].contains(w));
        if !is_explicit && !DOCUMENTS[document].is_short {
            continue;
        }
        let mut rest = &words[at + 1 + usize::from(is_explicit)..];
        while let Some((section, after)) = rest.first().and_then(|w| number(w)) {
            found.push((document, section.to_owned()));
            rest = &rest[1..];
            let and = rest.first().is_some_and(|w| ["and", "to"].contains(w));
            match after {
                "" | "," if and => rest = &rest[1..],
                "," => {}
                _ => break,
            }
        }
    }
    found
}

/// The numbers of a document's headings.
fn sections(markdown: &str) -> BTreeSet<String> {
    let headings = markdown.lines().filter_map(|line| line.strip_prefix('#'));
    headings.filter_map(|h| number(h.trim_start_matches('#').trim_start())).map(|n| n.0.to_owned()).collect()
}

/// The citations of a text that name no section.
fn dangling(text: &str) -> Vec<String> {
    let has = |(document, section): &Citation| {
        let path = root().join(DOCUMENTS[*document].path);
        sections(&std::fs::read_to_string(path).unwrap()).contains(section)
    };
    let missing = citations(text).into_iter().filter(|citation| !has(citation));
    missing.map(|(document, section)| format!("{} {section}", DOCUMENTS[document].name)).collect()
}

/// GitHub's anchor of a heading.
fn anchor(heading: &str) -> String {
    let text = heading.trim_start_matches('#').trim().to_lowercase();
    let kept = text.chars().filter(|c| c.is_alphanumeric() || " -_".contains(*c));
    kept.map(|c| if c == ' ' { '-' } else { c }).collect()
}

/// Documents named in a file: `docs/*.md`, `lab/*.md` and `schema/*.md` in a text, and the targets of Markdown links.
fn references(path: &Path, text: &str) -> Vec<String> {
    let is_path = |c: char| c.is_ascii_alphanumeric() || "_-./#".contains(c);
    let mut found: Vec<String> = text
        .split(|c: char| !is_path(c))
        .map(|word| word.trim_end_matches('.'))
        .filter(|word| {
            let file = word.split('#').next().unwrap_or("");
            (word.starts_with("docs/") || word.starts_with("lab/") || word.contains("schema/"))
                && file.ends_with(".md")
        })
        .map(str::to_owned)
        .collect();
    if path.extension().is_some_and(|e| e == "md") {
        let targets = text.split("](").skip(1).filter_map(|rest| rest.split_once(')'));
        found.extend(targets.map(|t| t.0.to_owned()).filter(|t| !t.contains("://")));
    }
    found
}

/// The references of a file, at `path`, that lead nowhere.
fn broken(path: &Path, text: &str) -> Vec<String> {
    let exists = |reference: &String| {
        let (file, heading) = reference.split_once('#').unwrap_or((reference, ""));
        let folders = [path.parent().unwrap().to_owned(), root(), root().join("exporters")];
        let mut candidates = folders.into_iter().map(|folder| folder.join(file));
        let target = if file.is_empty() { Some(path.to_owned()) } else { candidates.find(|f| f.exists()) };
        let has_heading = |target: PathBuf| {
            let document = std::fs::read_to_string(target).unwrap_or_default();
            document.lines().any(|line| line.starts_with('#') && anchor(line) == heading)
        };
        target.is_some_and(|target| heading.is_empty() || has_heading(target))
    };
    references(path, text).into_iter().filter(|reference| !exists(reference)).collect()
}

#[test]
fn every_cited_section_exists() {
    let mut counts = [0; DOCUMENTS.len()];
    for (path, text) in files().into_iter().filter(|(path, _)| !path.ends_with(NOTEBOOK)) {
        assert_eq!(dangling(&text), Vec::<String>::new(), "{}", path.display());
        citations(&text).iter().for_each(|citation| counts[citation.0] += 1);
    }
    for (Document { name, least, .. }, count) in DOCUMENTS.iter().zip(counts) {
        assert!(count >= *least, "{count} citations of {name}, expected at least {least}");
    }
}

#[test]
fn invented_citations_are_detected() {
    let text = "//! Order (method 2.1,\n//! 2.2 and 99.1), see `gltf.md`, section 9 and 12. The\n\
                # methods 3, method 2DGS and gltf.md 55 cite nothing; (Method, sections 1.4 and 6.99).";
    assert_eq!(dangling(text), ["method 99.1", "gltf.md 12", "method 6.99"]);
    assert_eq!(citations(text).len(), 7);
}

#[test]
fn every_named_document_exists() {
    let mut count = 0;
    for (path, text) in files() {
        assert_eq!(broken(&path, &text), Vec::<String>::new(), "{}", path.display());
        count += references(&path, &text).len();
    }
    assert!(count >= 30, "{count} references");
}

#[test]
fn invented_documents_and_headings_are_detected() {
    let text =
        "[a](method.md#62-statistics-and-error) [b](method.md#no-such-heading) [c](nowhere.md) docs/gone.md.";
    let wrong = broken(&root().join("docs/glossary.md"), text);
    assert_eq!(wrong, ["docs/gone.md", "method.md#no-such-heading", "nowhere.md"]);
}
