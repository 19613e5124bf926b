//! COLMAP's text files: a line for each camera or point, two for each image, of which the second (its
//! keypoints) may be blank. `#` starts a comment. A line that cannot be read is left out, but for the last of a file that
//! ends inside it.

use super::bytes::{read_file, read_text};
use super::colmap_model::{Broken, ColmapCamera, ColmapImage, ColmapModel, ColmapPoint, Parts};
use crate::text::quoted;
use crate::{Error, Result};
use litetex_exporters::parse_number;
use std::path::Path;
use std::str::FromStr;

/// Of a hundred thousand lines more than a tenth.
const BROKEN_MAX: usize = 10_000;

/// What stands for bytes that are no text.
const NO_TEXT: char = char::REPLACEMENT_CHARACTER;

/// The text of a file, in which bytes that are no UTF-8 text spoil their line only.
fn read_lines(path: &Path) -> Result<String> {
    let data = read_file(path)?;
    let is_utf_16 = data.starts_with(&[0xff, 0xfe]) || data.starts_with(&[0xfe, 0xff]);
    if is_utf_16 || std::str::from_utf8(&data).is_ok() {
        return read_text(path);
    }
    Ok(String::from_utf8_lossy(&data).trim_start_matches('\u{feff}').to_owned())
}

/// Blank-separated fields of one line; errors say what was found in it.
struct Fields<'a> {
    rest: &'a str,
}

impl<'a> Fields<'a> {
    fn new(line: &'a str) -> Self {
        Self { rest: line.trim() }
    }

    fn word(&mut self) -> Option<&'a str> {
        let rest = self.rest.trim_start();
        let end = rest.find(char::is_whitespace).unwrap_or(rest.len());
        let (word, after) = rest.split_at(end);
        self.rest = after;
        (!word.is_empty()).then_some(word)
    }

    fn next<T: FromStr>(&mut self, what: &str) -> Result<T, String> {
        self.parsed(what, |word| word.parse().ok())
    }

    /// The next number, which may be NaN or infinite.
    fn number(&mut self, what: &str) -> Result<f64, String> {
        self.parsed(what, parse_number)
    }

    fn parsed<T>(&mut self, what: &str, parse: impl Fn(&str) -> Option<T>) -> Result<T, String> {
        let word = self.word().ok_or_else(|| format!("the line ends where {what} was expected"))?;
        parse(word).ok_or_else(|| format!("{} found where {what} was expected", quoted(word)))
    }

    fn array<const N: usize>(&mut self, what: &str) -> Result<[f64; N], String> {
        let mut out = [0.0; N];
        for value in &mut out {
            *value = self.number(what)?;
        }
        Ok(out)
    }
}

fn id_of(line: &str) -> Option<u64> {
    line.split_whitespace().next().and_then(|word| word.parse().ok())
}

/// The lines of a text file that are no comments, numbered from 1.
struct Lines<'a> {
    path: &'a Path,
    text: &'a str,
    /// Number of the last line if no line break ends it.
    open: Option<usize>,
}

impl<'a> Lines<'a> {
    fn new(path: &'a Path, text: &'a str) -> Self {
        let open = (!text.ends_with('\n')).then(|| text.lines().count());
        Self { path, text, open }
    }

