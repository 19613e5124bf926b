//! `litetex schedule`: what the frequency scheduler makes of a capture's photos.

use super::capture;
use super::capture_args::CaptureArgs;
use super::log::Log;
use super::schedule_args::ScheduleFlags;
use super::schedule_chart;
use super::table::{Columns, Table, print_json};
use super::values::{format_count, format_duration};
use litetex_gs::atomic_file;
use litetex_gs::clock::process_cpu_secs;
use litetex_gs::frequency::{FrequencyOptions, FrequencySchedule};
use litetex_gs::train::{Schedule, TrainConfig};
use litetex_gs::views::{Split, ViewSource};
use litetex_gs::{Error, Result};
use serde::Serialize;
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::time::Instant;

/// Show how the sizes of images and textures will rise in a training
///
/// Analyses the frequencies of the training photos and lists the stages that follow: which steps render at
/// which scale, how large textures may grow, and how the work is shared out. Nothing is trained.
#[derive(clap::Args)]
pub struct ScheduleArgs {
    /// Folder of the capture
    capture: PathBuf,
    /// Steps of the training; the schedule ends after two thirds of them
    #[arg(long, visible_alias = "iterations", value_name = "N", default_value_t = 30_000, value_parser = clap::value_parser!(u32).range(1..))]
    steps: u32,
    /// As JSON
    #[arg(long)]
    json: bool,
    /// Also write a chart as SVG
    #[arg(long, value_name = "FILE")]
    svg: Option<PathBuf>,
    /// Replace the chart if it exists
    #[arg(long, requires = "svg")]
    force: bool,
    #[command(flatten)]
    schedule_flags: ScheduleFlags,
    #[command(flatten)]
    capture_args: CaptureArgs,
}

/// Steps that are alike in all that changes by jumps.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Stage {
    /// First step, from 1.
    pub first_step: u32,
    /// Last step.
    pub last_step: u32,
    /// Continuous scale at the first step.
    pub scale_from: f64,
    /// Continuous scale at the last step.
    pub scale_to: f64,
    /// Scale of the images.
    pub render_scale: f64,
    /// Their width.
    pub width_px: u32,
    /// Their height.
    pub height_px: u32,
    /// Cap of the texture resolution.
    pub texture_cap: u16,
    /// Pixels, as a part of those of the whole training.
    pub pixel_share: f64,
}

impl Stage {
    /// Its work, in images of full size.
    fn full_images(&self) -> f64 {
        // Not the last step plus 1, which may be one too many for its type.
        (f64::from(self.last_step - self.first_step) + 1.0) / self.render_scale.powi(2)
    }
}

/// A schedule laid out over the steps of a training.
#[derive(Debug, Serialize)]
pub struct Plan {
    schema: &'static str,
    /// Where the photos are.
    pub capture: PathBuf,
    /// Steps of the training.
    pub steps: u32,
    /// T_r: the schedule's end.
    pub schedule_steps: u32,
    /// Splits and growth of maps end after this step.
    pub densify_until: u32,
    options: FrequencyOptions,
    /// The schedule.
    pub schedule: FrequencySchedule,
    /// Width of most of the training photos.
    pub width_px: u32,
    /// Their height.
    pub height_px: u32,
    /// In order.
    pub stages: Vec<Stage>,
    /// Pixels of the whole training, as a part of those at full size.
    pub pixel_work: f64,
    analysis_secs: f64,
    analysis_cpu_secs: f64,
}

/// Analyses and prints.
pub fn run(args: &ScheduleArgs, log: &Log) -> anyhow::Result<()> {
    if let Some(svg) = &args.svg {
        check_writable(svg, args.force)?;
    }
    let plan = plan(args, log)?;
    if let Some(svg) = &args.svg {
        atomic_file::write(svg, schedule_chart::svg(&plan).as_bytes())?;
        log.info(&format!("wrote {}", svg.display()));
    }
    if args.json {
        return Ok(print_json(&plan)?);
    }
    Ok(print(&plan)?)
}

/// Refuses before the work, not after it.
fn check_writable(path: &Path, force: bool) -> Result<()> {
    if path.is_dir() {
        return Err(Error::Usage(format!("{}: is a folder, expected a file", path.display())));
    }
    if path.exists() && !force {
        return Err(Error::Usage(format!("{}: exists already; --force replaces it", path.display())));
    }
    Ok(())
}

