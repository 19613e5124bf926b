//! Documents, help, messages and comments say what `docs/glossary.md` says. Code is not read, nor code spans: names are a matter
//! of review.
#![allow(clippy::unwrap_used, reason = "a failing test may panic")]

use std::path::{Path, PathBuf};

/// Words to avoid, in each of their forms.
struct Rule {
    avoid: &'static [&'static str],
    instead: &'static str,
    /// Where formats or other programs call something so: beginnings of paths.
    except: &'static [&'static str],
}

const fn rule(avoid: &'static [&'static str], instead: &'static str) -> Rule {
    Rule { avoid, instead, except: &[] }
}

const RULES: [Rule; 19] = [
    rule(&["so many"], "a number, or `that many`"),
    rule(&["in vain"], "without effect"),
    rule(&["give back", "gives back", "gave back", "given back", "giving back"], "prune"),
    rule(&["take back", "takes back", "took back", "taken back", "taking back"], "undo"),
    rule(&["promise", "promises", "promised", "promising"], "predict, guarantee, allow"),
    rule(&["withhold", "withholds", "withheld", "withholding"], "hold out"),
    rule(&["starve", "starves", "starved", "starving"], "lack"),
    rule(&["worth"], "the number: it gains 2 dB, costs 2 dB"),
    rule(&["picture", "pictures"], "photo, image"),
    Rule {
        avoid: &["primitive", "primitives"],
        instead: "splat",
        except: &[
            "exporters/",
            "web/src/core/read/gltf/",
            "web/src/three/",
            "tests/third_party/gltf.mjs",
            "tests/cli_export.rs",
        ],
    },
    rule(&["structure step", "structure steps"], "density-control step"),
    rule(&["dataset", "datasets"], "capture"),
    rule(&["spender"], "budget allocator"),
    rule(&["in sight"], "visible"),
    rule(&["judge", "judges", "judged", "judging"], "validate, test, compare"),
    rule(&["draft", "drafts"], "planned splat"),
    rule(&["skybox"], "backdrop"),
    rule(&["side file", "side files"], "sidecar file"),
    rule(&["outlook", "forecast"], "resource estimate, ETA"),
];

/// The glossary lists what to avoid, and the notebook keeps the words of its time.
const NOT_READ: [&str; 3] = ["docs/glossary.md", "lab/choices.md", "tests/terms.rs"];

/// What has been found: line, words, what to say instead.
type Finding = (usize, String, &'static str);

/// A text's parts that people read, with the number of the line in which each begins.
fn prose(path: &Path, text: &str) -> Vec<(usize, String)> {
    match path.extension().and_then(|e| e.to_str()).unwrap_or("") {
        "md" => without_fences(text),
        "rs" => comments_and_strings(text),
        "py" | "sh" | "toml" => lines(text, &["#"]),
        _ => lines(text, &["//", "*", "/*"]),
    }
}

/// The lines of a Markdown text outside fenced code.
fn without_fences(text: &str) -> Vec<(usize, String)> {
    let mut is_code = false;
    let lines = text.lines().enumerate().filter(|(_, line)| {
        let is_fence = line.trim_start().starts_with("```");
        is_code ^= is_fence;
        !is_code && !is_fence
    });
    lines.map(|(at, line)| (at + 1, line.to_owned())).collect()
}

/// Comments that have lines of their own, or follow code.
fn lines(text: &str, marks: &[&str]) -> Vec<(usize, String)> {
    let comment = |line: &str| {
        let line = line.trim_start();
        let whole = marks.iter().find_map(|mark| line.strip_prefix(mark));
        whole
            .or_else(|| line.split_once(&format!(" {} ", marks[0])).map(|(_, comment)| comment))
            .map(str::to_owned)
    };
    text.lines().enumerate().filter_map(|(at, line)| Some((at + 1, comment(line)?))).collect()
}

/// The comments and the string literals of Rust code.
fn comments_and_strings(text: &str) -> Vec<(usize, String)> {
    let mut parts = Vec::new();
    let (mut rest, mut line) = (text, 1);
    while let Some(first) = rest.chars().next() {
        let length = if rest.starts_with("//") {
            rest.find('\n').unwrap_or(rest.len())
        } else if let Some(raw) = rest.strip_prefix("r#\"") {
            raw.find("\"#").map_or(rest.len(), |end| end + 5)
        } else if first == '"' {
            let mut is_escaped = false;
            let end = rest[1..].find(|c| {
                let ends = c == '"' && !is_escaped;
                is_escaped = c == '\\' && !is_escaped;
                ends
            });
            end.map_or(rest.len(), |end| end + 2)
        } else if first == '\'' && rest[1..].starts_with(['"', '\\']) {
            3
        } else {
            0
        };
        let (part, after) = rest.split_at(if length > 0 { length } else { first.len_utf8() });
        if length > 3 {
            parts.push((line, part.replace("\\n", " ")));
        }
        line += part.matches('\n').count();
        rest = after;
    }
    parts
}

/// The words of prose with their lines, in lower case, without code spans and the targets of links.
fn words(parts: &[(usize, String)]) -> Vec<(usize, String)> {
    let mut words = Vec::new();
    for (first, part) in parts {
        for (at, line) in part.lines().enumerate() {
            let spoken: String = line.split('`').step_by(2).collect::<Vec<_>>().join(" x ");
            let spoken = spoken.split("](").enumerate().map(|(at, piece)| match piece.split_once(')') {
                Some((_, after)) if at > 0 => after,
                _ => piece,
            });
            for piece in spoken {
                let trimmed =
                    piece.split_whitespace().map(|word| word.trim_matches(|c: char| !c.is_alphanumeric()));
                words.extend(trimmed.filter(|w| !w.is_empty()).map(|word| (first + at, word.to_lowercase())));
            }
        }
    }
    words
}

/// The words of a file that a rule excludes.
fn said(rule: &Rule, words: &[(usize, String)]) -> Vec<(usize, String)> {
    let mut found = Vec::new();
    for avoided in rule.avoid {
        for window in words.windows(avoided.split(' ').count()) {
            let said = window.iter().map(|(_, word)| word.as_str()).collect::<Vec<_>>().join(" ");
            if said == **avoided {
                found.push((window[0].0, said));
            }
        }
    }
    found
}

fn is_excepted(rule: &Rule, path: &Path) -> bool {
    rule.except.iter().any(|beginning| path.to_str().unwrap().starts_with(beginning))
}

/// What a file says that the rules exclude there.
fn findings(path: &Path, text: &str) -> Vec<Finding> {
    let words = words(&prose(path, text));
    let rules = RULES.iter().filter(|rule| !is_excepted(rule, path));
    let of_rule = |rule: &Rule| -> Vec<Finding> {
        said(rule, &words).into_iter().map(|(line, said)| (line, said, rule.instead)).collect()
    };
    rules.flat_map(of_rule).collect()
}

/// Sources and documents, by their paths from the root.
fn files() -> Vec<PathBuf> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut folders = vec![root.to_owned()];
    let mut files = Vec::new();
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(&folder).unwrap() {
            let path = entry.unwrap().path();
            let name = path.file_name().unwrap().to_str().unwrap();
            let extension = path.extension().and_then(|e| e.to_str()).unwrap_or("");
            let relative = path.strip_prefix(root).unwrap();
            if path.is_dir() {
                if !name.starts_with('.') && !["target", "node_modules", "dist"].contains(&name) {
                    folders.push(path);
                }
            } else if ["rs", "wgsl", "md", "ts", "glsl", "py", "mjs", "sh", "toml"].contains(&extension)
                && !NOT_READ.iter().any(|file| relative.ends_with(file))
            {
                files.push(relative.to_owned());
            }
        }
    }
    files
}

