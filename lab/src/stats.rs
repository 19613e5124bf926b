//! Mean, standard deviation and 95 % interval of a few values, and the Pareto front.

/// Statistics of a few values.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stats {
    pub n: usize,
    pub mean: f64,
    /// Standard deviation (n - 1); `None` for a single value.
    pub sd: Option<f64>,
    pub min: f64,
    pub max: f64,
}

impl Stats {
    /// `None` without values.
    pub fn of(values: &[f64]) -> Option<Self> {
        let n = values.len();
        if n == 0 {
            return None;
        }
        let mean = values.iter().sum::<f64>() / n as f64;
        let squares: f64 = values.iter().map(|x| (x - mean) * (x - mean)).sum();
        Some(Self {
            n,
            mean,
            sd: (n > 1).then(|| (squares / (n - 1) as f64).sqrt()),
            min: values.iter().copied().fold(f64::INFINITY, f64::min),
            max: values.iter().copied().fold(f64::NEG_INFINITY, f64::max),
        })
    }

    /// Student's 95 % interval of the mean; `None` for a single value.
    pub fn interval95(&self) -> Option<(f64, f64)> {
        let half = t975(self.n - 1) * self.sd? / (self.n as f64).sqrt();
        Some((self.mean - half, self.mean + half))
    }
}

/// The 97.5 % quantile of Student's t with `df` degrees of freedom, at least 1.
pub fn t975(df: usize) -> f64 {
    let (mut low, mut high) = (0.0, 20.0);
    // Bisection; the quantile lies between 1.96 (df = infinity) and 12.71 (df = 1).
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if within(middle, df) < 0.95 { low = middle } else { high = middle }
    }
    0.5 * (low + high)
}

/// P(|T| <= t), by the finite series of Abramowitz and Stegun 26.7.3 and 26.7.4.
fn within(t: f64, df: usize) -> f64 {
    let angle = (t / (df as f64).sqrt()).atan();
    let (sin, cos) = angle.sin_cos();
    let odd = df % 2 == 1;
    // Odd: cos + 2/3 cos^3 + 2*4/(3*5) cos^5 ...; even: 1 + 1/2 cos^2 + 1*3/(2*4) cos^4 ...; up to cos^(df-2).
    let (mut term, mut power) = if odd { (cos, 1) } else { (1.0, 0) };
    let mut sum = 0.0;
    while power + 2 <= df {
        sum += term;
        power += 2;
        term *= cos * cos * (power - 1) as f64 / power as f64;
    }
    if odd { (angle + sin * sum) * std::f64::consts::FRAC_2_PI } else { sin * sum }
}

/// Marks the points (cost, quality) that no other dominates, that is, costs no more and is at least as good without
/// being equal. Ties are kept; points with a NaN or infinity never belong to the front.
pub fn pareto_front(points: &[(f64, f64)]) -> Vec<bool> {
    let dominates = |a: &(f64, f64), b: &(f64, f64)| a.0 <= b.0 && a.1 >= b.1 && a != b;
    let finite = |p: &(f64, f64)| p.0.is_finite() && p.1.is_finite();
    points.iter().map(|p| finite(p) && !points.iter().any(|q| finite(q) && dominates(q, p))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_match_published_tables() {
        for (df, t) in [
            (1, 12.7062),
            (2, 4.30265),
            (3, 3.18245),
            (4, 2.77645),
            (7, 2.36462),
            (10, 2.22814),
            (29, 2.04523),
            (120, 1.97993),
            (5000, 1.96044),
        ] {
            assert!((t975(df) - t).abs() < 1e-4, "{df}: {} instead of {t}", t975(df));
        }
    }

    #[test]
    fn intervals_match_hand_computed_ones() {
        let stats = Stats::of(&[1.0, 2.0, 3.0, 4.0, 5.0]).unwrap();
        assert_eq!((stats.n, stats.mean, stats.min, stats.max), (5, 3.0, 1.0, 5.0));
        assert!((stats.sd.unwrap() - 1.581_139).abs() < 1e-6);
        let (low, high) = stats.interval95().unwrap();
        // 3 +- 2.77645 * 1.581139 / sqrt(5).
        assert!((low - 1.036_757).abs() < 1e-5 && (high - 4.963_243).abs() < 1e-5);
        let single = Stats::of(&[7.0]).unwrap();
        assert_eq!((single.sd, single.interval95()), (None, None));
        assert_eq!(Stats::of(&[]), None);
        assert_eq!(Stats::of(&[2.0; 4]).unwrap().interval95(), Some((2.0, 2.0)));
    }

    #[test]
    fn the_front_holds_all_undominated_points() {
        let points =
            [(1.0, 20.0), (2.0, 25.0), (2.0, 24.0), (3.0, 25.0), (4.0, 26.0), (4.0, 26.0), (0.5, f64::NAN)];
        assert_eq!(pareto_front(&points), [true, true, false, false, true, true, false]);
        // Negative control: with the sign of quality flipped the front is another.
        let turned = points.map(|(cost, quality)| (cost, -quality));
        assert_eq!(pareto_front(&turned), [true, false, false, false, false, false, false]);
        assert!(pareto_front(&[]).is_empty());
    }
}
