//! What a matrix expects of its runs: limits on figures, and on their differences and ratios to other runs. Limits
//! apply to means over the seeds.

use crate::results::{Record, Status};
use crate::stats::Stats;
use serde::Deserialize;

/// Exit codes of the program by which a run tells what is wrong with its input.
const CLEAR_ERRORS: std::ops::RangeInclusive<i32> = 2..=4;

/// A limit on a figure of a scene, for each variant.
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case", default)]
pub struct Check {
    /// What is checked, for people.
    pub name: String,
    /// JSON pointer into the summary: a number, or a list of names for `contains`.
    pub measure: String,
    /// Names that the list should have; the figure is the share that it has.
    pub contains: Vec<String>,
    /// The figure of this scene minus the own figure.
    pub from_scene: Option<String>,
    /// The own figure divided by that of this scene.
    pub over_scene: Option<String>,
    /// The figure of this variant minus the own figure.
    pub from_variant: Option<String>,
    /// The own figure divided by that of this variant.
    pub over_variant: Option<String>,
    /// The own figure divided by this number, such as that of the smallest model known.
    pub over: Option<f64>,
    /// The own figure divided by this other figure of the same runs, a JSON pointer too.
    pub over_measure: Option<String>,
    /// The list has the evaluations of a run; the figure is the CPU time at the first with at least this PSNR, seconds.
    pub reaches: Option<f64>,
    /// Largest value that passes.
    pub at_most: Option<f64>,
    /// Smallest value that passes.
    pub at_least: Option<f64>,
    /// The limit is a multiple of the value that this variant has, and never below 0.
    pub times_variant: Option<String>,
    /// The limit is a multiple of the standard deviation over the seeds of `from_scene`.
    pub times_sd: bool,
    /// Whether a run may also end with an error message.
    pub may_fail: bool,
}

/// Whether a check passes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// Every limit is kept.
    Pass,
    /// A limit is exceeded, or a run failed.
    Fail,
    /// There is no limit: the figure is only shown.
    Shown,
    /// Runs or figures are missing.
    Unknown,
}

/// What a check found for a variant.
#[derive(Clone, Debug, PartialEq)]
pub struct Finding {
    /// Whether the check passes.
    pub verdict: Verdict,
    /// The value that has limits; `None` without one.
    pub value: Option<f64>,
    /// Why there is no value, or what limit the value has besides the numbers in the check.
    pub remark: String,
}

impl Check {
    /// Whether the check makes sense, with a message that says what does not.
    ///
    /// # Errors
    /// The message.
    pub fn validate(&self) -> Result<(), String> {
        let references = [&self.from_scene, &self.over_scene, &self.from_variant, &self.over_variant];
        let others = [self.over.is_some(), self.over_measure.is_some()];
        let given = references.iter().map(|r| r.is_some()).chain(others).filter(|is_given| *is_given);
        let is_pointer = |text: &String| text.starts_with('/');
        let expected = if !is_pointer(&self.measure) {
            "measure, a JSON pointer into the summary such as \"/quality/psnr\""
        } else if given.count() > 1 {
            "at most one of from-scene, over-scene, from-variant, over-variant, over and over-measure"
        } else if self.over.is_some_and(|over| !(over > 0.0 && over.is_finite())) {
            "over, a number above 0"
        } else if !self.over_measure.as_ref().is_none_or(is_pointer) {
            "over-measure, a JSON pointer into the summary such as \"/size/splats\""
        } else if self.times_sd && self.from_scene.is_none() {
            "from-scene beside times-sd"
        } else if (self.times_sd || self.times_variant.is_some()) && !self.has_limits() {
            "at-most, at-least or both beside times-sd and times-variant"
        } else if self.reaches.is_some() && (!self.contains.is_empty() || self.over_measure.is_some()) {
            "reaches without contains and over-measure"
        } else {
            return Ok(());
        };
        Err(format!("check {:?}: expected {expected}", self.title()))
    }

    fn has_limits(&self) -> bool {
        self.at_most.is_some() || self.at_least.is_some()
    }

