//! Point clouds that lie beside the poses and that these do not name.

use super::ply;
use crate::capture::left_out::checked_points;
use crate::capture::source::{Source, first_paths};
use crate::text;
use std::path::{Path, PathBuf};

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
