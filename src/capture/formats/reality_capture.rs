//! The CSV export "Internal/External camera parameters" of RealityCapture / RealityScan, with a row for
//! each photo. Positions are `x, y, alt` with z up; `heading, pitch, roll` are in degrees; `f` refers to 36 mm film along the
//! photo's longer side, and `px`, `py` are shares of that side, from the middle of the photo.

use super::axes::from_opengl;
use super::bytes::read_text;
use super::lookup::{files, largest};
use super::{film, points_files};
use crate::camera::RigidTransform;
use crate::capture::folder::CaptureFolder;
use crate::capture::left_out::LeftOut;
use crate::capture::lens::{Distortion, Lens};
use crate::capture::photos::photo_size;
use crate::capture::pose_format::{Found, PoseFormat};
use crate::capture::source::{Source, SourceView, Why};
use crate::text::quoted;
use crate::{Report, Result, input_file};
use glam::{DMat3, DVec3};
use litetex_exporters::parse_number;
use std::fs::File;
use std::io::Read as _;
use std::path::{Path, PathBuf};

/// Columns without which a CSV file is something else.
const REQUIRED: [&str; 8] = ["name", "x", "y", "alt", "heading", "pitch", "roll", "f"];

/// Names of the files of points that are read, without their extension, in this order.
const POINTS: [&str; 3] = ["points", "points3d", "init"];

/// The names of the columns, if a line is the export's header.
fn header(line: &str) -> Option<Vec<String>> {
    let columns: Vec<String> = line
        .trim()
        .trim_start_matches('\u{feff}')
        .trim_start_matches('#')
        .split(',')
        .map(|c| c.trim().to_ascii_lowercase())
        .collect();
    REQUIRED.iter().all(|r| columns.iter().any(|c| c == r)).then_some(columns)
}

/// See [`PoseFormat`].
pub(crate) const FORMAT: PoseFormat = PoseFormat {
    name: "reality-capture",
    help: "CSV export of RealityCapture / RealityScan",
    files: "RealityCapture's \"Internal/External camera parameters\" (.csv)",
    has_observations: false,
    find,
};

fn find(path: &Path, report: &mut Report) -> Option<Found> {
    let (root, file) = match path.is_file() {
        true => (path.parent().unwrap_or(Path::new("")), Some(path).filter(|p| is_export(p))?.to_owned()),
        false => (path, largest(exports(path), num_rows, report)?),
    };
    Some(Found::new(root, Box::new(move |folder| read(&file, folder))))
}

/// Whether a file is the export.
fn is_export(path: &Path) -> bool {
    path.extension().is_some_and(|e| e.eq_ignore_ascii_case("csv"))
        // A count of cameras may stand before the header.
        && input_file::check(path, u64::MAX).is_ok()
        && head(path).lines().take(2).any(|line| header(line).is_some())
}

/// The exports in a capture's folder: CSV files with its columns.
fn exports(root: &Path) -> Vec<PathBuf> {
    files(root, "csv", 0).into_iter().filter(|p| is_export(p)).collect()
}

/// The rows below the header of a table, one a camera; 0 if it cannot be read.
fn num_rows(path: &Path) -> usize {
    let has_columns = |line: &&str| header(line).is_some();
    read_text(path).map_or(0, |text| {
        let rows = text.lines().skip_while(|line| !has_columns(line)).skip(1);
        rows.filter(|line| !line.trim().is_empty()).count()
    })
}

/// The beginning of a file: tables of other programs may have any size.
fn head(path: &Path) -> String {
    const HEAD_BYTES: u64 = 1 << 16;
    let mut head = Vec::new();
    // What cannot be read is no export.
    let _ = File::open(path).and_then(|file| file.take(HEAD_BYTES).read_to_end(&mut head));
    input_file::text_of_head(&head)
}

/// Why a file that has the columns of the export cannot be read; `None` if it has others.
pub(super) fn unreadable_table(path: &Path) -> Option<&'static str> {
    let head = head(path);
    let has_columns = |separator: char, text: &str| {
        text.lines().take(2).any(|line| header(&line.replace(separator, ",")).is_some())
    };
    // Half of the bytes of such text are zero.
    let narrow: String = head.replace('\0', "");
    if head.contains('\0') {
        return [',', ';', '\t']
            .into_iter()
            .any(|s| has_columns(s, &narrow))
            .then_some("in UTF-16 without a byte order mark");
    }
    let separators = [(';', "separated by semicolons"), ('\t', "separated by tabs")];
    separators.into_iter().find_map(|(separator, what)| has_columns(separator, &head).then_some(what))
}

/// A row of the table.
struct Row<'a> {
    columns: &'a [String],
    fields: Vec<&'a str>,
}

impl Row<'_> {
    fn text(&self, column: &str) -> Option<&str> {
        let at = self.columns.iter().position(|c| c == column)?;
        self.fields.get(at).map(|f| f.trim().trim_matches('"')).filter(|f| !f.is_empty())
    }

    fn number(&self, column: &str) -> Result<Option<f64>, String> {
        self.text(column)
            .map(|text| {
                let value = parse_number(text).filter(|v| v.is_finite());
                value.ok_or_else(|| format!("column {column:?} holds {}, expected a number", quoted(text)))
            })
            .transpose()
    }

    fn required(&self, column: &str) -> Result<f64, String> {
        self.number(column)?.ok_or_else(|| format!("column {column:?} is empty, expected a number"))
    }

    fn or_zero(&self, column: &str) -> Result<f64, String> {
        Ok(self.number(column)?.unwrap_or(0.0))
    }
}

