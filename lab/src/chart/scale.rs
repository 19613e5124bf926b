//! Scales of axes: from values to positions between 0 and 1, round ticks, and their labels.

use litetex_gs::text::format_count;

/// The kind of numbers on an axis, which decides how they are formatted.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Quantity {
    /// Decibels, seconds, errors: plain decimals.
    #[default]
    Plain,
    /// Splats, parameters, steps: 20k, 1.5M.
    Count,
    /// 20 kB, 1.5 MB, in powers of 1000.
    Bytes,
}

/// The range of an axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scale {
    /// Value at position 0.
    pub low: f64,
    /// Value at position 1.
    pub high: f64,
    /// Whether equal distances stand for equal ratios, not differences.
    pub is_log: bool,
}

/// Free space at both ends, as a share of the values' range.
const MARGIN: f64 = 0.06;
/// Ratio by which a logarithmic axis extends beyond a single value.
const SINGLE_VALUE_RATIO: f64 = 1.5;

impl Scale {
    /// The range of all finite values (positive ones, if logarithmic); `None` if there are none.
    pub fn around(values: impl IntoIterator<Item = f64>, is_log: bool) -> Option<Self> {
        let usable = values.into_iter().filter(|x| x.is_finite() && (!is_log || *x > 0.0));
        let (low, high) = usable.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), x| (l.min(x), h.max(x)));
        if low > high {
            return None;
        }
        if is_log {
            let margin = ((high / low).ln() * MARGIN).exp();
            let margin = if high / low < 1.0 + 1e-9 { SINGLE_VALUE_RATIO } else { margin };
            return Some(Self { low: low / margin, high: high * margin, is_log });
        }
        let margin = (high - low) * MARGIN;
        // A single value gets an axis too: of some tenths around 26 dB, and of thousandths around 0.
        let margin = if margin <= high.abs() * 1e-12 { (high.abs() * 0.02).max(1e-3) } else { margin };
        Some(Self { low: low - margin, high: high + margin, is_log })
    }

    /// Position of a value: 0 at the low end, 1 at the high end; not finite for values that the axis cannot show.
    pub fn place(&self, value: f64) -> f64 {
        if self.is_log {
            (value / self.low).ln() / (self.high / self.low).ln()
        } else {
            (value - self.low) / (self.high - self.low)
        }
    }

    /// At most `most` ticks in ascending order, and at least two where possible.
    pub fn ticks(&self, most: usize) -> Vec<f64> {
        if !self.is_log {
            return self.linear_ticks(most);
        }
        let finest = (&[1.0, 2.0, 5.0][..], 1);
        let spacings = std::iter::once(finest).chain((1..).map(|decades| (&[1.0][..], decades)));
        let all = spacings.map(|(mantissas, decades)| self.log_ticks(mantissas, decades));
        let fitting = all.take_while(|ticks| ticks.len() >= 2).find(|ticks| ticks.len() <= most);
        // Less than a decade: evenly spaced round numbers.
        fitting.unwrap_or_else(|| self.linear_ticks(most))
    }

    fn log_ticks(&self, mantissas: &[f64], every: i32) -> Vec<f64> {
        let (from, to) = (self.low.log10().floor() as i32, self.high.log10().ceil() as i32);
        let decades = (from..=to).filter(|d| d.rem_euclid(every) == 0);
        let all = decades.flat_map(|d| mantissas.iter().map(move |m| m * 10_f64.powi(d)));
        all.filter(|x| (self.low..=self.high).contains(x)).collect()
    }

    fn linear_ticks(&self, most: usize) -> Vec<f64> {
        let decade = 10_f64.powf(((self.high - self.low) / most as f64).log10().floor());
        let ends = |step: f64| ((self.low / step).ceil() as i64, (self.high / step).floor() as i64);
        let step = [1.0, 2.0, 5.0, 10.0].map(|m| m * decade).into_iter().find(|&step| {
            let (from, to) = ends(step);
            to - from < most as i64
        });
        let step = step.unwrap_or(20.0 * decade);
        let (from, to) = ends(step);
        (from..=to).map(|i| i as f64 * step).collect()
    }
}

