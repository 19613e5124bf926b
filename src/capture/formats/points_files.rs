//! Point clouds that pose files name, or that lie beside them.

use super::ply;
use crate::Result;
use crate::capture::folder::CaptureFolder;
use crate::capture::left_out::checked_points;
use crate::capture::paths::plain;
use crate::capture::photo_folder::ends;
use crate::capture::source::{Source, first_paths};
use crate::text;
use serde_json::Value;
use std::path::{Path, PathBuf};

/// Reads the points that the pose file at `path` names with its `ply_file_path`. Without them the capture can be used all the same.
///
/// # Errors
/// If they lie outside an archive.
pub(super) fn read_named(
    path: &Path,
    stated: &Value,
    folder: &CaptureFolder,
    source: &mut Source,
) -> Result<()> {
    let Some(stated) = stated.as_str() else {
        let found = stated.to_string();
        let what = format!(
            "{}: ply_file_path holds {}, expected the path of a file",
            text::path(path),
            text::shortened(&found, 40)
        );
        source.report.warn("points-file-unreadable", 1, what);
        return Ok(());
    };
    if stated.trim().is_empty() {
        return Ok(());
    }
    let mut ply = folder.file(stated)?;
    if !ply.exists() {
        ply = end_that_is_there(folder, stated).unwrap_or(ply);
    }
    // Blender's files name the same points each.
    if source.points_file.as_ref() == Some(&ply) {
        return Ok(());
    }
    if !ply.exists() {
        let what = format!("{}: the points that {} names are not there", text::path(&ply), text::path(path));
        source.report.warn("points-file-missing", 1, what);
        return Ok(());
    }
    let read = ply::read_points(&ply);
    source.points_file = Some(ply);
    match read {
        Ok(points) => {
            source.points.extend(points);
        }
        Err(error) => {
            let what =
                format!("{error}; the capture is read without the points that {} names", text::path(path));
            source.report.warn("points-file-unreadable", 1, what);
        }
    }
    Ok(())
}

/// The file of a path on another computer, as photos are found: the longest end that is there.
fn end_that_is_there(folder: &CaptureFolder, stated: &str) -> Option<PathBuf> {
    let path = plain(stated);
    ends(&path).map(|(_, end)| folder.root.join(end)).find(|file| file.is_file())
}

/// Reads the first of the files of these names, in lower case and without extension, in a folder where clouds of such names
/// are those of the poses. Other clouds there may be of another project, so they are only named.
pub(super) fn read(folder: &Path, names: &[&str], source: &mut Source) {
    let mut clouds = clouds(folder);
    let is_named =
        |cloud: &PathBuf, name: &str| cloud.file_stem().is_some_and(|stem| stem.eq_ignore_ascii_case(name));
    let Some(at) = names.iter().find_map(|name| clouds.iter().position(|cloud| is_named(cloud, name))) else {
        return;
    };
    let cloud = clouds.remove(at);
    match ply::read_points(&cloud).and_then(|points| checked_points(&cloud, points)) {
        Ok(points) => {
            source.points = points;
            source.points_file = Some(cloud);
            warn(&clouds, source);
        }
        // It may be of another project.
        Err(error) => {
            source.points_file = Some(cloud);
            let what = format!("{error}; the capture is read without these points");
            source.report.warn("points-beside-unreadable", 1, what);
        }
    }
}

/// Names the clouds in the capture's folder and beside the poses, of a capture that has no points: nothing says whether they
/// are in the frame of the poses.
pub(crate) fn name(root: &Path, source: &mut Source) {
    let poses = if source.path.is_dir() { Some(&*source.path) } else { source.path.parent() };
    let mut found = clouds(root);
    found.extend(poses.into_iter().flat_map(clouds));
    found.sort();
    found.dedup();
    // What cannot be read was named.
    found.retain(|cloud| Some(cloud) != source.points_file.as_ref());
    warn(&found, source);
}

/// The PLY files of a folder, sorted.
fn clouds(folder: &Path) -> Vec<PathBuf> {
    let folder = if folder.as_os_str().is_empty() { Path::new(".") } else { folder };
    let mut clouds: Vec<PathBuf> = std::fs::read_dir(folder)
        .into_iter()
        .flatten()
        .filter_map(|entry| Some(entry.ok()?.path()))
        .filter(|p| p.is_file() && p.extension().is_some_and(|e| e.eq_ignore_ascii_case("ply")))
        .collect();
    clouds.sort();
    clouds
}

fn warn(clouds: &[PathBuf], source: &mut Source) {
    if !clouds.is_empty() {
        let what = format!(
            "{} beside {} {} not used: {}; \"--init ply:FILE\" starts from the points of one",
            text::counted(clouds.len(), "point cloud"),
            text::path(&source.path),
            if clouds.len() == 1 { "is" } else { "are" },
            first_paths(clouds)
        );
        source.report.warn("points-beside-not-used", clouds.len(), what);
    }
}
