//! The heat map of checks: which variant passes what, with the figures, and the share of the decided cases that it passes.

use super::cases::{Case, WorstView};
use super::study::Study;
use super::svg::{Anchor, Svg, TITLE_PX, escape, shortened};
use super::table::{Column, Table, TableCell, Tone};
use crate::checks::{Check, Finding, Verdict};
use crate::matrix::{Matrix, SceneEntry};
use crate::results::Record;
use std::fmt::Write;

const ROW_PX: f64 = 19.0;
const CELL_PX: f64 = 104.0;
const SCENE_PX: f64 = 170.0;
const CHECK_PX: f64 = 300.0;
const TOP_PX: f64 = 62.0;

/// A row of the heat map: a check with a finding for each variant.
struct Row<'a> {
    scene: &'a str,
    check: &'a Check,
    findings: Vec<Finding>,
}

/// Numbers of cases of a variant.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Score {
    /// Every check passes.
    passed: usize,
    /// A check fails.
    failed: usize,
    /// No check fails and some have no verdict.
    undecided: usize,
}

impl Score {
    fn add(&mut self, verdicts: &[Verdict]) {
        let count = if verdicts.contains(&Verdict::Fail) {
            &mut self.failed
        } else if verdicts.contains(&Verdict::Unknown) {
            &mut self.undecided
        } else {
            &mut self.passed
        };
        *count += 1;
    }

    fn decided(&self) -> usize {
        self.passed + self.failed
    }
}

impl Case {
    /// The checks of the scenes of a matrix.
    pub fn all(matrix: &Matrix) -> Vec<Self> {
        let case = |s: &SceneEntry| Self { scene: s.name.clone(), checks: s.checks.clone() };
        matrix.scenes.iter().map(case).collect()
    }
}

/// All findings, and the share of the decided cases that each variant passes.
pub struct HeatMap<'a> {
    variants: &'a [String],
    rows: Vec<Row<'a>>,
    /// By variant.
    scores: Vec<Score>,
}

