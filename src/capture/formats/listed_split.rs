//! Lists of photos that say which frames of a `transforms.json` are held out: in the file itself (nerfstudio), or in a
//! file beside it (ScanNet++, Eyeful Tower).

use super::bytes::read_text;
use crate::capture::folder::CaptureFolder;
use crate::capture::paths::without_extension;
use crate::capture::source::first_names;
use crate::text::{counted, quoted};
use crate::views::Split;
use crate::{Report, Result};
use serde::Deserialize;
use serde_json::Value;
use std::collections::HashMap;
use std::path::{Path, PathBuf};

/// Files of lists beside the poses, of ScanNet++ and Eyeful Tower; ScanNet++'s also in the folder above.
const FILES: [&str; 3] = ["train_test_lists.json", "splits.json", "../train_test_lists.json"];

/// The lists as nerfstudio names them.
#[derive(Debug, Default, Deserialize)]
pub(super) struct Filenames {
    train_filenames: Option<Vec<String>>,
    val_filenames: Option<Vec<String>>,
    test_filenames: Option<Vec<String>>,
}

/// The lists of a file beside the poses.
#[derive(Debug, Deserialize)]
struct Lists {
    train: Option<Vec<String>>,
    val: Option<Vec<String>>,
    test: Option<Vec<String>>,
}

/// What a frame says of itself.
#[derive(Debug, Default, Deserialize)]
pub(super) struct Flags {
    /// "train", "val" or "test".
    split: Option<Value>,
    /// Blurred or in shadow, according to its author (ScanNet++).
    is_bad: Option<Value>,
}

