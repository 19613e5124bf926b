//! Charts and tables of results: SVG files, tables as CSV and Markdown, and one page with all of it. Produces the
//! contents of the files; the command line writes them.

mod checks;
mod compare;
#[cfg(test)]
pub(crate) mod fixtures;
mod html;
mod measure;
mod mismatch;
pub mod plot;
mod scale;
mod sections;
mod study;
mod svg;
mod table;
mod tables;

pub use study::{Clock, Options, WorstView};

/// The page, which has all charts and tables.
pub const PAGE: &str = "index.html";
/// All tables as Markdown.
const TABLES: &str = "tables.md";
/// List of the files written, one per line: only these may be replaced later.
pub const MANIFEST: &str = ".chart-files";

use crate::matrix::SceneEntry;
use crate::results::Record;
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
    /// What [`summary`] returns.
    pub summary: String,
    /// Warnings for the reader, which are on the page too.
    pub report: Report,
}

/// Means over the seeds, and what the runs make of the checks of these scenes if there are any, as text.
///
/// # Errors
/// [`litetex_gs::Error::Usage`] if no run succeeded.
pub fn summary(records: Vec<Record>, cases: &[SceneEntry]) -> Result<String> {
    Ok(summary_of(&Study::new(vec![records], &Options::default())?, cases))
}

fn summary_of(study: &Study, cases: &[SceneEntry]) -> String {
    let checks = checks::table(study, cases).map_or(String::new(), |checks| checks.text());
    tables::results(study, &[]).text() + &checks
}

/// Makes all charts and tables of the lines of one or several files.
///
/// # Errors
/// [`litetex_gs::Error::Usage`] if no run succeeded, or no variant is called like the baseline.
pub fn build(files: Vec<Vec<Record>>, options: &Options) -> Result<Output> {
    let study = Study::new(files, options)?;
    let mut tables = tables::tables(&study);
    let mut names = HashSet::new();
    let mut svgs: Vec<(String, String)> = Vec::new();
    let mut file = |id: &str, svg: &svg::Svg| {
        svgs.push((format!("charts/{}.svg", sections::unused(id, &mut names)), svg.standalone()));
        svg.inline()
    };
    let mut parts = Vec::new();
    let checks = checks::table(&study, &options.cases);
    if let Some(checks) = &checks {
        parts.push(Part::charts("Checks", &checks.note, &[file("checks", &checks.svg())]));
        let gallery = checks::gallery(&options.cases, &study.variants, &options.worst_views);
        if !gallery.is_empty() {
            let body = format!("<p class=\"note\">Render left, photo right.</p>\n{gallery}");
            parts.push(Part { title: "Worst test views".to_owned(), body });
        }
    }
    parts.push(Part::table(&tables[0]));
    for section in sections::sections(&study) {
        let drawn: Vec<String> =
            section.charts.iter().filter_map(|c| Some(file(&c.id, &c.draw()?))).collect();
        parts.push(Part::charts(&section.title, section.note.trim_end(), &drawn));
    }
    parts.extend(tables[1..].iter().map(Part::table));
    tables.extend(checks);
    let markdown: String = tables.iter().map(table::Table::markdown).collect();
    let mut out = vec![
        (PAGE.to_owned(), html::page(&study, &parts)),
        (TABLES.to_owned(), format!("{}\n\n{markdown}", table::markdown_text(&html::facts(&study)))),
    ];
    tables.extend(tables::raw_tables(&study));
    out.extend(tables.iter().map(|t| (format!("tables/{}.csv", t.id), t.csv())));
    out.extend(svgs);
    let names: String = out.iter().map(|(name, _)| format!("{name}\n")).collect();
    out.insert(0, (MANIFEST.to_owned(), format!("{MANIFEST}\n{names}")));
    Ok(Output { files: out, summary: summary_of(&study, &options.cases), report: study.report })
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
            "tables/runs.csv",
            "tables/curves.csv",
            "charts/fox-psnr-cpu-secs.svg",
            "charts/paired-psnr.svg",
        ] {
            assert!(names.contains(name), "{name}: {names:?}");
        }
        assert!(output.summary.starts_with("scene "), "{}", output.summary);
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
