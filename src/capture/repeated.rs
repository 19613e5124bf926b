//! Views that the pose files describe more than once. What is repeated word for word counts once; where the poses of one photo
//! differ, nobody knows which is right.

use super::left_out::is_too_many;
use super::source::{Source, SourceView, UnusedView, Why, first_names};
use crate::text::{counted, path};
use crate::views::Split;
use crate::{Report, Result};
use std::collections::HashMap;

/// Leaves out views that occur again on the same side of the split, and all of a name whose poses or lenses differ. The others
/// keep their order.
///
/// # Errors
/// [`crate::Error::InvalidInput`] if the photos with different poses are more than a tenth of all.
pub(super) fn leave_out(source: &mut Source, report: &mut Report) -> Result<()> {
    let mut by_name = HashMap::<(&str, _), Vec<usize>>::new();
    for (index, view) in source.views.iter().enumerate() {
        by_name.entry((&view.name, view.split.map(|side| side == Split::Test))).or_default().push(index);
    }
    let num_names = by_name.len();
    let mut repeated: Vec<Vec<usize>> = by_name.into_values().filter(|of_name| of_name.len() > 1).collect();
    if repeated.is_empty() {
        return Ok(());
    }
    repeated.sort();
    let views = &source.views;
    let is_same = |of_name: &Vec<usize>| of_name.iter().all(|&i| are_same(&views[of_name[0]], &views[i]));
    let (same, different): (Vec<_>, Vec<_>) = repeated.into_iter().partition(is_same);
    let names = |groups: &[Vec<usize>]| first_names(groups.iter().map(|group| views[group[0]].name.as_str()));
    if is_too_many(different.len(), num_names) {
        return Err(invalid!(
            &source.path,
            "{} of {num_names} photos occur with different poses or lenses, and no more than one in 10 may be left out: {}; \
             expected one pose for each photo: export them again",
            different.len(),
            names(&different)
        ));
    }
    if !same.is_empty() {
        let what = format!(
            "{}: {} more than once, always with the same pose; used once: {}",
            path(&source.path),
            occur(same.len()),
            names(&same)
        );
        report.warn("views-repeated", same.len(), what);
    }
    if !different.is_empty() {
        let what = format!(
            "{}: {} with different poses or lenses, of which nobody knows the right one; left out: {}",
            path(&source.path),
            occur(different.len()),
            names(&different)
        );
        report.warn("views-with-several-poses", different.len(), what);
    }
    let mut is_kept = vec![true; views.len()];
    same.iter().flat_map(|group| &group[1..]).for_each(|&index| is_kept[index] = false);
    for group in &different {
        group.iter().for_each(|&index| is_kept[index] = false);
        let SourceView { name, split, .. } = &views[group[0]];
        source.unused.push(UnusedView { name: name.clone(), why: Why::Broken, split: *split });
    }
    let mut kept = is_kept.into_iter();
    source.views.retain(|_| kept.next() == Some(true));
    Ok(())
}

fn occur(count: usize) -> String {
    format!("{} {}", counted(count, "photo"), if count == 1 { "occurs" } else { "occur" })
}

fn are_same(a: &SourceView, b: &SourceView) -> bool {
    a.lens == b.lens && a.camera_from_capture == b.camera_from_capture
}