fn read(path: &Path, folder: &CaptureFolder) -> Result<Source> {
    let text = read_text(path)?;
    let inside = if folder.root.join("images").is_dir() { "images" } else { "" };
    let photos = folder.images.clone().unwrap_or_else(|| folder.photos(inside));
    let mut source = Source::at(path);
    source.stated_up = Some(DVec3::Z);
    let mut columns: Option<Vec<String>> = None;
    let (mut total, mut left_out) = (0, LeftOut::default());
    for (index, line) in text.lines().enumerate() {
        let Some(columns) = &columns else {
            columns = header(line);
            continue;
        };
        if line.trim().is_empty() {
            continue;
        }
        total += 1;
        let row = Row { columns, fields: line.split(',').collect() };
        let name = row.text("name").unwrap_or_default().replace('\\', "/");
        let element = format!("line {} ({})", index + 1, quoted(&name));
        if name.is_empty() {
            left_out.push(element, "the name is missing");
            continue;
        }
        let camera_from_capture = match pose(&row) {
            Ok(pose) => pose,
            Err(problem) => {
                left_out.push_view(element, &name, problem);
                continue;
            }
        };
        let Some(photo) = photos.find(&name)? else {
            source.leave_out(name, Why::NoPhoto);
            continue;
        };
        let lens = match lens(&row, photo_size(&photo)?) {
            Ok(lens) => lens,
            Err(problem) => {
                left_out.push_view(element, &name, problem);
                continue;
            }
        };
        source.views.push(SourceView::new(name, photo, lens, camera_from_capture));
    }
    if columns.is_none() {
        return Err(invalid!(path, "no header with the columns {}", REQUIRED.join(", ")));
    }
    left_out.finish_views(path, total, &mut source)?;
    points_files::read(&folder.root, &POINTS, &mut source);
    Ok(source)
}

/// Rotations about z by -heading, then x by pitch, then y by roll lead from the camera (x right, y up,
/// z backward) to the capture, as nerfstudio reads the same export.
fn pose(row: &Row<'_>) -> Result<RigidTransform, String> {
    let angle = |column: &str| row.required(column).map(f64::to_radians);
    let turn = DMat3::from_rotation_z(-angle("heading")?)
        * DMat3::from_rotation_x(angle("pitch")?)
        * DMat3::from_rotation_y(angle("roll")?);
    let centre = DVec3::new(row.required("x")?, row.required("y")?, row.required("alt")?);
    from_opengl(turn, centre).map_err(|e| format!("the pose: {e}"))
}

fn lens(row: &Row<'_>, size_px: (u32, u32)) -> Result<Lens, String> {
    let k = [row.or_zero("k1")?, row.or_zero("k2")?, row.or_zero("k3")?, row.or_zero("k4")?];
    let p = [row.or_zero("t1")?, row.or_zero("t2")?];
    let any = k.iter().chain(&p).any(|&v| v != 0.0);
    let lens = Lens {
        pinhole: film::pinhole(row.required("f")?, [row.or_zero("px")?, row.or_zero("py")?], size_px),
        distortion: if any { Distortion::Brown { k, p, shear: 0.0 } } else { Distortion::None },
    };
    lens.checked()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::capture::{Capture, LoadOptions};
    use tempfile::tempdir;

    fn load(rows: &str) -> Result<Capture> {
        let folder = tempdir().unwrap();
        std::fs::create_dir(folder.path().join("images")).unwrap();
        for name in ["a.png", "b.png"] {
            image::RgbImage::new(36, 18).save(folder.path().join("images").join(name)).unwrap();
        }
        let header = "#cameras 2\n#name,x,y,alt,heading,pitch,roll,f,px,py,k1,k2,k3,k4,t1,t2\n";
        std::fs::write(folder.path().join("cameras.csv"), format!("{header}{rows}")).unwrap();
        Capture::load(folder.path(), &LoadOptions::default())
    }

    #[test]
    fn heading_is_clockwise_from_north_and_pitch_from_straight_down() {
        // Without any turn the camera looks down, its upper edge to the north (+y).
        let rows = "a.png,1,2,3,0,0,0,20,0.0625,-0.125,0,0,0,0,0,0\nb.png,0,0,0,90,90,0,20,0,0,0,0,0,0,0,0\n";
        let capture = load(rows).unwrap();
        assert_eq!(capture.format.name(), FORMAT.name);
        let axes = |view: usize| capture.views[view].camera.camera_from_local.rotation.transpose();
        assert!((axes(0) * DVec3::Z - DVec3::NEG_Z).length() < 1e-12);
        assert!((axes(0) * DVec3::NEG_Y - DVec3::Y).length() < 1e-12);
        // Pitch 90: level; heading 90: east.
        assert!((axes(1) * DVec3::Z - DVec3::X).length() < 1e-12);
        assert!((axes(1) * DVec3::NEG_Y - DVec3::Z).length() < 1e-12);
        let centre = capture.views[0].camera.centre_in_local();
        let centre = capture.capture_from_local.transform_point(centre);
        assert!((centre - DVec3::new(1.0, 2.0, 3.0)).length() < 1e-12);
        // Shares of the longer side, 36 px.
        let p = capture.views[0].camera.pinhole;
        assert_eq!((p.fx_px, p.cx_px, p.cy_px), (20.0, 20.25, 4.5));
    }

    #[test]
    fn missing_numbers_name_line_and_column() {
        let text = load("a.png,1,2,3,0,x,0,20\n").err().unwrap().to_string();
        assert!(text.contains("line 3") && text.contains("\"pitch\"") && text.contains("\"x\""), "{text}");
        let text = load("a.png,1,2,3\n").err().unwrap().to_string();
        assert!(text.contains("line 3") && text.contains("\"heading\""), "{text}");
    }
}
