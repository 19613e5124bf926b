//! Lists of photos that say which frames of a `transforms.json` are held out: in the file itself (nerfstudio), or in a
//! file beside it (ScanNet++, Eyeful Tower).

use super::by_name::ByName;
use super::bytes::read_text;
use crate::capture::folder::CaptureFolder;
use crate::capture::source::first_names;
use crate::text::{self, counted, quoted};
use crate::views::Split;
use crate::{Report, Result};
use serde::Deserialize;
use serde_json::Value;
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

/// Warns of lists that hold something else than names. No published layout has lists of indices in these files, and frames
/// may be counted in the order of the file or by name.
fn warn_of_other_lists(path: &Path, value: &Value, report: &mut Report) {
    let is_other = |key: &&str| {
        let list = value.get(key).and_then(Value::as_array);
        list.is_some_and(|list| list.iter().any(|entry| !entry.is_string()))
    };
    let keys: Vec<&str> = ["train", "val", "test"].into_iter().filter(is_other).collect();
    if let Some(key) = keys.first() {
        let found = value[*key].as_array().into_iter().flatten().find(|entry| !entry.is_string());
        let what = format!(
            "{}: {} hold {}, expected names of photos: the file splits nothing; name the views to hold out with \
             --test-list",
            text::path(path),
            keys.join(" and "),
            text::shortened(&found.map(Value::to_string).unwrap_or_default(), 40)
        );
        report.warn("split-list-without-names", keys.len(), what);
    }
}

/// Lists of names, and where they are from.
#[derive(Debug)]
pub(super) struct ListedSplit {
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
    pub(super) fn of_poses(path: &Path, names: Filenames) -> Option<Self> {
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
    pub(super) fn beside(folder: &CaptureFolder, report: &mut Report) -> Result<Option<Self>> {
        for name in FILES {
            // An archive has no folder above it.
            let Some(path) = folder.file(name).ok().filter(|path| path.is_file()) else { continue };
            let Ok(value) = serde_json::from_str::<Value>(&read_text(&path)?) else { continue };
            let lists = match Lists::deserialize(&value) {
                Ok(lists) => lists,
                Err(_) => {
                    warn_of_other_lists(&path, &value, report);
                    continue;
                }
            };
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
    pub(super) fn name_any(&self, frames: &[&str]) -> bool {
        let by_name = ByName::new(frames);
        self.lists.iter().flat_map(|list| &list.names).any(|name| !by_name.find(name).is_empty())
    }

    /// What decided the split, for people: "train_filenames and val_filenames of transforms.json".
    pub(super) fn words(&self) -> String {
        let keys: Vec<&str> = self.lists.iter().map(|list| list.key).collect();
        let file = self.path.file_name().unwrap_or_default().to_string_lossy();
        format!("{} of {}", keys.join(" and "), quoted(&file))
    }

    /// The side of every frame, given by its stored path; `None` leaves it out: both sides are listed, and it is on
    /// neither. A frame that is listed on both sides is held out.
    ///
    /// # Errors
    /// [`crate::Error::InvalidInput`] if a list matches no frame.
    pub(super) fn sides(&self, frames: &[&str], report: &mut Report) -> Result<Vec<Option<Split>>> {
        let by_name = ByName::new(frames);
        let mut sides = vec![None; frames.len()];
        let (mut unknown, mut of_several) = (Vec::new(), Vec::new());
        for list in &self.lists {
            let before = unknown.len();
            for name in &list.names {
                let found = by_name.find(name);
                if found.is_empty() {
                    unknown.push(name.as_str());
                }
                if found.iter().any(|&frame| frames[frame] != frames[found[0]]) {
                    of_several.push(name.as_str());
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
                     extension: correct the list, or remove it and name the views to hold out with --test-list",
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
                text::path(&self.path),
                first_names(unknown.iter().copied())
            );
            report.warn("split-names-unknown", unknown.len(), what);
        }
        if !of_several.is_empty() {
            let what = format!(
                "{} of the split in {} fit several frames each, and stand for all of them: {}; list them with their folders",
                counted(of_several.len(), "name"),
                text::path(&self.path),
                first_names(of_several.iter().copied())
            );
            report.warn("split-names-of-several", of_several.len(), what);
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

#[cfg(test)]
mod tests {
    use super::*;

    fn listed(lists: [(&'static str, Split, &[&str]); 3]) -> ListedSplit {
        let owned =
            lists.map(|(key, side, names)| (key, side, Some(names.iter().map(|&n| n.into()).collect())));
        ListedSplit::new(Path::new("transforms.json"), owned).unwrap()
    }

    pub(super) fn sides(lists: [&[&str]; 3], frames: &[&str]) -> Result<String> {
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

    #[test]
    fn names_without_the_folder_that_tells_frames_apart_are_said() {
        let frames = ["images/left/1.png", "images/right/1.png", "images/right/2.png"];
        let lists = |name| {
            listed([("train", Split::Train, &[]), ("val", Split::Test, &[]), ("test", Split::Test, &[name])])
        };
        let mut report = Report::default();
        let sides = lists("1.png").sides(&frames, &mut report).unwrap();
        assert_eq!(sides, [Some(Split::Test), Some(Split::Test), Some(Split::Train)]);
        assert_eq!((&*report.warnings[0].code, report.warnings[0].count), ("split-names-of-several", 1));
        let mut report = Report::default();
        assert!(lists("right/1").sides(&frames, &mut report).is_ok() && report.warnings.is_empty());
        let error = lists("images/middle/1.png").sides(&frames, &mut report).unwrap_err();
        assert!(error.exit_code() == 3 && error.to_string().contains("\"images/middle/1.png\""), "{error}");
    }
}
