//! The runs to compare, their measures and their pairs: from lines of results to numbers.

use super::measure::{Measure, bytes_of};
use super::mismatch;
use super::plot::Quantity;
use crate::matrix::SceneEntry;
use crate::results::{self, Hardware, Record, Status};
use crate::stats::Stats;
use litetex_gs::{Error, Report, Result};
use std::collections::{HashMap, HashSet};

/// The clock that training time is read from.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Clock {
    /// CPU time if every run used the CPU as its device, else wall time.
    #[default]
    Auto,
    /// CPU time of the process.
    Cpu,
    /// Wall time of training.
    Wall,
}

/// An image of the worst test view of a run, as a data URI.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct WorstView {
    /// Scene of the run.
    pub scene: String,
    /// Variant of the run.
    pub variant: String,
    /// The image.
    pub uri: String,
}

/// How to compare.
#[derive(Clone, Debug, Default)]
pub struct Options {
    /// Variant that the others are compared with; the first if `None`.
    pub baseline: Option<String>,
    /// Whether times of noisy runs count.
    pub include_noisy: bool,
    /// Clock of the training times.
    pub clock: Clock,
    /// Scenes with what is expected of their runs.
    pub cases: Vec<SceneEntry>,
    /// Images for the cases.
    pub worst_views: Vec<WorstView>,
}

/// The successful runs of all seeds of a scene, variant and budget.
#[derive(Clone, Debug)]
pub struct Group<'a> {
    pub scene: &'a str,
    pub variant: &'a str,
    pub budget: &'a str,
    pub runs: Vec<&'a Record>,
    /// Number of failed runs.
    pub failed: usize,
}

/// Merged results, successful `runs` and `failed` ones. Scenes, variants and budgets are in the order of the matrix.
#[derive(Clone, Debug)]
pub struct Study {
    pub runs: Vec<Record>,
    pub failed: Vec<Record>,
    pub scenes: Vec<String>,
    pub variants: Vec<String>,
    pub budgets: Vec<String>,
    /// Variant that the others are compared with.
    pub baseline: String,
    /// Whether times of noisy runs count.
    pub include_noisy: bool,
    /// PSNR, gradient-PSNR, SSIM and FLIP, in this order.
    pub qualities: Vec<Measure>,
    /// Splats and texels.
    pub counts: Vec<Measure>,
    pub params: Measure,
    /// Layers per pixel, rasterised and blended, if the runs report them.
    pub layers: Vec<Measure>,
    /// Sizes on disk, as far as the runs report them.
    pub bytes: Vec<Measure>,
    /// Training time by the chosen clock.
    pub time: Measure,
    /// Warnings for the reader of tables and charts.
    pub report: Report,
}

impl Study {
    /// Merges the lines of several files: the last line of a key counts, names keep the order of the matrices.
    ///
    /// # Errors
    /// [`Error::Usage`] if no run succeeded or no variant has the baseline's name.
    pub fn new(files: Vec<Vec<Record>>, options: &Options) -> Result<Self> {
        let mut report = Report::default();
        let records = merged(files, &mut report);
        let scenes = names(&records, |r| &r.scene);
        let variants = names(&records, |r| &r.variant);
        let budgets = names(&records, |r| &r.budget);
        let (runs, failed): (Vec<Record>, Vec<Record>) =
            records.into_iter().partition(|r| r.status == Status::Ok && r.summary.is_some());
        if runs.is_empty() {
            return Err(Error::Usage(format!(
                "no successful run in the results ({} failed); there is nothing to chart",
                failed.len()
            )));
        }
        mismatch::warn(&runs, &mut report);
        let baseline = baseline(options.baseline.as_deref(), &variants)?;
        let is_cpu_time = match options.clock {
            Clock::Auto => runs.iter().all(|r| device(r) == "cpu"),
            clock => clock == Clock::Cpu,
        };
        let count = |id, name| Measure::cost(id, name, "", &format!("/size/{id}"), Quantity::Count);
        let time = Measure::training_time(is_cpu_time);
        warn_of_conditions(&runs, options.include_noisy, time.unit, &mut report);
        Ok(Self {
            failed,
            scenes,
            variants,
            budgets,
            baseline,
            include_noisy: options.include_noisy,
            qualities: Measure::qualities(),
            counts: vec![
                count("splats", "Splats"),
                count("texels", "Texels"),
                count("sh_coefficients", "SH coefficients"),
            ],
            params: count("params", "Parameters"),
            layers: Measure::layers_of(&runs),
            bytes: bytes_of(&runs),
            time,
            report,
            runs,
        })
    }

