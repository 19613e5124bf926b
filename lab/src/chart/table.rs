//! A table as Markdown, CSV, HTML, SVG and text. Names in it may contain markup or formulas.

use super::svg::{Svg, escape, text_width_px};
use litetex_gs::console::columns;

/// Height of a row of a drawing, free space in its cells, and the baseline of its title.
const ROW_PX: f64 = 19.0;
const PADDING_PX: f64 = 8.0;
const TITLE_Y: f64 = 25.0;

/// Colour of a cell, on top of what its text says.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Tone {
    #[default]
    Plain,
    Good,
    Bad,
    Faint,
}

impl Tone {
    fn class(self) -> &'static str {
        match self {
            Self::Plain => "",
            Self::Good => "good",
            Self::Bad => "bad",
            Self::Faint => "faint",
        }
    }
}

/// Text for people, and a value for each of the column's keys.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TableCell {
    pub text: String,
    pub values: Vec<String>,
    pub tone: Tone,
}

impl TableCell {
    /// A cell whose value is its text.
    pub fn name(text: &str) -> Self {
        Self { text: text.to_owned(), values: vec![text.to_owned()], tone: Tone::Plain }
    }

    /// Text for people and exact numbers for programs, empty where there is none.
    pub fn numbers(text: impl Into<String>, numbers: &[Option<f64>]) -> Self {
        let exact = |n: &Option<f64>| n.filter(|x| x.is_finite()).map_or(String::new(), |x| x.to_string());
        Self { text: text.into(), values: numbers.iter().map(exact).collect(), tone: Tone::Plain }
    }

    /// The same cell in a colour.
    pub fn toned(self, tone: Tone) -> Self {
        Self { tone, ..self }
    }
}

/// A column of a table.
#[derive(Clone, Debug, PartialEq)]
pub struct Column {
    /// Heading for people.
    pub name: String,
    /// Names of the CSV columns, one per value of a cell.
    pub keys: Vec<String>,
    /// Numbers are aligned to the right.
    pub is_number: bool,
}

impl Column {
    /// A column of text.
    pub fn names(name: &str, key: &str) -> Self {
        Self { name: name.to_owned(), keys: vec![key.to_owned()], is_number: false }
    }

    /// A column of numbers.
    pub fn numbers(name: impl Into<String>, keys: &[&str]) -> Self {
        Self { name: name.into(), keys: keys.iter().map(|&key| key.to_owned()).collect(), is_number: true }
    }
}

/// A titled table.
#[derive(Clone, Debug, PartialEq)]
pub struct Table {
    /// File name without extension.
    pub id: String,
    pub title: String,
    /// How to read the table.
    pub note: String,
    pub columns: Vec<Column>,
    pub rows: Vec<Vec<TableCell>>,
}

impl Table {
    /// A table with a name for its files, a title and a note on how to read it.
    pub fn new(
        id: &str,
        title: &str,
        note: impl Into<String>,
        columns: Vec<Column>,
        rows: Vec<Vec<TableCell>>,
    ) -> Self {
        Self { id: id.to_owned(), title: title.to_owned(), note: note.into(), columns, rows }
    }

    /// As aligned text for terminals.
    pub fn text(&self) -> String {
        let header: Vec<&str> = self.columns.iter().map(|c| c.name.as_str()).collect();
        let text = |row: &Vec<TableCell>| row.iter().map(|cell| cell.text.clone()).collect();
        let rows: Vec<Vec<String>> = self.rows.iter().map(text).collect();
        format!("{}\n{}\n", columns(&header, &rows), self.note)
    }

    /// As a drawing, with cells in the colours of their tones.
    pub fn svg(&self) -> Svg {
        let widths: Vec<f64> = (0..self.columns.len())
            .map(|c| {
                let cells = self.rows.iter().map(|row| row[c].text.as_str());
                let texts = cells.chain([self.columns[c].name.as_str()]);
                texts.map(text_width_px).fold(0.0, f64::max) + 2.0 * PADDING_PX
            })
            .collect();
        let height = TITLE_Y + ROW_PX * (self.rows.len() as f64 + 2.0);
        let mut svg = Svg::new(widths.iter().sum(), height, &self.title);
        svg.text("lt-text lt-title", (PADDING_PX, TITLE_Y), "start", &self.title);
        let header = self.columns.iter().map(|c| (c.name.as_str(), Tone::Plain)).collect();
        let rows =
            self.rows.iter().map(|row| row.iter().map(|cell| (cell.text.as_str(), cell.tone)).collect());
        let lines: Vec<Vec<(&str, Tone)>> = std::iter::once(header).chain(rows).collect();
        for (i, line) in lines.iter().enumerate() {
            let (mut left, top) = (0.0, TITLE_Y + ROW_PX * (i as f64 + 0.5));
            for (((text, tone), width), column) in line.iter().zip(&widths).zip(&self.columns) {
                let (right, bottom) = (left + width - 1.0, top + ROW_PX - 1.0);
                if *tone != Tone::Plain {
                    let corners = [(left, top), (right, top), (right, bottom), (left, bottom)];
                    svg.polyline(&format!("lt-{}", tone.class()), &corners);
                }
                let (x, anchor) = if column.is_number {
                    (left + 0.5 * width, "middle")
                } else {
                    (left + PADDING_PX, "start")
                };
                let class = if i == 0 { "lt-axis" } else { "lt-text" };
                svg.text(class, (x, top + ROW_PX - 6.0), anchor, text);
                left += width;
            }
        }
        svg
    }

