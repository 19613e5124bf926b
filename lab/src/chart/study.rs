//! The runs that are compared, what is measured of them, and their pairs. From lines of results to numbers;
//! nothing is drawn here.

use super::measure::{Better, Measure, bytes_of};
use super::scale::Quantity;
use super::stats::Sample;
use super::unlike::same_images;
use super::{plausible, unlike};
use crate::results::{self, Record, Status};
use crate::{Error, Report, Result};
use std::collections::HashMap;

/// Which clock counts.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Clock {
    /// CPU seconds if every run was computed by the CPU, else wall seconds.
    #[default]
    Auto,
    /// CPU seconds of the process.
    Cpu,
    /// Wall seconds.
    Wall,
}

/// What the user chose.
#[derive(Clone, Debug, Default)]
pub struct Options {
    /// Variant that others are compared with; the first if none is named.
    pub baseline: Option<String>,
    /// Whether times of noisy runs count.
    pub include_noisy: bool,
    /// Which clock.
    pub clock: Clock,
}

/// A point of a run's curve.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CurvePoint {
    /// Step.
    pub step: f64,
    /// By the study's clock.
    pub secs: Option<f64>,
    /// dB.
    pub psnr: Option<f64>,
    /// dB.
    pub grad_psnr: Option<f64>,
}

/// Repetitions of the same run: all seeds of a scene, variant and budget.
#[derive(Clone, Debug)]
pub struct Group<'a> {
    /// Name.
    pub scene: &'a str,
    /// Name.
    pub variant: &'a str,
    /// Name.
    pub budget: &'a str,
    /// Successful runs.
    pub runs: Vec<&'a Record>,
}

/// Results, ordered.
#[derive(Clone, Debug)]
pub struct Study {
    /// Successful runs.
    pub runs: Vec<Record>,
    /// Failed ones.
    pub failed: Vec<Record>,
    /// Names in the order of the matrix.
    pub scenes: Vec<String>,
    /// Names in the order of the matrix.
    pub variants: Vec<String>,
    /// Names in the order of the matrix.
    pub budgets: Vec<String>,
    /// Variant that others are compared with.
    pub baseline: String,
    /// Whether times of noisy runs count.
    pub include_noisy: bool,
    /// PSNR, gradient-PSNR, SSIM, FLIP.
    pub qualities: Vec<Measure>,
    /// Splats, texels.
    pub counts: Vec<Measure>,
    /// Parameters.
    pub params: Measure,
    /// Sizes on disk that the runs tell of.
    pub bytes: Vec<Measure>,
    /// Training time.
    pub time: Measure,
    /// Seconds in points of curves.
    curve_secs: &'static str,
    /// What the reader must know.
    pub report: Report,
}

