//! Results on standard output: short aligned tables, nothing else.

use std::io::Write;

/// Two columns, aligned.
#[derive(Default)]
pub struct Table {
    rows: Vec<(String, String)>,
}

impl Table {
    /// Adds a row.
    pub fn row(&mut self, name: &str, value: impl std::fmt::Display) -> &mut Self {
        self.rows.push((name.to_owned(), value.to_string()));
        self
    }

    /// Prints the table.
    ///
    /// # Errors
    /// What standard output says; a closed pipe is treated as success further up.
    pub fn print(&self) -> std::io::Result<()> {
        let width = self.rows.iter().map(|(n, _)| n.chars().count()).max().unwrap_or(0);
        let mut out = std::io::stdout().lock();
        for (name, value) in &self.rows {
            writeln!(out, "{name:width$}  {value}")?;
        }
        out.flush()
    }
}

/// Rows of as many cells as there are headings, each column aligned to the right.
pub struct Columns {
    rows: Vec<Vec<String>>,
}

impl Columns {
    /// A table with these headings.
    pub fn new(headings: &[&str]) -> Self {
        Self { rows: vec![headings.iter().map(|&h| h.to_owned()).collect()] }
    }

    /// Adds a row.
    pub fn row(&mut self, cells: Vec<String>) -> &mut Self {
        self.rows.push(cells);
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

/// Prints JSON for machines.
///
/// # Errors
/// What standard output says.
pub fn print_json(value: &impl serde::Serialize) -> std::io::Result<()> {
    let mut out = std::io::stdout().lock();
    serde_json::to_writer_pretty(&mut out, value)?;
    writeln!(out)?;
    out.flush()
}
