//! `transforms.json` of nerfstudio and instant-ngp, and `transforms_train.json` / `_test.json` of
//! Blender scenes. Poses are OpenGL camera-to-world (x right, y up, z backward).

use super::axes::from_opengl;
use super::frame_uses::{Flags, Use, uses};
use super::json::{self, Number};
use super::listed_split::Filenames;
use super::points_files;
use super::transforms_lens::Intrinsics;
use crate::camera::RigidTransform;
use crate::capture::folder::CaptureFolder;
use crate::capture::left_out::LeftOut;
use crate::capture::lens::Distortion;
use crate::capture::paths::{common_folder, plain};
use crate::capture::photo_folder::PhotoFolder;
use crate::capture::pose_format::{Found, PoseFormat};
use crate::capture::source::{Source, SourceView, UnusedView, Why};
use crate::text::{self, quoted};
use crate::views::Split;
use crate::{Report, Result};
use glam::{DMat3, DVec3};
use serde::Deserialize;
use serde_json::Value;
use std::path::{Path, PathBuf};

/// What a frame states beside what decides its use.
#[derive(Debug, Deserialize)]
struct Stated {
    file_path: String,
    mask_path: Option<String>,
    transform_matrix: Option<Vec<Vec<Number>>>,
    #[serde(flatten)]
    intrinsics: Intrinsics,
}

#[derive(Debug, Deserialize)]
#[serde(from = "Value")]
struct Frame {
    /// `file_path`, if it is a text.
    name: Option<String>,
    flags: Flags,
    /// Or what is wrong with it.
    stated: Result<Stated, String>,
}

impl From<Value> for Frame {
    fn from(frame: Value) -> Self {
        Self {
            name: frame.get("file_path").and_then(Value::as_str).map(str::to_owned),
            flags: Flags::of(&frame),
            stated: json::parsed(frame),
        }
    }
}

#[derive(Debug, Deserialize)]
struct File {
    #[serde(flatten)]
    intrinsics: Intrinsics,
    frames: Vec<Frame>,
    /// Held out (ScanNet++).
    #[serde(default)]
    test_frames: Option<Vec<Frame>>,
    ply_file_path: Option<Value>,
    #[serde(flatten)]
    filenames: Filenames,
}

/// See [`PoseFormat`].
pub(crate) const FORMAT: PoseFormat = PoseFormat {
    name: "transforms",
    help: "transforms.json of nerfstudio, instant-ngp and Blender scenes",
    files: "transforms.json or transforms_train.json",
    has_observations: false,
    find,
};

fn find(path: &Path, _: &mut Report) -> Option<Found> {
    let is_json = path.is_file() && path.extension().is_some_and(|e| e == "json");
    let (root, files) = match is_json {
        true => (path.parent().unwrap_or(Path::new("")), vec![(path.to_owned(), Side::Unstated)]),
        false => (path, files_in(path)),
    };
    let has_files = !files.is_empty();
    let read =
        move |folder: &CaptureFolder| read(&files, &Folders { poses: folder.clone(), masks: folder.clone() });
    has_files.then(|| Found::new(root, Box::new(read)))
}

/// The files of held-out views. The first that is there serves as test set: published figures are those of
/// `transforms_test.json`.
const HELD_OUT: [&str; 3] = ["transforms_test.json", "transforms_val.json", "transforms_eval.json"];

/// The files of a capture with the side of the split that each states. Where there are no training views, held-out ones are
/// all that there is.
fn files_in(root: &Path) -> Vec<(PathBuf, Side)> {
    let existing = |name: &str| Some(root.join(name)).filter(|p| p.is_file());
    let mut held_out = HELD_OUT.into_iter().filter_map(existing);
    let train = existing("transforms_train.json").or_else(|| existing("transforms.json"));
    let (train, test) = match (train, held_out.next()) {
        (Some(train), Some(test)) => (train, test),
        (only, test) => return only.or(test).into_iter().map(|only| (only, Side::Unstated)).collect(),
    };
    let both = [(train, Side::Stated(Split::Train)), (test, Side::Stated(Split::Test))];
    both.into_iter().chain(held_out.map(|other| (other, Side::Unused))).collect()
}

/// What a file of poses states of its frames by its name.
#[derive(Clone, Copy, PartialEq)]
enum Side {
    Stated(Split),
    Unstated,
    /// Views of a second set of test views.
    Unused,
}

/// The files of poses with the side of the split that each states.
type Files = [(PathBuf, Side)];

