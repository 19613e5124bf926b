//! Which views are held out.

use super::options::LoadOptions;
use super::paths::without_extension;
use super::source::{SourceView, first_names};
use crate::text::{path, quoted};
use crate::views::Split;
use crate::{Result, input_file};

/// A million names take less.
const LIST_BYTES_MAX: u64 = 64 << 20;

/// Decides the split of views sorted by name, and says what decided it: the user's list, else what the files state
/// (`split_by`), else every n-th view is held out, from the first on.
pub(crate) fn assign(
    views: &[SourceView],
    split_by: Option<&str>,
    options: &LoadOptions,
) -> Result<(Vec<Split>, String)> {
    if let Some(list) = &options.test_list {
        let text = input_file::read_text(list, LIST_BYTES_MAX)?;
        let names: Vec<&str> =
            text.lines().map(str::trim).filter(|l| !l.is_empty() && !l.starts_with('#')).collect();
        let unknown: Vec<&str> =
            names.iter().copied().filter(|n| !views.iter().any(|v| is_named(v, n))).collect();
        if !unknown.is_empty() {
            return Err(invalid!(
                list,
                "no view is named {}; expected names such as {}, with or without extension",
                first_names(unknown),
                quoted(views.first().map_or("", |v| &v.name))
            ));
        }
        let splits = views.iter().map(|v| side(names.iter().any(|n| is_named(v, n)))).collect();
        return Ok((splits, format!("the names in {} (--test-list)", path(list))));
    }
    if views.iter().any(|v| v.split.is_some()) {
        let splits = views.iter().map(|v| v.split.unwrap_or(Split::Train)).collect();
        return Ok((splits, split_by.unwrap_or("the capture's files").to_owned()));
    }
    let every = options.test_every;
    let splits = (0..views.len()).map(|index| side(every > 0 && index % every == 0)).collect();
    Ok((splits, format!("--test-every {every}; the capture states no split")))
}

fn side(is_test: bool) -> Split {
    if is_test { Split::Test } else { Split::Train }
}

fn is_named(view: &SourceView, name: &str) -> bool {
    view.name == name || without_extension(&view.name) == name
}
