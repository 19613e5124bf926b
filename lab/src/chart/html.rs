//! The page: all tables and charts in one self-contained HTML file for light and dark screens.

use super::study::{Study, device};
use super::svg::{escape, style};
use super::table::Table;
use crate::results::Record;
use std::collections::BTreeSet;
use std::fmt::Write;

/// Style sheet of the page; that of the charts is `svg::style`.
const CSS: &str = "\
:root{color-scheme:light dark;--bg:#fff;--text:#1c2024;--second:#5c6570;--rule:#e4e7eb;--zebra:#f6f7f9;\
--good:#0a6b3d;--bad:#b0203a;--link:#0b62a4}\
@media(prefers-color-scheme:dark){:root{--bg:#15181c;--text:#e8eaed;--second:#a3abb5;--rule:#2b3037;\
--zebra:#1b1f24;--good:#4fd29a;--bad:#ff7a8c;--link:#5aa9e6}}\
*{box-sizing:border-box}\
body{margin:0 auto;max-width:1640px;padding:28px 32px 64px;background:var(--bg);color:var(--text);\
font:15px/1.5 system-ui,-apple-system,\"Segoe UI\",Roboto,\"Helvetica Neue\",Arial,sans-serif}\
h1{font-size:26px;margin:0 0 4px}h2{font-size:19px;margin:44px 0 8px;padding-top:8px;border-top:1px solid var(--rule)}\
p{margin:6px 0;max-width:100ch}.note,.facts{color:var(--second)}a{color:var(--link)}\
nav{display:flex;flex-wrap:wrap;gap:4px 18px;margin:14px 0}\
.warning{border-left:3px solid var(--bad);padding:4px 12px;margin:8px 0}\
.charts{display:grid;grid-template-columns:repeat(auto-fit,minmax(min(560px,100%),1fr));gap:26px}\
figure{margin:0;min-width:0;max-width:900px}figure svg{width:100%;height:auto;display:block}\
.views{display:flex;flex-wrap:wrap;gap:10px;margin:10px 0}.views figure{width:388px}\
.table{overflow-x:auto;margin:12px 0}\
.table::-webkit-scrollbar{height:11px;background:var(--zebra)}\
.table::-webkit-scrollbar-thumb{background:var(--second);border-radius:5px}\
table{border-collapse:collapse;font-size:12px;font-variant-numeric:tabular-nums}\
th,td{padding:4px 6px;text-align:left;white-space:nowrap;border-bottom:1px solid var(--rule)}\
th{font-weight:600;color:var(--second);border-bottom-width:2px;white-space:normal;vertical-align:bottom}\
tbody tr:nth-child(even){background:var(--zebra)}\
td:last-child:not(.num){white-space:normal;min-width:16ch}.num{text-align:right}.good{color:var(--good);font-weight:600}\
.bad{color:var(--bad);font-weight:600}.faint{color:var(--second)}\
footer{margin-top:48px;color:var(--second);font-size:13px}";

/// A section of the page.
pub struct Part {
    pub title: String,
    /// HTML below the heading.
    pub body: String,
}

impl Part {
    /// A section with one table.
    pub fn table(table: &Table) -> Self {
        Self { title: table.title.clone(), body: table.html() }
    }

    /// A section with charts as inline SVG.
    pub fn charts(title: &str, note: &str, drawn: &[String]) -> Self {
        let mut body = format!("<p class=\"note\">{}</p>\n", escape(note));
        if !drawn.is_empty() {
            let figures: Vec<String> = drawn.iter().map(|svg| format!("<figure>{svg}</figure>")).collect();
            let _ = writeln!(body, "<div class=\"charts\">\n{}\n</div>", figures.join("\n"));
        }
        Self { title: title.to_owned(), body }
    }
}

/// Assembles the page.
pub fn page(study: &Study, parts: &[Part]) -> String {
    let title = format!("Results: {}", study.scenes.join(", "));
    let mut out = format!(
        "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
         <meta name=\"viewport\" content=\"width=device-width,initial-scale=1\">\n<title>{}</title>\n\
         <style>{CSS}{}</style>\n</head>\n<body>\n<h1>{}</h1>\n<p class=\"facts\">{}</p>\n",
        escape(&title),
        style(),
        escape(&title),
        escape(&facts(study))
    );
    for warning in &study.report.warnings {
        let _ = writeln!(out, "<p class=\"warning\">{}</p>", escape(&warning.message));
    }
    out += "<nav>";
    for (i, part) in parts.iter().enumerate() {
        let _ = write!(out, "<a href=\"#part-{i}\">{}</a>", escape(&part.title));
    }
    out += "</nav>\n";
    for (i, part) in parts.iter().enumerate() {
        let _ = writeln!(
            out,
            "<section id=\"part-{i}\">\n<h2>{}</h2>\n{}</section>",
            escape(&part.title),
            part.body
        );
    }
    let _ = writeln!(
        out,
        "<footer>litetex {} · hover over points of charts to see their values</footer>\n</body>\n</html>",
        env!("CARGO_PKG_VERSION")
    );
    out
}

/// One line about what was run, on which machine and when.
pub fn facts(study: &Study) -> String {
    let distinct = |of: &dyn Fn(&Record) -> String| {
        let all: BTreeSet<String> = study.runs.iter().map(of).filter(|s| !s.is_empty()).collect();
        all.into_iter().collect::<Vec<_>>().join("; ")
    };
    let device = |r: &Record| {
        let about = r.value("/device/description").and_then(|s| s.as_str()).unwrap_or("");
        format!("{} {about}", device(r)).trim().to_owned()
    };
    let machine = |r: &Record| {
        let memory = r.hardware.memory_bytes.map(|b| format!(", {:.0} GiB", b as f64 / 1_073_741_824.0));
        format!("{} ({} cores{}), {}", r.hardware.cpu, r.cores, memory.unwrap_or_default(), r.hardware.os)
    };
    let seeds: BTreeSet<u64> = study.runs.iter().map(|r| r.seed).collect();
    let seeds: Vec<String> = seeds.iter().map(u64::to_string).collect();
    let failed = match study.failed.len() {
        0 => String::new(),
        n => format!(", {n} failed"),
    };
    format!(
        "{} runs{failed} · variants {} · baseline {} · budgets {} · seeds {} · device {} · {} · version {} · {}",
        study.runs.len(),
        study.variants.join(", "),
        study.baseline,
        study.budgets.join(", "),
        seeds.join(", "),
        distinct(&device),
        distinct(&machine),
        distinct(&|r| format!("{} {}", r.version, r.build).trim().to_owned()),
        distinct(&|r| r.utc.get(..10).unwrap_or_default().to_owned()),
    )
}
