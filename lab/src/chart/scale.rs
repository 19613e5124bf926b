//! Axes: from values to a place between 0 and 1, ticks where people expect them (1-2-5), and their labels.
//! Knows neither pixels nor SVG.

/// What the numbers of an axis are, and so how they are written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Quantity {
    /// dB, seconds, errors.
    Plain,
    /// Splats, parameters, steps: 20k, 1.5M.
    Count,
    /// 20 kB, 1.5 MB; decimal.
    Bytes,
}

/// An axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scale {
    /// Value at place 0.
    pub low: f64,
    /// Value at place 1.
    pub high: f64,
    /// Whether equal distances are equal ratios.
    pub log: bool,
}

/// Free space at both ends, as a share of the values' range.
const MARGIN: f64 = 0.06;
/// Ratio by which a logarithmic axis with a single value reaches beyond it.
const ALONE_RATIO: f64 = 1.5;

impl Scale {
    /// An axis for all finite values (all positive ones, if logarithmic); `None` if there are none.
    pub fn around(values: impl IntoIterator<Item = f64>, log: bool) -> Option<Self> {
        let usable = values.into_iter().filter(|x| x.is_finite() && (!log || *x > 0.0));
        let (low, high) = usable.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), x| (l.min(x), h.max(x)));
        if low > high {
            return None;
        }
        let scale = if log {
            let margin = ((high / low).ln() * MARGIN).exp();
            let margin = if high / low < 1.0 + 1e-9 { ALONE_RATIO } else { margin };
            Self { low: low / margin, high: high * margin, log }
        } else {
            let margin = (high - low) * MARGIN;
            // A single value of 26 dB deserves an axis of some tenths, one of 0 an axis at all.
            let margin = if margin <= high.abs() * 1e-12 { (high.abs() * 0.02).max(1e-3) } else { margin };
            Self { low: low - margin, high: high + margin, log }
        };
        (scale.low.is_finite() && scale.high.is_finite() && (!log || scale.low > 0.0)).then_some(scale)
    }

    /// Place of a value: 0 at the low, 1 at the high end.
    pub fn place(&self, value: f64) -> f64 {
        if self.log {
            (value / self.low).ln() / (self.high / self.low).ln()
        } else {
            (value - self.low) / (self.high - self.low)
        }
    }

    /// At most `most` ticks (never fewer than the axis needs to be read: two, where possible), ascending.
    pub fn ticks(&self, most: usize) -> Vec<f64> {
        let most = most.max(2);
        if self.log {
            for mantissas in [&[1.0, 2.0, 5.0][..], &[1.0]] {
                let ticks = self.log_ticks(mantissas, 1);
                if (3..=most).contains(&ticks.len())
                    || (mantissas.len() == 1 && (2..=most).contains(&ticks.len()))
                {
                    return ticks;
                }
            }
            let decades = self.log_ticks(&[1.0], 1).len();
            if decades > most {
                return self.log_ticks(&[1.0], decades.div_ceil(most) as i32);
            }
        }
        // Less than a decade: round numbers, at their places on whatever scale.
        self.linear_ticks(most)
    }

    fn log_ticks(&self, mantissas: &[f64], every: i32) -> Vec<f64> {
        let (from, to) = (self.low.log10().floor() as i32, self.high.log10().ceil() as i32);
        let decades = (from..=to).filter(|d| d.rem_euclid(every) == 0);
        let all = decades.flat_map(|d| mantissas.iter().map(move |m| m * 10_f64.powi(d)));
        all.filter(|x| (self.low..=self.high).contains(x)).collect()
    }

    fn linear_ticks(&self, most: usize) -> Vec<f64> {
        let span = self.high - self.low;
        let mut decade = 10_f64.powf((span / most as f64).log10().floor());
        loop {
            for mantissa in [1.0, 2.0, 5.0] {
                let step = mantissa * decade;
                let (from, to) = ((self.low / step).ceil(), (self.high / step).floor());
                if to - from + 1.0 <= most as f64 {
                    // -0 is written as 0.
                    return (0..=(to - from).max(-1.0) as i64)
                        .map(|i| (from + i as f64) * step + 0.0)
                        .collect();
                }
            }
            decade *= 10.0;
        }
    }
}

/// Labels of ticks: evenly spaced numbers with equally many digits, others as short as they are exact.
pub fn labels(ticks: &[f64], quantity: Quantity) -> Vec<String> {
    let digits_of = |x: f64| (0..=6_usize).find(|&d| is_whole(x * 10_f64.powi(d as i32))).unwrap_or(6);
    let gaps: Vec<f64> = ticks.windows(2).map(|w| w[1] - w[0]).collect();
    let even = gaps.len() > 1 && gaps.iter().all(|g| (g - gaps[0]).abs() <= 1e-6 * gaps[0].abs());
    let digits = ticks.iter().map(|&t| digits_of(t)).max().filter(|_| even && quantity == Quantity::Plain);
    let label = |&tick: &f64| {
        let (factor, unit) = match (quantity, prefix(tick)) {
            (Quantity::Plain, _) => (1.0, ""),
            (Quantity::Count, prefix) => prefix,
            (Quantity::Bytes, (factor, "")) => (factor, " B"),
            (Quantity::Bytes, (factor, "k")) => (factor, " kB"),
            (Quantity::Bytes, (factor, "M")) => (factor, " MB"),
            (Quantity::Bytes, (factor, _)) => (factor, " GB"),
        };
        let value = tick / factor;
        with_thousands(&format!("{value:.*}", digits.unwrap_or(digits_of(value)))).replace('-', "−") + unit
    };
    ticks.iter().map(label).collect()
}