    /// As GitHub's Markdown, with a heading.
    pub fn markdown(&self) -> String {
        let mut out = format!("## {}\n\n", markdown_text(&self.title));
        if !self.note.is_empty() {
            out += &format!("{}\n\n", markdown_text(&self.note));
        }
        if self.rows.is_empty() {
            return out;
        }
        let line = |cells: Vec<String>| format!("| {} |\n", cells.join(" | "));
        out += &line(self.columns.iter().map(|c| markdown_text(&c.name)).collect());
        out +=
            &line(self.columns.iter().map(|c| if c.is_number { "---:" } else { "---" }.to_owned()).collect());
        for row in &self.rows {
            out += &line(row.iter().map(|c| markdown_text(&c.text)).collect());
        }
        out + "\n"
    }

    /// As comma-separated values at full precision.
    pub fn csv(&self) -> String {
        let line = |fields: Vec<String>| fields.join(",") + "\n";
        let mut out = line(self.columns.iter().flat_map(|c| &c.keys).map(|k| csv_field(k)).collect());
        for row in &self.rows {
            out += &line(row.iter().flat_map(|c| &c.values).map(|v| csv_field(v)).collect());
        }
        out
    }

    /// As HTML, without a heading.
    pub fn html(&self) -> String {
        let mut out = String::new();
        if !self.note.is_empty() {
            out += &format!("<p class=\"note\">{}</p>\n", escape(&self.note));
        }
        if self.rows.is_empty() {
            return out;
        }
        let class = |c: &Column, tone: Tone| {
            let names = [if c.is_number { "num" } else { "" }, tone.class()].join(" ");
            if names.trim().is_empty() { String::new() } else { format!(" class=\"{}\"", names.trim()) }
        };
        // The tabindex lets keyboards scroll it.
        out += "<div class=\"table\" tabindex=\"0\"><table>\n<thead><tr>";
        for c in &self.columns {
            out += &format!("<th scope=\"col\"{}>{}</th>", class(c, Tone::Plain), escape(&c.name));
        }
        out += "</tr></thead>\n<tbody>\n";
        for row in &self.rows {
            out += "<tr>";
            for (cell, c) in row.iter().zip(&self.columns) {
                out += &format!("<td{}>{}</td>", class(c, cell.tone), escape(&cell.text));
            }
            out += "</tr>\n";
        }
        out + "</tbody></table></div>\n"
    }
}

/// Escapes text for GitHub's Markdown, including its tables.
pub fn markdown_text(text: &str) -> String {
    let mut out = String::new();
    for c in text.chars() {
        match c {
            '\\' | '`' | '*' | '_' | '[' | ']' | '|' | '~' => out.extend(['\\', c]),
            '<' => out.push_str("&lt;"),
            '>' => out.push_str("&gt;"),
            '&' => out.push_str("&amp;"),
            c if c.is_control() => out.push(' '),
            c => out.push(c),
        }
    }
    out
}

/// A field as in RFC 4180. Text that spreadsheets would take for a formula gets an apostrophe.
fn csv_field(text: &str) -> String {
    let is_formula = text.starts_with(['=', '+', '-', '@', '\t']) && text.parse::<f64>().is_err();
    let text = if is_formula { format!("'{text}") } else { text.to_owned() };
    if text.contains([',', '"', '\n', '\r']) { format!("\"{}\"", text.replace('"', "\"\"")) } else { text }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn table(name: &str) -> Table {
        let columns =
            vec![Column::names("variant", "variant"), Column::numbers("PSNR", &["psnr_mean", "psnr_sd"])];
        let psnr = TableCell::numbers("20.1 ± 0.1", &[Some(20.125), None]).toned(Tone::Good);
        Table::new("t", name, name, columns, vec![vec![TableCell::name(name), psnr]])
    }

    #[test]
    fn names_with_markup_are_escaped() {
        let hostile = table("=1|2,\"<script>`*_\n]");
        let markdown = hostile.markdown();
        assert_eq!(markdown.lines().count(), 8, "{markdown}");
        assert!(markdown.contains("| =1\\|2,\"&lt;script&gt;\\`\\*\\_ \\] | 20.1 ± 0.1 |"), "{markdown}");
        assert_eq!(hostile.csv(), "variant,psnr_mean,psnr_sd\n\"'=1|2,\"\"<script>`*_\n]\",20.125,\n");
        let html = hostile.html();
        assert!(!html.contains("<script") && html.contains("=1|2,&quot;&lt;script&gt;"), "{html}");
        assert!(html.contains("<td class=\"num good\">20.1 ± 0.1</td>"), "{html}");
    }

    #[test]
    fn plain_names_and_numbers_are_unchanged() {
        assert_eq!(csv_field("-0.25"), "-0.25");
        assert_eq!(csv_field("fixed:4"), "fixed:4");
        assert_eq!(markdown_text("300 steps, 2x"), "300 steps, 2x");
        assert_eq!(TableCell::numbers("-", &[Some(f64::NAN), Some(0.1)]).values, ["", "0.1"]);
    }

    #[test]
    fn a_table_without_rows_shows_its_note() {
        let mut empty = table("a");
        empty.rows.clear();
        assert_eq!(empty.markdown(), "## a\n\na\n\n");
        assert_eq!(empty.html(), "<p class=\"note\">a</p>\n");
        assert_eq!(empty.csv(), "variant,psnr_mean,psnr_sd\n");
    }
}