    /// What is checked and its limits, for people.
    pub fn title(&self) -> String {
        let what = if self.name.is_empty() { &self.measure } else { &self.name };
        let unit = match (&self.times_variant, self.times_sd) {
            (Some(variant), _) => format!(" x {variant}"),
            (None, true) => " sd".to_owned(),
            (None, false) => String::new(),
        };
        let limit = |sign: &str, limit: Option<f64>| limit.map(|x| format!("{sign} {x}{unit}"));
        let limits: Vec<String> =
            [limit("≤", self.at_most), limit("≥", self.at_least)].into_iter().flatten().collect();
        if limits.is_empty() { what.clone() } else { format!("{what} {}", limits.join(" and ")) }
    }

    /// The finding for a variant of a scene.
    pub fn find(&self, records: &[Record], scene: &str, variant: &str) -> Finding {
        let unknown =
            |remark: &str| Finding { verdict: Verdict::Unknown, value: None, remark: remark.to_owned() };
        let own: Vec<&Record> = of(records, scene, variant).collect();
        let failed: Vec<&&Record> = own.iter().filter(|r| r.status == Status::Failed).collect();
        if own.is_empty() {
            return unknown("not run");
        }
        if !failed.is_empty() {
            let is_clear = |r: &Record| r.exit_code.is_some_and(|code| CLEAR_ERRORS.contains(&code));
            let passes = self.may_fail && failed.len() == own.len() && failed.iter().all(|r| is_clear(r));
            let verdict = if passes { Verdict::Pass } else { Verdict::Fail };
            return Finding { verdict, value: None, remark: "error".to_owned() };
        }
        let value = self.value(records, scene, variant);
        if !self.has_limits() {
            let remark = match value {
                Some(_) => "",
                None if self.reaches.is_some() => "never",
                None => "no figure",
            };
            return Finding { verdict: Verdict::Shown, value, remark: remark.to_owned() };
        }
        let Some(value) = value else { return unknown("no figure") };
        let factor = match (&self.times_variant, self.times_sd) {
            (Some(other), _) => self.value(records, scene, other).map(|v| v.max(0.0)),
            (None, true) => self.from_scene.as_ref().and_then(|from| self.stats(records, from, variant)?.sd),
            (None, false) => Some(1.0),
        };
        let Some(factor) = factor else { return unknown("no limit") };
        let passes = self.at_most.is_none_or(|limit| value <= limit * factor)
            && self.at_least.is_none_or(|limit| value >= limit * factor);
        let remark = if factor == 1.0 { String::new() } else { format!("times {factor:.3}") };
        Finding { verdict: if passes { Verdict::Pass } else { Verdict::Fail }, value: Some(value), remark }
    }

    fn value(&self, records: &[Record], scene: &str, variant: &str) -> Option<f64> {
        let own = self.mean(records, scene, variant)?;
        let other = |of_scene: &Option<String>, of_variant: &Option<String>| {
            let is_given = of_scene.is_some() || of_variant.is_some();
            let (scene, variant) =
                (of_scene.as_deref().unwrap_or(scene), of_variant.as_deref().unwrap_or(variant));
            is_given.then(|| self.mean(records, scene, variant))
        };
        if let Some(from) = other(&self.from_scene, &self.from_variant) {
            return Some(from? - own);
        }
        if let Some(over) = other(&self.over_scene, &self.over_variant) {
            return Some(ratio(own, over?));
        }
        if let Some(measure) = &self.over_measure {
            let other = Self { measure: measure.clone(), contains: Vec::new(), ..self.clone() };
            return Some(ratio(own, other.mean(records, scene, variant)?));
        }
        Some(own / self.over.unwrap_or(1.0))
    }

    fn figure(&self, record: &Record) -> Option<f64> {
        if let Some(psnr) = self.reaches {
            let points = record.points(&self.measure, ["psnr_test", "cpu_secs"]);
            return points.iter().find(|p| p[0] >= psnr).map(|p| p[1]);
        }
        if self.contains.is_empty() {
            return record.number(&self.measure);
        }
        record.summary.as_ref()?;
        let list = record.value(&self.measure).and_then(|v| v.as_array());
        let has = |name: &&String| list.is_some_and(|l| l.iter().any(|v| v.as_str() == Some(name)));
        Some(self.contains.iter().filter(has).count() as f64 / self.contains.len() as f64)
    }

