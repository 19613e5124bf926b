//! What every pose format is read into: views with lens and pose in the frame of the capture, and points.
//! Later steps do not depend on the format.

use super::lens::Lens;
use super::photo_folder::Match;
use crate::Report;
use crate::camera::RigidTransform;
use crate::text;
use crate::views::{SfmPoint, Split};
use glam::{DMat3, DVec3};
use std::path::{Path, PathBuf};

/// A photo with a pose, as the pose files describe it.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct SourceView {
    /// Name relative to the photo folder, with forward slashes.
    pub name: String,
    /// The photo's file, where the reader looks for it.
    pub photo: Option<Match>,
    /// The mask's file, where the format names it.
    pub mask: Option<PathBuf>,
    pub lens: Lens,
    pub camera_from_capture: RigidTransform,
    /// Side of the split, where the format states one.
    pub split: Option<Split>,
    /// Indices of the points that were triangulated from this photo.
    pub observed: Vec<u32>,
}

impl SourceView {
    /// A view of which nothing else is stated.
    pub fn new(name: String, photo: Match, lens: Lens, camera_from_capture: RigidTransform) -> Self {
        let photo = Some(photo);
        Self { name, photo, mask: None, lens, camera_from_capture, split: None, observed: Vec::new() }
    }

    /// Where the photo is; nowhere before it was looked for.
    pub fn photo_path(&self) -> &Path {
        self.photo.as_deref().unwrap_or(Path::new(""))
    }
}

/// Why a view is left out that the pose files describe.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Why {
    Broken,
    NoPhoto,
    NoPose,
    /// By the author.
    Disabled,
    /// By the author, as a bad photo.
    Bad,
    /// Aligned, but not with the others.
    Apart,
    /// On neither side of a split that lists both.
    Unlisted,
    /// Of a second set of test views.
    Validation,
    Far,
}

impl Why {
    /// For people: what the view is.
    pub fn words(self) -> &'static str {
        match self {
            Self::Broken => "broken",
            Self::NoPhoto => "without a photo",
            Self::NoPose => "without a pose",
            Self::Disabled => "disabled by the author",
            Self::Bad => "marked as bad by the author",
            Self::Apart => "not aligned with the others",
            Self::Unlisted => "on no side of the split",
            Self::Validation => "of a second set of test views",
            Self::Far => "far from all others",
        }
    }
}

/// A view that the pose files describe and that is left out.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct UnusedView {
    /// As it would be called if it were used, perhaps without the extension.
    pub name: String,
    pub why: Why,
    /// Side of the split, where the format states one.
    pub split: Option<Split>,
}

impl UnusedView {
    /// A view of which nothing else is stated.
    pub fn new(name: impl Into<String>, why: Why) -> Self {
        Self { name: name.into(), why, split: None }
    }
}

/// A capture as its pose files describe it.
#[derive(Clone, Debug)]
pub(crate) struct Source {
    /// The file or folder that was read, named in messages.
    pub path: PathBuf,
    pub views: Vec<SourceView>,
    pub points: Vec<SfmPoint>,
    /// Points that cannot be read: what each is called, and what is wrong with it.
    pub broken_points: Vec<(String, String)>,
    /// Up as the format defines it, a unit vector, where it does.
    pub stated_up: Option<DVec3>,
    /// The program whose poses are in metres, where the format says so.
    pub metric: Option<&'static str>,
    /// The file of the points, where the poses name one or one lies beside them, whether it can be read or not.
    pub points_file: Option<PathBuf>,
    /// Mean reprojection error of the points in pixels, where the format states it.
    pub reprojection_error_px: Option<f64>,
    /// The views that the files describe beside `views`.
    pub unused: Vec<UnusedView>,
    /// What in the files decided the split, for people; `None` where they state none.
    pub split_by: Option<String>,
    pub report: Report,
}

impl Source {
    /// An empty capture, to be read from `path`.
    pub fn at(path: &Path) -> Self {
        Self {
            path: path.to_owned(),
            views: Vec::new(),
            points: Vec::new(),
            broken_points: Vec::new(),
            stated_up: None,
            metric: None,
            points_file: None,
            reprojection_error_px: None,
            unused: Vec::new(),
            split_by: None,
            report: Report::default(),
        }
    }

