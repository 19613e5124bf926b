//! Charts and tables from `results.jsonl`, without running anything: SVG files, tables as CSV and Markdown,
//! and one page with all of it. Lines in, texts out; reading and writing files is the command line's business.

mod compare;
mod curves;
mod figures;
#[cfg(test)]
mod fixtures;
mod forest;
mod html;
mod labels;
mod look;
mod measure;
mod paired;
mod plausible;
mod plot;
mod raw;
mod scale;
mod stats;
mod study;
mod svg;
mod table;
mod tables;
mod unlike;

pub use study::{Clock, Options};

use crate::results::Record;
use crate::{Report, Result};
use html::Part;
use std::collections::HashSet;
use study::Study;

/// Files made of results.
#[derive(Clone, Debug, PartialEq)]
pub struct Output {
    /// Names and contents; the page is the first.
    pub files: Vec<(String, String)>,
    /// The main table, as Markdown.
    pub results_markdown: String,
    /// What the reader must know.
    pub report: Report,
}

/// Makes everything of the lines of one or several files.
///
/// # Errors
/// [`crate::Error::Usage`] if there is no successful run, or no such baseline.
pub fn build(files: Vec<Vec<Record>>, options: &Options) -> Result<Output> {
    let study = Study::new(files, options)?;
    let tables = tables::tables(&study);
    let mut names = HashSet::new();
    let mut svgs: Vec<(String, String)> = Vec::new();
    let mut file = |id: &str, svg: &svg::Svg| {
        let mut name = format!("charts/{id}.svg");
        let mut number = 2;
        while !names.insert(name.clone()) {
            name = format!("charts/{id}-{number}.svg");
            number += 1;
        }
        svgs.push((name, svg.standalone()));
        svg.inline()
    };
    let mut parts = vec![Part::table(&tables[0])];
    for section in figures::sections(&study) {
        let drawn: Vec<String> =
            section.charts.iter().filter_map(|c| Some(file(&c.id, &c.draw()?))).collect();
        if !drawn.is_empty() || !section.note.is_empty() {
            parts.push(Part::section(&section, &drawn));
        }
    }
    let forests: Vec<String> = study.qualities[..2]
        .iter()
        .chain([&study.time])
        .filter_map(|m| Some(file(&format!("paired-{}", m.id).replace('_', "-"), &forest::draw(&study, m)?)))
        .collect();
    if !forests.is_empty() {
        let note = "Coloured where the interval excludes 0, grey where nothing is decided.";
        parts.push(Part::charts("Differences to the baseline", note, &forests));
    }
    parts.extend(tables[1..].iter().map(Part::table));
    let markdown: Vec<String> = tables.iter().map(table::Table::markdown).collect();
    let mut out = vec![
        ("index.html".to_owned(), html::page(&study, &parts)),
        (
            "tables.md".to_owned(),
            format!("{}\n\n{}", table::markdown_text(&html::facts(&study)), markdown.concat()),
        ),
    ];
    out.extend(
        tables.iter().chain(&raw::raw_tables(&study)).map(|t| (format!("tables/{}.csv", t.id), t.csv())),
    );
    out.extend(svgs);
    Ok(Output { files: out, results_markdown: markdown[0].clone(), report: study.report })
}

#[cfg(test)]
mod tests {
    use super::fixtures::records;
    use super::*;

    fn output() -> Output {
        build(vec![records()], &Options::default()).unwrap()
    }

    #[test]
    fn the_page_needs_nothing_from_elsewhere_and_no_name_breaks_out() {
        let output = output();
        let page = &output.files[0].1;
        for forbidden in ["http:", "https:", "<script", "src=", "@import", "url(", "<b>"] {
            assert!(!page.contains(forbidden), "{forbidden}");
        }
        assert!(page.contains("prefers-color-scheme:dark") && page.contains("&lt;b&gt;&amp;|,&quot;"));
        assert_eq!(page.matches("<svg").count(), page.matches("</svg>").count());
        assert_eq!(
            page.matches("<svg").count(),
            output.files.iter().filter(|f| f.0.ends_with(".svg")).count()
        );
    }

    #[test]
    fn files_have_plain_names_that_differ() {
        let output = output();
        let names: HashSet<&str> = output.files.iter().map(|f| f.0.as_str()).collect();
        assert_eq!(names.len(), output.files.len());
        assert!(
            names.iter().all(|n| n.chars().all(|c| c.is_ascii_alphanumeric() || "-./".contains(c))),
            "{names:?}"
        );
        for name in [
            "index.html",
            "tables.md",
            "tables/results.csv",
            "tables/paired.csv",
            "tables/ablation.csv",
            "tables/matched.csv",
            "tables/runs.csv",
            "tables/curves.csv",
            "charts/fox-psnr-cpu-secs.svg",
            "charts/paired-psnr.svg",
        ] {
            assert!(names.contains(name), "{name}: {names:?}");
        }
        assert!(output.results_markdown.starts_with("## Results"));
    }

    #[test]
    fn same_results_same_bytes() {
        assert_eq!(output(), output());
    }

    #[test]
    fn without_a_successful_run_there_is_nothing_to_draw() {
        let mut all = records();
        all.iter_mut().for_each(|r| r.status = crate::results::Status::Failed);
        for files in [vec![], vec![vec![]], vec![all]] {
            let error = build(files, &Options::default()).unwrap_err();
            assert!(error.to_string().contains("no successful run"), "{error}");
        }
    }
}
