//! Paired comparison of variants with the baseline: differences with their 95 % t intervals, and what may be
//! concluded from them. Rests on pairs only; who is paired with whom is told in each row.

use super::measure::{Better, Measure};
use super::stats::Sample;
use super::study::{Group, Study};

/// Pairs that a claim needs.
pub const CLAIM_PAIRS_MIN: usize = 5;

/// What follows from an interval.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// No pairs.
    Nothing,
    /// One pair: no interval.
    Single,
    /// The interval holds 0.
    Undecided,
    /// All differences are 0.
    Equal,
    /// The interval excludes 0, on the good side.
    Better,
    /// On the bad side.
    Worse,
}

/// Differences of a variant to the baseline in one measure.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Difference {
    /// Of the differences, or of the logarithms of the ratios; `None` without pairs.
    pub sample: Option<Sample>,
    /// Whether it is of ratios.
    pub is_ratio: bool,
    /// What follows.
    pub verdict: Verdict,
}

impl Difference {
    /// Of these differences `variant - baseline`.
    pub fn of(values: &[f64], measure: &Measure) -> Self {
        let sample = Sample::of(values);
        let verdict = match sample.map(|s| (s, s.interval95())) {
            None => Verdict::Nothing,
            Some((_, None)) => Verdict::Single,
            Some((s, _)) if s.min == 0.0 && s.max == 0.0 => Verdict::Equal,
            Some((_, Some((low, high)))) if low <= 0.0 && high >= 0.0 => Verdict::Undecided,
            Some((s, _)) if (s.mean > 0.0) == (measure.better == Better::Higher) => Verdict::Better,
            Some(_) => Verdict::Worse,
        };
        Self { sample, is_ratio: measure.is_cost, verdict }
    }

    /// Number of pairs.
    pub fn n(&self) -> usize {
        self.sample.map_or(0, |s| s.n)
    }

    /// Mean difference; per cent for ratios.
    pub fn mean(&self) -> Option<f64> {
        self.sample.map(|s| self.told(s.mean))
    }

    /// Its 95 % interval.
    pub fn interval(&self) -> Option<(f64, f64)> {
        let (low, high) = self.sample?.interval95()?;
        Some((self.told(low), self.told(high)))
    }

    /// The verdict in words.
    pub fn words(&self) -> String {
        let few = self.n() < CLAIM_PAIRS_MIN;
        let weight = if few { format!(" (only {} pairs)", self.n()) } else { String::new() };
        match self.verdict {
            Verdict::Nothing => "no pairs".to_owned(),
            Verdict::Single => "1 pair: no interval".to_owned(),
            Verdict::Undecided => "not decided".to_owned(),
            Verdict::Equal => "equal".to_owned(),
            Verdict::Better => format!("better{weight}"),
            Verdict::Worse => format!("worse{weight}"),
        }
    }

    fn told(&self, value: f64) -> f64 {
        if self.is_ratio { 100.0 * value.exp_m1() } else { value }
    }
}

/// Which pairs a row is about.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Scope<'a> {
    /// Seeds of one scene and budget.
    Cell(&'a str, &'a str),
    /// All seeds of all scenes and budgets.
    AllPairs,
    /// Means of scenes.
    Scenes,
}

/// Differences of a variant to the baseline.
pub fn compare(study: &Study, variant: &str, scope: Scope<'_>, measure: &Measure) -> Difference {
    let of = |scene: &str, budget: &str| -> Vec<f64> {
        let [a, b] = [variant, &study.baseline].map(|v| study.group(scene, v, budget));
        study.differences(&a, &b, measure)
    };
    let of_scene = |scene: &String| -> Vec<f64> { study.budgets.iter().flat_map(|b| of(scene, b)).collect() };
    let values = match scope {
        Scope::Cell(scene, budget) => of(scene, budget),
        Scope::AllPairs => study.scenes.iter().flat_map(of_scene).collect(),
        Scope::Scenes => study.scenes.iter().filter_map(|s| Some(Sample::of(&of_scene(s))?.mean)).collect(),
    };
    Difference::of(&values, measure)
}

/// Differences between any two groups of a scene, by seed.
pub fn compare_groups(study: &Study, a: &Group<'_>, b: &Group<'_>, measure: &Measure) -> Difference {
    Difference::of(&study.differences(a, b, measure), measure)
}

