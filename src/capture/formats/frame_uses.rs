//! What becomes of the frames of a `transforms.json`: views on a side of the split, or left out.

use super::listed_split::{Filenames, ListedSplit};
use crate::capture::folder::CaptureFolder;
use crate::capture::source::{Why, first_names};
use crate::text::{counted, quoted};
use crate::views::Split;
use crate::{Report, Result};
use serde_json::Value;
use std::path::Path;

/// What a frame says of itself.
#[derive(Debug, Default)]
pub(super) struct Flags {
    /// "train", "val" or "test".
    split: Option<Value>,
    /// Blurred or in shadow, according to its author (ScanNet++).
    is_bad: Option<Value>,
}

impl Flags {
    /// Those of a frame.
    pub(super) fn of(frame: &Value) -> Self {
        Self { split: frame.get("split").cloned(), is_bad: frame.get("is_bad").cloned() }
    }
}

/// What becomes of a frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Use {
    /// A view, on a side of the split where the files state one.
    View(Option<Split>),
    LeftOut(Why),
}

/// What becomes of the frames of a pose file, and what decided the split.
#[derive(Debug)]
pub(super) struct Uses {
    pub frames: Vec<Use>,
    /// For people; `None` where the files state no split.
    pub split_by: Option<String>,
}

/// Decides what becomes of the frames of the pose file at `path`, given by stored path and flags; those from `first_test`
/// on are from its list `test_frames` (ScanNet++). `beside`: the folder whose lists count where the file has none.
///
/// # Errors
/// [`crate::Error::InvalidInput`] if a list matches no frame, or no frame is left.
pub(super) fn uses(
    path: &Path,
    frames: &[(&str, &Flags)],
    first_test: usize,
    filenames: Filenames,
    beside: Option<&CaptureFolder>,
    report: &mut Report,
) -> Result<Uses> {
    let names: Vec<&str> = frames.iter().map(|frame| frame.0).collect();
    let flagged = |flags: &Flags| match flags.split.as_ref().and_then(Value::as_str) {
        Some("train") => Some(Split::Train),
        Some("val" | "validation" | "eval" | "test") => Some(Split::Test),
        _ => None,
    };
    let file = quoted(&path.file_name().unwrap_or_default().to_string_lossy());
    let side_of = |is_test: bool| Some(if is_test { Split::Test } else { Split::Train });
    let (sides, split_by) = if let Some(lists) = ListedSplit::of_poses(path, filenames) {
        (lists.sides(&names, report)?, Some(lists.words()))
    } else if first_test < frames.len() {
        let sides = (0..frames.len()).map(|index| side_of(index >= first_test)).collect();
        (sides, Some(format!("test_frames of {file}")))
    } else if frames.iter().any(|frame| flagged(frame.1).is_some()) {
        let sides = frames.iter().map(|frame| flagged(frame.1).or(Some(Split::Train))).collect();
        (sides, Some(format!("the key split of the frames of {file}")))
    } else if let Some(lists) =
        beside.map(|folder| ListedSplit::beside(folder, report)).transpose()?.flatten()
    {
        if lists.name_any(&names) {
            (lists.sides(&names, report)?, Some(lists.words()))
        } else {
            let what = format!("{} name no frame of {file}: they split nothing", lists.words());
            report.warn("split-list-of-others", 1, what);
            (vec![None; frames.len()], None)
        }
    } else {
        (vec![None; frames.len()], None)
    };
    let is_bad: Vec<bool> = frames.iter().map(|frame| frame.1.is_bad.as_ref().is_some_and(is_true)).collect();
    let is_out = |index: usize| is_bad[index] || (split_by.is_some() && sides[index].is_none());
    let frames: Vec<Use> = (0..frames.len())
        .map(|index| match is_out(index) {
            true => Use::LeftOut(if is_bad[index] { Why::Bad } else { Why::Unlisted }),
            false => Use::View(sides[index]),
        })
        .collect();
    let named = |is: &dyn Fn(usize) -> bool| -> Vec<&str> {
        (0..names.len()).filter(|&index| is(index)).map(|index| names[index]).collect()
    };
    let mut warn = |code, why: &str, out: Vec<&str>| {
        if !out.is_empty() {
            let total = counted(names.len(), "frame");
            let what = format!("{} of {total} {why}: {}", out.len(), first_names(out.iter().copied()));
            report.warn(code, out.len(), what);
        }
    };
    let bad = named(&|index| is_bad[index]);
    let unlisted = named(&|index| is_out(index) && !is_bad[index]);
    if !names.is_empty() && bad.len() + unlisted.len() == names.len() {
        return Err(invalid!(
            path,
            "no frame is left: {} of {} are marked as bad (is_bad), the others are in no list of the split; correct the file",
            bad.len(),
            names.len()
        ));
    }
    warn("frames-marked-bad", "are marked as bad by their author (is_bad) and left out", bad);
    warn(
        "frames-in-no-split",
        "are neither among the training nor among the test frames and left out",
        unlisted,
    );
    Ok(Uses { frames, split_by })
}

/// JSON's `true`, also as a number.
fn is_true(value: &Value) -> bool {
    value.as_bool().unwrap_or_else(|| value.as_f64().is_some_and(|number| number != 0.0))
}
