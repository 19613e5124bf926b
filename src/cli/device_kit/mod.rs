//! Everything worth knowing of a device in one call of less than nine minutes: what it is, whether it computes
//! rightly, what its kernels cost, how fast it sorts and trains (`scripts/device-kit`). Each part is a process of
//! its own ([`part`]) with a share of the time; on a slow device it does less, and what is too much even then is
//! skipped. Trainings go through the whole method, with as many steps as there is time for; the long ones, which only
//! come if they are asked for, with fixed numbers of steps. What comes of it: [`report`].

mod part;
mod report;

use litetex_gs::{Error, Result};
use part::Part;
use serde_json::Value;
use std::ffi::OsString;
use std::path::PathBuf;
use std::time::{Duration, Instant};

/// What is asked of the kit.
pub struct Kit {
    pub capture: PathBuf,
    /// Where everything goes.
    pub folder: PathBuf,
    pub device: String,
    /// Small sizes and few steps, for trying the kit.
    pub tiny: bool,
    /// Also trainings of fixed lengths, however long they take.
    pub long: bool,
    /// Training time for each size.
    pub train_secs: Option<u32>,
}

/// Less than nine minutes, with what a part may be late.
const TOTAL_SECS: f64 = 505.0;
/// How much later than its share a part may end before it is stopped.
const LATE_SECS: f64 = 15.0;
/// Shares of the parts before training; what one leaves goes to those after it.
const DEVICES_SECS: f64 = 5.0;
const SELFTEST_SECS: f64 = 45.0;
const BENCH_SECS: [f64; 3] = [60.0, 60.0, 80.0];
/// Of training: loading, evaluating and saving.
const AROUND_TRAINING_SECS: f64 = 25.0;
/// Saving a checkpoint and starting a process.
const SAVING_SECS: f64 = 3.0;
/// An evaluated view over a step, where it was not measured: an image, and its comparison with the photo.
const VIEW_PER_STEP: f64 = 0.25;
/// Steps and evaluations may take so many times what was measured: other work comes and goes on a machine whose
/// processor is the device.
const SLACK: f64 = 2.0;
/// A step of the grown model over one of the first, on average over a run: maps are larger, early images smaller.
/// Measured, fox at 270 x 480 on the CPU: 1.2.
const GROWN_STEP: f64 = 1.5;
/// Steps that a training of unknown speed plans for.
const STEPS_MAX: u32 = 30_000;
/// Long trainings: image size, steps, steps between evaluations.
const LONG: [(&str, u32, u32); 2] = [("960", 7_000, 1_000), ("full", 30_000, 3_000)];
const LONG_TINY: [(&str, u32, u32); 2] = [("48", 40, 10), ("full", 60, 20)];
/// A long training that takes longer is stopped.
const LONG_SECS: f64 = 4.0 * 3600.0;
/// Points of a curve before its end, and the share of the time that they may take.
const CURVE_POINTS: u32 = 3;
const CURVE_SHARE: f64 = 0.3;

