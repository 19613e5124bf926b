//! Charts and tables of results: SVG files, tables as CSV and Markdown, and one page with all of it. Produces the
//! contents of the files; the command line writes them.

mod cases;
mod cells;
mod compare;
mod curves;
mod figures;
#[cfg(test)]
pub(crate) mod fixtures;
mod forest;
mod heat;
mod html;
mod labels;
mod legend;
mod look;
mod measure;
mod merge;
mod mismatch;
mod paired;
mod parts;
mod plausible;
pub mod plot;
mod raw;
mod scale;
mod section;
mod series;
mod stats;
mod study;
mod svg;
mod table;
mod tables;

pub use cases::{Case, WorstView};
pub use study::{Clock, Options};

/// The page, which has all charts and tables.
pub const PAGE: &str = "index.html";
/// All tables as Markdown.
const TABLES: &str = "tables.md";
/// List of the files written, one per line: only these may be replaced later.
pub const MANIFEST: &str = ".chart-files";

use crate::results::Record;
use heat::HeatMap;
use html::Part;
use litetex_gs::{Report, Result};
use std::collections::HashSet;
use study::Study;

/// The files made of results.
#[derive(Clone, Debug, PartialEq)]
pub struct Output {
    /// Relative paths with forward slashes, and contents; the manifest comes first, so that an interrupted writer
    /// leaves nothing unlisted.
    pub files: Vec<(String, String)>,
    /// The main table as Markdown, and that of the checks if there are any.
    pub results_markdown: String,
    /// Warnings for the reader, which are on the page too.
    pub report: Report,
}

/// What the runs make of the checks, as a table in Markdown; empty without checks.
///
/// # Errors
/// [`litetex_gs::Error::Usage`] if no run succeeded.
pub fn checks_markdown(records: Vec<Record>, cases: Vec<Case>) -> Result<String> {
    let options = Options { cases, ..Options::default() };
    let study = Study::new(vec![records], &options)?;
    let heat = HeatMap::new(&study, &options.cases);
    Ok(heat.map_or(String::new(), |heat| heat.table().markdown()))
}

/// Makes all charts and tables of the lines of one or several files.
///
/// # Errors
/// [`litetex_gs::Error::Usage`] if no run succeeded, or no variant is called like the baseline.
pub fn build(files: Vec<Vec<Record>>, options: &Options) -> Result<Output> {
    let study = Study::new(files, options)?;
    let heat = HeatMap::new(&study, &options.cases);
    let mut tables = tables::tables(&study);
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
    if let Some(heat) = &heat {
        parts.insert(0, Part::charts("Checks", &heat.note(), &[file("checks", &heat.draw())]));
        let gallery = heat::gallery(&options.cases, &study.variants, &options.worst_views);
        if !gallery.is_empty() {
            let body = format!("<p class=\"note\">Render left, photo right.</p>\n{gallery}");
            parts.insert(1, Part { title: "Worst test views".to_owned(), body });
        }
    }
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
        let note = "Coloured where the interval excludes 0, grey where it does not.";
        parts.push(Part::charts("Differences to the baseline", note, &forests));
    }
    parts.extend(tables[1..].iter().map(Part::table));
    let checks = heat.map(|heat| heat.table());
    let checks_markdown = checks.as_ref().map_or(String::new(), table::Table::markdown);
    tables.extend(checks);
    let markdown: Vec<String> = tables.iter().map(table::Table::markdown).collect();
    let mut out = vec![
        (PAGE.to_owned(), html::page(&study, &parts)),
        (
            TABLES.to_owned(),
            format!("{}\n\n{}", table::markdown_text(&html::facts(&study)), markdown.concat()),
        ),
    ];
    out.extend(
        tables.iter().chain(&raw::raw_tables(&study)).map(|t| (format!("tables/{}.csv", t.id), t.csv())),
    );
    out.extend(svgs);
    let names: String = out.iter().map(|(name, _)| format!("{name}\n")).collect();
    out.insert(0, (MANIFEST.to_owned(), format!("{MANIFEST}\n{names}")));
    Ok(Output {
        files: out,
        results_markdown: format!("{}{checks_markdown}", markdown[0]),
        report: study.report,
    })
}

/// The files listed in a manifest. Paths that [`build`] would never write are ignored: the file may be damaged, and
/// nothing outside its folder must be touched.
pub fn manifest_entries(text: &str) -> Vec<String> {
    let is_plain = |part: &str| {
        !part.is_empty()
            && part != ".."
            && part.chars().all(|c| c.is_ascii_alphanumeric() || "-.".contains(c))
    };
    let is_ours = |name: &&str| match name.split_once('/') {
        None => [PAGE, MANIFEST, TABLES].contains(name),
        Some((folder, file)) => ["charts", "tables"].contains(&folder) && is_plain(file),
    };
    text.lines().filter(is_ours).map(ToOwned::to_owned).collect()
}

#[cfg(test)]
mod tests {
    use super::fixtures::records;
    use super::*;

    fn output() -> Output {
        build(vec![records()], &Options::default()).unwrap()
    }

    #[test]
    fn the_page_is_self_contained_and_names_are_escaped() {
        let output = output();
        let page = &output.files.iter().find(|f| f.0 == PAGE).unwrap().1;
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
    fn file_names_are_plain_and_distinct() {
        let output = output();
        let names: HashSet<&str> = output.files.iter().map(|f| f.0.as_str()).collect();
        assert_eq!(names.len(), output.files.len());
        assert!(
            names.iter().all(|n| n.chars().all(|c| c.is_ascii_alphanumeric() || "-./".contains(c))),
            "{names:?}"
        );
        for name in [
            PAGE,
            TABLES,
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
    fn the_manifest_lists_all_files_and_foreign_paths_in_it_are_ignored() {
        let output = output();
        let names: Vec<&str> = output.files.iter().map(|f| f.0.as_str()).collect();
        assert_eq!(manifest_entries(&output.files[0].1), names);
        let hostile =
            "../index.html\n/etc/passwd\ncharts/../x\ncharts/..\nnotes.txt\ncharts/\ntables/a b\n\n";
        assert_eq!(manifest_entries(hostile), Vec::<String>::new());
        assert_eq!(
            manifest_entries("charts/fox-psnr.svg\nindex.html"),
            ["charts/fox-psnr.svg", "index.html"]
        );
    }

    #[test]
    fn equal_results_give_equal_bytes() {
        assert_eq!(output(), output());
    }

    #[test]
    fn without_a_successful_run_there_is_nothing_to_chart() {
        let mut all = records();
        all.iter_mut().for_each(|r| r.status = crate::results::Status::Failed);
        for files in [vec![], vec![vec![]], vec![all]] {
            let error = build(files, &Options::default()).unwrap_err();
            assert!(error.to_string().contains("no successful run"), "{error}");
        }
    }
}