#[test]
fn the_words_are_those_of_the_glossary() {
    let files = files();
    assert!(files.len() > 300, "{} files", files.len());
    let mut wrong = Vec::new();
    for path in &files {
        let text = std::fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join(path)).unwrap();
        let found = findings(path, &text).into_iter();
        wrong.extend(
            found.map(|(line, said, instead)| format!("{}:{line}: {said}; say: {instead}", path.display())),
        );
    }
    assert!(wrong.is_empty(), "{} findings\n{}", wrong.len(), wrong.join("\n"));
}

#[test]
fn every_exception_is_needed() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let files = files();
    for rule in &RULES {
        for beginning in rule.except {
            let mut there = files.iter().filter(|path| path.to_str().unwrap().starts_with(beginning));
            let says = |path: &PathBuf| {
                let text = std::fs::read_to_string(root.join(path)).unwrap();
                !said(rule, &words(&prose(path, &text))).is_empty()
            };
            assert!(there.any(says), "{}: not in {beginning}", rule.avoid[0]);
        }
    }
}

#[test]
fn every_word_to_avoid_is_found() {
    for Rule { avoid, instead, .. } in &RULES {
        for said in *avoid {
            let (first, second) = said.split_once(' ').unwrap_or((said, ""));
            for (file, text) in [
                ("a.md", format!("# A title\n\nWhat is\n({said}, or not).\n")),
                ("a.rs", format!("fn f() {{}}\n\n/// What is\n/// {first}\n/// {second}.\n")),
                ("a.rs", format!("let a = '\"';\n\nlet text = \"An \\\" end,\n {said}\";\n")),
                ("a.ts", format!("const a = 1;\n\n// What is\n// {said}\n")),
                ("a.sh", format!("true\n\n# What is\n# {}\n", said.to_uppercase())),
            ] {
                let found = findings(Path::new(file), &text);
                assert_eq!(found, [(4, (*said).to_owned(), *instead)], "{file}: {text}");
            }
        }
    }
}

#[test]
fn code_is_not_prose() {
    for (file, text) in [
        ("a.md", "Set `promise`, see [it](worth.md).\n\n```sh\nlitetex --iterations 3 # judge\n```\n"),
        (
            "a.rs",
            "use crate::dataset;\nlet worth = promise('\"'); // of `dataset`\nlet give = \"give-back\";\n",
        ),
        ("a.ts", "const picture: Promise<void> = worth();\n"),
    ] {
        assert_eq!(findings(Path::new(file), text), [], "{file}");
    }
}
