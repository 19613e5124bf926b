//! The forest plot of paired differences: a row per variant and scene with the mean difference to the baseline and its
//! 95 % interval, and a line at 0.

use super::cells::signed;
use super::compare::{Conclusion, Difference, Scope, compare};
use super::look::{MARK_PX, colour};
use super::measure::Measure;
use super::scale::{Quantity, Scale, Spacing, labels};
use super::study::Study;
use super::svg::{Anchor, Svg, TEXT_PX, TITLE_PX, shortened, text_width_px};

const WIDTH_PX: f64 = 760.0;
const TOP: f64 = 60.0;
const ROW_PX: f64 = 22.0;
/// Extra space between variants.
const GAP_PX: f64 = 8.0;
const NAME_PX: f64 = 220.0;
/// Width of the column of numbers on the right.
const NUMBERS_PX: f64 = 170.0;

/// A variant, or one of its scenes and budgets.
struct Row {
    name: String,
    look: usize,
    /// Whether it pools all pairs of the variant.
    is_pooled: bool,
    difference: Difference,
}

fn rows(study: &Study, measure: &Measure) -> Vec<Row> {
    let mut rows = Vec::new();
    for variant in study.variants.iter().filter(|v| **v != study.baseline) {
        let mut add = |name: String, is_pooled, scope| {
            let difference = compare(study, variant, scope, measure);
            if difference.n() > 0 {
                rows.push(Row { name, look: study.look(variant), is_pooled, difference });
            }
        };
        add(variant.clone(), true, Scope::AllPairs);
        if study.scenes.len() * study.budgets.len() > 1 {
            for scene in &study.scenes {
                for budget in &study.budgets {
                    let name = match (study.scenes.len(), study.budgets.len()) {
                        (1, _) => budget.clone(),
                        (_, 1) => scene.clone(),
                        _ => format!("{scene}, {budget}"),
                    };
                    add(name, false, Scope::SceneBudget(scene, budget));
                }
            }
        }
    }
    rows
}

/// Draws the differences in one measure; `None` without pairs.
pub fn draw(study: &Study, measure: &Measure) -> Option<Svg> {
    let rows = rows(study, measure);
    let ends = rows.iter().flat_map(|r| {
        let (low, high) = r.difference.interval().unwrap_or((0.0, 0.0));
        [low, high, r.difference.mean().unwrap_or(0.0), 0.0]
    });
    let x = Scale::around(ends, Spacing::Linear)?;
    if rows.is_empty() {
        return None;
    }
    let gaps = rows.iter().skip(1).filter(|r| r.is_pooled).count() as f64;
    let bottom = TOP + ROW_PX * rows.len() as f64 + GAP_PX * gaps + 6.0;
    let title = format!("{}: difference to {}", measure.name, study.baseline);
    let mut svg = Svg::new(WIDTH_PX, bottom + 46.0, &title);
    let short = shortened(&title, WIDTH_PX - 24.0, TITLE_PX * 1.05);
    svg.text("lt-text lt-title", (12.0, 24.0), Anchor::Start, &short, Some(&title));
    svg.text("lt-axis", (12.0, 46.0), Anchor::Start, "Mean of paired differences and 95 % interval", None);
    let (left, right) = (NAME_PX, WIDTH_PX - NUMBERS_PX);
    let at = |value: f64| left + x.place(value) * (right - left);
    let unit = if measure.is_cost { "%" } else { measure.unit };
    draw_axis(&mut svg, &x, at, bottom, unit);
    let mut y = TOP + 0.5 * ROW_PX;
    for (i, row) in rows.iter().enumerate() {
        if i > 0 && row.is_pooled {
            y += GAP_PX;
        }
        draw_row(&mut svg, row, measure, at, y);
        y += ROW_PX;
    }
    Some(svg)
}