/// What becomes of a frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Use {
    /// A view, on a side of the split where the files state one.
    View(Option<Split>),
    LeftOut,
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
    } else if let Some(lists) = beside.map(ListedSplit::beside).transpose()?.flatten() {
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
        .map(|index| if is_out(index) { Use::LeftOut } else { Use::View(sides[index]) })
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

/// Lists of names, and where they are from.
#[derive(Debug)]
struct ListedSplit {
    path: PathBuf,
    lists: Vec<List>,
}

#[derive(Debug)]
struct List {
    key: &'static str,
    side: Split,
    names: Vec<String>,
}

impl ListedSplit {
    /// The lists of the pose file at `path`; `None` if it has none.
    fn of_poses(path: &Path, names: Filenames) -> Option<Self> {
        Self::new(
            path,
            [
                ("train_filenames", Split::Train, names.train_filenames),
                ("val_filenames", Split::Test, names.val_filenames),
                ("test_filenames", Split::Test, names.test_filenames),
            ],
        )
    }

    /// The lists of a file beside the poses. A file of such a name that holds something else is not meant for us.
    ///
    /// # Errors
    /// If the file cannot be read.
    fn beside(folder: &CaptureFolder) -> Result<Option<Self>> {
        for name in FILES {
            // An archive has no folder above it.
            let Some(path) = folder.file(name).ok().filter(|path| path.is_file()) else { continue };
            let Ok(lists) = serde_json::from_str::<Lists>(&read_text(&path)?) else { continue };
            let found = Self::new(
                &path,
                [
                    ("train", Split::Train, lists.train),
                    ("val", Split::Test, lists.val),
                    ("test", Split::Test, lists.test),
                ],
            );
            if found.is_some() {
                return Ok(found);
            }
        }
        Ok(None)
    }

    /// Empty lists say nothing: nerfstudio's exporters write them for a side without frames.
    fn new(path: &Path, lists: [(&'static str, Split, Option<Vec<String>>); 3]) -> Option<Self> {
        let lists: Vec<List> = lists
            .into_iter()
            .filter_map(|(key, side, names)| Some(List { key, side, names: names? }))
            .filter(|list| !list.names.is_empty())
            .collect();
        (!lists.is_empty()).then(|| Self { path: path.to_owned(), lists })
    }

    /// Whether any of the names is that of a frame. A list beside the poses may be that of other captures.
    fn name_any(&self, frames: &[&str]) -> bool {
        let by_name = ByName::new(frames);
        self.lists.iter().flat_map(|list| &list.names).any(|name| !by_name.find(name).is_empty())
    }

    /// What decided the split, for people: "train_filenames and val_filenames of transforms.json".
    fn words(&self) -> String {
        let keys: Vec<&str> = self.lists.iter().map(|list| list.key).collect();
        let file = self.path.file_name().unwrap_or_default().to_string_lossy();
        format!("{} of {}", keys.join(" and "), quoted(&file))
    }

    /// The side of every frame, given by its stored path; `None` leaves it out: both sides are listed, and it is on
    /// neither. A frame that is listed on both sides is held out.
    ///
    /// # Errors
    /// [`crate::Error::InvalidInput`] if a list matches no frame.
    fn sides(&self, frames: &[&str], report: &mut Report) -> Result<Vec<Option<Split>>> {
        let by_name = ByName::new(frames);
        let mut sides = vec![None; frames.len()];
        let mut unknown = Vec::new();
        for list in &self.lists {
            let before = unknown.len();
            for name in &list.names {
                let found = by_name.find(name);
                if found.is_empty() {
                    unknown.push(name.as_str());
                }
                for &frame in found {
                    if sides[frame] != Some(Split::Test) {
                        sides[frame] = Some(list.side);
                    }
                }
            }
            if unknown.len() - before == list.names.len() {
                return Err(invalid!(
                    &self.path,
                    "{} lists {}, and no frame is named so: {}; expected names such as {}, with or without folder and \
                     extension: correct the list, or name the views to hold out with --test-list",
                    list.key,
                    counted(list.names.len(), "name"),
                    first_names(list.names.iter().map(String::as_str)),
                    quoted(frames.first().copied().unwrap_or_default())
                ));
            }
        }
        if !unknown.is_empty() {
            let what = format!(
                "{} of the split in {} match no frame: {}",
                counted(unknown.len(), "name"),
                crate::text::path(&self.path),
                first_names(unknown.iter().copied())
            );
            report.warn("split-names-unknown", unknown.len(), what);
        }
        // With one side listed, the other frames are on the other side.
        let lists_side = |side| self.lists.iter().any(|list| list.side == side);
        let unlisted = match (lists_side(Split::Train), lists_side(Split::Test)) {
            (true, true) => None,
            (true, false) => Some(Split::Test),
            _ => Some(Split::Train),
        };
        Ok(sides.into_iter().map(|side| side.or(unlisted)).collect())
    }
}

/// Frames by all names that a list may call them: the stored path and its ends, with and without extension.
struct ByName {
    frames: HashMap<String, Vec<usize>>,
}

impl ByName {
    fn new(paths: &[&str]) -> Self {
        let mut frames = HashMap::<String, Vec<usize>>::new();
        for (index, path) in paths.iter().enumerate() {
            for key in keys(path) {
                let known = frames.entry(key).or_default();
                if known.last() != Some(&index) {
                    known.push(index);
                }
            }
        }
        Self { frames }
    }

    /// The frames that a listed name means: the longest end of it that a frame has too. The extension tells frames apart
    /// only where it must.
    fn find(&self, listed: &str) -> &[usize] {
        keys(listed).iter().find_map(|key| self.frames.get(key)).map_or(&[], Vec::as_slice)
    }
}

/// A path and its ends (`a/b/c.png`, `b/c.png`, `c.png`), longest first, each followed by itself without extension.
fn keys(path: &str) -> Vec<String> {
    let path = super::transforms::plain(path);
    let starts = std::iter::once(0).chain(path.match_indices('/').map(|(at, _)| at + 1));
    starts
        .flat_map(|start| [path[start..].to_owned(), without_extension(&path[start..]).to_owned()])
        .filter(|key| !key.is_empty())
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn listed(lists: [(&'static str, Split, &[&str]); 3]) -> ListedSplit {
        let owned =
            lists.map(|(key, side, names)| (key, side, Some(names.iter().map(|&n| n.into()).collect())));
        ListedSplit::new(Path::new("transforms.json"), owned).unwrap()
    }

    fn sides(lists: [&[&str]; 3], frames: &[&str]) -> Result<String> {
        let [train, val, test] = lists;
        let lists = listed([
            ("train_filenames", Split::Train, train),
            ("val_filenames", Split::Test, val),
            ("test_filenames", Split::Test, test),
        ]);
        let letter = |side| match side {
            Some(Split::Train) => 'T',
            Some(Split::Test) => 'h',
            None => '-',
        };
        Ok(lists.sides(frames, &mut Report::default())?.into_iter().map(letter).collect())
    }

    #[test]
    fn names_match_with_or_without_folder_and_extension() {
        let frames = ["./images/a.png", "images\\b.png", "images/c", "images/sub/d.png"];
        for (name, expected) in [
            ("images/a.png", "hTTT"),
            ("a", "hTTT"),
            ("a.jpg", "hTTT"),
            (".\\images\\b.png", "ThTT"),
            ("images_4/b.JPG", "ThTT"),
            ("c.png", "TThT"),
            ("/home/me/images/sub/d.png", "TTTh"),
        ] {
            assert_eq!(sides([&[], &[], &[name]], &frames).unwrap(), expected, "{name}");
        }
        let rig = ["left/1.png", "right/1.png"];
        assert_eq!(sides([&[], &["right/1"], &[]], &rig).unwrap(), "Th");
        assert_eq!(
            sides([&[], &["1"], &[]], &["1.png", "1.0.png"]).unwrap(),
            "hT",
            "only the extension goes"
        );
        assert_eq!(sides([&[], &["f.0002"], &[]], &["f.0001", "f.0002"]).unwrap(), "Th", "a number is none");
    }

    #[test]
    fn one_listed_side_decides_the_other_and_two_leave_the_rest_out() {
        let frames = ["a.png", "b.png", "c.png", "d.png"];
        assert_eq!(sides([&["a", "b"], &[], &[]], &frames).unwrap(), "TThh");
        assert_eq!(sides([&[], &["a"], &["b"]], &frames).unwrap(), "hhTT");
        assert_eq!(sides([&["a", "b"], &["c"], &[]], &frames).unwrap(), "TTh-");
        assert_eq!(sides([&["a", "b"], &["b"], &[]], &frames).unwrap(), "Th--", "listed twice: held out");
    }

    #[test]
    fn a_list_that_matches_nothing_is_an_error_and_single_names_a_warning() {
        let text = sides([&[], &["a"], &["nowhere.png"]], &["a.png", "b.png"]).unwrap_err().to_string();
        for part in ["transforms.json", "test_filenames", "\"nowhere.png\"", "\"a.png\"", "--test-list"] {
            assert!(text.contains(part), "{part}: {text}");
        }
        let mut report = Report::default();
        let lists = listed([
            ("train", Split::Train, &[]),
            ("val", Split::Test, &[]),
            ("test", Split::Test, &["a", "x"]),
        ]);
        assert_eq!(lists.sides(&["a", "b"], &mut report).unwrap(), [Some(Split::Test), Some(Split::Train)]);
        assert!(report.warnings[0].message.contains("\"x\"") && report.warnings[0].count == 1);
    }
}