fn plan(args: &ScheduleArgs, log: &Log) -> Result<Plan> {
    let mut load = capture::LoadOptions::default();
    args.capture_args.apply(&mut load);
    let mut options = FrequencyOptions::default();
    args.schedule_flags.apply(&mut options);
    options.check()?;
    let capture = capture::open(&args.capture, &load)?;
    log.report(&capture.report);
    let (began, cpu_began) = (Instant::now(), process_cpu_secs());
    let schedule = FrequencySchedule::analyse(&capture, &options)?;
    let (analysis_secs, analysis_cpu_secs) = (began.elapsed().as_secs_f64(), process_cpu_secs() - cpu_began);
    let (width_px, height_px) = usual_size(&capture)
        .ok_or_else(|| Error::Usage("the capture has no training views: see --test-every".to_owned()))?;
    let config = TrainConfig { steps: args.steps, scheduler: options, ..TrainConfig::default() };
    let timetable = Schedule::new(&config, capture.indices(Split::Train).len());
    let stages = stages(&schedule, &timetable, &config, (width_px, height_px));
    Ok(Plan {
        schema: "litetex-schedule/1",
        capture: args.capture.clone(),
        steps: args.steps,
        schedule_steps: timetable.full_size_from,
        densify_until: timetable.densify_until,
        options: config.scheduler,
        schedule,
        width_px,
        height_px,
        pixel_work: stages.iter().map(Stage::full_images).sum::<f64>() / f64::from(args.steps),
        stages,
        analysis_secs,
        analysis_cpu_secs,
    })
}

/// The size that most training views have; of equally many, the largest.
fn usual_size(views: &dyn ViewSource) -> Option<(u32, u32)> {
    let mut sizes = std::collections::BTreeMap::new();
    for view in views.indices(Split::Train) {
        let p = views.camera(view).pinhole;
        *sizes.entry((p.width_px, p.height_px)).or_insert(0) += 1;
    }
    sizes.into_iter().max_by_key(|&(size, num)| (num, size)).map(|(size, _)| size)
}

/// Runs of steps with the same render scale and the same cap.
fn stages(
    schedule: &FrequencySchedule,
    timetable: &Schedule,
    config: &TrainConfig,
    (width_px, height_px): (u32, u32),
) -> Vec<Stage> {
    let options = &config.scheduler;
    // Steps done before this one: the first is rendered at the scale of the start.
    let share = |step: u32| timetable.stage_share(step - 1);
    let level = |step: u32| {
        let t = share(step);
        let render_scale = schedule.render_scale(t, options.scale_rule, width_px.min(height_px));
        (render_scale, schedule.texture_cap(t, options.cap_rule))
    };
    let mut stages: Vec<Stage> = Vec::new();
    let mut next = Some(1);
    while let Some(first_step) = next.filter(|&step| step <= config.steps) {
        let (render_scale, texture_cap) = level(first_step);
        let last_step = last_alike(first_step, config.steps, level);
        stages.push(Stage {
            first_step,
            last_step,
            scale_from: schedule.scale(share(first_step)),
            scale_to: schedule.scale(share(last_step)),
            render_scale,
            width_px: reduced(width_px, render_scale),
            height_px: reduced(height_px, render_scale),
            texture_cap,
            pixel_share: 0.0,
        });
        next = last_step.checked_add(1);
    }
    let total: f64 = stages.iter().map(Stage::full_images).sum();
    for stage in &mut stages {
        stage.pixel_share = stage.full_images() / total;
    }
    stages
}

/// The last of the steps `first..=end` whose level is that of `first`. By halving: levels go one way only, so that
/// none comes back, and a run may have billions of steps.
fn last_alike<T: PartialEq>(first: u32, end: u32, level: impl Fn(u32) -> T) -> u32 {
    let here = level(first);
    let (mut alike, mut other) = (first, u64::from(end) + 1);
    while u64::from(alike) + 1 < other {
        let middle = alike + ((other - u64::from(alike)) / 2) as u32;
        if level(middle) == here { alike = middle } else { other = middle.into() }
    }
    alike
}

fn reduced(side_px: u32, scale: f64) -> u32 {
    (f64::from(side_px) / scale).floor().max(1.0) as u32
}