/// Reads the poses of a file with photos, masks, points and lists elsewhere.
///
/// # Errors
/// As all readers of poses.
pub(super) fn read_at(file: &Path, folders: &Folders) -> Result<Source> {
    read(&[(file.to_owned(), Side::Unstated)], folders)
}

/// Where what a file names lies.
pub(super) struct Folders {
    /// Points and lists of the split; of photos where `--images` names no folder.
    pub poses: CaptureFolder,
    pub masks: CaptureFolder,
}

fn read(files: &Files, folders: &Folders) -> Result<Source> {
    let folder = &folders.poses;
    let mut source = Source::at(files.first().map_or(&folder.root, |f| &f.0));
    source.stated_up = files.first().is_some_and(|f| is_of_blender(&f.0)).then_some(DVec3::Z);
    for (path, side) in files {
        match side {
            Side::Stated(split) => read_one(path, Some(*split), folders, &mut source)?,
            Side::Unstated => read_one(path, None, folders, &mut source)?,
            Side::Unused => leave_out(path, &files[1].0, &mut source),
        }
    }
    let is_brown = |v: &&SourceView| matches!(v.lens.distortion, Distortion::Brown { .. });
    let num_brown = source.views.iter().filter(is_brown).count();
    if num_brown > 0 {
        let what = format!(
            "{}: k4 of {num_brown} of {} views is taken for the r^8 term of Brown's lens, which converters from Metashape \
             and RealityCapture write; with the camera_model FULL_OPENCV it is OpenCV's denominator",
            text::path(&source.path),
            source.views.len()
        );
        source.report.warn("brown-k4", num_brown, what);
    }
    if let [_, (held_out, _), ..] = files {
        source.split_by = Some(quoted(&held_out.file_name().unwrap_or_default().to_string_lossy()));
    }
    strip_common_folder(&mut source);
    Ok(source)
}

/// Leaves out the frames of a second set of test views; `used` is the file of the first.
fn leave_out(path: &Path, used: &Path, source: &mut Source) {
    let frames =
        json::read::<File>(path, "the JSON of Blender").map_or_else(|_| Vec::new(), |file| file.frames);
    let names: Vec<String> = frames.into_iter().filter_map(|frame| frame.name).collect();
    let count = names.len();
    source.unused.extend(names.iter().map(|name| UnusedView::new(plain(name), Why::Validation)));
    let what = format!(
        "{}: {} not used, since {} has the test views; where it is not there, these are held out",
        text::path(path),
        if count == 1 { "1 frame is".to_owned() } else { format!("{count} frames are") },
        used.file_name().unwrap_or_default().to_string_lossy()
    );
    source.report.warn("validation-views-not-used", count, what);
}

fn read_one(path: &Path, split: Option<Split>, folders: &Folders, source: &mut Source) -> Result<()> {
    let folder = &folders.poses;
    let mut file: File = json::read(path, "the JSON of nerfstudio, instant-ngp or Blender")?;
    let mut left_out = LeftOut::default();
    let num_frames = file.frames.len();
    file.frames.extend(file.test_frames.take().unwrap_or_default());
    let named: Vec<usize> =
        (0..file.frames.len()).filter(|&index| file.frames[index].name.is_some()).collect();
    let listed: Vec<(&str, &Flags)> = named
        .iter()
        .map(|&index| &file.frames[index])
        .map(|frame| (frame.name.as_deref().unwrap_or_default(), &frame.flags))
        .collect();
    let first_test = named.iter().filter(|&&index| index < num_frames).count();
    let filenames = std::mem::take(&mut file.filenames);
    // Blender's files say by their names what they hold.
    let beside = split.is_none().then_some(folder);
    let uses = uses(path, &listed, first_test, filenames, beside, &mut source.report)?;
    source.split_by = source.split_by.take().or(uses.split_by);
    let mut use_of = vec![Use::View(None); file.frames.len()];
    named.iter().zip(uses.frames).for_each(|(&index, use_)| use_of[index] = use_);
    // `--images images_4` replaces the leading folders of the stored paths; photos that were moved to `images` are found there.
    let photos = match &folder.images {
        Some(images) => vec![images.clone()],
        None => ["", "images"].map(|inside| folder.photos(inside)).to_vec(),
    };
    for (index, frame) in file.frames.iter().enumerate() {
        let name = frame.name.as_deref().unwrap_or_default();
        let listed = match use_of[index] {
            Use::View(listed) => split.or(listed),
            Use::LeftOut(why) => {
                source.leave_out(plain(name), why);
                continue;
            }
        };
        let element = format!("frames[{index}] ({})", quoted(name));
        match view(path, frame, &element, &file.intrinsics, folders, &photos)? {
            Ok(view) => source.views.push(SourceView { split: listed, ..view }),
            Err(Unusable::NoPhoto) => {
                source.unused.push(UnusedView { name: plain(name), why: Why::NoPhoto, split: listed });
            }
            Err(Unusable::Broken(problem)) => {
                left_out.push_split_view(element, &plain(name), problem, listed)
            }
        }
    }
    left_out.finish_views(path, file.frames.len(), source)?;
    match &file.ply_file_path {
        Some(stated) => points_files::read_named(path, stated, folder, source),
        None => Ok(()),
    }
}

