//! Growth in vain: splats that were split, or whose maps were refined, in the last step, and that carry no less loss for it
//! (method 6.14).

use super::history::{SplatHistory, Trial};
use super::score::Scores;

/// The share of its loss that a splat must lose by growth, beyond what training alone does.
const GAIN_MIN: f64 = 0.02;

/// Fewest withheld splats that tell what training alone does. Not measured.
const WITHHELD_MIN: usize = 10;

/// For each splat whether it grew in the last step to no avail. What training alone does to the loss is measured on the
/// splats that were withheld; if there are too few, nothing is found.
pub fn grew_in_vain(histories: &[SplatHistory], scores: &Scores) -> Vec<bool> {
    let is_known = |(history, _): &(&SplatHistory, &f64)| history.error > 0.0;
    let pairs = || histories.iter().zip(&scores.total);
    let has_grown =
        |history: &SplatHistory| history.trial == Trial::Split || history.trial.refined_axes().is_some();
    let withheld = pairs().filter(is_known).filter(|(history, _)| history.trial == Trial::Withheld);
    let (count, before, after) = withheld
        .fold((0, 0.0, 0.0), |(n, b, a), (history, &now)| (n + 1, b + f64::from(history.error), a + now));
    if count < WITHHELD_MIN {
        return vec![false; histories.len()];
    }
    let left = (1.0 - GAIN_MIN) * after / before;
    let in_vain = |(history, now): (&SplatHistory, &f64)| {
        has_grown(history) && history.error > 0.0 && *now > left * f64::from(history.error)
    };
    pairs().map(in_vain).collect()
}

#[cfg(test)]
mod tests {
    use super::super::settings::ErrorMeasure;
    use super::*;
    use crate::backend::WindowStatistics;

    #[test]
    fn growth_is_compared_with_splats_that_were_withheld() {
        let of = |trial, error| SplatHistory { trial, error, ..SplatHistory::first(2) };
        let withheld = |count| std::iter::repeat_n(of(Trial::Withheld, 1.0), count);
        let others = [
            of(Trial::None, 1.0),
            of(Trial::RefinedU, 1.0),
            of(Trial::RefinedBoth, 1.0),
            of(Trial::Split, 1.0),
            of(Trial::Split, 0.0),
        ];
        let found = |count: usize| {
            let histories: Vec<SplatHistory> = withheld(count).chain(others).collect();
            // Training alone leaves 0.6 of the loss.
            let of_withheld = (0..count).map(|i| if i % 2 == 0 { 0.5 } else { 0.7 });
            let errors: Vec<f32> = of_withheld.chain([9.0, 0.61, 0.5, 0.59, 0.6]).collect();
            let n = errors.len();
            let (seen, ones) = (vec![1; n], vec![0.1; n]);
            let window =
                WindowStatistics { views: 1, seen, area: ones.clone(), contribution: ones, error: errors };
            let scores = Scores::new(&window, 1, ErrorMeasure::Mass, 0.0);
            grew_in_vain(&histories, &scores).split_off(count)
        };
        assert_eq!(found(10), [false, true, false, true, false]);
        assert_eq!(found(8), [false; 5], "too few were withheld");
    }
}
