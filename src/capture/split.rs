//! Which views are held out.

use super::options::LoadOptions;
use super::source::{SourceView, first_names};
use crate::text::quoted;
use crate::views::Split;
use crate::{Result, input_file};

/// A million names take less.
const LIST_BYTES_MAX: u64 = 64 << 20;

/// Decides the split of views sorted by name: by the user's list, else as the files state, else every n-th
/// view is held out, from the first on.
pub(crate) fn assign(views: &mut [SourceView], options: &LoadOptions) -> Result<Vec<Split>> {
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
        return Ok(views.iter().map(|v| side(names.iter().any(|n| is_named(v, n)))).collect());
    }
    if views.iter().any(|v| v.split.is_some()) {
        return Ok(views.iter().map(|v| v.split.unwrap_or(Split::Train)).collect());
    }
    let every = options.test_every;
    Ok((0..views.len()).map(|index| side(every > 0 && index % every == 0)).collect())
}

fn side(is_test: bool) -> Split {
    if is_test { Split::Test } else { Split::Train }
}

fn is_named(view: &SourceView, name: &str) -> bool {
    view.name == name || view.name.rsplit_once('.').is_some_and(|(stem, _)| stem == name)
}