/// Runs all parts, writes `device-kit.json` and prints a table.
///
/// # Errors
/// [`Error::CheckFailed`] if a part failed; [`Error::Io`] if the folder cannot be written.
pub fn run(kit: &Kit) -> anyhow::Result<()> {
    std::fs::create_dir_all(&kit.folder).map_err(|e| Error::io(&kit.folder, e))?;
    let (sizes, steps) = if kit.tiny { (["32", "48", "full"], 2) } else { (["480", "960", "full"], 16) };
    let train_secs = f64::from(kit.train_secs.unwrap_or(if kit.tiny { 2 } else { 40 }));
    let mut shares = vec![DEVICES_SECS, SELFTEST_SECS];
    shares.extend(BENCH_SECS);
    shares.extend([train_secs + AROUND_TRAINING_SECS; 3]);
    let mut run = Run {
        kit,
        timetable: Timetable { end: Instant::now() + Duration::from_secs_f64(TOTAL_SECS), shares },
        parts: Vec::new(),
    };
    let device = ["--device".into(), kit.device.clone().into()];
    run.part("devices", |_| Ok(vec!["devices".into(), "--json".into()]))?;
    run.part("selftest", |_| Ok([&["selftest".into()], &device[..]].concat()))?;
    for size in sizes {
        run.part(&format!("bench-{size}"), |share| {
            let name = format!("bench-{size}.json");
            let mut args: Vec<OsString> = vec!["bench-kernels".into(), kit.capture.clone().into()];
            args.extend(device.clone());
            args.extend(["--max-resolution".into(), bound(size).into()]);
            args.extend(["--steps".into(), steps.to_string().into()]);
            args.extend(["--max-time".into(), format!("{share:.1}").into()]);
            args.extend(["--force".into(), "--json".into(), kit.folder.join(name).into()]);
            if size == sizes[0] {
                args.push("--sort".into());
            }
            Ok(args)
        })?;
    }
    for size in sizes {
        let speed = Speed::of(run.figures(&format!("bench-{size}")));
        let name = format!("train-{size}");
        run.part(&name, |share| {
            let Training { secs, steps, eval_every } = speed.training(train_secs, share)?;
            let mut args = train_args(kit, &name, size, steps, eval_every);
            args.extend(["--max-time".into(), format!("{secs:.1}s").into()]);
            Ok(args)
        })?;
    }
    let long = if kit.tiny { LONG_TINY } else { LONG };
    for (size, steps, eval_every) in if kit.long { &long[..] } else { &[] } {
        let name = format!("train-long-{size}");
        run.part_within(&name, LONG_SECS, &train_args(kit, &name, size, *steps, *eval_every))?;
    }
    report::publish(&kit.folder, &kit.device, &run.parts)
}

/// A training with the whole method, whatever the defaults are.
fn train_args(kit: &Kit, name: &str, size: &str, steps: u32, eval_every: u32) -> Vec<OsString> {
    let mut args: Vec<OsString> = vec!["train".into(), kit.capture.clone().into()];
    args.extend(["-o".into(), kit.folder.join(name).into(), "--force".into(), "--quiet".into()]);
    args.extend(["--device".into(), kit.device.clone().into(), "--policy".into(), "litetex".into()]);
    args.extend(["--max-resolution".into(), bound(size).into(), "--no-save-images".into()]);
    args.extend(["--steps".into(), steps.to_string().into()]);
    args.extend(["--eval-every".into(), eval_every.to_string().into()]);
    args
}

/// What `--max-resolution` takes for a size.
fn bound(size: &str) -> &str {
    if size == "full" { "65536" } else { size }
}

/// The kit on its way.
struct Run<'a> {
    kit: &'a Kit,
    timetable: Timetable,
    parts: Vec<Part>,
}

impl Run<'_> {
    /// Runs a part with the arguments for its share of the time, or skips it and says why.
    fn part(&mut self, name: &str, args: impl FnOnce(f64) -> Result<Vec<OsString>, String>) -> Result<()> {
        let share = self.timetable.next_share(Instant::now());
        match args(share) {
            Ok(args) => return self.part_within(name, share + LATE_SECS, &args),
            Err(why) => self.parts.push(Part::skipped(name, why)),
        }
        Ok(())
    }

    /// Runs a part that is stopped after a time.
    fn part_within(&mut self, name: &str, limit_secs: f64, args: &[OsString]) -> Result<()> {
        eprintln!("{name} ...");
        self.parts.push(Part::run(&self.kit.folder, name, limit_secs, args)?);
        Ok(())
    }

    fn figures(&self, name: &str) -> &Value {
        self.parts.iter().find(|p| p.name == name).map_or(&Value::Null, |p| &p.figures)
    }
}

/// Which part may take how long.
struct Timetable {
    end: Instant,
    /// Of the parts to come, seconds.
    shares: Vec<f64>,
}

impl Timetable {
    /// Share of the next part: its part of the time that is left for it and those after it.
    fn next_share(&mut self, now: Instant) -> f64 {
        let wanted: f64 = self.shares.iter().sum();
        let left = self.end.saturating_duration_since(now).as_secs_f64();
        if self.shares.is_empty() { 0.0 } else { self.shares.remove(0) * left / wanted.max(1e-9) }
    }
}

/// What was measured of a size, where it was.
#[derive(Debug, PartialEq)]
struct Speed {
    step_secs: Option<f64>,
    load_secs: f64,
    test_views: f64,
    /// Of all test views.
    evaluation_secs: f64,
}

/// How long to train, and how often to evaluate.
#[derive(Debug, PartialEq)]
struct Training {
    secs: f64,
    /// Of the whole schedule: what should fit.
    steps: u32,
    /// Steps; 0: only at the end.
    eval_every: u32,
}