/// Labels of ticks: plain numbers of a linear scale with equally many decimals, others as short as is exact.
pub fn labels(ticks: &[f64], is_log: bool, quantity: Quantity) -> Vec<String> {
    let scaled = ticks.iter().map(|&tick| match (quantity, tick.abs()) {
        (Quantity::Plain, _) => (tick, ""),
        (_, size) if size >= 0.999_999e9 => (tick / 1e9, "G"),
        (_, size) if size >= 0.999_999e6 => (tick / 1e6, "M"),
        (_, size) if size >= 0.999_999e3 => (tick / 1e3, "k"),
        _ => (tick, ""),
    });
    let scaled: Vec<(f64, &str)> = scaled.collect();
    let most = scaled.iter().map(|(value, _)| decimals(*value)).max().unwrap_or(0);
    let is_even = !is_log && quantity == Quantity::Plain;
    let label = |&(value, prefix): &(f64, &str)| {
        let text = number(value, if is_even { most } else { decimals(value) });
        if quantity == Quantity::Bytes { format!("{text} {prefix}B") } else { text + prefix }
    };
    scaled.iter().map(label).collect()
}

/// Decimals that a number needs, at most six.
fn decimals(value: f64) -> usize {
    let text = format!("{value:.6}");
    text.trim_end_matches('0').split_once('.').map_or(0, |(_, decimals)| decimals.len())
}

/// "−1,234,567.5"; what rounds to zero has no sign.
pub fn number(value: f64, digits: usize) -> String {
    let text = format!("{:.digits$}", value.abs());
    let (whole, fraction) = text.split_at(text.find('.').unwrap_or(text.len()));
    let whole = whole.parse().map_or(whole.to_owned(), format_count);
    let sign = if value < 0.0 && text.contains(|c| ('1'..='9').contains(&c)) { "−" } else { "" };
    format!("{sign}{whole}{fraction}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_are_round_and_labelled_with_the_digits_they_need() {
        let (linear, log) = (false, true);
        for (low, high, is_log, most, quantity, expected) in [
            (20.3, 27.9, linear, 8, Quantity::Plain, "21 22 23 24 25 26 27"),
            (20.3, 27.9, linear, 5, Quantity::Plain, "22 24 26"),
            (26.02, 26.18, linear, 5, Quantity::Plain, "26.05 26.10 26.15"),
            (-0.3, 0.3, linear, 5, Quantity::Plain, "−0.2 −0.1 0.0 0.1 0.2"),
            (0.0, 30_000.0, linear, 4, Quantity::Count, "0 10k 20k 30k"),
            (900.0, 2600.0, linear, 4, Quantity::Count, "1k 1.5k 2k 2.5k"),
            (3.0, 150.0, log, 8, Quantity::Plain, "5 10 20 50 100"),
            (0.4, 3000.0, log, 6, Quantity::Plain, "1 10 100 1,000"),
            (0.04, 6.0, log, 8, Quantity::Plain, "0.05 0.1 0.2 0.5 1 2 5"),
            // Less than a decade.
            (14_000.0, 17_500.0, log, 4, Quantity::Count, "14k 15k 16k 17k"),
            (9e5, 6e6, log, 6, Quantity::Bytes, "1 MB 2 MB 5 MB"),
        ] {
            let ticks = Scale { low, high, is_log }.ticks(most);
            assert_eq!(labels(&ticks, is_log, quantity).join(" "), expected, "{low} {high}");
        }
    }

    #[test]
    fn scales_contain_their_values_even_a_single_one() {
        let scale = Scale::around([10.0, 1000.0, f64::NAN, -1.0, 0.0], true).unwrap();
        assert!(scale.place(10.0) > 0.01 && scale.place(1000.0) < 0.99);
        assert!((scale.place(100.0) - 0.5).abs() < 1e-12);
        for (value, is_log) in [(26.2, false), (0.0, false), (-3.0, false), (14_686.0, true), (1e-7, true)] {
            let scale = Scale::around([value], is_log).unwrap();
            assert!((scale.place(value) - 0.5).abs() < 1e-9, "{value}");
            assert!(!scale.ticks(6).is_empty(), "{value}");
        }
        for (values, is_log) in
            [(vec![], false), (vec![f64::NAN, f64::INFINITY], false), (vec![0.0, -2.0], true)]
        {
            assert!(Scale::around(values, is_log).is_none());
        }
    }

    #[test]
    fn ticks_are_never_too_many() {
        for exponent in -12..12 {
            for mantissa in [1.0, 1.7, 3.3, 9.99] {
                let low = mantissa * 10_f64.powi(exponent);
                for ratio in [1.001, 1.3, 2.0, 11.0, 1e4, 1e15] {
                    for is_log in [false, true] {
                        let ticks = Scale { low, high: low * ratio, is_log }.ticks(6);
                        assert!((1..=6).contains(&ticks.len()), "{low} x {ratio} {is_log}: {ticks:?}");
                        assert!(ticks.is_sorted());
                    }
                }
            }
        }
    }

    #[test]
    fn thousands_are_separated_and_zero_has_no_sign() {
        assert_eq!(number(-1_234_567.5, 1), "−1,234,567.5");
        assert_eq!(number(-0.001, 2), "0.00");
    }
}
