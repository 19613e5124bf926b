//! Results on standard output: short aligned tables and JSON. Cells may hold names from files, so that control
//! characters are escaped here.

use crate::text::printable;
use std::io::Write;
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

    /// Prints the table.
    ///
    /// # Errors
    /// What writing reports; a closed pipe counts as success in `main`.
    pub fn print(&self) -> std::io::Result<()> {
        let width = self.rows.iter().map(|(n, _)| n.chars().count()).max().unwrap_or(0);
        let mut out = std::io::stdout().lock();
        for (name, value) in &self.rows {
            writeln!(out, "{name:width$}  {value}")?;
        }
        out.flush()
    }
}

/// Rows with one cell for each heading, all aligned to the right.
pub struct Columns {
    rows: Vec<Vec<String>>,
}

impl Columns {
    /// An empty table with these headings.
    pub fn new(headings: &[&str]) -> Self {
        Self { rows: vec![headings.iter().map(|&h| h.to_owned()).collect()] }
    }

    /// Adds a row.
    pub fn row(&mut self, cells: Vec<String>) -> &mut Self {
        self.rows.push(cells.iter().map(|cell| printable(cell, &[]).into_owned()).collect());
        self
    }

    /// Prints the table.
    ///
    /// # Errors
    /// As [`Table::print`].
    pub fn print(&self) -> std::io::Result<()> {
        let mut widths = vec![0; self.rows[0].len()];
        for row in &self.rows {
            for (width, cell) in widths.iter_mut().zip(row) {
                *width = cell.chars().count().max(*width);
            }
        }
        let mut out = std::io::stdout().lock();
        for row in &self.rows {
            let cells = row.iter().zip(&widths).map(|(cell, &width)| format!("{cell:>width$}"));
            writeln!(out, "{}", cells.collect::<Vec<_>>().join("  "))?;
        }
        out.flush()
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

/// Prints a value as JSON.
///
/// # Errors
/// What writing reports.
pub fn print_json(value: &impl serde::Serialize) -> std::io::Result<()> {
    let mut out = std::io::stdout().lock();
    serde_json::to_writer_pretty(&mut out, value)?;
    writeln!(out)?;
    out.flush()
}

/// Prints rows under a header with numbers aligned to the right; nothing if there are no rows.
///
/// # Errors
/// What writing reports.
pub fn print_columns(header: &[&str], rows: &[Vec<String>]) -> std::io::Result<()> {
    if rows.is_empty() {
        return Ok(());
    }
    let mut out = std::io::stdout().lock();
    out.write_all(columns(header, rows).as_bytes())?;
    out.flush()
}

/// Aligns columns of numbers to the right and others to the left.
fn columns(header: &[&str], rows: &[Vec<String>]) -> String {
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
