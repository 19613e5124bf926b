//! Which views are held out.

use super::options::LoadOptions;
use super::paths::{plain, without_extension};
use super::source::{Source, SourceView, UnusedView, first_names, first_of};
use crate::text::{counted, path, quoted};
use crate::views::Split;
use crate::{Report, Result, input_file};
use std::collections::{BTreeSet, HashMap};
use std::path::Path;

/// A million names take less.
const LIST_BYTES_MAX: u64 = 64 << 20;

/// Decides the split of the views, which are sorted by name, and says what decided it: the user's list, else what the files
/// state, else every n-th view is held out, from the first on. Warns of views that should be held out and were left out.
pub(crate) fn assign(
    source: &Source,
    options: &LoadOptions,
    report: &mut Report,
) -> Result<(Vec<Split>, String)> {
    let views = &source.views;
    if let Some(list) = &options.test_list {
        return Ok((listed(source, list, report)?, format!("the names in {} (--test-list)", path(list))));
    }
    if views.iter().any(|v| v.split.is_some()) {
        let splits = views.iter().map(|v| v.split.unwrap_or(Split::Train)).collect();
        let split_by = source.split_by.as_deref().unwrap_or("the capture's files");
        warn_of_unused(source.unused.iter().filter(|v| v.split == Some(Split::Test)), split_by, report);
        return Ok((splits, split_by.to_owned()));
    }
    let every = options.test_every;
    let splits = (0..views.len()).map(|index| side(every > 0 && index % every == 0)).collect();
    Ok((splits, format!("--test-every {every}; the capture states no split")))
}

/// The split by the names in a file.
fn listed(source: &Source, list: &Path, report: &mut Report) -> Result<Vec<Split>> {
    let text = input_file::read_text(list, LIST_BYTES_MAX)?;
    let names: Vec<&str> =
        text.lines().map(str::trim).filter(|l| !l.is_empty() && !l.starts_with('#')).collect();
    let known = ListedViews::new(&source.views);
    // The extension of a photo that was not looked for is not known.
    let stem_of = |name: &str| without_extension(&plain(name)).to_lowercase();
    let unused: HashMap<String, &UnusedView> = source.unused.iter().map(|v| (stem_of(&v.name), v)).collect();
    let (mut unknown, mut left_out, mut listed) = (Vec::new(), Vec::new(), BTreeSet::<usize>::new());
    for &name in &names {
        let found = known.find(name);
        listed.extend(found);
        if found.is_empty() {
            let named =
                [stem_of(name), plain(name).to_lowercase()].iter().find_map(|way| unused.get(way).copied());
            match named {
                Some(view) => left_out.push(view),
                None => unknown.push(name),
            }
        }
    }
    if !unknown.is_empty() {
        return Err(invalid!(
            list,
            "no view is named {}; expected names such as {}, with or without extension",
            first_names(unknown),
            quoted(source.views.first().map_or("", |v| &v.name))
        ));
    }
    warn_of_unused(left_out.into_iter(), &path(list), report);
    Ok((0..source.views.len()).map(|index| side(listed.contains(&index))).collect())
}

/// Views by the names that a list may give them: with or without extension, in any case where that leaves one view.
/// Lists of pose files may be of other copies of the photos; the user's is of these, so folders and another extension count.
#[derive(Default)]
struct ListedViews {
    exact: HashMap<String, Vec<usize>>,
    folded: HashMap<String, Vec<usize>>,
}

impl ListedViews {
    fn new(views: &[SourceView]) -> Self {
        let mut by_name = Self::default();
        for (index, view) in views.iter().enumerate() {
            let name = plain(&view.name);
            let ways = BTreeSet::from([without_extension(&name), &name]);
            for way in ways {
                by_name.exact.entry(way.to_owned()).or_default().push(index);
                by_name.folded.entry(way.to_lowercase()).or_default().push(index);
            }
        }
        by_name
    }

    fn find(&self, listed: &str) -> &[usize] {
        let listed = plain(listed);
        let in_any_case = || self.folded.get(&listed.to_lowercase()).filter(|views| views.len() == 1);
        self.exact.get(&listed).or_else(in_any_case).map_or(&[], Vec::as_slice)
    }
}

fn warn_of_unused<'a>(views: impl Iterator<Item = &'a UnusedView>, split_by: &str, report: &mut Report) {
    let shown: Vec<String> = views.map(|v| format!("{} is {}", quoted(&v.name), v.why.words())).collect();
    if !shown.is_empty() {
        let count = shown.len();
        let what = format!(
            "left out {} that should be held out ({split_by}): {}",
            counted(count, "view"),
            first_of(shown.into_iter())
        );
        report.warn("held-out-views-left-out", count, what);
    }
}

fn side(is_test: bool) -> Split {
    if is_test { Split::Test } else { Split::Train }
}