impl Study {
    /// Puts lines of one or several files together: the last line of a key counts, names appear in the order
    /// of the matrices.
    ///
    /// # Errors
    /// [`Error::Usage`] if no run succeeded or the baseline is none of the variants.
    pub fn new(files: Vec<Vec<Record>>, options: &Options) -> Result<Self> {
        let mut report = Report::default();
        let ordered = files.into_iter().flat_map(|file| {
            let mut file = results::latest(file);
            file.sort_by_key(|r| r.cell);
            file
        });
        let records = unambiguous(results::latest(ordered.collect()), &mut report);
        let names = |of: fn(&Record) -> &String| {
            let mut names: Vec<String> = Vec::new();
            for record in &records {
                if !names.contains(of(record)) {
                    names.push(of(record).clone());
                }
            }
            names
        };
        let (scenes, variants, budgets) = (names(|r| &r.scene), names(|r| &r.variant), names(|r| &r.budget));
        let (mut runs, failed): (Vec<Record>, Vec<Record>) =
            records.into_iter().partition(|r| r.status == Status::Ok && r.summary.is_some());
        if runs.is_empty() {
            return Err(Error::Usage(format!(
                "no successful run in the results ({} failed ones); nothing to make charts of",
                failed.len()
            )));
        }
        plausible::leave_out(&mut runs, &mut report);
        unlike::warn(&runs, &mut report);
        let baseline = match &options.baseline {
            None => variants[0].clone(),
            Some(name) if variants.contains(name) => name.clone(),
            Some(name) => {
                return Err(Error::Usage(format!(
                    "--baseline {name:?}: no such variant in the results; there are {}",
                    variants.iter().map(|v| format!("{v:?}")).collect::<Vec<_>>().join(", ")
                )));
            }
        };
        let on_cpu = runs.iter().all(|r| device(r) == "cpu");
        let is_cpu_clock = match options.clock {
            Clock::Auto => on_cpu,
            clock => clock == Clock::Cpu,
        };
        let (clock, curve_secs) = if is_cpu_clock { ("CPU", "cpu_secs") } else { ("wall", "wall_secs") };
        let time_id = if is_cpu_clock { "cpu_secs" } else { "wall_secs" };
        let time = Measure {
            digits: 1,
            is_time: true,
            ..Measure::cost(
                time_id,
                "Training time",
                if is_cpu_clock { "CPU seconds" } else { "wall seconds" },
                format!("/time/train_{time_id}"),
                Quantity::Plain,
            )
        };
        let noisy = runs.iter().filter(|r| r.noisy).count();
        if noisy > 0 {
            let what = if options.include_noisy {
                "count all the same"
            } else {
                "are left out of times and charts of time"
            };
            report.warn(
                "noisy-runs",
                noisy,
                format!("{noisy} of {} runs were made on a busy machine; their times {what}", runs.len()),
            );
        }
        let machines = distinct(runs.iter().map(machine));
        if machines > 1 {
            report.warn(
                "several-machines",
                machines,
                format!("the runs were made on {machines} machines or devices; {clock} times are compared within one only"),
            );
        }
        let builds = distinct(runs.iter().map(|r| (&r.version, &r.build)));
        if builds > 1 {
            report.warn(
                "several-builds",
                builds,
                format!("the runs were made by {builds} builds of the program"),
            );
        }
        let bytes = bytes_of(&runs);
        Ok(Self {
            runs,
            failed,
            scenes,
            variants,
            budgets,
            baseline,
            include_noisy: options.include_noisy,
            qualities: vec![
                Measure::quality("psnr", "Test PSNR", "dB", 2, Better::Higher),
                Measure::quality("grad_psnr", "Test gradient-PSNR", "dB", 2, Better::Higher),
                Measure::quality("ssim_3dgs", "Test SSIM (3DGS)", "", 4, Better::Higher),
                Measure::quality("flip", "Test FLIP", "", 4, Better::Lower),
            ],
            counts: vec![
                Measure::cost("primitives", "Splats", "", "/size/primitives".to_owned(), Quantity::Count),
                Measure::cost("texels", "Texels", "", "/size/texels".to_owned(), Quantity::Count),
            ],
            params: Measure::cost("params", "Parameters", "", "/size/params".to_owned(), Quantity::Count),
            bytes,
            time,
            curve_secs,
            report,
        })
    }

