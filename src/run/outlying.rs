//! Training views that the scene fits much worse than the others: their poses or exposures are doubtful.

use std::collections::BTreeMap;

/// A view stands out if its loss is more than this many scaled median absolute deviations above the median,
const DEVIATIONS: f64 = 3.0;

/// and at least this multiple of it: where all views are fitted alike, small deviations mean nothing.
const MULTIPLE: f64 = 1.5;

/// Standard deviation of a normal distribution over its median absolute deviation.
const SIGMA_PER_DEVIATION: f64 = 1.4826;

/// The latest loss of each view.
#[derive(Default)]
pub struct ViewLosses(BTreeMap<usize, f64>);

impl ViewLosses {
    /// Notes the loss of a step on a view.
    pub fn record(&mut self, view: usize, loss: f64) {
        self.0.insert(view, loss);
    }

    /// Views that stand out, worst first; none among fewer than 5.
    pub fn outlying(&self) -> Vec<usize> {
        if self.0.len() < 5 {
            return Vec::new();
        }
        let typical = median(self.0.values().copied());
        let deviation = median(self.0.values().map(|loss| (loss - typical).abs()));
        let limit = (typical + DEVIATIONS * SIGMA_PER_DEVIATION * deviation).max(MULTIPLE * typical);
        let mut out: Vec<(usize, f64)> =
            self.0.iter().map(|(&v, &l)| (v, l)).filter(|(_, l)| *l > limit).collect();
        out.sort_by(|a, b| b.1.total_cmp(&a.1));
        out.into_iter().map(|(view, _)| view).collect()
    }
}

fn median(values: impl Iterator<Item = f64>) -> f64 {
    let mut values: Vec<f64> = values.collect();
    let middle = values.len() / 2;
    *values.select_nth_unstable_by(middle, f64::total_cmp).1
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn views_far_above_the_others_stand_out() {
        let mut losses = ViewLosses::default();
        (0..20).for_each(|view| losses.record(view, 0.05 + 0.001 * (view % 7) as f64));
        assert!(losses.outlying().is_empty());
        losses.record(3, 0.12);
        losses.record(11, 0.2);
        assert_eq!(losses.outlying(), [11, 3]);
        // Only the latest loss counts.
        losses.record(11, 0.05);
        assert_eq!(losses.outlying(), [3]);
    }

    #[test]
    fn equal_views_and_few_views_have_no_outliers() {
        let mut losses = ViewLosses::default();
        (0..4).for_each(|view| losses.record(view, if view == 0 { 9.0 } else { 0.1 }));
        assert!(losses.outlying().is_empty(), "too few to tell");
        (0..30).for_each(|view| losses.record(view, 0.1));
        losses.record(5, 0.14);
        assert!(losses.outlying().is_empty(), "far out in deviations, but not in loss");
    }
}