#[cfg(test)]
mod tests {
    use super::super::fixtures::{record, records};
    use super::super::study::Options;
    use super::*;

    fn study(records: Vec<crate::results::Record>) -> Study {
        Study::new(vec![records], &Options::default()).unwrap()
    }

    #[test]
    fn pairs_find_what_the_spread_of_seeds_hides() {
        let study = study(records());
        let psnr = study.qualities[0].clone();
        let paired = compare(&study, "=textured", Scope::Cell("fox", "300 steps"), &psnr);
        // Differences 0.51, 0.52, 0.50, 0.51, 0.52: mean 0.512, sd 0.00837, half width 2.776 sd / sqrt 5.
        let (low, high) = paired.interval().unwrap();
        assert!((paired.mean().unwrap() - 0.512).abs() < 1e-9);
        assert!((low - 0.501_611).abs() < 1e-5 && (high - 0.522_389).abs() < 1e-5, "{low} {high}");
        assert_eq!((paired.n(), paired.words().as_str()), (5, "better"));
        assert_eq!(compare(&study, "=textured", Scope::AllPairs, &psnr).n(), 10);
        let scenes = compare(&study, "=textured", Scope::Scenes, &psnr);
        assert_eq!(scenes.n(), 2);
    }

    #[test]
    fn a_permuted_pairing_gives_other_intervals() {
        let mut permuted = records();
        for r in permuted.iter_mut().filter(|r| r.variant == "plain") {
            r.seed = r.seed % 5 + 1;
        }
        let right = study(records());
        let psnr = right.qualities[0].clone();
        let scope = Scope::Cell("fox", "300 steps");
        let [right, wrong] = [right, study(permuted)].map(|s| compare(&s, "=textured", scope, &psnr));
        assert_eq!(right.verdict, Verdict::Better);
        // The mean is the same whoever is paired with whom; what is known of it is not.
        assert!((right.mean().unwrap() - wrong.mean().unwrap()).abs() < 1e-9);
        assert_eq!(wrong.verdict, Verdict::Undecided);
        let width = |d: Difference| d.interval().map(|(low, high)| high - low).unwrap();
        assert!(width(wrong) > 20.0 * width(right));
    }

    #[test]
    fn costs_are_ratios_and_less_is_better() {
        let study = study(records());
        let params = compare(&study, "=textured", Scope::AllPairs, &study.params);
        assert!((params.mean().unwrap() - 100.0 * (830.0 / 590.0 - 1.0)).abs() < 1e-9);
        assert_eq!((params.verdict, params.n()), (Verdict::Worse, 10));
        let psnr = &study.qualities[0];
        assert_eq!(compare(&study, "plain", Scope::AllPairs, psnr).verdict, Verdict::Equal);
    }

    #[test]
    fn one_pair_gives_no_interval_and_no_win() {
        let two = vec![record(0, ("s", "a", "b"), 1, 20.0), record(1, ("s", "c", "b"), 1, 25.0)];
        let study = study(two);
        let psnr = &study.qualities[0];
        let single = compare(&study, "c", Scope::AllPairs, psnr);
        assert_eq!((single.mean(), single.interval()), (Some(5.0), None));
        assert_eq!(single.words(), "1 pair: no interval");
        let nothing = compare(&study, "c", Scope::Cell("s", "other"), psnr);
        assert_eq!((nothing.n(), nothing.verdict), (0, Verdict::Nothing));
    }

    #[test]
    fn times_are_compared_on_one_machine_and_in_quiet_only() {
        let mut all = records();
        all.iter_mut().filter(|r| r.seed == 2 && r.variant == "plain").for_each(|r| r.noisy = true);
        all.iter_mut().filter(|r| r.seed == 3 && r.variant == "plain").for_each(|r| r.cores = 64);
        let study = study(all);
        assert_eq!(compare(&study, "=textured", Scope::AllPairs, &study.time).n(), 6);
        assert_eq!(compare(&study, "=textured", Scope::AllPairs, &study.qualities[0]).n(), 10);
        let codes: Vec<&str> = study.report.warnings.iter().map(|w| w.code.as_str()).collect();
        assert_eq!(codes, ["noisy-runs", "several-machines"]);
    }
}