impl Speed {
    fn of(bench: &Value) -> Self {
        let number = |v: &Value| v.as_f64();
        let step_secs = number(&bench["wall_secs_per_step"]).or_else(|| number(&bench["first_step_secs"]));
        let evaluation = &bench["evaluation"];
        let test_views = number(&evaluation["views"]).unwrap_or(0.0);
        let estimate = VIEW_PER_STEP * step_secs.unwrap_or(0.0);
        let secs_per_view = number(&evaluation["secs_per_view"]).unwrap_or(estimate);
        Self {
            step_secs,
            load_secs: number(&bench["load_secs"]).unwrap_or(0.0),
            test_views,
            evaluation_secs: test_views * secs_per_view,
        }
    }

    /// Training that ends within a share: the time that is wanted, or what evaluation and loading leave.
    ///
    /// # Errors
    /// The figures, if there is not even time for a step.
    fn training(&self, wanted_secs: f64, share: f64) -> Result<Training, String> {
        // Nothing was measured: it is tried.
        let Some(step_secs) = self.step_secs else {
            return Ok(Training { secs: wanted_secs, steps: STEPS_MAX, eval_every: 0 });
        };
        // A step begins as long as the time is not over.
        let around = self.load_secs + SAVING_SECS + SLACK * (self.evaluation_secs + step_secs);
        let left = share - around;
        if left < 0.0 {
            return Err(format!(
                "one step takes {step_secs:.1} s and an evaluation of {} views {:.1} s: too much for its {share:.0} s",
                self.test_views, self.evaluation_secs
            ));
        }
        let secs = wanted_secs.min(left).max(0.1);
        let spare = (share - around - secs).min(CURVE_SHARE * share);
        let points = (spare / self.evaluation_secs.max(1e-9)).min(f64::from(CURVE_POINTS)) as u32;
        let steps = (secs / (GROWN_STEP * step_secs).max(1e-9)).clamp(1.0, f64::from(STEPS_MAX)) as u32;
        let eval_every = if points == 0 { 0 } else { (steps / (points + 1)).max(1) };
        Ok(Training { secs, steps, eval_every })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn what_a_part_leaves_goes_to_those_after_it() {
        let start = Instant::now();
        let after = |secs| start + Duration::from_secs(secs);
        let mut timetable = Timetable { end: after(100), shares: vec![10.0, 20.0, 20.0] };
        assert_eq!(timetable.next_share(start), 20.0);
        assert_eq!(timetable.next_share(after(0)), 50.0, "the first took no time");
        assert_eq!(timetable.next_share(after(90)), 10.0, "the second took more than its share");
        assert_eq!(timetable.next_share(after(200)), 0.0);
    }

    #[test]
    fn training_fits_its_share() {
        let speed = |step: f64, evaluation: f64| {
            Speed::of(&json!({ "wall_secs_per_step": step, "load_secs": 1.0,
                "evaluation": { "views": 7, "secs_per_view": evaluation / 7.0 } }))
        };
        let fast = speed(0.002, 0.35).training(40.0, 75.0).unwrap();
        assert_eq!(fast, Training { secs: 40.0, steps: 13_333, eval_every: 3_333 });
        // 5 s a step and 10 s an evaluation: one point before the end.
        let slow = speed(5.0, 10.0).training(40.0, 85.0).unwrap();
        assert_eq!(slow, Training { secs: 40.0, steps: 5, eval_every: 2 });
        let slower = speed(20.0, 15.0).training(40.0, 80.0).unwrap();
        assert!(slower.eval_every == 0 && (slower.secs - 6.0).abs() < 1e-9, "{slower:?}");
        let too_slow = speed(30.0, 50.0).training(40.0, 80.0).unwrap_err();
        assert!(too_slow.contains("one step takes 30.0 s") && too_slow.contains("7 views"), "{too_slow}");
        // Of a part that was skipped or failed.
        let first = Speed::of(&json!({ "first_step_secs": 40.0, "evaluation": { "views": 7 } }));
        assert!(first.training(40.0, 100.0).unwrap_err().contains("7 views 70.0 s"));
        assert!(first.training(40.0, 230.0).is_ok());
        assert!(Speed::of(&Value::Null).training(40.0, 80.0).is_ok());
    }
}