fn print(plan: &Plan) -> std::io::Result<()> {
    let schedule = &plan.schedule;
    let mut table = Table::default();
    table.row("views analysed", schedule.views);
    table.row("full size", format!("{}x{}", plan.width_px, plan.height_px));
    table.row("first scale", format!("{:.2}", schedule.s_max));
    if plan.options.noise_robust {
        table.row("noise", format!("{:.1} of 255", 255.0 * schedule.noise));
    }
    table.row("schedule ends", format!("at step {}", format_count(plan.schedule_steps.into())));
    table.row("pixel work", format!("{:.0} % of full size throughout", 100.0 * plan.pixel_work));
    let cpu = format_duration(plan.analysis_cpu_secs);
    table.row("analysis", format!("{}, CPU {cpu}", format_duration(plan.analysis_secs)));
    table.print()?;
    writeln!(std::io::stdout())?;
    let mut columns = Columns::new(&["steps", "scale", "render scale", "size", "texture cap", "pixel work"]);
    for s in &plan.stages {
        let (first, last) = (format_count(s.first_step.into()), format_count(s.last_step.into()));
        columns.row(vec![
            format!("{first} - {last}"),
            match s.scale_from == s.scale_to {
                true => format!("{:.2}", s.scale_from),
                false => format!("{:.2} - {:.2}", s.scale_from, s.scale_to),
            },
            format!("{:.2}", s.render_scale),
            format!("{}x{}", s.width_px, s.height_px),
            s.texture_cap.to_string(),
            format!("{:.1} %", 100.0 * s.pixel_share),
        ]);
    }
    columns.print()
}

#[cfg(test)]
mod tests {
    use super::*;
    use litetex_gs::frequency::{CapRule, ScaleRule};

    /// Stages of a schedule with several nodes, from 900x700 px.
    fn of(steps: u32, scale_rule: ScaleRule, cap_rule: CapRule) -> (Vec<Stage>, impl Fn(u32) -> (f64, u16)) {
        let nodes = vec![(0.0, 3.7), (0.2, 2.9), (0.21, 1.8), (0.7, 1.2), (1.0, 1.0)];
        let schedule = FrequencySchedule { s_max: 3.7, nodes, views: 3, noise: 0.0 };
        let scheduler = FrequencyOptions { scale_rule, cap_rule, ..FrequencyOptions::default() };
        let config = TrainConfig { steps, scheduler, ..TrainConfig::default() };
        let timetable = Schedule::new(&config, 10);
        let stages = stages(&schedule, &timetable, &config, (900, 700));
        let level = move |step: u32| {
            let t = timetable.stage_share(step - 1);
            (schedule.render_scale(t, scale_rule, 700), schedule.texture_cap(t, cap_rule))
        };
        (stages, level)
    }

    #[test]
    fn stages_are_those_of_counting_step_by_step() {
        for steps in [1, 2, 3, 10, 299, 1_000, 30_000] {
            for scale_rule in [ScaleRule::Off, ScaleRule::Integer, ScaleRule::Fractional] {
                for cap_rule in [CapRule::Squared, CapRule::Authors] {
                    let (stages, level) = of(steps, scale_rule, cap_rule);
                    let found = stages.iter().flat_map(|s| {
                        (s.first_step..=s.last_step).map(|step| (step, (s.render_scale, s.texture_cap)))
                    });
                    assert!(found.eq((1..=steps).map(|step| (step, level(step)))), "{steps} {scale_rule:?}");
                    assert!(stages.windows(2).all(|s| level(s[0].last_step) != level(s[1].first_step)));
                }
            }
        }
    }

    #[test]
    fn the_longest_training_has_the_stages_of_the_usual_one() {
        let rules = (ScaleRule::Fractional, CapRule::Squared);
        let (mut usual, _) = of(30_000, rules.0, rules.1);
        let (mut longest, _) = of(u32::MAX, rules.0, rules.1);
        assert_eq!(longest[longest.len() - 1].last_step, u32::MAX);
        // Fine steps find a stage between two jumps that usual steps take as one.
        [&mut usual, &mut longest].into_iter().for_each(|stages| stages.retain(|s| s.pixel_share > 1e-3));
        assert!(longest.len() == usual.len() && longest.len() > 5, "{longest:?}");
        for (a, b) in usual.iter().zip(&longest) {
            assert_eq!((a.render_scale, a.texture_cap), (b.render_scale, b.texture_cap));
            assert!((a.pixel_share - b.pixel_share).abs() < 1e-3, "{a:?} {b:?}");
        }
    }
}