    fn data(&self) -> impl Iterator<Item = (usize, &'a str)> + use<'a> {
        self.text
            .lines()
            .enumerate()
            .map(|(index, line)| (index + 1, line))
            .filter(|(_, line)| !line.trim_start().starts_with('#'))
    }

    /// A line that cannot be read.
    ///
    /// # Errors
    /// [`Error::InvalidInput`] if the file ends inside it: what else is missing is not known.
    fn broken(&self, (number, line): (usize, &str), name: Option<&str>, what: String) -> Result<Broken> {
        if self.open == Some(number) {
            return Err(Error::invalid(
                self.path,
                format!("line {number}: {what}; the file ends inside this line: copy it again"),
            ));
        }
        let file = self.path.file_name().unwrap_or_default().to_string_lossy();
        Ok(Broken {
            id: id_of(line),
            name: name.map(str::to_owned).filter(|name| !name.is_empty()),
            place: format!("{file}: line {number}"),
            what,
        })
    }

    /// Adds a line that cannot be read, in bounded memory.
    fn leave_out<T>(&self, parts: &mut Parts<T>, broken: Broken) -> Result<()> {
        if parts.broken.len() == BROKEN_MAX {
            let what =
                format!("more than {BROKEN_MAX} lines cannot be read; {}: {}", broken.place, broken.what);
            return Err(Error::invalid(self.path, what));
        }
        parts.broken.push(broken);
        Ok(())
    }

    /// The part of each line that is not blank.
    fn parts<T>(&self, part: impl Fn(&str) -> Result<T, String>) -> Result<Parts<T>> {
        let mut parts = Parts::default();
        for line in self.data().filter(|(_, line)| !line.trim().is_empty()) {
            match part(line.1) {
                Ok(part) => parts.good.push(part),
                Err(what) => self.leave_out(&mut parts, self.broken(line, None, what)?)?,
            }
        }
        Ok(parts)
    }
}

/// Reads `cameras.txt`.
pub(crate) fn read_cameras(path: &Path) -> Result<Parts<ColmapCamera>> {
    Lines::new(path, &read_lines(path)?).parts(camera)
}

fn camera(line: &str) -> Result<ColmapCamera, String> {
    let mut fields = Fields::new(line);
    let id = fields.next("a camera id")?;
    let name: String = fields.next("a camera model")?;
    let model = ColmapModel::by_name(&name).ok_or_else(|| name.clone());
    let width = fields.next("a width")?;
    let height = fields.next("a height")?;
    let mut params = Vec::new();
    while let Some(word) = fields.word() {
        params.push(parse_number(word).ok_or_else(|| format!("{} is not a number", quoted(word)))?);
    }
    match model {
        Ok(model) if params.len() != model.num_params => {
            Err(format!("{} parameters found, {name} has {}", params.len(), model.num_params))
        }
        model => Ok(ColmapCamera { id, model, width, height, params }),
    }
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

/// Words of an image's line before the name.
const BEFORE_NAME: usize = 9;

/// The name in the line of an image: the rest, since names may contain blanks.
fn name_of(line: &str) -> &str {
    let mut fields = Fields::new(line);
    for _ in 0..BEFORE_NAME {
        fields.word();
    }
    fields.rest.trim()
}

/// Reads `images.txt`.
pub(crate) fn read_images(path: &Path) -> Result<Parts<ColmapImage>> {
    let text = read_lines(path)?;
    let lines = Lines::new(path, &text);
    let mut images = Parts::default();
    let mut data = lines.data().peekable();
    while let Some(line) = data.next() {
        if line.1.trim().is_empty() {
            continue;
        }
        let mut image = image(line.1);
        // Some tools omit the second line of images without keypoints.
        let mut at = line;
        if let Some(point_ids) = data.peek().and_then(|(_, second)| keypoints(second)) {
            data.next();
            image = image.map(|image| ColmapImage { point_ids, ..image });
        } else if let Some(second) = data.next_if(|(_, second)| is_broken_keypoints(second)) {
            at = second;
            image = image.and(Err("no keypoints, expected x, y and the id of a point for each".to_owned()));
        }
        match image {
            Ok(image) => images.good.push(image),
            Err(what) => {
                let broken = lines.broken(at, Some(name_of(line.1)), what)?;
                lines.leave_out(&mut images, Broken { id: id_of(line.1), ..broken })?;
            }
        }
    }
    Ok(images)
}

/// Whether a line that is neither keypoints nor an image is meant as keypoints: it ends in a number, not in a name.
fn is_broken_keypoints(line: &str) -> bool {
    image(line).is_err() && line.split_whitespace().last().is_some_and(|word| parse_number(word).is_some())
}

fn image(line: &str) -> Result<ColmapImage, String> {
    let mut fields = Fields::new(line);
    let id = fields.next("an image id")?;
    let quaternion = fields.array("a quaternion")?;
    let translation = fields.array("a translation")?;
    let camera_id = fields.next("a camera id")?;
    let name = fields.rest.trim().to_owned();
    if name.contains(NO_TEXT) {
        return Err("its name is not UTF-8 text".to_owned());
    }
    Ok(ColmapImage { id, quaternion, translation, camera_id, name, point_ids: Vec::new() })
}

/// Reads `points3D.txt`.
pub(crate) fn read_points(path: &Path) -> Result<Parts<ColmapPoint>> {
    Lines::new(path, &read_lines(path)?).parts(point)
}

fn point(line: &str) -> Result<ColmapPoint, String> {
    let mut fields = Fields::new(line);
    let id = fields.next("a point id")?;
    let position = fields.array("a position")?;
    let mut rgb = [0; 3];
    for channel in &mut rgb {
        *channel = fields.next("a colour from 0 to 255")?;
    }
    Ok(ColmapPoint { id, position, rgb, error_px: fields.number("a reprojection error")? })
}
