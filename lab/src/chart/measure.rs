//! The measures of a run: name, unit, location in the summary, and which direction is good.

use super::plot::{Axis, Quantity};
use super::scale::number;
use crate::results::Record;

/// A figure of a run.
#[derive(Clone, Debug, PartialEq)]
pub struct Measure {
    /// Identifier in file names and headers of CSV files.
    pub id: String,
    /// Name in headings and legends.
    pub name: String,
    /// Empty for counts and indices.
    pub unit: &'static str,
    /// JSON pointer into the summary.
    pub pointer: String,
    /// Number of decimals shown to people.
    pub digits: usize,
    /// Whether higher values are better.
    pub is_gain: bool,
    /// Costs are compared as ratios, quality by differences.
    pub is_cost: bool,
    /// Times count only if the machine was quiet.
    pub is_time: bool,
    /// How axes format it.
    pub quantity: Quantity,
}

impl Measure {
    /// A quality figure of the test views.
    fn quality(id: &str, name: &str, unit: &'static str, digits: usize, is_gain: bool) -> Self {
        Self {
            id: id.to_owned(),
            name: name.to_owned(),
            unit,
            pointer: format!("/quality/{id}"),
            digits,
            is_gain,
            is_cost: false,
            is_time: false,
            quantity: Quantity::Plain,
        }
    }

    /// A size or a time.
    pub fn cost(id: &str, name: &str, unit: &'static str, pointer: &str, quantity: Quantity) -> Self {
        Self {
            id: id.to_owned(),
            name: name.to_owned(),
            unit,
            pointer: pointer.to_owned(),
            digits: 0,
            is_gain: false,
            is_cost: true,
            is_time: false,
            quantity,
        }
    }

    /// PSNR, gradient-PSNR, SSIM and FLIP of the test views.
    pub fn qualities() -> Vec<Self> {
        vec![
            Self::quality("psnr", "Test PSNR", "dB", 2, true),
            Self::quality("grad_psnr", "Test gradient-PSNR", "dB", 2, true),
            Self::quality("ssim_3dgs", "Test SSIM (3DGS)", "", 4, true),
            Self::quality("flip", "Test FLIP", "", 4, false),
        ]
    }

    /// Layers per pixel, if any run reports them.
    pub fn layers_of(runs: &[Record]) -> Vec<Self> {
        let of = |id: &str, name: &str| {
            let cost = Self::cost(
                &format!("{id}_layers"),
                name,
                "per pixel",
                &format!("/layers_per_pixel/{id}"),
                Quantity::Plain,
            );
            Self { digits: 1, ..cost }
        };
        let mut found = vec![of("rasterised", "Layers rasterised"), of("blended", "Layers blended")];
        found.retain(|measure| runs.iter().any(|run| run.number(&measure.pointer).is_some()));
        found
    }

    /// Training time; points of curves have it under its identifier.
    pub fn training_time(is_cpu_time: bool) -> Self {
        let (id, unit) =
            if is_cpu_time { ("cpu_secs", "CPU seconds") } else { ("wall_secs", "wall seconds") };
        let cost = Self::cost(id, "Training time", unit, &format!("/time/train_{id}"), Quantity::Plain);
        Self { digits: 1, is_time: true, ..cost }
    }

    /// A value with its unit: "26.12 dB", "830,000 parameters".
    pub fn amount(&self, value: f64) -> String {
        let unit = match self.unit {
            "" if self.is_cost => self.name.to_lowercase(),
            unit => unit.to_owned(),
        };
        format!("{} {unit}", number(value, self.digits)).trim_end().to_owned()
    }

    /// A difference with its sign and unit, a percentage for costs: "+0.51 dB", "−3.2 %".
    pub fn signed(&self, value: f64) -> String {
        let (digits, unit) = if self.is_cost { (1, "%") } else { (self.digits, self.unit) };
        let text = number(value, digits);
        let is_positive = value > 0.0 && text.contains(|c| ('1'..='9').contains(&c));
        format!("{}{text} {unit}", if is_positive { "+" } else { "" }).trim_end().to_owned()
    }

    /// An axis of this measure: logarithmic for costs.
    pub fn axis(&self) -> Axis {
        Axis { name: self.title(), is_log: self.is_cost, quantity: self.quantity, ..Axis::default() }
    }

    /// Name and unit, for axes and table headers.
    pub fn title(&self) -> String {
        if self.unit.is_empty() { self.name.clone() } else { format!("{}, {}", self.name, self.unit) }
    }
}

/// Every number of `size` whose name ends in `_bytes`, and every one of `size.disk` (file sizes by format).
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
                found.push(Measure::cost(key, &format!("File ({what})"), "bytes", &pointer, Quantity::Bytes));
            }
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn differences_have_a_sign_and_a_unit() {
        let (psnr, time) = (&Measure::qualities()[0], Measure::training_time(true));
        assert_eq!([-0.001, 0.512].map(|x| psnr.signed(x)), ["0.00 dB", "+0.51 dB"]);
        assert_eq!(
            (time.signed(-12.345), time.amount(1234.0)),
            ("−12.3 %".into(), "1,234.0 CPU seconds".into())
        );
    }
}