fn is_whole(x: f64) -> bool {
    (x - x.round()).abs() < 1e-6 * x.abs().max(1.0)
}

fn prefix(value: f64) -> (f64, &'static str) {
    match value.abs() {
        v if v >= 0.999_999e9 => (1e9, "G"),
        v if v >= 0.999_999e6 => (1e6, "M"),
        v if v >= 0.999_999e3 => (1e3, "k"),
        _ => (1.0, ""),
    }
}

/// "1234567.8" as "1,234,567.8".
pub fn with_thousands(number: &str) -> String {
    let (sign, rest) = number.strip_prefix('-').map_or(("", number), |rest| ("-", rest));
    let (whole, fraction) = rest.split_once('.').map_or((rest, None), |(w, f)| (w, Some(f)));
    let mut out = sign.to_owned();
    for (i, digit) in whole.chars().enumerate() {
        if i > 0 && (whole.len() - i).is_multiple_of(3) {
            out.push(',');
        }
        out.push(digit);
    }
    if let Some(fraction) = fraction {
        out.push('.');
        out.push_str(fraction);
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    fn axis(low: f64, high: f64, log: bool, most: usize, quantity: Quantity) -> Vec<String> {
        labels(&Scale { low, high, log }.ticks(most), quantity)
    }

    #[test]
    fn linear_ticks_are_round() {
        assert_eq!(axis(20.3, 27.9, false, 8, Quantity::Plain), ["21", "22", "23", "24", "25", "26", "27"]);
        assert_eq!(axis(20.3, 27.9, false, 5, Quantity::Plain), ["22", "24", "26"]);
        assert_eq!(axis(26.02, 26.18, false, 5, Quantity::Plain), ["26.05", "26.10", "26.15"]);
        assert_eq!(axis(-0.3, 0.3, false, 5, Quantity::Plain), ["−0.2", "−0.1", "0.0", "0.1", "0.2"]);
        assert_eq!(axis(0.0, 30_000.0, false, 4, Quantity::Count), ["0", "10k", "20k", "30k"]);
        assert_eq!(axis(900.0, 2600.0, false, 4, Quantity::Count), ["1k", "1.5k", "2k", "2.5k"]);
    }

    #[test]
    fn logarithmic_ticks_are_1_2_5_or_decades_or_what_a_narrow_range_needs() {
        assert_eq!(axis(3.0, 150.0, true, 8, Quantity::Plain), ["5", "10", "20", "50", "100"]);
        assert_eq!(axis(0.4, 3000.0, true, 6, Quantity::Plain), ["1", "10", "100", "1,000"]);
        assert_eq!(axis(0.04, 6.0, true, 8, Quantity::Plain), ["0.05", "0.1", "0.2", "0.5", "1", "2", "5"]);
        assert_eq!(axis(1e-3, 1e9, true, 5, Quantity::Count).len(), 5);
        assert_eq!(axis(14_000.0, 17_500.0, true, 4, Quantity::Count), ["14k", "15k", "16k", "17k"]);
        assert_eq!(axis(9e5, 6e6, true, 6, Quantity::Bytes), ["1 MB", "2 MB", "5 MB"]);
        assert_eq!(
            axis(300.0, 3e4, true, 6, Quantity::Bytes),
            ["500 B", "1 kB", "2 kB", "5 kB", "10 kB", "20 kB"]
        );
    }

    #[test]
    fn axes_hold_their_values_and_single_ones() {
        let scale = Scale::around([10.0, 1000.0, f64::NAN, -1.0, 0.0], true).unwrap();
        assert!(scale.place(10.0) > 0.01 && scale.place(1000.0) < 0.99);
        assert!((scale.place(100.0) - 0.5).abs() < 1e-12);
        let linear = Scale::around([10.0, 30.0], false).unwrap();
        assert!((linear.place(20.0) - 0.5).abs() < 1e-12);
        for (value, log) in [(26.2, false), (0.0, false), (-3.0, false), (14_686.0, true), (1e-7, true)] {
            let scale = Scale::around([value], log).unwrap();
            assert!((scale.place(value) - 0.5).abs() < 1e-9, "{value}");
            assert!(!scale.ticks(6).is_empty(), "{value}");
        }
        for (values, log) in
            [(vec![], false), (vec![f64::NAN, f64::INFINITY], false), (vec![0.0, -2.0], true)]
        {
            assert!(Scale::around(values, log).is_none());
        }
    }

    #[test]
    fn ticks_are_never_too_many() {
        for exponent in -12..12 {
            for mantissa in [1.0, 1.7, 3.3, 9.99] {
                let low = mantissa * 10_f64.powi(exponent);
                for ratio in [1.001, 1.3, 2.0, 11.0, 1e4, 1e15] {
                    for log in [false, true] {
                        let ticks = Scale { low, high: low * ratio, log }.ticks(6);
                        assert!((1..=6).contains(&ticks.len()), "{low} x {ratio} {log}: {ticks:?}");
                        assert!(ticks.is_sorted());
                    }
                }
            }
        }
    }

    #[test]
    fn thousands() {
        assert_eq!(with_thousands("-1234567.5"), "-1,234,567.5");
        assert_eq!(with_thousands("999"), "999");
    }
}