    /// Groups with at least one run, successful or not, by scene, budget and variant in the order of the matrix.
    pub fn groups(&self) -> Vec<Group<'_>> {
        let mut groups = Vec::new();
        for scene in &self.scenes {
            for budget in &self.budgets {
                groups.extend(self.variants.iter().map(|variant| self.group(scene, variant, budget)));
            }
        }
        groups.retain(|g| !g.runs.is_empty() || g.failed > 0);
        groups
    }

    /// One group, possibly without runs.
    pub fn group<'a>(&'a self, scene: &'a str, variant: &'a str, budget: &'a str) -> Group<'a> {
        let of = |r: &&Record| r.scene == scene && r.variant == variant && r.budget == budget;
        let mut runs: Vec<&Record> = self.runs.iter().filter(of).collect();
        runs.sort_by_key(|r| r.seed);
        Group { scene, variant, budget, runs, failed: self.failed.iter().filter(of).count() }
    }

    /// A measure of a run; `None` if it is missing, no number, or a time that is not to be trusted.
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

    /// Statistics over the seeds of a group.
    pub fn stats(&self, group: &Group<'_>, measure: &Measure) -> Option<Stats> {
        let values: Vec<f64> = group.runs.iter().filter_map(|r| self.value(r, measure)).collect();
        Stats::of(&values)
    }

    /// Differences `a - b` of runs with equal seeds in two groups of a scene; for costs the logarithms of the ratios.
    /// Times are compared only on the same machine, and nothing across different images.
    pub fn differences(&self, a: &Group<'_>, b: &Group<'_>, measure: &Measure) -> Vec<f64> {
        let mut out = Vec::new();
        for run in &a.runs {
            let partner = b.runs.iter().find(|p| p.seed == run.seed && p.scene == run.scene);
            let Some(partner) = partner else { continue };
            let is_comparable = !measure.is_time || machine(run) == machine(partner);
            if !(is_comparable && mismatch::same_images(run, partner)) {
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

    /// Number of a variant, which selects its colour and marker.
    pub fn look(&self, variant: &str) -> Option<usize> {
        self.variants.iter().position(|v| v == variant)
    }

    /// Variants besides the baseline.
    pub fn others(&self) -> impl Iterator<Item = &String> {
        self.variants.iter().filter(|v| **v != self.baseline)
    }
}

/// The last lines of all keys, in the order of the matrices.
fn merged(files: Vec<Vec<Record>>, report: &mut Report) -> Vec<Record> {
    let ordered = files.into_iter().flat_map(|file| {
        let mut file = results::latest(file);
        file.sort_by_key(|r| r.cell);
        file
    });
    unambiguous(results::latest(ordered.collect()), report)
}

/// Distinct names in the order of their first use.
fn names(records: &[Record], of: fn(&Record) -> &String) -> Vec<String> {
    let mut seen = HashSet::new();
    records.iter().map(of).filter(|name| seen.insert(*name)).cloned().collect()
}

/// Keeps the last of several runs with equal names and seed but different arguments or versions.
fn unambiguous(records: Vec<Record>, report: &mut Report) -> Vec<Record> {
    let name = |r: &Record| (r.scene.clone(), r.variant.clone(), r.budget.clone(), r.seed);
    let last: HashMap<_, usize> = records.iter().enumerate().map(|(i, r)| (name(r), i)).collect();
    let (kept, dropped): (Vec<_>, Vec<_>) =
        records.into_iter().enumerate().partition(|(i, r)| last.get(&name(r)) == Some(i));
    if let Some((_, first)) = dropped.first() {
        report.warn(
            "ambiguous-runs",
            dropped.len(),
            format!(
                "{} runs are ignored because a later one has the same names and seed but other arguments or another \
                 version; the first is {}",
                dropped.len(),
                first.describe()
            ),
        );
    }
    kept.into_iter().map(|(_, r)| r).collect()
}

/// Name of the device that trained.
pub fn device(run: &Record) -> &str {
    run.value("/device/name").and_then(|name| name.as_str()).unwrap_or("unknown")
}

/// The variant requested, or the first.
fn baseline(name: Option<&str>, variants: &[String]) -> Result<String> {
    match name {
        None => Ok(variants[0].clone()),
        Some(name) if variants.iter().any(|v| v == name) => Ok(name.to_owned()),
        Some(name) => Err(Error::Usage(format!(
            "--baseline {name:?}: no such variant in the results; there are {}",
            variants.iter().map(|v| format!("{v:?}")).collect::<Vec<_>>().join(", ")
        ))),
    }
}

/// Warns about busy machines, several machines and several builds.
fn warn_of_conditions(runs: &[Record], include_noisy: bool, clock: &str, report: &mut Report) {
    let noisy = runs.iter().filter(|r| r.noisy).count();
    if noisy > 0 {
        let what = if include_noisy { "are included" } else { "are left out of tables and charts of time" };
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
            format!(
                "the runs were made on {machines} machines or devices; {clock} are compared only within one"
            ),
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
}

/// What must be equal for times to be compared.
fn machine(run: &Record) -> (&Hardware, usize, &str) {
    (&run.hardware, run.cores, device(run))
}

fn distinct<T: Eq + std::hash::Hash>(all: impl Iterator<Item = T>) -> usize {
    all.collect::<HashSet<T>>().len()
}