    /// Leaves out a view.
    pub fn leave_out(&mut self, name: impl Into<String>, why: Why) {
        self.unused.push(UnusedView::new(name, why));
    }

    /// Names of the views that are left out for a reason.
    pub fn names_unused(&self, why: Why) -> Vec<&str> {
        self.unused.iter().filter(|v| v.why == why).map(|v| v.name.as_str()).collect()
    }

    /// Number of views with a pose that can be read, whether their photo is there or not.
    pub fn num_posed(&self) -> usize {
        self.views.len() + self.names_unused(Why::NoPhoto).len()
    }

    /// Leaves out points, also of what the views observe.
    pub fn retain_points(&mut self, keep: impl Fn(&SfmPoint) -> bool) {
        let mut kept = 0;
        let new_index: Vec<Option<u32>> = self
            .points
            .iter()
            .map(|point| {
                keep(point).then(|| {
                    kept += 1;
                    kept - 1
                })
            })
            .collect();
        self.points.retain(keep);
        for view in &mut self.views {
            view.observed =
                view.observed.iter().filter_map(|&i| new_index.get(i as usize).copied().flatten()).collect();
        }
    }
}

/// Larger coordinates are taken for damage: even the moon's distance in millimetres is less.
pub(crate) const MAX_COORDINATE: f64 = 1e12;

/// The rotation nearest to a matrix that is a rotation up to rounding and uniform scale.
///
/// # Errors
/// What is wrong with the matrix.
pub(crate) fn nearest_rotation(matrix: DMat3) -> Result<DMat3, String> {
    if !matrix.is_finite() {
        return Err("it holds NaN or infinite numbers".to_owned());
    }
    let determinant = matrix.determinant();
    if determinant <= 1e-30 {
        return Err(format!(
            "its determinant is {determinant:e}, expected 1 (a mirrored or flattened frame)"
        ));
    }
    let scaled = matrix * (1.0 / determinant.cbrt());
    let deviation = (scaled.transpose() * scaled - DMat3::IDENTITY)
        .to_cols_array()
        .into_iter()
        .fold(0.0_f64, |a, v| a.max(v.abs()));
    // Published captures are rounded to 1e-7 to 1e-4; a sheared frame deviates more.
    if deviation > 0.02 {
        return Err(format!("its axes deviate from orthogonal ones by {deviation:.3}"));
    }
    // Polar decomposition by Newton's method; each iteration squares the error.
    let mut rotation = scaled;
    for _ in 0..6 {
        rotation = (rotation + rotation.inverse().transpose()) * 0.5;
    }
    Ok(rotation)
}

/// A pose from its parts.
///
/// # Errors
/// What is wrong with it.
pub(crate) fn checked_pose(rotation: DMat3, translation: DVec3) -> Result<RigidTransform, String> {
    if !translation.is_finite() || translation.abs().max_element() > MAX_COORDINATE {
        return Err(format!(
            "its translation is {:?}, expected finite numbers up to {MAX_COORDINATE:e}",
            translation.to_array()
        ));
    }
    Ok(RigidTransform {
        rotation: nearest_rotation(rotation).map_err(|e| format!("its matrix is not a rotation: {e}"))?,
        translation,
    })
}

/// Up to five names and how many more there are: "a", "b" and 4 more.
pub(crate) fn first_names<'a>(names: impl IntoIterator<Item = &'a str>) -> String {
    first_of(names.into_iter().map(text::quoted))
}

/// As [`first_names`], for paths, whose ends matter.
pub(crate) fn first_paths<'a>(paths: impl IntoIterator<Item = &'a PathBuf>) -> String {
    first_of(paths.into_iter().map(|path| format!("{:?}", text::path(path))))
}

/// As [`first_names`], of texts that are shown as they are.
pub(crate) fn first_of(shown: impl Iterator<Item = String>) -> String {
    const SHOWN: usize = 5;
    let all: Vec<String> = shown.collect();
    let mut text = all[..all.len().min(SHOWN)].join(", ");
    if all.len() > SHOWN {
        text.push_str(&format!(" and {} more", all.len() - SHOWN));
    }
    text
}