    /// Groups with at least one successful run, by scene, budget and variant in the order of the matrix.
    pub fn groups(&self) -> Vec<Group<'_>> {
        let mut groups = Vec::new();
        for scene in &self.scenes {
            for budget in &self.budgets {
                groups.extend(self.variants.iter().map(|variant| self.group(scene, variant, budget)));
            }
        }
        groups.retain(|g| !g.runs.is_empty());
        groups
    }

    /// One group; without runs if there are none.
    pub fn group<'a>(&'a self, scene: &'a str, variant: &'a str, budget: &'a str) -> Group<'a> {
        let of = |r: &&Record| r.scene == scene && r.variant == variant && r.budget == budget;
        let mut runs: Vec<&Record> = self.runs.iter().filter(of).collect();
        runs.sort_by_key(|r| r.seed);
        Group { scene, variant, budget, runs }
    }

    /// What was measured of a run; `None` if it is missing, no number, or a time that is not to be trusted.
    pub fn value(&self, run: &Record, measure: &Measure) -> Option<f64> {
        if measure.is_time && !self.counts_time(run) {
            return None;
        }
        run.number(&measure.pointer)
    }

    /// Whether the run's times count.
    pub fn counts_time(&self, run: &Record) -> bool {
        self.include_noisy || !run.noisy
    }

    /// Over the seeds of a group.
    pub fn sample(&self, group: &Group<'_>, measure: &Measure) -> Option<Sample> {
        let values: Vec<f64> = group.runs.iter().filter_map(|r| self.value(r, measure)).collect();
        Sample::of(&values)
    }

    /// Differences `a - b` between the runs with equal seeds of two groups of a scene; of costs the logarithm
    /// of their ratio. Times are only compared on the same machine, and nothing if the images were others.
    pub fn differences(&self, a: &Group<'_>, b: &Group<'_>, measure: &Measure) -> Vec<f64> {
        let mut out = Vec::new();
        for run in &a.runs {
            let partner = b.runs.iter().find(|p| p.seed == run.seed && p.scene == run.scene);
            let Some(partner) = partner else { continue };
            let is_comparable = !measure.is_time || machine(run) == machine(partner);
            if !(is_comparable && same_images(run, partner)) {
                continue;
            }
            let (Some(x), Some(y)) = (self.value(run, measure), self.value(partner, measure)) else {
                continue;
            };
            match measure.is_cost {
                false => out.push(x - y),
                true if x > 0.0 && y > 0.0 => out.push((x / y).ln()),
                true => {}
            }
        }
        out
    }

    /// Quality and cost while the run went on.
    pub fn curve(&self, run: &Record) -> Vec<CurvePoint> {
        let points =
            run.summary.as_ref().and_then(|s| s.get("curve")?.as_array()).map_or(&[][..], Vec::as_slice);
        let point = |p: &serde_json::Value| {
            let number = |key: &str| p.get(key)?.as_f64().filter(|x| x.is_finite());
            Some(CurvePoint {
                step: number("step")?,
                secs: number(self.curve_secs).filter(|_| self.counts_time(run)),
                psnr: number("psnr_test"),
                grad_psnr: number("grad_psnr_test"),
            })
        };
        points.iter().filter_map(point).collect()
    }

    /// Number of a variant, for its colour.
    pub fn look(&self, variant: &str) -> usize {
        self.variants.iter().position(|v| v == variant).unwrap_or(0)
    }
}

/// Name of the device that computed.
pub fn device(run: &Record) -> &str {
    let name = run.summary.as_ref().and_then(|s| s.pointer("/device/name")?.as_str());
    name.unwrap_or("unknown")
}

/// What must be equal for times to be compared.
fn machine(run: &Record) -> (&crate::results::Hardware, usize, &str) {
    (&run.hardware, run.cores, device(run))
}

fn distinct<T: Eq + std::hash::Hash>(all: impl Iterator<Item = T>) -> usize {
    all.collect::<std::collections::HashSet<T>>().len()
}

/// The last of several runs that have equal names but different arguments or versions.
fn unambiguous(records: Vec<Record>, report: &mut Report) -> Vec<Record> {
    let mut last: HashMap<(String, String, String, u64), usize> = HashMap::new();
    for (i, r) in records.iter().enumerate() {
        last.insert((r.scene.clone(), r.variant.clone(), r.budget.clone(), r.seed), i);
    }
    let mut left_out = Vec::new();
    let mut kept = Vec::new();
    for (i, r) in records.into_iter().enumerate() {
        let name = (r.scene.clone(), r.variant.clone(), r.budget.clone(), r.seed);
        if last.get(&name) == Some(&i) { kept.push(r) } else { left_out.push(name) }
    }
    if let Some((scene, variant, budget, seed)) = left_out.first() {
        report.warn(
            "ambiguous-runs",
            left_out.len(),
            format!(
                "{} runs have the names and seed of a later one but other arguments or another version, and are left \
                 out; the first is {scene:?}, {variant:?}, {budget:?}, seed {seed}",
                left_out.len()
            ),
        );
    }
    kept
}