fn draw_axis(svg: &mut Svg, x: &Scale, at: impl Fn(f64) -> f64, bottom: f64, unit: &str) {
    let mut most = 7;
    let (ticks, texts) = loop {
        let ticks = x.ticks(most);
        let texts = labels(&ticks, Quantity::Plain);
        let fits = ticks.windows(2).zip(texts.windows(2)).all(|(t, l)| {
            let half = 0.5 * (text_width_px(&l[0], TEXT_PX) + text_width_px(&l[1], TEXT_PX));
            at(t[1]) - at(t[0]) > half + 12.0
        });
        if fits || most <= 2 {
            break (ticks, texts);
        }
        most -= 1;
    };
    for (&tick, text) in ticks.iter().zip(&texts) {
        svg.line("lt-grid", (at(tick), TOP - 4.0), (at(tick), bottom));
        svg.text("lt-axis", (at(tick), bottom + 16.0), Anchor::Middle, text, None);
    }
    svg.line("lt-frame", (at(0.0), TOP - 4.0), (at(0.0), bottom));
    let middle = 0.5 * (at(x.low) + at(x.high));
    svg.text("lt-axis", (middle, bottom + 36.0), Anchor::Middle, unit, None);
}

fn draw_row(svg: &mut Svg, row: &Row, measure: &Measure, at: impl Fn(f64) -> f64, y: f64) {
    let Some(mean) = row.difference.mean() else { return };
    let colour = colour(row.look);
    let decided = matches!(row.difference.conclusion, Conclusion::Better | Conclusion::Worse);
    let (line, fill) = if decided {
        (format!("lt-line lt-s{colour}"), format!("lt-f{colour}"))
    } else {
        ("lt-line lt-grey-line".to_owned(), "lt-grey".to_owned())
    };
    let numbers = match row.difference.interval() {
        Some((low, high)) => {
            svg.line(&line, (at(low), y), (at(high), y));
            for end in [low, high] {
                svg.line(&line, (at(end), y - 4.0), (at(end), y + 4.0));
            }
            let half = number_without_sign(0.5 * (high - low), measure);
            format!("{} ± {half}, n = {}", signed(mean, measure), row.difference.n())
        }
        None => format!("{}, n = 1", signed(mean, measure)),
    };
    let hover = format!("{}: {numbers}; {}", row.name, row.difference.words());
    let (class, indent) = if row.is_pooled { ("lt-text", 12.0) } else { ("lt-axis", 26.0) };
    let radius = if row.is_pooled { MARK_PX } else { 0.75 * MARK_PX };
    svg.marker(&fill, row.look, (at(mean), y), radius, &hover);
    let name = shortened(&row.name, NAME_PX - indent - 14.0, TEXT_PX);
    svg.text(class, (indent, y + 4.0), Anchor::Start, &name, (name != row.name).then_some(&row.name));
    svg.text(class, (WIDTH_PX - NUMBERS_PX + 14.0, y + 4.0), Anchor::Start, &numbers, None);
}

fn number_without_sign(value: f64, measure: &Measure) -> String {
    let text = signed(value, measure);
    let text = text.trim_start_matches(['+', '−']);
    text.split(' ').next().unwrap_or_default().to_owned()
}

#[cfg(test)]
mod tests {
    use super::super::fixtures::{record, records};
    use super::super::study::Options;
    use super::*;

    #[test]
    fn rows_are_variants_and_scenes_with_their_numbers() {
        let study = Study::new(vec![records()], &Options::default()).unwrap();
        let file = draw(&study, &study.qualities[0]).unwrap().standalone();
        assert!(file.contains("+0.51 dB ± 0.01, n = 10") && file.contains("n = 5; better"), "{file}");
        assert!(file.contains("&lt;b&gt;&amp;|,&quot;") && !file.contains("NaN"), "{file}");
    }

    #[test]
    fn a_single_pair_has_no_interval_and_a_single_variant_no_chart() {
        let pair = vec![record(0, ("s", "a", "b"), 1, 20.0), record(1, ("s", "c", "b"), 1, 25.0)];
        let study = Study::new(vec![pair.clone()], &Options::default()).unwrap();
        let file = draw(&study, &study.qualities[0]).unwrap().standalone();
        assert!(file.contains("+5.00 dB, n = 1") && !file.contains('±'), "{file}");
        let alone = Study::new(vec![pair[..1].to_vec()], &Options::default()).unwrap();
        assert!(draw(&alone, &alone.qualities[0]).is_none());
    }
}
