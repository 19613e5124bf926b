//! COLMAP's text files: a line for each camera or point, two for each image, of which the second (its
//! keypoints) may be blank. `#` starts a comment.

use super::bytes::read_text;
use super::colmap_model::{ColmapCamera, ColmapImage, ColmapModel, ColmapPoint};
use crate::text::quoted;
use crate::{Error, Result};
use litetex_exporters::parse_number;
use std::path::Path;
use std::str::FromStr;

/// Blank-separated fields of one line, with errors that name file and line.
struct Fields<'a> {
    path: &'a Path,
    line_number: usize,
    rest: &'a str,
}

impl<'a> Fields<'a> {
    fn new(path: &'a Path, (line_number, line): (usize, &'a str)) -> Self {
        Self { path, line_number, rest: line.trim() }
    }

    fn invalid(&self, what: impl std::fmt::Display) -> Error {
        invalid!(self.path, "line {}: {what}", self.line_number)
    }

    fn word(&mut self) -> Option<&'a str> {
        let rest = self.rest.trim_start();
        let end = rest.find(char::is_whitespace).unwrap_or(rest.len());
        let (word, after) = rest.split_at(end);
        self.rest = after;
        (!word.is_empty()).then_some(word)
    }

    fn next<T: FromStr>(&mut self, what: &str) -> Result<T> {
        self.parsed(what, |word| word.parse().ok())
    }

    /// The next number, which may be NaN or infinite.
    fn number(&mut self, what: &str) -> Result<f64> {
        self.parsed(what, parse_number)
    }

    fn parsed<T>(&mut self, what: &str, parse: impl Fn(&str) -> Option<T>) -> Result<T> {
        let word =
            self.word().ok_or_else(|| self.invalid(format!("the line ends where {what} was expected")))?;
        parse(word).ok_or_else(|| self.invalid(format!("{} found where {what} was expected", quoted(word))))
    }

    fn array<const N: usize>(&mut self, what: &str) -> Result<[f64; N]> {
        let mut out = [0.0; N];
        for value in &mut out {
            *value = self.number(what)?;
        }
        Ok(out)
    }
}

/// Lines that are neither blank nor comments, numbered from 1.
fn data_lines(text: &str) -> impl Iterator<Item = (usize, &str)> {
    text.lines()
        .enumerate()
        .map(|(index, line)| (index + 1, line))
        .filter(|(_, line)| !line.trim().is_empty() && !line.trim_start().starts_with('#'))
}

/// Reads `cameras.txt`.
pub(crate) fn read_cameras(path: &Path) -> Result<Vec<ColmapCamera>> {
    let text = read_text(path)?;
    let mut cameras = Vec::new();
    for line in data_lines(&text) {
        let mut fields = Fields::new(path, line);
        let id = fields.next("a camera id")?;
        let name: String = fields.next("a camera model")?;
        let model = ColmapModel::by_name(&name, path, id)?;
        let width = fields.next("a width")?;
        let height = fields.next("a height")?;
        let mut params = Vec::with_capacity(model.num_params);
        while let Some(word) = fields.word() {
            let value = parse_number(word);
            params.push(value.ok_or_else(|| fields.invalid(format!("{} is not a number", quoted(word))))?);
        }
        if params.len() != model.num_params {
            return Err(fields.invalid(format!(
                "camera {id} has {} parameters, {name} has {}",
                params.len(),
                model.num_params
            )));
        }
        cameras.push(ColmapCamera { id, model, width, height, params });
    }
    Ok(cameras)
}

/// Ids of the triangulated keypoints if the line lists keypoints (x, y, point id or -1), else `None`.
fn keypoints(line: &str) -> Option<Vec<u64>> {
    let words: Vec<&str> = line.split_whitespace().collect();
    if !words.len().is_multiple_of(3) {
        return None;
    }
    let mut point_ids = Vec::new();
    for triple in words.chunks_exact(3) {
        parse_number(triple[0])?;
        parse_number(triple[1])?;
        if triple[2].parse::<i64>().ok()? >= 0 {
            point_ids.push(triple[2].parse().ok()?);
        }
    }
    Some(point_ids)
}

/// Reads `images.txt`.
pub(crate) fn read_images(path: &Path) -> Result<Vec<ColmapImage>> {
    let text = read_text(path)?;
    let mut lines = text
        .lines()
        .enumerate()
        .map(|(index, line)| (index + 1, line))
        .filter(|(_, line)| !line.trim_start().starts_with('#'))
        .peekable();
    let mut images = Vec::new();
    while let Some(line) = lines.next() {
        if line.1.trim().is_empty() {
            continue;
        }
        let mut fields = Fields::new(path, line);
        let id = fields.next("an image id")?;
        let quaternion = fields.array("a quaternion")?;
        let translation = fields.array("a translation")?;
        let camera_id = fields.next("a camera id")?;
        // Names may contain blanks, so the name is the rest of the line.
        let name = fields.rest.trim().to_owned();
        // Some tools omit the second line of images without keypoints.
        let point_ids = match lines.peek().map(|(_, second)| keypoints(second)) {
            Some(Some(point_ids)) => {
                lines.next();
                point_ids
            }
            _ => Vec::new(),
        };
        images.push(ColmapImage { id, quaternion, translation, camera_id, name, point_ids });
    }
    Ok(images)
}

/// Reads `points3D.txt`.
pub(crate) fn read_points(path: &Path) -> Result<Vec<ColmapPoint>> {
    let text = read_text(path)?;
    let mut points = Vec::new();
    for line in data_lines(&text) {
        let mut fields = Fields::new(path, line);
        let id = fields.next("a point id")?;
        let position = fields.array("a position")?;
        let mut rgb = [0; 3];
        for channel in &mut rgb {
            *channel = fields.next("a colour from 0 to 255")?;
        }
        points.push(ColmapPoint { id, position, rgb, error_px: fields.number("a reprojection error")? });
    }
    Ok(points)
}
