//! Scales of axes: from values to positions between 0 and 1, round ticks, and their labels.

/// The kind of numbers on an axis, which decides how they are formatted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Quantity {
    /// Decibels, seconds, errors: plain decimals.
    Plain,
    /// Splats, parameters, steps: 20k, 1.5M.
    Count,
    /// 20 kB, 1.5 MB, in powers of 1000.
    Bytes,
}

/// What equal distances on an axis stand for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Spacing {
    /// Equal differences.
    Linear,
    /// Equal ratios, with ticks at 1, 2, 5 and 10.
    Log10,
    /// Equal ratios, with ticks at powers of 2.
    Log2,
}

impl Spacing {
    pub(super) fn is_log(self) -> bool {
        self != Self::Linear
    }
}

/// The range of an axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scale {
    /// Value at position 0.
    pub low: f64,
    /// Value at position 1.
    pub high: f64,
    pub spacing: Spacing,
}

/// Free space at both ends, as a share of the values' range.
const MARGIN: f64 = 0.06;
/// Ratio by which a logarithmic axis extends beyond a single value.
const SINGLE_VALUE_RATIO: f64 = 1.5;

impl Scale {
    /// The range of all finite values (positive ones, if logarithmic); `None` if there are none.
    pub fn around(values: impl IntoIterator<Item = f64>, spacing: Spacing) -> Option<Self> {
        let log = spacing.is_log();
        let usable = values.into_iter().filter(|x| x.is_finite() && (!log || *x > 0.0));
        let (low, high) = usable.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), x| (l.min(x), h.max(x)));
        if low > high {
            return None;
        }
        let scale = if log {
            let margin = ((high / low).ln() * MARGIN).exp();
            let margin = if high / low < 1.0 + 1e-9 { SINGLE_VALUE_RATIO } else { margin };
            Self { low: low / margin, high: high * margin, spacing }
        } else {
            let margin = (high - low) * MARGIN;
            // A single value gets an axis too: of some tenths around 26 dB, and of thousandths around 0.
            let margin = if margin <= high.abs() * 1e-12 { (high.abs() * 0.02).max(1e-3) } else { margin };
            Self { low: low - margin, high: high + margin, spacing }
        };
        (scale.low.is_finite() && scale.high.is_finite() && (!log || scale.low > 0.0)).then_some(scale)
    }

    /// Whether the axis can show a value at all.
    pub fn accepts(&self, value: f64) -> bool {
        !self.spacing.is_log() || value > 0.0
    }

    /// Position of a value: 0 at the low end, 1 at the high end.
    pub fn place(&self, value: f64) -> f64 {
        if self.spacing.is_log() {
            (value / self.low).ln() / (self.high / self.low).ln()
        } else {
            (value - self.low) / (self.high - self.low)
        }
    }

    /// At most `most` ticks in ascending order, and at least two where possible.
    pub fn ticks(&self, most: usize) -> Vec<f64> {
        let most = most.max(2);
        if self.spacing == Spacing::Log2 {
            let ticks = self.binary_ticks(most);
            if ticks.len() >= 2 {
                return ticks;
            }
        }
        if self.spacing == Spacing::Log10 {
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
        // Less than a decade: evenly spaced round numbers.
        self.linear_ticks(most)
    }

    fn log_ticks(&self, mantissas: &[f64], every: i32) -> Vec<f64> {
        let (from, to) = (self.low.log10().floor() as i32, self.high.log10().ceil() as i32);
        let decades = (from..=to).filter(|d| d.rem_euclid(every) == 0);
        let all = decades.flat_map(|d| mantissas.iter().map(move |m| m * 10_f64.powi(d)));
        all.filter(|x| (self.low..=self.high).contains(x)).collect()
    }

    /// Powers of 2, of 4, of 8 ...: as many as fit.
    fn binary_ticks(&self, most: usize) -> Vec<f64> {
        let (from, to) = (self.low.log2().ceil() as i32, self.high.log2().floor() as i32);
        let every = (1..).find(|&n| (to - from) / n < most as i32).unwrap_or(1);
        (from..=to).filter(|e| e.rem_euclid(every) == 0).map(|e| 2_f64.powi(e)).collect()
    }

    fn linear_ticks(&self, most: usize) -> Vec<f64> {
        let span = self.high - self.low;
        let mut decade = 10_f64.powf((span / most as f64).log10().floor());
        loop {
            for mantissa in [1.0, 2.0, 5.0] {
                let step = mantissa * decade;
                let (from, to) = ((self.low / step).ceil(), (self.high / step).floor());
                if to - from + 1.0 <= most as f64 {
                    // Adding 0 turns -0 into 0.
                    return (0..=(to - from).max(-1.0) as i64)
                        .map(|i| (from + i as f64) * step + 0.0)
                        .collect();
                }
            }
            decade *= 10.0;
        }
    }
}

/// Labels of ticks: evenly spaced numbers with equally many decimals, others as short as is exact.
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

/// Formats with thousands separators.
pub fn number(value: f64, digits: usize) -> String {
    with_thousands(&format!("{value:.digits$}"))
}

