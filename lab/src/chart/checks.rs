//! The table of checks: which variant passes what, with the figures, and the share of the decided cases that it passes;
//! and the worst test views.

use super::study::{Study, WorstView};
use super::svg::escape;
use super::table::{Column, Table, TableCell, Tone};
use crate::checks::{Finding, Verdict};
use crate::matrix::SceneEntry;
use crate::results::Record;
use std::fmt::Write;

/// Numbers of cases of a variant.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Score {
    /// Every check passes.
    passed: usize,
    /// Every check passes, or one fails.
    decided: usize,
    /// No check fails and some have no verdict.
    undecided: usize,
}

impl Score {
    fn add(&mut self, verdicts: &[Verdict]) {
        let has = |verdict| verdicts.contains(&verdict);
        match (has(Verdict::Fail), has(Verdict::Unknown), has(Verdict::Pass)) {
            (true, ..) => self.decided += 1,
            (false, true, _) => self.undecided += 1,
            (false, false, true) => (self.passed, self.decided) = (self.passed + 1, self.decided + 1),
            // Figures that are only shown.
            (false, false, false) => {}
        }
    }
}

/// All findings, and the share of the decided cases that each variant passes; `None` without a check.
pub fn table(study: &Study, cases: &[SceneEntry]) -> Option<Table> {
    let records: Vec<Record> = study.runs.iter().chain(&study.failed).cloned().collect();
    let mut rows = Vec::new();
    let mut scores = vec![Score::default(); study.variants.len()];
    for case in cases {
        let mut found = vec![Vec::new(); study.variants.len()];
        for check in &case.checks {
            let mut row = vec![TableCell::name(&case.name), TableCell::name(&check.title())];
            for (variant, verdicts) in study.variants.iter().zip(&mut found) {
                let finding = check.find(&records, &case.name, variant);
                verdicts.push(finding.verdict);
                row.push(cell(&finding));
            }
            rows.push(row);
        }
        scores.iter_mut().zip(&found).for_each(|(score, verdicts)| score.add(verdicts));
    }
    let mut columns = vec![Column::names("scene", "scene"), Column::names("Check", "check")];
    let mut shares = Vec::new();
    for (variant, Score { passed, decided, undecided }) in study.variants.iter().zip(&scores) {
        let name = format!("{variant}, {passed} / {decided}");
        columns.push(Column::numbers(name, &[variant, &format!("{variant}_verdict")]));
        let share = 100.0 * *passed as f64 / (*decided).max(1) as f64;
        let rest =
            if *undecided > 0 { format!(", {undecided} more without a verdict") } else { String::new() };
        shares.push(format!("{variant} {passed} of {decided} ({share:.0} %{rest})"));
    }
    let note = format!(
        "Cases of which every check passes, of those with a verdict: {}. Figures are means over the seeds.",
        shares.join(", ")
    );
    (!rows.is_empty()).then(|| Table::new("checks", "Checks", note, columns, rows))
}

fn cell(found: &Finding) -> TableCell {
    let value = found.value.map(|v| format!("{v:.3}"));
    let text = match (value, found.remark.as_str()) {
        (Some(value), "") => value,
        (Some(value), remark) => format!("{value} ({})", remark.trim_start_matches("times ")),
        (None, remark) => remark.to_owned(),
    };
    let tone = match found.verdict {
        Verdict::Pass => Tone::Good,
        Verdict::Fail => Tone::Bad,
        Verdict::Shown => Tone::Plain,
        Verdict::Unknown => Tone::Faint,
    };
    let exact = found.value.map_or(String::new(), |v| v.to_string());
    TableCell { text, values: vec![exact, format!("{:?}", found.verdict).to_lowercase()], tone }
}

/// HTML with the worst test view of each case and variant: render left, photo right.
pub fn gallery(cases: &[SceneEntry], variants: &[String], views: &[WorstView]) -> String {
    let mut out = String::new();
    for case in cases {
        let of = |variant: &String| views.iter().find(|v| v.scene == case.name && v.variant == *variant);
        let shown: Vec<&WorstView> = variants.iter().filter_map(of).collect();
        if shown.is_empty() {
            continue;
        }
        out += "<div class=\"views\">";
        for WorstView { scene, variant, uri } in shown {
            let _ = write!(
                out,
                "<figure><svg viewBox=\"0 0 388 144\"><image width=\"388\" height=\"144\" href=\"{}\"/></svg>\
                 <figcaption class=\"note\">{}: {}</figcaption></figure>",
                escape(uri),
                escape(scene),
                escape(variant)
            );
        }
        out += "</div>\n";
    }
    out
}

#[cfg(test)]
mod tests {
    use super::super::fixtures::records;
    use super::super::study::Options;
    use super::*;
    use crate::checks::Check;

    fn check(measure: &str, at_least: f64) -> Check {
        Check { measure: measure.to_owned(), at_least: Some(at_least), ..Check::default() }
    }

    fn cases() -> Vec<SceneEntry> {
        let psnr = |at_least| check("/quality/psnr", at_least);
        let case = |name: &str, checks| SceneEntry { name: name.to_owned(), checks, ..SceneEntry::default() };
        vec![
            case("fox", vec![psnr(25.4), psnr(20.0)]),
            case("<b>&|,\"", vec![psnr(20.0)]),
            case("free", vec![]),
        ]
    }

    #[test]
    fn cells_tell_what_passes_and_scores_count_whole_cases() {
        let study = Study::new(vec![records()], &Options::default()).unwrap();
        let mut cases = cases();
        let found = table(&study, &cases).unwrap();
        // "fox" has a mean of 25.18 with "plain" and of 25.69 with "=textured".
        assert!(found.note.contains("plain 1 of 2 (50 %), =textured 2 of 2 (100 %)"), "{}", found.note);
        let svg = found.svg().standalone();
        assert_eq!((svg.matches("\"lt-good\"").count(), svg.matches("\"lt-bad\"").count()), (5, 1));
        assert!(!svg.contains("<b>&|") && svg.contains(">plain, 1 / 2<"), "{svg}");
        let csv = found.csv();
        assert!(csv.contains("fail") && csv.lines().count() == 4, "{csv}");
        assert!(table(&study, &cases[2..]).is_none());
        // A failed check decides a case whatever else is in it; without a verdict a case counts neither way.
        cases.iter_mut().for_each(|case| case.checks.push(check("/no/figure", 1.0)));
        let note = table(&study, &cases).unwrap().note;
        assert!(note.contains("plain 0 of 1 (0 %, 2 more without a verdict)"), "{note}");
        assert!(note.contains("=textured 0 of 0 (0 %, 3 more"), "{note}");
    }

    #[test]
    fn the_gallery_shows_the_views_that_exist() {
        let [scene, variant, uri] = ["fox", "plain", "data:image/jpeg;base64,AA=="].map(ToOwned::to_owned);
        let view = WorstView { scene, variant: variant.clone(), uri };
        let variants = [variant, "other".to_owned()];
        assert_eq!(gallery(&cases(), &variants, &[view]).matches("<image").count(), 1);
        assert!(gallery(&cases(), &variants, &[]).is_empty());
    }
}