impl<'a> HeatMap<'a> {
    /// `None` without a check.
    pub fn new(study: &'a Study, cases: &'a [Case]) -> Option<Self> {
        let records: Vec<Record> = study.runs.iter().chain(&study.failed).cloned().collect();
        let mut rows = Vec::new();
        let mut scores = vec![Score::default(); study.variants.len()];
        for case in cases.iter().filter(|c| !c.checks.is_empty()) {
            let from = rows.len();
            rows.extend(case.checks.iter().map(|check| Row {
                scene: &case.scene,
                check,
                findings: study.variants.iter().map(|v| check.find(&records, &case.scene, v)).collect(),
            }));
            for (i, score) in scores.iter_mut().enumerate() {
                let verdicts = rows[from..].iter().map(|row: &Row<'_>| row.findings[i].verdict);
                let verdicts: Vec<Verdict> = verdicts.filter(|verdict| *verdict != Verdict::Shown).collect();
                if !verdicts.is_empty() {
                    score.add(&verdicts);
                }
            }
        }
        (!rows.is_empty()).then_some(Self { variants: &study.variants, rows, scores })
    }

    /// One line: the robustness scores.
    pub fn note(&self) -> String {
        let scores = self.variants.iter().zip(&self.scores).map(|(variant, score)| {
            let (passed, decided) = (score.passed, score.decided());
            let share = 100.0 * passed as f64 / decided.max(1) as f64;
            let undecided = match score.undecided {
                0 => String::new(),
                undecided => format!(", {undecided} more without a verdict"),
            };
            format!("{variant} {passed} of {decided} ({share:.0} %{undecided})")
        });
        format!(
            "Cases of which every check passes, of those with a verdict: {}. Figures are means over the seeds.",
            scores.collect::<Vec<_>>().join(", ")
        )
    }

    /// The findings as a table.
    pub fn table(&self) -> Table {
        let mut columns = vec![Column::names("scene", "scene"), Column::names("Check", "check")];
        for variant in self.variants {
            columns.push(Column::numbers(variant, &[variant.clone(), format!("{variant}_verdict")]));
        }
        let rows = self.rows.iter().map(|row| {
            let cells = row.findings.iter().map(|found| {
                let exact = found.value.map_or(String::new(), |v| v.to_string());
                let verdict = format!("{:?}", found.verdict).to_lowercase();
                TableCell { text: text(found), values: vec![exact, verdict], tone: tone(found.verdict) }
            });
            [TableCell::name(row.scene), TableCell::name(&row.check.title())]
                .into_iter()
                .chain(cells)
                .collect()
        });
        Table {
            id: "checks".to_owned(),
            title: "Checks".to_owned(),
            note: self.note(),
            columns,
            rows: rows.collect(),
        }
    }

    /// The findings as coloured cells.
    pub fn draw(&self) -> Svg {
        let left = SCENE_PX + CHECK_PX;
        let width = left + CELL_PX * self.variants.len() as f64 + 8.0;
        let height = TOP_PX + ROW_PX * self.rows.len() as f64 + 8.0;
        let mut svg = Svg::new(width, height, "Checks by scene and variant");
        svg.text(
            "lt-text lt-title",
            (8.0, 10.0 + TITLE_PX),
            Anchor::Start,
            "What each variant withstands",
            None,
        );
        for (i, (variant, score)) in self.variants.iter().zip(&self.scores).enumerate() {
            let x = left + CELL_PX * (i as f64 + 0.5);
            let name = shortened(variant, CELL_PX - 8.0, 12.0);
            let heading = format!("{} / {}", score.passed, score.decided());
            svg.text("lt-text", (x, TOP_PX - 24.0), Anchor::Middle, &name, Some(variant));
            svg.text("lt-axis", (x, TOP_PX - 8.0), Anchor::Middle, &heading, None);
        }
        let mut last = "";
        for (k, row) in self.rows.iter().enumerate() {
            let top = TOP_PX + ROW_PX * k as f64;
            let base = top + ROW_PX - 5.5;
            if row.scene != last {
                svg.line("lt-grid", (8.0, top), (width - 8.0, top));
                let name = shortened(row.scene, SCENE_PX - 16.0, 12.0);
                svg.text("lt-text", (8.0, base), Anchor::Start, &name, Some(row.scene));
                last = row.scene;
            }
            let title = row.check.title();
            let shown = shortened(&title, CHECK_PX - 8.0, 12.0);
            svg.text("lt-axis", (SCENE_PX, base), Anchor::Start, &shown, Some(&title));
            for (i, found) in row.findings.iter().enumerate() {
                let (x0, x1) = (left + CELL_PX * i as f64 + 1.0, left + CELL_PX * (i + 1) as f64 - 1.0);
                let (y0, y1) = (top + 1.0, top + ROW_PX - 1.0);
                svg.polyline(class(found.verdict), &[(x0, y0), (x1, y0), (x1, y1), (x0, y1)], true);
                let hover = format!("{}, {}: {title}: {}", row.scene, self.variants[i], text(found));
                svg.text("lt-text", (0.5 * (x0 + x1), base), Anchor::Middle, &text(found), Some(&hover));
            }
        }
        svg
    }
}

/// HTML with the worst test view of each case and variant: render left, photo right.
pub fn gallery(cases: &[Case], variants: &[String], views: &[WorstView]) -> String {
    let mut out = String::new();
    for case in cases {
        let mut cells = String::new();
        for variant in variants {
            let Some(view) = views.iter().find(|v| v.scene == case.scene && v.variant == *variant) else {
                continue;
            };
            let _ = write!(
                cells,
                "<figure><svg viewBox=\"0 0 388 144\"><image width=\"388\" height=\"144\" href=\"{}\"/></svg>\
                 <figcaption class=\"note\">{}: {}</figcaption></figure>",
                escape(&view.uri),
                escape(&case.scene),
                escape(variant)
            );
        }
        if !cells.is_empty() {
            let _ = writeln!(out, "<div class=\"views\">{cells}</div>");
        }
    }
    out
}

fn text(found: &Finding) -> String {
    let value = found.value.map(|v| format!("{v:.3}"));
    match (value, found.remark.as_str()) {
        (Some(value), "") => value,
        (Some(value), remark) => format!("{value} ({})", remark.trim_start_matches("times ")),
        (None, remark) => remark.to_owned(),
    }
}

fn tone(verdict: Verdict) -> Tone {
    match verdict {
        Verdict::Pass => Tone::Good,
        Verdict::Fail => Tone::Bad,
        Verdict::Shown => Tone::Plain,
        Verdict::Unknown => Tone::Faint,
    }
}

fn class(verdict: Verdict) -> &'static str {
    match verdict {
        Verdict::Pass => "lt-pass",
        Verdict::Fail => "lt-fail",
        Verdict::Shown => "lt-shown",
        Verdict::Unknown => "lt-unknown",
    }
}

