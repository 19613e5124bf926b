//! What is measured of a run: name, unit, place in the summary, which direction is good.

use super::scale::Quantity;
use crate::results::Record;

/// Which direction is good.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Better {
    /// Quality.
    Higher,
    /// Errors, cost.
    Lower,
}

/// Something measured of a run.
#[derive(Clone, Debug, PartialEq)]
pub struct Measure {
    /// In file names and heads of CSV files.
    pub id: String,
    /// For people.
    pub name: String,
    /// Unit, empty for counts and indices.
    pub unit: &'static str,
    /// Place in the summary.
    pub pointer: String,
    /// Decimals.
    pub digits: usize,
    /// Which direction is good.
    pub better: Better,
    /// Costs are compared as ratios, quality by differences.
    pub is_cost: bool,
    /// Whether it is a time, which a busy machine spoils.
    pub is_time: bool,
    /// How axes write it.
    pub quantity: Quantity,
}

impl Measure {
    /// A figure of the test views.
    pub fn quality(id: &str, name: &str, unit: &'static str, digits: usize, better: Better) -> Self {
        Self {
            id: id.to_owned(),
            name: name.to_owned(),
            unit,
            pointer: format!("/quality/{id}"),
            digits,
            better,
            is_cost: false,
            is_time: false,
            quantity: Quantity::Plain,
        }
    }

    /// What quality is paid with.
    pub fn cost(id: &str, name: &str, unit: &'static str, pointer: String, quantity: Quantity) -> Self {
        Self {
            id: id.to_owned(),
            name: name.to_owned(),
            unit,
            pointer,
            digits: 0,
            better: Better::Lower,
            is_cost: true,
            is_time: false,
            quantity,
        }
    }

    /// Name and unit, for axes and heads of tables.
    pub fn title(&self) -> String {
        if self.unit.is_empty() { self.name.clone() } else { format!("{}, {}", self.name, self.unit) }
    }
}

/// Every number of `size` whose name ends in `_bytes`, and those of `size.disk`, by format.
pub fn bytes_of(runs: &[Record]) -> Vec<Measure> {
    let mut found: Vec<Measure> = Vec::new();
    for run in runs {
        let Some(size) = run.summary.as_ref().and_then(|s| s.get("size")?.as_object()) else { continue };
        let plain =
            size.iter().filter(|(key, _)| key.ends_with("_bytes")).map(|(key, value)| (key, value, "/size"));
        let disk = size.get("disk").and_then(|d| d.as_object()).into_iter().flatten();
        for (key, value, at) in plain.chain(disk.map(|(key, value)| (key, value, "/size/disk"))) {
            let pointer = format!("{at}/{}", key.replace('~', "~0").replace('/', "~1"));
            if value.is_number() && found.iter().all(|m| m.pointer != pointer) {
                let what = key.trim_end_matches("_bytes").replace('_', " ");
                let what = match what.as_str() {
                    "checkpoint" => "Checkpoint with optimiser".to_owned(),
                    what => format!("File ({what})"),
                };
                found.push(Measure::cost(key, &what, "bytes", pointer, Quantity::Bytes));
            }
        }
    }
    found
}
