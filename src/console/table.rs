//! Results for people: short aligned tables. Cells may hold names from files, so that control
//! characters are escaped here.

use crate::text::printable;
use std::fmt;
use std::path::Path;

/// Rows of a name and a value, aligned.
#[derive(Default)]
pub struct Table {
    rows: Vec<(String, String)>,
}

impl Table {
    /// Adds a row.
    pub fn row(&mut self, name: &str, value: impl std::fmt::Display) -> &mut Self {
        self.rows.push((printable(name, &[]).into_owned(), printable(&value.to_string(), &[]).into_owned()));
        self
    }
}

impl fmt::Display for Table {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let width = self.rows.iter().map(|(n, _)| n.chars().count()).max().unwrap_or(0);
        self.rows.iter().try_for_each(|(name, value)| writeln!(f, "{name:width$}  {value}"))
    }
}

/// A path as JSON holds it: characters that are not Unicode are replaced, as in messages.
pub fn path_text(path: &Path) -> String {
    path.display().to_string()
}

/// [`path_text`] for derived serialisation.
///
/// # Errors
/// As the serializer.
pub fn serialize_path<S: serde::Serializer>(path: &Path, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.serialize_str(&path_text(path))
}

/// Rows under a header, columns of numbers aligned to the right and others to the left; nothing if there are no rows.
pub fn columns(header: &[&str], rows: &[Vec<String>]) -> String {
    if rows.is_empty() {
        return String::new();
    }
    let cell = |row: &[String], c: usize| {
        row.get(c).map(|cell| printable(cell, &[]).into_owned()).unwrap_or_default()
    };
    let is_number = |text: &str| match text.strip_prefix(['-', '+']).unwrap_or(text) {
        "" => true,
        digits => digits.starts_with(|c: char| c.is_ascii_digit()),
    };
    let lines = std::iter::once(header.iter().map(|&h| h.to_owned()).collect()).chain(rows.iter().cloned());
    let lines: Vec<Vec<String>> = lines.collect();
    let widths =
        (0..header.len()).map(|c| lines.iter().map(|l| cell(l, c).chars().count()).max().unwrap_or(0));
    let widths: Vec<(usize, bool)> =
        widths.enumerate().map(|(c, width)| (width, rows.iter().all(|r| is_number(&cell(r, c))))).collect();
    let mut text = String::new();
    for line in &lines {
        let mut padded = String::new();
        for (c, &(width, right)) in widths.iter().enumerate() {
            let cell = cell(line, c);
            padded += &if right { format!("{cell:>width$}  ") } else { format!("{cell:<width$}  ") };
        }
        text += padded.trim_end();
        text.push('\n');
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_are_aligned() {
        let rows = [["é", "1.5"], ["long", "-12.0"]].map(|r| r.map(ToOwned::to_owned).into());
        assert_eq!(columns(&["name", "dB"], &rows), "name     dB\né       1.5\nlong  -12.0\n");
        let missing = [["-", "--x"], ["7", ""]].map(|r| r.map(ToOwned::to_owned).into());
        assert_eq!(columns(&["long", "b"], &missing), "long  b\n   -  --x\n   7\n");
        assert_eq!(columns(&["a", "b"], &[vec!["x".to_owned()]]), "a  b\nx\n");
    }
}
