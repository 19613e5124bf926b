//! Imports keep to the rules of `ARCHITECTURE.md`: files do not import each other in a circle, and modules not what is above them.
/// Modules, and the others that they must not import.
const RULES: [(&str, &str); 5] = [
    ("cpu gpu reference frequency verify", "cpu gpu reference verify train capture run"),
    ("capture train", "cpu gpu reference verify train capture run init"),
    ("image", "model backend train capture run"),
    ("run", "gpu reference console cli"),
    ("structure_from_motion", "backend cpu gpu reference model train init run viewer console cli"),
];
/// The paths of a tree of imports, such as `a::{b, c::{d, e}}`.
fn expand(tree: &str) -> Vec<String> {
    let Some((base, inner)) = tree.split_once('{') else { return vec![tree.trim().to_owned()] };
    let mut depth = 1;
    let parts = inner.split(|c| {
        depth += i32::from(c == '{') - i32::from(c == '}');
        depth == 1 && c == ',' || depth == 0
    });
    parts.flat_map(expand).map(|path| base.trim().to_owned() + &path).collect()
}
fn files(path: String) -> Vec<String> {
    let Ok(entries) = std::fs::read_dir(&path) else { return vec![path] };
    entries.flatten().flat_map(|entry| files(entry.path().display().to_string())).collect()
}
/// Which file of a crate imports which, tests aside; a folder's `mod.rs` and the files below it only if `within`.
fn imports(root: &str, within: bool) -> Vec<[String; 2]> {
    let name = |p: &str| p[root.len() + 1..].replace("/mod.rs", "").replace(".rs", "").replace('/', "::");
    let all: Vec<_> = files(root.to_owned()).into_iter().map(|path| (name(&path), path)).collect();
    let of_file = |(file, path): &(String, String)| {
        let resolve = |path: String| {
            let own = format!("::{file}");
            let folder = own.rsplitn(path.matches("super::").count() + 1, "::").last()?;
            let full = format!("{folder}::{}", path.replace("super::", ""));
            let full = path.strip_prefix("crate").or(path.strip_prefix("litetex_gs")).unwrap_or(&full);
            let mut outer = std::iter::successors(full.get(2..), |path| Some(path.rsplit_once("::")?.0));
            let to = outer.find(|path| all.iter().any(|(file, _)| file == path))?.to_owned();
            let is_in = |a: &str, b: &str| a == b || !within && a.starts_with(&format!("{b}::"));
            (!is_in(&to, file) && !is_in(file, &to)).then(|| [file.clone(), to])
        };
        let text = std::fs::read_to_string(path).unwrap_or_default();
        let parts = text.split("mod tests {").take(1).flat_map(|code| code.split("use ").skip(1));
        let trees = parts.filter_map(|part| part.split(';').next()).filter(|t| !t.contains(['(', '.']));
        trees.flat_map(expand).filter(|path| !path.ends_with(':')).filter_map(resolve).collect::<Vec<_>>()
    };
    all.iter().filter(|(file, _)| !file.contains("tests")).flat_map(of_file).collect()
}
#[test]
fn imports_keep_to_the_rules() {
    for [file, to] in imports("src", true) {
        let [own, other] = [&file, &to].map(|file| file.split("::").next());
        let is_one = |list: &str, top| list.split(' ').any(|name| Some(name) == top);
        let broken = RULES.iter().find(|rule| is_one(rule.0, own) && is_one(rule.1, other));
        assert!(broken.is_none() || own == other, "{file} imports {to}");
    }
    for mut left in [imports("src", true), imports("lab/src", true), imports("exporters/src", false)] {
        for _ in 0..left.len() {
            let all = left.clone();
            left.retain(|[_, to]| all.iter().any(|[file, _]| file == to));
        }
        assert!(left.is_empty(), "circles, and files that import these: {left:?}");
    }
}
