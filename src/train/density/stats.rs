//! What a statistics window measured of each splat: error, contribution, prune counts (method 6.2 and 6.3).

use crate::backend::WindowStatistics;

/// What counts as a splat's error (method 6.2).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ErrorMeasure {
    /// Loss per unit of contribution, independent of the splat's size (paper).
    Mean,
    /// Loss that the splat carries in a view; larger for larger splats.
    Mass,
}

/// Share of the mean error at or below which a splat is never a candidate. Relative, because the mass of a splat falls with
/// their number: CAT's 1e-6 would stop growth beyond some 50,000 splats.
const ERROR_SHARE_MIN: f64 = 0.01;

/// Statistics of each splat, scaled as if each training view had been counted once.
pub struct Scores {
    /// Whether a view of the window saw the splat.
    pub seen: Vec<bool>,
    /// Covered share of the image, summed over the training views.
    pub area: Vec<f64>,
    /// Blending weight per pixel, summed over the training views.
    pub contribution: Vec<f64>,
    /// Contribution relative to the mean of the splats seen.
    pub share: Vec<f64>,
    /// Error by the chosen measure; 0 for splats that no view saw or that contribute too little.
    pub error: Vec<f64>,
}

impl Scores {
    /// Scales the sums of a window that counted `statistics.views` of `train_views` views. Splats that contribute
    /// less than `least_contribution` have no error.
    pub fn new(
        statistics: &WindowStatistics,
        train_views: usize,
        measure: ErrorMeasure,
        least_contribution: f64,
    ) -> Self {
        let scale = train_views as f64 / f64::from(statistics.views.max(1));
        let scaled = |values: &[f32]| values.iter().map(|&v| f64::from(v) * scale).collect::<Vec<_>>();
        let contribution = scaled(&statistics.contribution);
        let mass = scaled(&statistics.error);
        let error = mass
            .iter()
            .zip(&contribution)
            .zip(&statistics.seen)
            .map(|((&mass, &contribution), &seen)| {
                if seen == 0 || contribution < least_contribution {
                    return 0.0;
                }
                match measure {
                    ErrorMeasure::Mean => mass / (contribution + 1e-8),
                    // The mean over the views that see the splat.
                    ErrorMeasure::Mass => mass / (f64::from(seen) * scale),
                }
            })
            .collect();
        let num_seen = statistics.seen.iter().filter(|&&s| s > 0).count();
        let mean = contribution.iter().sum::<f64>() / num_seen.max(1) as f64;
        let share = contribution.iter().map(|c| if mean > 0.0 { c / mean } else { 1.0 }).collect();
        Self {
            seen: statistics.seen.iter().map(|&s| s > 0).collect(),
            area: scaled(&statistics.area),
            contribution,
            share,
            error,
        }
    }

    /// High-error splats: those whose error is strictly above the quantile of all that have one.
    pub fn high_error(&self, quantile: f64) -> Vec<bool> {
        let mut errors: Vec<f64> = self.error.iter().copied().filter(|&e| e > 0.0).collect();
        if errors.is_empty() {
            return vec![false; self.error.len()];
        }
        let least = ERROR_SHARE_MIN * errors.iter().sum::<f64>() / errors.len() as f64;
        let at = (quantile * (errors.len() - 1) as f64).floor() as usize;
        let (_, &mut threshold, _) = errors.select_nth_unstable_by(at, f64::total_cmp);
        self.error.iter().map(|&e| e > threshold.max(least)).collect()
    }
}

/// The prune count after a check: one more if the splat was useless, zero if it was not, unchanged if the check
/// did not count (`None`).
pub fn prune_count_after(prune_count: u16, useless: Option<bool>) -> u16 {
    match useless {
        None => prune_count,
        Some(false) => 0,
        Some(true) => prune_count.saturating_add(1),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn statistics(error: Vec<f32>) -> WindowStatistics {
        let n = error.len();
        WindowStatistics { views: 2, seen: vec![1; n], area: vec![0.1; n], contribution: vec![0.1; n], error }
    }

    #[test]
    fn the_quantile_is_strict_and_equal_errors_select_no_splat() {
        let window = statistics((0..100).map(|i| i as f32 * 1e-3).collect());
        let high_error = Scores::new(&window, 4, ErrorMeasure::Mean, 5e-6).high_error(0.85);
        assert_eq!(high_error.iter().filter(|is_high| **is_high).count(), 15);
        assert!(high_error[85..].iter().all(|is_high| *is_high));
        let none = Scores::new(&statistics(vec![0.0; 10]), 4, ErrorMeasure::Mean, 5e-6);
        assert!(none.high_error(0.85).iter().all(|is_high| !is_high));
        let equal = Scores::new(&statistics(vec![0.3; 10]), 4, ErrorMeasure::Mean, 5e-6);
        assert!(equal.high_error(0.5).iter().all(|is_high| !is_high), "no splat is above the others");
    }

    #[test]
    fn small_errors_of_many_splats_count_and_negligible_ones_do_not() {
        // Nine splats in ten carry a millionth of the others' error.
        let errors = |scale: f32| {
            statistics(
                (0..100)
                    .map(|i| scale * if i < 90 { 1e-6 + 1e-9 * i as f32 } else { 1.0 + i as f32 })
                    .collect(),
            )
        };
        for scale in [1e-9, 1.0] {
            let scores = Scores::new(&errors(scale), 4, ErrorMeasure::Mass, 5e-6);
            let high = scores.high_error(0.5).iter().filter(|is_high| **is_high).count();
            assert_eq!(high, 10, "at {scale}");
        }
    }

    #[test]
    fn a_window_of_half_the_views_counts_double_and_the_mean_error_ignores_size() {
        let mut window = statistics(vec![0.05, 0.1]);
        window.contribution = vec![0.1, 0.2];
        let mean = Scores::new(&window, 4, ErrorMeasure::Mean, 0.0);
        assert!((mean.contribution[0] - 0.2).abs() < 1e-8 && (mean.area[0] - 0.2).abs() < 1e-8);
        assert!((mean.error[0] - mean.error[1]).abs() < 1e-6);
        let mass = Scores::new(&window, 4, ErrorMeasure::Mass, 0.0);
        assert!((mass.error[1] / mass.error[0] - 2.0).abs() < 1e-6, "twice the size, twice the mass");
        let hidden = Scores::new(&window, 4, ErrorMeasure::Mean, 0.3);
        assert_eq!(hidden.error[0], 0.0, "a splat that contributes too little has no error");
        assert!(hidden.error[1] > 0.0);
    }

    #[test]
    fn prune_counts_count_consecutive_checks() {
        let script = [Some(true), Some(true), None, Some(true), Some(false), Some(true)];
        let counts: Vec<u16> = script
            .iter()
            .scan(0, |prune_count, &useless| {
                *prune_count = prune_count_after(*prune_count, useless);
                Some(*prune_count)
            })
            .collect();
        assert_eq!(counts, [1, 2, 2, 3, 0, 1]);
    }
}