#[cfg(test)]
mod tests {
    use super::super::fixtures::records;
    use super::super::study::Options;
    use super::*;

    fn cases() -> Vec<Case> {
        let check = |at_least| Check {
            measure: "/quality/psnr".to_owned(),
            at_least: Some(at_least),
            ..Check::default()
        };
        vec![
            Case { scene: "fox".to_owned(), checks: vec![check(25.4), check(20.0)] },
            Case { scene: "<b>&|,\"".to_owned(), checks: vec![check(20.0)] },
            Case { scene: "free".to_owned(), checks: vec![] },
        ]
    }

    #[test]
    fn cells_tell_what_passes_and_scores_count_whole_cases() {
        let study = Study::new(vec![records()], &Options::default()).unwrap();
        let cases = cases();
        let map = HeatMap::new(&study, &cases).unwrap();
        // "fox" has a mean of 25.18 with "plain" and of 25.69 with "=textured".
        let score = |passed, failed, undecided| Score { passed, failed, undecided };
        assert_eq!(map.scores, [score(1, 1, 0), score(2, 0, 0)]);
        let svg = map.draw().standalone();
        assert_eq!((svg.matches("\"lt-pass\"").count(), svg.matches("\"lt-fail\"").count()), (5, 1));
        assert!(!svg.contains("<b>&|"));
        let csv = map.table().csv();
        assert!(csv.contains("fail") && csv.lines().count() == 4, "{csv}");
        assert!(map.note().contains("plain 1 of 2 (50 %)"), "{}", map.note());
        assert!(HeatMap::new(&study, &cases[2..]).is_none());
    }

    #[test]
    fn cases_without_a_verdict_count_neither_way() {
        let study = Study::new(vec![records()], &Options::default()).unwrap();
        let mut cases = cases();
        let unknown = Check { measure: "/no/figure".to_owned(), at_least: Some(1.0), ..Check::default() };
        cases.iter_mut().for_each(|case| case.checks.push(unknown.clone()));
        let map = HeatMap::new(&study, &cases).unwrap();
        // A failed check decides a case whatever else is in it.
        let score = |passed, failed, undecided| Score { passed, failed, undecided };
        assert_eq!(map.scores, [score(0, 1, 2), score(0, 0, 3)]);
        assert!(map.note().contains("plain 0 of 1 (0 %, 2 more without a verdict)"), "{}", map.note());
        assert!(map.draw().standalone().contains(">0 / 1<"));
    }

    #[test]
    fn the_gallery_shows_the_views_that_exist() {
        let view = WorstView {
            scene: "fox".into(),
            variant: "plain".into(),
            uri: "data:image/jpeg;base64,AA==".into(),
        };
        let html = gallery(&cases(), &["plain".to_owned(), "other".to_owned()], &[view]);
        assert_eq!(html.matches("<image").count(), 1);
        assert!(gallery(&cases(), &["plain".to_owned()], &[]).is_empty());
    }
}