/// "1 run", "3 runs".
pub fn counted(n: usize, what: &str) -> String {
    if n == 1 { format!("1 {what}") } else { format!("{n} {what}s") }
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

    fn axis(low: f64, high: f64, spacing: Spacing, most: usize, quantity: Quantity) -> Vec<String> {
        labels(&Scale { low, high, spacing }.ticks(most), quantity)
    }

    #[test]
    fn linear_ticks_are_round() {
        assert_eq!(
            axis(20.3, 27.9, Spacing::Linear, 8, Quantity::Plain),
            ["21", "22", "23", "24", "25", "26", "27"]
        );
        assert_eq!(axis(20.3, 27.9, Spacing::Linear, 5, Quantity::Plain), ["22", "24", "26"]);
        assert_eq!(axis(26.02, 26.18, Spacing::Linear, 5, Quantity::Plain), ["26.05", "26.10", "26.15"]);
        assert_eq!(
            axis(-0.3, 0.3, Spacing::Linear, 5, Quantity::Plain),
            ["−0.2", "−0.1", "0.0", "0.1", "0.2"]
        );
        assert_eq!(axis(0.0, 30_000.0, Spacing::Linear, 4, Quantity::Count), ["0", "10k", "20k", "30k"]);
        assert_eq!(axis(900.0, 2600.0, Spacing::Linear, 4, Quantity::Count), ["1k", "1.5k", "2k", "2.5k"]);
    }

    #[test]
    fn logarithmic_ticks_are_1_2_5_or_decades_or_linear_in_a_narrow_range() {
        assert_eq!(axis(3.0, 150.0, Spacing::Log10, 8, Quantity::Plain), ["5", "10", "20", "50", "100"]);
        assert_eq!(axis(0.4, 3000.0, Spacing::Log10, 6, Quantity::Plain), ["1", "10", "100", "1,000"]);
        assert_eq!(
            axis(0.04, 6.0, Spacing::Log10, 8, Quantity::Plain),
            ["0.05", "0.1", "0.2", "0.5", "1", "2", "5"]
        );
        assert_eq!(axis(1e-3, 1e9, Spacing::Log10, 5, Quantity::Count).len(), 5);
        assert_eq!(
            axis(14_000.0, 17_500.0, Spacing::Log10, 4, Quantity::Count),
            ["14k", "15k", "16k", "17k"]
        );
        assert_eq!(axis(9e5, 6e6, Spacing::Log10, 6, Quantity::Bytes), ["1 MB", "2 MB", "5 MB"]);
        assert_eq!(
            axis(300.0, 3e4, Spacing::Log10, 6, Quantity::Bytes),
            ["500 B", "1 kB", "2 kB", "5 kB", "10 kB", "20 kB"]
        );
    }

    #[test]
    fn binary_ticks_are_as_many_powers_of_two_as_fit() {
        assert_eq!(
            axis(3.0, 300.0, Spacing::Log2, 8, Quantity::Plain),
            ["4", "8", "16", "32", "64", "128", "256"]
        );
        assert_eq!(axis(3.0, 300.0, Spacing::Log2, 5, Quantity::Plain), ["4", "16", "64", "256"]);
        // A range without two powers has linear ticks.
        assert_eq!(axis(4.0, 7.0, Spacing::Log2, 4, Quantity::Plain), ["4", "5", "6", "7"]);
    }

    #[test]
    fn scales_contain_their_values_even_a_single_one() {
        let scale = Scale::around([10.0, 1000.0, f64::NAN, -1.0, 0.0], Spacing::Log10).unwrap();
        assert!(scale.place(10.0) > 0.01 && scale.place(1000.0) < 0.99);
        assert!((scale.place(100.0) - 0.5).abs() < 1e-12);
        let linear = Scale::around([10.0, 30.0], Spacing::Linear).unwrap();
        assert!((linear.place(20.0) - 0.5).abs() < 1e-12);
        let (linear, log) = (Spacing::Linear, Spacing::Log10);
        for (value, spacing) in [(26.2, linear), (0.0, linear), (-3.0, linear), (14_686.0, log), (1e-7, log)]
        {
            let scale = Scale::around([value], spacing).unwrap();
            assert!((scale.place(value) - 0.5).abs() < 1e-9, "{value}");
            assert!(!scale.ticks(6).is_empty(), "{value}");
        }
        for (values, spacing) in
            [(vec![], linear), (vec![f64::NAN, f64::INFINITY], linear), (vec![0.0, -2.0], log)]
        {
            assert!(Scale::around(values, spacing).is_none());
        }
    }

    #[test]
    fn ticks_are_never_too_many() {
        for exponent in -12..12 {
            for mantissa in [1.0, 1.7, 3.3, 9.99] {
                let low = mantissa * 10_f64.powi(exponent);
                for ratio in [1.001, 1.3, 2.0, 11.0, 1e4, 1e15] {
                    for spacing in [Spacing::Linear, Spacing::Log10, Spacing::Log2] {
                        let ticks = Scale { low, high: low * ratio, spacing }.ticks(6);
                        assert!((1..=6).contains(&ticks.len()), "{low} x {ratio} {spacing:?}: {ticks:?}");
                        assert!(ticks.is_sorted());
                    }
                }
            }
        }
    }

    #[test]
    fn thousands_are_separated() {
        assert_eq!(with_thousands("-1234567.5"), "-1,234,567.5");
        assert_eq!(with_thousands("999"), "999");
    }
}
