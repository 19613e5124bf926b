//! What became of the splats that grew in the last density-control step, and of those that were withheld (method 6.14).

use super::growth::KINDS;
use super::history::{SplatHistory, Trial};
use super::score::Scores;

/// Losses of a group of splats over a window.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Outcome {
    /// Number of splats; a half counts as one.
    pub splats: f64,
    /// Their summed loss before the step.
    pub before: f64,
    /// Their summed loss after the window.
    pub after: f64,
    /// Sums of the squared losses before, of the losses before times those after, and of the squared losses after.
    pub squares: [f64; 3],
}

impl Outcome {
    /// The share of the loss that is left; `None` if there was none, or none is left.
    pub fn left(&self) -> Option<f64> {
        (self.before > 0.0 && self.after > 0.0).then(|| self.after / self.before)
    }

    /// Variance of [`Self::left`] over its square, of the ratio of two sums over independent splats. A few splats carry much of
    /// the loss, so that it may be large however many there are. `None` as there.
    pub fn relative_variance(&self) -> Option<f64> {
        let left = self.left()?;
        let [before, mixed, after] = self.squares;
        let deviations = (after - 2.0 * left * mixed + left * left * before).max(0.0);
        Some(deviations / (self.after * self.after))
    }

    /// The share of the loss that may be left at most: two standard errors above [`Self::left`]. `None` as there.
    pub fn left_at_most(&self) -> Option<f64> {
        Some(self.left()? * (1.0 + 2.0 * self.relative_variance()?.sqrt()))
    }

    /// Two groups taken together.
    pub fn and(self, other: Self) -> Self {
        Self {
            splats: self.splats + other.splats,
            before: self.before + other.before,
            after: self.after + other.after,
            squares: std::array::from_fn(|i| self.squares[i] + other.squares[i]),
        }
    }

    /// This outcome with less weight. (Its variance comes out too large for that, not too small.)
    pub fn faded(self, weight: f64) -> Self {
        Self {
            splats: weight * self.splats,
            before: weight * self.before,
            after: weight * self.after,
            squares: self.squares.map(|sum| weight * sum),
        }
    }

    /// The outcome of one splat.
    fn of(before: f64, after: f64) -> Self {
        let squares = [before * before, before * after, after * after];
        Self { splats: 1.0, before, after, squares }
    }
}

/// Outcomes of a window by kind of growth.
#[derive(Clone, Copy, Debug, Default)]
pub struct Outcomes {
    /// Splats that grew.
    pub grown: [Outcome; KINDS],
    /// Splats that were withheld from growth of this kind.
    pub withheld: [Outcome; KINDS],
}

impl Outcomes {
    /// Compares the losses of a window with those before it. Splats whose loss was unknown are left out.
    pub fn new(histories: &[SplatHistory], scores: &Scores) -> Self {
        let mut all = Self::default();
        for (history, &after) in
            histories.iter().zip(&scores.total).filter(|(history, _)| history.error > 0.0)
        {
            let group = match (history.trial, history.trial.grown()) {
                (Trial::Withheld(kind), _) => &mut all.withheld[kind as usize],
                (_, Some(kind)) => &mut all.grown[kind as usize],
                _ => continue,
            };
            *group = group.and(Outcome::of(history.error.into(), after));
        }
        all
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_few_large_losses_make_a_ratio_uncertain() {
        let group = |splats: &[(f64, f64)]| {
            splats
                .iter()
                .fold(Outcome::default(), |all, &(before, after)| all.and(Outcome::of(before, after)))
        };
        // Half is left, 10 of 20. Two splats are 1 off that: (1 + 1) / 10^2.
        let even = group(&[(4.0, 1.0), (2.0, 2.0), (6.0, 3.0), (4.0, 2.0), (4.0, 2.0)]);
        assert_eq!((even.left(), even.splats), (Some(0.5), 5.0));
        assert!((even.relative_variance().unwrap() - 0.02).abs() < 1e-12);
        assert!((even.left_at_most().unwrap() - (0.5 + 0.02_f64.sqrt())).abs() < 1e-12);
        // In another unit of the loss it is the same, and where one splat carries nearly all of it much larger.
        let scaled = group(&[(0.4, 0.1), (0.2, 0.2), (0.6, 0.3), (0.4, 0.2), (0.4, 0.2)]);
        assert!((scaled.relative_variance().unwrap() - 0.02).abs() < 1e-12);
        let uneven = group(&[(40.0, 4.0), (2.0, 2.0), (6.0, 3.0), (4.0, 2.0), (4.0, 2.0)]);
        assert!(uneven.relative_variance().unwrap() > 0.1);
        // Negative controls: nothing is uncertain where all keep the same share, and nothing is known without any.
        assert!(group(&[(4.0, 2.0), (2.0, 1.0)]).relative_variance().unwrap() < 1e-12);
        assert_eq!(Outcome::default().relative_variance(), None);
    }
}
