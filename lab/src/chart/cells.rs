//! Cells that several tables share.

use super::compare::{Conclusion, Difference};
use super::measure::Measure;
use super::scale::number;
use super::study::Group;
use super::table::{Column, TableCell, Tone};

/// Columns for [`group_cells`].
pub fn group_columns() -> Vec<Column> {
    ["scene", "budget", "variant"].map(|n| Column::names(n, n)).into()
}

/// Scene, budget and variant of a group.
pub fn group_cells(group: &Group<'_>) -> Vec<TableCell> {
    [group.scene, group.budget, group.variant].map(TableCell::name).into()
}

/// Columns for [`difference_cells`].
pub fn difference_columns() -> Vec<Column> {
    vec![
        Column::numbers("Pairs", &["pairs".to_owned()]),
        Column::numbers("Mean difference", &["difference".to_owned()]),
        Column::numbers("95 % interval", &["low95".to_owned(), "high95".to_owned()]),
        Column::names("Conclusion", "verdict"),
    ]
}

/// Number of pairs, mean difference, interval, conclusion.
pub fn difference_cells(d: &Difference, measure: &Measure) -> Vec<TableCell> {
    let interval = d.interval();
    let text = match interval {
        Some((low, high)) => format!("{} to {}", signed(low, measure), signed(high, measure)),
        None if d.n() == 1 => "none: 1 pair".to_owned(),
        None => "–".to_owned(),
    };
    vec![
        TableCell::numbers(d.n().to_string(), &[Some(d.n() as f64)]),
        difference_cell(d, measure),
        TableCell::numbers(text, &[interval.map(|i| i.0), interval.map(|i| i.1)]),
        TableCell::name(&d.words()).toned(tone(d)),
    ]
}

/// The mean difference alone.
pub fn difference_cell(d: &Difference, measure: &Measure) -> TableCell {
    TableCell::numbers(d.mean().map_or("–".to_owned(), |x| signed(x, measure)), &[d.mean()])
}

/// Colour of a conclusion.
pub fn tone(d: &Difference) -> Tone {
    match d.conclusion {
        Conclusion::Better => Tone::Good,
        Conclusion::Worse => Tone::Bad,
        _ => Tone::Faint,
    }
}

/// "+0.51 dB", "−3.2 %".
pub fn signed(value: f64, measure: &Measure) -> String {
    let (digits, unit) = match (measure.is_cost, measure.unit) {
        (true, _) => (1, " %"),
        (false, "") => (measure.digits, ""),
        (false, _) => (measure.digits, " dB"),
    };
    let text = number(value, digits);
    // What rounds to zero has no sign.
    let is_zero = text.chars().all(|c| "-0.".contains(c));
    let text = if is_zero { text.trim_start_matches('-').to_owned() } else { text };
    let text = text.replace('-', "−");
    if value > 0.0 && !is_zero { format!("+{text}{unit}") } else { format!("{text}{unit}") }
}
