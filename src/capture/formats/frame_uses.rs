//! What becomes of the frames of a `transforms.json`: views on a side of the split, or left out.

use super::listed_split::{Filenames, ListedSplit};
use crate::capture::folder::CaptureFolder;
use crate::capture::source::{Why, first_names};
use crate::text::{counted, quoted};
use crate::views::Split;
use crate::{Report, Result};
use litetex_exporters::parse_number;
use serde_json::Value;
use std::collections::BTreeSet;
use std::path::Path;

/// Words of a split, in lower case, and their sides. Views of both kinds of words for test views are held out alike.
const TRAIN: [&str; 2] = ["train", "training"];
const TEST: [&str; 12] = [
    "test",
    "testing",
    "val",
    "valid",
    "validation",
    "validate",
    "eval",
    "evaluation",
    "holdout",
    "hold-out",
    "hold_out",
    "dev",
];

/// What a frame says of itself.
#[derive(Debug, Default)]
pub(super) struct Flags {
    /// A word of [`TRAIN`] or [`TEST`].
    split: Option<Value>,
    /// Blurred or in shadow, according to its author (ScanNet++).
    is_bad: Option<Value>,
}

impl Flags {
    /// Those of a frame.
    pub(super) fn of(frame: &Value) -> Self {
        // What is null or empty is not stated.
        let stated = |key: &str| frame.get(key).filter(|v| !v.is_null() && !word(v).is_empty()).cloned();
        Self { split: stated("split"), is_bad: stated("is_bad") }
    }

    /// The side that `split` states, or the word that is none.
    fn side(&self) -> Result<Option<Split>, String> {
        let Some(word) = self.split.as_ref().map(word) else { return Ok(None) };
        match &*word {
            known if TRAIN.contains(&known) => Ok(Some(Split::Train)),
            known if TEST.contains(&known) => Ok(Some(Split::Test)),
            _ => Err(word),
        }
    }

    /// Whether `is_bad` says so, or the word that does not tell.
    fn is_bad(&self) -> Result<bool, String> {
        let Some(value) = &self.is_bad else { return Ok(false) };
        let word = word(value);
        match &*word {
            "true" | "yes" => Ok(true),
            "false" | "no" => Ok(false),
            // Also as a number.
            number => parse_number(number).map(|number| number != 0.0).ok_or(word),
        }
    }
}

/// A text in lower case without blanks around it, or anything else as JSON.
fn word(value: &Value) -> String {
    value.as_str().map_or_else(|| value.to_string(), |text| text.trim().to_lowercase())
}

/// What all frames say.
///
/// # Errors
/// [`crate::Error::InvalidInput`] that names the words that say nothing; `expected` are those that do.
fn understood<T>(
    path: &Path,
    frames: &[(&str, &Flags)],
    key: &str,
    expected: &str,
    of: impl Fn(&Flags) -> Result<T, String>,
) -> Result<Vec<T>> {
    let (mut known, mut words, mut first, mut count) = (Vec::new(), BTreeSet::new(), "", 0);
    for (name, flags) in frames {
        match of(flags) {
            Ok(value) => known.push(value),
            Err(word) => {
                words.insert(word);
                first = if count == 0 { name } else { first };
                count += 1;
            }
        }
    }
    if words.is_empty() {
        return Ok(known);
    }
    Err(invalid!(
        path,
        "{key} of {count} of {} holds {}, the first {}; expected {expected}: correct the words, or remove the key {key}",
        counted(frames.len(), "frame"),
        first_names(words.iter().map(String::as_str)),
        quoted(first)
    ))
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
/// [`crate::Error::InvalidInput`] if a list matches no frame, a flag is not understood, or no frame is left.
pub(super) fn uses(
    path: &Path,
    frames: &[(&str, &Flags)],
    first_test: usize,
    filenames: Filenames,
    beside: Option<&CaptureFolder>,
    report: &mut Report,
) -> Result<Uses> {
    let names: Vec<&str> = frames.iter().map(|frame| frame.0).collect();
    let file = quoted(&path.file_name().unwrap_or_default().to_string_lossy());
    let side_of = |is_test: bool| Some(if is_test { Split::Test } else { Split::Train });
    let (sides, split_by) = if let Some(lists) = ListedSplit::of_poses(path, filenames) {
        (lists.sides(&names, report)?, Some(lists.words()))
    } else if first_test < frames.len() {
        let sides = (0..frames.len()).map(|index| side_of(index >= first_test)).collect();
        (sides, Some(format!("test_frames of {file}")))
    } else if frames.iter().any(|frame| frame.1.split.is_some()) {
        let sides = understood(path, frames, "split", "train, val or test", Flags::side)?;
        let sides = sides.into_iter().map(|side| side.or(Some(Split::Train))).collect();
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
    let is_bad = understood(path, frames, "is_bad", "true or false", Flags::is_bad)?;
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

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    fn uses_of(frames: &[Value]) -> Result<Uses> {
        let flags: Vec<Flags> = frames.iter().map(Flags::of).collect();
        let frames: Vec<(&str, &Flags)> = flags.iter().map(|flags| ("images/a.png", flags)).collect();
        let path = Path::new("transforms.json");
        uses(path, &frames, frames.len(), Filenames::default(), None, &mut Report::default())
    }

    #[test]
    fn words_of_a_split_are_understood_in_any_case_or_refused() {
        let [train, test] = [Split::Train, Split::Test].map(|side| Use::View(Some(side)));
        for (word, side) in [
            ("train", train),
            ("Training", train),
            ("TEST", test),
            (" valid ", test),
            ("testing", test),
            ("holdout", test),
        ] {
            let frames = [json!({ "split": word }), json!({ "split": "train" }), json!({ "split": null })];
            assert_eq!(uses_of(&frames).unwrap().frames, [side, train, train], "{word}");
        }
        for (value, shown) in [(json!("query"), "\"query\""), (json!(3), "\"3\""), (json!(["test"]), "test")]
        {
            let error = uses_of(&[json!({ "split": "train" }), json!({ "split": value })]).unwrap_err();
            let text = error.to_string();
            let parts =
                ["transforms.json", "split of 1 of 2 frames", shown, "train, val or test", "images/a.png"];
            assert!(error.exit_code() == 3 && parts.iter().all(|part| text.contains(part)), "{text}");
        }
        let unstated = [json!({}), json!({ "split": "" })];
        assert_eq!(uses_of(&unstated).unwrap().split_by, None, "negative control");
    }

    #[test]
    fn marks_of_bad_frames_may_be_texts_and_numbers() {
        for (value, is_bad) in [
            (json!(true), true),
            (json!("True"), true),
            (json!(1), true),
            (json!("1"), true),
            (json!(false), false),
            (json!("false"), false),
            (json!(0.0), false),
            (json!("0"), false),
            (json!(null), false),
        ] {
            let frames = uses_of(&[json!({ "is_bad": value }), json!({})]).unwrap().frames;
            assert_eq!(frames[0] == Use::LeftOut(Why::Bad), is_bad, "{value}");
        }
        let text = uses_of(&[json!({ "is_bad": "perhaps" })]).unwrap_err().to_string();
        assert!(text.contains("is_bad of 1 of 1 frame holds \"perhaps\"") && text.contains("true"), "{text}");
    }
}