/// Why a frame is no view.
enum Unusable {
    NoPhoto,
    Broken(String),
}

/// The view of a frame, or why it is none.
fn view(
    path: &Path,
    frame: &Frame,
    element: &str,
    of_file: &Intrinsics,
    folders: &Folders,
    photos: &[PhotoFolder],
) -> Result<Result<SourceView, Unusable>> {
    let broken = |problem: String| Ok(Err(Unusable::Broken(problem)));
    let stated = match &frame.stated {
        Ok(stated) => stated,
        Err(problem) => return broken(problem.clone()),
    };
    let camera_from_capture = match pose(stated.transform_matrix.as_deref()) {
        Ok(pose) => pose,
        Err(problem) => return broken(format!("transform_matrix: {problem}")),
    };
    let stored = plain(&stated.file_path);
    let mut found = None;
    for folder in photos {
        found = folder.find(&stored)?;
        if found.is_some() {
            break;
        }
    }
    let Some(photo) = found else {
        return Ok(Err(Unusable::NoPhoto));
    };
    let lens = match stated.intrinsics.or(of_file).lens(path, element, &photo)? {
        Ok(lens) => lens,
        Err(problem) => return broken(problem),
    };
    let mask = stated.mask_path.as_ref().map(|mask| find_mask(&folders.masks, mask, &photo)).transpose()?;
    let name = name(&folders.poses.root, &stated.file_path, &photo);
    Ok(Ok(SourceView { mask, ..SourceView::new(name, photo, lens, camera_from_capture) }))
}

/// Whether the frame is Blender's, in which z is up. `transforms.json` of other programs defines none.
fn is_of_blender(path: &Path) -> bool {
    path.file_name().is_some_and(|name| name == "transforms_train.json")
}

/// Name of a view: the stored path with the extension of the photo that was found.
fn name(root: &Path, file_path: &str, photo: &Path) -> String {
    let stored = plain(file_path);
    let inside = photo.strip_prefix(root).ok().map(|p| plain(&p.to_string_lossy()));
    match inside {
        Some(inside) if inside.starts_with(&stored) => inside,
        _ => stored,
    }
}

/// Makes names relative to the folder that all photos share, as COLMAP's names are.
fn strip_common_folder(source: &mut Source) {
    let folder = common_folder(source.views.iter().map(|v| v.name.as_str())).to_owned();
    source.views.iter_mut().for_each(|v| drop(v.name.drain(..folder.len())));
    for view in &mut source.unused {
        let shared = common_folder([folder.as_str(), view.name.as_str()]).len();
        view.name.drain(..shared);
    }
}

/// The mask at a stored path, or where it should be. The photo itself, of the same stem, is none.
fn find_mask(folder: &CaptureFolder, stored: &str, photo: &Path) -> Result<PathBuf> {
    match folder.photos("").find_whole(&plain(stored))? {
        Some(found) if found.path != photo => Ok(found.path),
        _ => folder.file(stored),
    }
}

/// camera_from_capture in OpenCV axes from an OpenGL camera-to-world matrix.
fn pose(rows: Option<&[Vec<Number>]>) -> Result<RigidTransform, String> {
    let rows = rows.ok_or("missing")?;
    if !matches!(rows.len(), 3 | 4) || rows.iter().any(|r| r.len() != 4) {
        let found: Vec<usize> = rows.iter().map(Vec::len).collect();
        return Err(format!("rows of {found:?} numbers found, expected 4 (or 3) rows of 4"));
    }
    let column = |j: usize| DVec3::new(rows[0][j].0, rows[1][j].0, rows[2][j].0);
    from_opengl(DMat3::from_cols(column(0), column(1), column(2)), column(3))
}
