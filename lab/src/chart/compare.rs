//! Paired comparison of variants with the baseline: differences, their 95 % intervals, and what may be concluded.

use super::measure::Measure;
use super::study::Study;
use crate::stats::Stats;

/// Fewer pairs are marked as too few for a claim.
pub const CLAIM_PAIRS_MIN: usize = 5;

/// What follows from the 95 % interval.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Conclusion {
    NoPairs,
    /// One pair has no interval.
    SinglePair,
    /// The interval contains 0.
    Undecided,
    /// All differences are 0.
    Equal,
    /// The whole interval is on the good side of 0.
    Better,
    /// The whole interval is on the bad side of 0.
    Worse,
}

/// Paired differences in one measure.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Difference {
    /// Of the differences, or of the logarithms of ratios; `None` without pairs.
    pub stats: Option<Stats>,
    pub is_ratio: bool,
    pub conclusion: Conclusion,
}

impl Difference {
    /// From the values of [`Study::differences`].
    pub fn of(values: &[f64], measure: &Measure) -> Self {
        let stats = Stats::of(values);
        let conclusion = match stats.map(|s| (s, s.interval95())) {
            None => Conclusion::NoPairs,
            Some((_, None)) => Conclusion::SinglePair,
            Some((s, _)) if s.min == 0.0 && s.max == 0.0 => Conclusion::Equal,
            Some((_, Some((low, high)))) if low <= 0.0 && high >= 0.0 => Conclusion::Undecided,
            Some((s, _)) if (s.mean > 0.0) == measure.is_gain => Conclusion::Better,
            Some(_) => Conclusion::Worse,
        };
        Self { stats, is_ratio: measure.is_cost, conclusion }
    }

    /// Number of pairs.
    pub fn n(&self) -> usize {
        self.stats.map_or(0, |s| s.n)
    }

    /// Mean difference; a percentage for ratios.
    pub fn mean(&self) -> Option<f64> {
        self.stats.map(|s| self.in_unit(s.mean))
    }

    /// 95 % interval of the mean difference.
    pub fn interval(&self) -> Option<(f64, f64)> {
        let (low, high) = self.stats?.interval95()?;
        Some((self.in_unit(low), self.in_unit(high)))
    }

    /// The conclusion, with a note where pairs are few.
    pub fn words(&self) -> String {
        let few = self.n() < CLAIM_PAIRS_MIN;
        let weight = if few { format!(" (only {} pairs)", self.n()) } else { String::new() };
        match self.conclusion {
            Conclusion::NoPairs => "no pairs".to_owned(),
            Conclusion::SinglePair => "1 pair: no interval".to_owned(),
            Conclusion::Undecided => "not decided".to_owned(),
            Conclusion::Equal => "equal".to_owned(),
            Conclusion::Better => format!("better{weight}"),
            Conclusion::Worse => format!("worse{weight}"),
        }
    }

    fn in_unit(&self, value: f64) -> f64 {
        if self.is_ratio { 100.0 * value.exp_m1() } else { value }
    }
}

/// Which runs a comparison pools.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Scope<'a> {
    /// The seeds of one scene and budget.
    SceneBudget(&'a str, &'a str),
    /// All seeds of all scenes and budgets.
    AllPairs,
    /// One mean per scene.
    SceneMeans,
}

impl<'a> Scope<'a> {
    /// All scopes that differ, the widest first.
    pub fn all(study: &'a Study) -> Vec<Self> {
        let mut all = vec![Self::AllPairs];
        if study.scenes.len() > 1 {
            all.push(Self::SceneMeans);
        }
        if study.scenes.len() * study.budgets.len() > 1 {
            let of_scene =
                |scene: &'a String| study.budgets.iter().map(move |budget| Self::SceneBudget(scene, budget));
            all.extend(study.scenes.iter().flat_map(of_scene));
        }
        all
    }
}

/// Compares a variant with the baseline.
pub fn compare(study: &Study, variant: &str, scope: Scope<'_>, measure: &Measure) -> Difference {
    let of = |scene: &str, budget: &str| -> Vec<f64> {
        let [a, b] = [variant, &study.baseline].map(|v| study.group(scene, v, budget));
        study.differences(&a, &b, measure)
    };
    let of_scene = |scene: &String| -> Vec<f64> { study.budgets.iter().flat_map(|b| of(scene, b)).collect() };
    let values = match scope {
        Scope::SceneBudget(scene, budget) => of(scene, budget),
        Scope::AllPairs => study.scenes.iter().flat_map(of_scene).collect(),
        Scope::SceneMeans => {
            study.scenes.iter().filter_map(|s| Some(Stats::of(&of_scene(s))?.mean)).collect()
        }
    };
    Difference::of(&values, measure)
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
    fn pairing_detects_differences_below_the_seed_spread() {
        let study = study(records());
        let psnr = study.qualities[0].clone();
        let paired = compare(&study, "=textured", Scope::SceneBudget("fox", "300 steps"), &psnr);
        // Differences 0.51, 0.52, 0.50, 0.51, 0.52: mean 0.512, sd 0.00837, half width 2.776 sd / sqrt 5.
        let (low, high) = paired.interval().unwrap();
        assert!((paired.mean().unwrap() - 0.512).abs() < 1e-9);
        assert!((low - 0.501_611).abs() < 1e-5 && (high - 0.522_389).abs() < 1e-5, "{low} {high}");
        assert_eq!((paired.n(), paired.words().as_str()), (5, "better"));
        assert_eq!(compare(&study, "=textured", Scope::AllPairs, &psnr).n(), 10);
        let scenes = compare(&study, "=textured", Scope::SceneMeans, &psnr);
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
        let scope = Scope::SceneBudget("fox", "300 steps");
        let [right, wrong] = [right, study(permuted)].map(|s| compare(&s, "=textured", scope, &psnr));
        assert_eq!(right.conclusion, Conclusion::Better);
        // The mean does not depend on the pairing; the interval does.
        assert!((right.mean().unwrap() - wrong.mean().unwrap()).abs() < 1e-9);
        assert_eq!(wrong.conclusion, Conclusion::Undecided);
        let width = |d: Difference| d.interval().map(|(low, high)| high - low).unwrap();
        assert!(width(wrong) > 20.0 * width(right));
    }

    #[test]
    fn costs_are_compared_as_ratios_and_lower_is_better() {
        let study = study(records());
        let params = compare(&study, "=textured", Scope::AllPairs, &study.params);
        assert!((params.mean().unwrap() - 100.0 * (830.0 / 590.0 - 1.0)).abs() < 1e-9);
        assert_eq!((params.conclusion, params.n()), (Conclusion::Worse, 10));
        let psnr = &study.qualities[0];
        assert_eq!(compare(&study, "plain", Scope::AllPairs, psnr).conclusion, Conclusion::Equal);
    }

    #[test]
    fn one_pair_gives_no_interval_and_no_conclusion() {
        let two = vec![record(0, ("s", "a", "b"), 1, 20.0), record(1, ("s", "c", "b"), 1, 25.0)];
        let study = study(two);
        let psnr = &study.qualities[0];
        let single = compare(&study, "c", Scope::AllPairs, psnr);
        assert_eq!((single.mean(), single.interval()), (Some(5.0), None));
        assert_eq!(single.words(), "1 pair: no interval");
        let nothing = compare(&study, "c", Scope::SceneBudget("s", "other"), psnr);
        assert_eq!((nothing.n(), nothing.conclusion), (0, Conclusion::NoPairs));
    }

    #[test]
    fn times_are_compared_only_on_one_quiet_machine() {
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
