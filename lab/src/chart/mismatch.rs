//! Runs that share names but cannot be compared: files of results are merged by concatenation, and a matrix or its
//! photos may have changed in between.

use crate::results::Record;
use litetex_gs::Report;
use litetex_gs::text::{counted, shortened};
use serde_json::Value;
use std::collections::{HashMap, HashSet};

/// What quality figures depend on besides the model: size and number of the views, and how photos were resampled.
const IMAGES: [&str; 5] =
    ["/capture/width_px", "/capture/height_px", "/capture/train_views", "/capture/test_views", "/resample"];
/// Longest list of arguments shown in a warning.
const ARGS_CHARS_MAX: usize = 200;

/// Whether two runs of a scene were evaluated on the same images.
pub fn same_images(a: &Record, b: &Record) -> bool {
    images(a) == images(b)
}

/// Warns about scenes whose runs used different images, and about repetitions that differ in more than the seed.
pub fn warn(runs: &[Record], report: &mut Report) {
    let (scenes, first) = mismatched(runs, |r| r.scene.as_str(), same_images);
    if let Some((a, b)) = first {
        report.warn(
            "different-images",
            scenes,
            format!(
                "the runs of {} used different images (size, number of views or resampling): {} {}, {} {}; such \
                 runs are not paired, and their means are not comparable",
                counted(scenes, "scene"),
                a.describe(),
                describe_images(a),
                b.describe(),
                describe_images(b)
            ),
        );
    }
    let repeats = |r: &Record| (r.scene.clone(), r.variant.clone(), r.budget.clone());
    let (groups, first) = mismatched(runs, repeats, |a, b| (&a.args, steps(a)) == (&b.args, steps(b)));
    if let Some((a, b)) = first {
        let describe = |r: &Record| {
            let steps = r.number("/steps").map_or("?".to_owned(), |s| s.to_string());
            let args = r.args.join(" ");
            format!("{} has {} and made {steps} steps", r.describe(), shortened(&args, ARGS_CHARS_MAX))
        };
        report.warn(
            "different-repetitions",
            groups,
            format!(
                "in {} of equal scene, variant and budget, runs differ in more than the seed, so that means mix \
                 different settings: {}, {}",
                counted(groups, "group"),
                describe(a),
                describe(b)
            ),
        );
    }
}

/// Number of groups in which some run differs from the first, and the first two that differ.
fn mismatched<'a, K: Eq + std::hash::Hash>(
    runs: &'a [Record],
    group: impl Fn(&'a Record) -> K,
    alike: impl Fn(&Record, &Record) -> bool,
) -> (usize, Option<(&'a Record, &'a Record)>) {
    let mut firsts: HashMap<K, (usize, &Record)> = HashMap::new();
    let mut groups = HashSet::new();
    let mut first_two = None;
    for run in runs {
        let next = firsts.len();
        let &mut (number, first) = firsts.entry(group(run)).or_insert((next, run));
        if !alike(first, run) {
            groups.insert(number);
            first_two = first_two.or(Some((first, run)));
        }
    }
    (groups.len(), first_two)
}

fn images(run: &Record) -> [Option<&Value>; IMAGES.len()] {
    IMAGES.map(|pointer| run.value(pointer))
}

fn describe_images(run: &Record) -> String {
    let of = |value: Option<&Value>| match value {
        None | Some(Value::Null) => "?".to_owned(),
        Some(Value::String(text)) => text.clone(),
        Some(other) => other.to_string(),
    };
    let [width, height, train, test, resample] = images(run).map(of);
    format!("({width}x{height} px, {train} + {test} views, {resample})")
}

/// Steps done; `None` if the time limit ended the run, since such runs differ in their steps by design.
fn steps(run: &Record) -> Option<u64> {
    let summary = run.summary.as_ref()?;
    if summary.get("stopped_by").is_some_and(|by| by == "time") {
        None
    } else {
        summary.get("steps")?.as_u64()
    }
}

#[cfg(test)]
mod tests {
    use super::super::compare::{Scope, compare};
    use super::super::fixtures::records;
    use super::super::study::{Options, Study};
    use super::*;
    use serde_json::json;

    /// Codes and texts of warnings, and the number of pairs in the first scene.
    fn study(all: Vec<Record>) -> (Vec<(String, String)>, usize) {
        let study = Study::new(vec![all], &Options::default()).unwrap();
        let pairs =
            compare(&study, "=textured", Scope::SceneBudget("fox", "300 steps"), &study.qualities[0]).n();
        (study.report.warnings.iter().map(|w| (w.code.clone(), w.message.clone())).collect(), pairs)
    }

    fn changed(is_meant: fn(&Record) -> bool, change: fn(&mut Record)) -> Vec<Record> {
        let mut all = records();
        for r in all.iter_mut() {
            r.args = ["--texture", "none", "--steps", "300"].map(ToOwned::to_owned).into();
            let summary = r.summary.as_mut().unwrap();
            summary["capture"] =
                json!({ "width_px": 270, "height_px": 480, "train_views": 43, "test_views": 7 });
            (summary["resample"], summary["steps"]) = (json!("area"), json!(300));
            if is_meant(r) {
                change(r);
            }
        }
        all
    }

    #[test]
    fn matching_runs_are_paired_without_a_warning() {
        assert_eq!(study(changed(|_| false, |_| {})), (vec![], 5));
        // Variants may differ in their arguments, and time limits end runs at different steps.
        assert_eq!(study(changed(|r| r.variant == "plain", |r| r.args.clear())), (vec![], 5));
        let timed = |r: &mut Record| {
            let summary = r.summary.as_mut().unwrap();
            (summary["stopped_by"], summary["steps"]) = (json!("time"), json!(300 - r.seed));
        };
        assert_eq!(study(changed(|_| true, timed)), (vec![], 5));
    }

    #[test]
    fn repetitions_with_other_arguments_or_steps_are_reported() {
        let is_one = |r: &Record| r.seed == 4 && r.variant == "plain" && r.scene == "fox";
        let (warnings, pairs) = study(changed(is_one, |r| r.args[3] = "600".to_owned()));
        assert_eq!((warnings.len(), warnings[0].0.as_str(), pairs), (1, "different-repetitions", 5));
        for part in ["in 1 group of", "\"plain\"", "--steps 300 and", "--steps 600 and"] {
            assert!(warnings[0].1.contains(part), "{part}: {warnings:?}");
        }
        let (warnings, _) = study(changed(is_one, |r| r.summary.as_mut().unwrap()["steps"] = json!(150)));
        assert!(warnings[0].1.contains("made 150 steps"), "{warnings:?}");
    }

    #[test]
    fn runs_on_other_images_are_not_paired() {
        let is_half = |r: &Record| r.seed > 3 && r.variant == "plain" && r.scene == "fox";
        for (change, part) in [
            (
                (|r| r.summary.as_mut().unwrap()["capture"]["width_px"] = json!(135)) as fn(&mut Record),
                "(135x480 px",
            ),
            (|r| r.summary.as_mut().unwrap()["capture"]["test_views"] = json!(8), "43 + 8 views"),
            (|r| r.summary.as_mut().unwrap()["resample"] = json!("point"), "point)"),
            (|r| r.summary.as_mut().unwrap()["capture"] = json!(null), "?x? px"),
        ] {
            let (warnings, pairs) = study(changed(is_half, change));
            assert_eq!((warnings.len(), warnings[0].0.as_str(), pairs), (1, "different-images", 3));
            assert!(warnings[0].1.contains(part) && warnings[0].1.contains("not paired"), "{warnings:?}");
        }
    }
}
