//! Growth in vain: splats that were split, or whose maps were refined, in the last step, and that carry no less loss for it
//! (method 6.14).

use super::growth::{Kind, WITHHELD_MIN};
use super::history::SplatHistory;
use super::outcome::Outcomes;
use super::score::Scores;

/// The share of its loss that a splat must lose by growth, beyond what training alone does.
const GAIN_MIN: f64 = 0.02;

/// For each splat whether it grew in the last step to no avail: it keeps more of its loss than training alone may leave, two
/// standard errors above what it left to the splats that were withheld from the same kind of growth. If there are too few of
/// those, nothing is found. Bands learn slowly and are judged later (method 6.13).
pub fn grew_in_vain(histories: &[SplatHistory], scores: &Scores, window: &Outcomes) -> Vec<bool> {
    let left = |kind: Kind| {
        let withheld = window.withheld[kind as usize];
        withheld
            .left_at_most()
            .filter(|_| withheld.splats >= WITHHELD_MIN)
            .map(|left| (1.0 - GAIN_MIN) * left)
    };
    let [of_splits, of_refined] = [Kind::Split, Kind::Refined].map(left);
    let in_vain = |(history, &now): (&SplatHistory, &f64)| {
        let left = match history.trial.grown() {
            Some(Kind::Split) => of_splits,
            Some(Kind::Refined) => of_refined,
            Some(Kind::Band) | None => None,
        };
        left.is_some_and(|left| history.error > 0.0 && now > left * f64::from(history.error))
    };
    histories.iter().zip(&scores.total).map(in_vain).collect()
}

#[cfg(test)]
mod tests {
    use super::super::history::Trial;
    use super::super::settings::ErrorMeasure;
    use super::*;
    use crate::backend::WindowStatistics;

    #[test]
    fn growth_is_compared_with_splats_that_were_withheld() {
        let of = |trial, error| SplatHistory { trial, error, ..SplatHistory::first(2) };
        let from = |kind, count| std::iter::repeat_n(of(Trial::Withheld(kind), 1.0), count);
        let others = [
            of(Trial::None, 1.0),
            of(Trial::RefinedU, 1.0),
            of(Trial::RefinedBoth, 1.0),
            of(Trial::Split, 1.0),
            of(Trial::Split, 1.0),
            of(Trial::Split, 0.0),
        ];
        let found = |splits: usize, maps: usize| {
            let withheld = from(Kind::Split, splits).chain(from(Kind::Refined, maps));
            let histories: Vec<SplatHistory> = withheld.chain(others).collect();
            // Training alone leaves 0.6 of the loss of splats withheld from splits, with a standard error of 0.032, and 0.8 of
            // the others': 0.65 and 0.85 less a fiftieth are the bounds.
            let around =
                |left: f32, count| (0..count).map(move |i| left + if i % 2 == 0 { 0.1 } else { -0.1 });
            let errors =
                around(0.6, splits).chain(around(0.8, maps)).chain([9.0, 0.86, 0.83, 0.66, 0.64, 0.6]);
            let errors: Vec<f32> = errors.collect();
            let n = errors.len();
            let (seen, ones) = (vec![1; n], vec![0.1; n]);
            let window =
                WindowStatistics { views: 1, seen, area: ones.clone(), contribution: ones, error: errors };
            let scores = Scores::new(&window, 1, ErrorMeasure::Mass, 0.0);
            grew_in_vain(&histories, &scores, &Outcomes::new(&histories, &scores)).split_off(splits + maps)
        };
        assert_eq!(found(10, 10), [false, true, false, true, false, false]);
        assert_eq!(found(10, 8), [false, false, false, true, false, false], "too few maps were withheld");
        assert_eq!(found(8, 8), [false; 6]);
    }
}