    fn stats(&self, records: &[Record], scene: &str, variant: &str) -> Option<Stats> {
        let figures: Vec<Option<f64>> = of(records, scene, variant).map(|r| self.figure(r)).collect();
        // Runs that never reach the PSNR must not drop out of the mean.
        if self.reaches.is_some() && figures.contains(&None) {
            return None;
        }
        Stats::of(&figures.into_iter().flatten().collect::<Vec<_>>())
    }

    fn mean(&self, records: &[Record], scene: &str, variant: &str) -> Option<f64> {
        Some(self.stats(records, scene, variant)?.mean)
    }
}

/// Nothing is as much as nothing.
fn ratio(own: f64, other: f64) -> f64 {
    if own == other { 1.0 } else { own / other }
}

fn of<'a>(records: &'a [Record], scene: &str, variant: &str) -> impl Iterator<Item = &'a Record> {
    records.iter().filter(move |r| r.scene == scene && r.variant == variant)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::chart::fixtures::record;

    fn runs() -> Vec<Record> {
        let mut all = Vec::new();
        for (scene, loss) in [("control", 0.0), ("hard", 2.0)] {
            for (variant, gain) in [("paper", 0.0), ("ours", 0.5)] {
                for seed in 1..=3 {
                    // A standard deviation of 0.1.
                    let psnr = 25.0 - loss * (1.0 - gain) + 0.1 * (seed as f64 - 2.0);
                    all.push(record(all.len(), (scene, variant, "b"), seed, psnr));
                }
            }
        }
        all
    }

    fn check(text: &str) -> Check {
        let check: Check = toml::from_str(text).unwrap();
        check.validate().unwrap();
        check
    }

    #[test]
    fn limits_apply_to_losses_ratios_and_multiples() {
        let runs = runs();
        let psnr = "measure = '/quality/psnr'\n";
        for (rest, value, passes) in [
            ("at-least = 20", 24.0, true),
            ("at-least = 24.5", 24.0, false),
            ("from-scene = 'control'\nat-most = 1.1", 1.0, true),
            ("from-scene = 'control'\nat-most = 0.5", 1.0, false),
            ("from-scene = 'control'\nat-most = 0.55\ntimes-variant = 'paper'", 1.0, true),
            ("from-scene = 'control'\nat-most = 0.45\ntimes-variant = 'paper'", 1.0, false),
            ("from-scene = 'control'\nat-most = 11\ntimes-sd = true", 1.0, true),
            ("from-scene = 'control'\nat-most = 9\ntimes-sd = true", 1.0, false),
            ("from-variant = 'paper'\nat-most = -0.9", -1.0, true),
            ("over-scene = 'control'\nat-most = 1.0\nat-least = 0.95", 24.0 / 25.0, true),
            ("over-variant = 'paper'\nat-least = 1.1", 24.0 / 23.0, false),
            ("over = 12\nat-most = 2", 2.0, true),
            ("over = 8\nat-most = 2", 3.0, false),
            ("over-measure = '/size/splats'\nat-most = 0.0024", 0.0024, true),
            ("over-measure = '/size/splats'\nat-most = 0.0023", 0.0024, false),
        ] {
            let found = check(&format!("{psnr}{rest}")).find(&runs, "hard", "ours");
            assert!((found.value.unwrap() - value).abs() < 1e-9, "{rest}: {found:?}");
            assert_eq!(
                found.verdict,
                if passes { Verdict::Pass } else { Verdict::Fail },
                "{rest}: {found:?}"
            );
        }
    }

    #[test]
    fn failed_runs_fail_unless_a_clear_error_is_allowed() {
        let mut runs = runs();
        let limit = "measure = '/quality/psnr'\nat-least = 1\n";
        let verdict =
            |runs: &[Record], rest: &str| check(&format!("{limit}{rest}")).find(runs, "hard", "ours").verdict;
        for run in runs.iter_mut().filter(|r| r.scene == "hard") {
            (run.status, run.exit_code, run.summary) = (Status::Failed, Some(3), None);
        }
        assert_eq!(verdict(&runs, ""), Verdict::Fail);
        assert_eq!(verdict(&runs, "may-fail = true"), Verdict::Pass);
        for run in runs.iter_mut().filter(|r| r.scene == "hard" && r.seed == 1) {
            run.exit_code = Some(101);
        }
        assert_eq!(verdict(&runs, "may-fail = true"), Verdict::Fail);
        assert_eq!(verdict(&[], ""), Verdict::Unknown);
        let missing = Check { measure: "/quality/none".to_owned(), at_most: Some(1.0), ..Check::default() };
        assert_eq!(missing.find(&runs, "control", "ours").verdict, Verdict::Unknown);
    }

    #[test]
    fn lists_are_checked_for_names() {
        let mut runs = runs();
        let names = check("measure = '/outliers'\ncontains = ['a', 'b']\nat-least = 1");
        let found = |runs: &[Record]| names.find(runs, "hard", "ours");
        // Without the list nothing is found.
        assert_eq!((found(&runs).verdict, found(&runs).value), (Verdict::Fail, Some(0.0)));
        for (list, verdict) in [(vec!["b"], Verdict::Fail), (vec!["b", "c", "a"], Verdict::Pass)] {
            runs.iter_mut().for_each(|r| r.summary.as_mut().unwrap()["outliers"] = list.clone().into());
            assert_eq!(found(&runs).verdict, verdict);
        }
    }

    #[test]
    fn figures_without_limits_are_only_shown() {
        let mut runs = runs();
        let found = |runs: &[Record], text: &str| check(text).find(runs, "hard", "ours");
        let over = found(&runs, "measure = '/quality/psnr'\nover = 12");
        assert_eq!((over.verdict, over.value.map(f64::round)), (Verdict::Shown, Some(2.0)));
        let curve = [(20.0, 1.5), (30.0, 2.5), (29.0, 3.5)];
        let curve: Vec<_> = curve.map(|(p, s)| serde_json::json!({"psnr_test": p, "cpu_secs": s})).into();
        runs.iter_mut().for_each(|r| r.summary.as_mut().unwrap()["curve"] = curve.clone().into());
        let reached = |psnr: f64| found(&runs, &format!("measure = '/curve'\nreaches = {psnr:?}"));
        assert_eq!([20.0, 29.0].map(|psnr| reached(psnr).value), [Some(1.5), Some(2.5)]);
        assert_eq!((reached(31.0).value, reached(31.0).remark.as_str()), (None, "never"));
        runs.iter_mut().rfind(|r| r.scene == "hard").unwrap().summary.as_mut().unwrap()["curve"] =
            [0; 0].into();
        assert_eq!(found(&runs, "measure = '/curve'\nreaches = 20").value, None, "a run never reaches it");
        assert_eq!(found(&runs, "measure = '/none'").remark, "no figure");
        assert_eq!(check("measure = '/curve'\nname = 'n'").title(), "n");
    }

    #[test]
    fn nothing_over_nothing_is_one() {
        assert_eq!((ratio(0.0, 0.0), ratio(3.0, 2.0)), (1.0, 1.5));
    }

    #[test]
    fn senseless_checks_are_refused() {
        for (text, part) in [
            ("at-most = 1", "measure"),
            ("measure = '/a'\nat-most = 1\nfrom-scene = 'a'\nover-scene = 'b'", "at most one"),
            ("measure = '/a'\nat-most = 1\ntimes-sd = true", "from-scene beside"),
            ("measure = '/a'\nat-most = 1\nfrom-scene = 'a'\nover = 2", "at most one"),
            ("measure = '/a'\nfrom-scene = 'b'\ntimes-sd = true", "at-most, at-least"),
            ("measure = '/a'\nreaches = 40\nover-measure = '/b'", "reaches without"),
            ("measure = '/a'\nat-most = 1\nover = 0", "over, a number above 0"),
            ("measure = '/a'\nat-most = 1\nover = inf", "over, a number above 0"),
            ("measure = '/a'\nat-most = 1\nover-measure = 'a'", "over-measure, a JSON pointer"),
        ] {
            let error = toml::from_str::<Check>(text).unwrap().validate().unwrap_err();
            assert!(error.contains(part), "{error}");
        }
        assert!(toml::from_str::<Check>("measure = '/a'\nat-mots = 1").is_err());
    }
}
