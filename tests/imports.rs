//! Imports keep to the rules of `ARCHITECTURE.md`: files do not import each other in a circle, and modules not what is above them.
#![allow(clippy::unwrap_used, reason = "a failing test may panic")]
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
/// Modules, and those that they may not import.
const FORBIDDEN: [(&str, &str); 9] = [
    ("cpu", "gpu reference train capture run verify"),
    ("gpu", "cpu reference train capture run verify"),
    ("reference", "cpu gpu train capture run verify"),
    ("image", "model backend train capture run"),
    ("frequency", "train cpu gpu reference capture run"),
    ("capture", "cpu gpu reference train init run"),
    ("train", "capture cpu gpu reference run init verify"),
    ("verify", "train capture run cpu gpu reference"),
    ("run", "gpu reference cli"),
];
type Graph = BTreeMap<String, BTreeSet<String>>;
/// The paths of a tree of imports, such as `a::{b, c::{d, e}}`.
fn expand(tree: &str) -> Vec<String> {
    let Some(open) = tree.find('{') else {
        return vec![tree.split(" as ").next().unwrap().trim().to_owned()];
    };
    let (inner, mut depth) = (&tree[open + 1..tree.rfind('}').unwrap()], 0);
    let parts = inner.split(|c| {
        depth += i32::from(c == '{') - i32::from(c == '}');
        c == ',' && depth == 0
    });
    let paths = parts.filter(|part| !part.trim().is_empty()).flat_map(expand);
    paths.map(|path| format!("{}{path}", tree[..open].trim())).collect()
}
/// The files of a crate by module, and the modules that each imports, tests aside. Imports of the crate's root do not count, nor,
/// if `within` is not set, those between a module and the modules in its folder.
fn graph(root: &str, within: bool) -> Graph {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join(root);
    let (mut folders, mut texts) = (vec![root.clone()], BTreeMap::new());
    while let Some(folder) = folders.pop() {
        for path in std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()) {
            let name =
                path.with_extension("").strip_prefix(&root).unwrap().to_str().unwrap().replace('/', "::");
            if path.is_dir() && !name.ends_with("tests") {
                folders.push(path);
            } else if path.extension().is_some_and(|e| e == "rs") && !name.ends_with("tests") && name != "lib"
            {
                let text = std::fs::read_to_string(&path).unwrap();
                texts.insert(
                    name.trim_end_matches("::mod").to_owned(),
                    text.split("#[cfg(test)]\nmod tests {").next().unwrap().to_owned(),
                );
            }
        }
    }
    let imports = |(module, text): (&String, &String)| {
        let uses = text.split("use ").skip(1).zip(text.split("use ")).filter(|(_, before)| {
            before.ends_with('\n') || before.ends_with("pub ") || before.ends_with(") ")
        });
        let resolve = |path: String| {
            let of = |up: usize| {
                module.split("::").collect::<Vec<_>>()[..module.split("::").count() - up].join("::")
            };
            let ups = path.matches("super::").count();
            let (first, rest) = path.split_once("::")?;
            let full = match first {
                "crate" | "litetex_gs" => rest.to_owned(),
                "super" => format!("{}::{}", of(ups), path.replace("super::", "")),
                _ => format!("{module}::{path}"),
            };
            let full = full.trim_start_matches("::").to_owned();
            let found = (1..=full.split("::").count())
                .rev()
                .map(|n| full.split("::").take(n).collect::<Vec<_>>().join("::"))
                .find(|m| texts.contains_key(m))?;
            let is_related = |a: &str, b: &str| a.starts_with(&format!("{b}::"));
            (found != *module && (within || !is_related(&found, module) && !is_related(module, &found)))
                .then_some(found)
        };
        (
            module.clone(),
            uses.flat_map(|(text, _)| expand(text.split(';').next().unwrap())).filter_map(resolve).collect(),
        )
    };
    texts.iter().map(imports).collect()
}
/// The modules that import each other in a circle, and those that import them.
fn circular(mut graph: Graph) -> Vec<String> {
    while let Some(free) =
        graph.iter().find(|(_, to)| to.iter().all(|to| !graph.contains_key(to))).map(|(m, _)| m.clone())
    {
        graph.remove(&free);
    }
    graph.into_keys().collect()
}
#[test]
fn imports_keep_to_the_rules() {
    let src = graph("src", true);
    assert!(src.len() > 200 && src.values().map(BTreeSet::len).sum::<usize>() > 800, "imports are found");
    for (module, forbidden) in FORBIDDEN {
        let inside = |m: &str, top: &str| m == top || m.starts_with(&format!("{top}::"));
        for (file, imported) in src.iter().filter(|(file, _)| inside(file, module)) {
            let wrong = imported.iter().find(|to| forbidden.split(' ').any(|top| inside(to, top)));
            assert!(wrong.is_none(), "{file} imports {wrong:?}");
        }
    }
    for graph in [src, graph("lab/src", true), graph("exporters/src", false)] {
        assert_eq!(circular(graph), Vec::<String>::new());
    }
    // Negative control.
    let planted = [("a", "b"), ("b", "c"), ("c", "b"), ("d", "e")]
        .map(|(from, to)| (from.to_owned(), BTreeSet::from([to.to_owned()])));
    assert_eq!(circular(Graph::from(planted)), ["a", "b", "c"]);
    assert_eq!(expand("a::{b, c::{d as x, e}}"), ["a::b", "a::c::d", "a::c::e"]);
}
