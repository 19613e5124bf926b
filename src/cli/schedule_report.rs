//! What `litetex schedule` reports: the frequency schedule of a capture and the stages that follow from it.

use litetex_gs::capture::Capture;
use litetex_gs::clock::process_cpu_secs;
use litetex_gs::console::{Table, columns, serialize_path};
use litetex_gs::frequency::{FrequencyOptions, FrequencySchedule};
use litetex_gs::text::{format_count, format_duration};
use litetex_gs::train::{Schedule, StageSpan, TrainConfig, stage_spans};
use litetex_gs::views::{Split, ViewSource};
use litetex_gs::{Result, usage};
use serde::Serialize;
use std::path::{Path, PathBuf};
use std::time::Instant;

/// A schedule laid out over the steps of a training.
#[derive(Debug, Serialize)]
pub struct ScheduleReport {
    #[serde(serialize_with = "serialize_path")]
    pub capture: PathBuf,
    /// Steps of the training.
    pub steps: u32,
    /// Step of the first image of full size.
    pub schedule_steps: u32,
    /// Last step after which splats are split and maps refined.
    pub densify_until: u32,
    options: FrequencyOptions,
    pub schedule: FrequencySchedule,
    /// Width of most training photos, as trained.
    pub width_px: u32,
    /// Height of most training photos, as trained.
    pub height_px: u32,
    /// The stages, in order.
    pub stages: Vec<StageSpan>,
    /// Pixels of the whole training, as a share of those of full size throughout.
    pub pixel_work: f64,
    analysis_secs: f64,
    analysis_cpu_secs: f64,
}

impl ScheduleReport {
    /// Analyses the photos of a capture for a training of `steps`.
    ///
    /// # Errors
    /// [`litetex_gs::Error::Usage`] without training views; what reading the photos found.
    pub fn new(path: &Path, capture: &Capture, steps: u32, options: FrequencyOptions) -> Result<Self> {
        let (began, cpu_began) = (Instant::now(), process_cpu_secs());
        let schedule = FrequencySchedule::analyse(capture, &options)?;
        let analysis_secs = began.elapsed().as_secs_f64();
        let analysis_cpu_secs = process_cpu_secs() - cpu_began;
        let (width_px, height_px) = usual_size(capture)
            .ok_or_else(|| usage!("the capture has no training views: see --test-every"))?;
        let config = TrainConfig { steps, scheduler: options, ..TrainConfig::default() };
        let timetable = Schedule::new(&config, capture.indices(Split::Train).len());
        let stages = stage_spans(&schedule, &timetable, &config, (width_px, height_px));
        Ok(Self {
            capture: path.to_owned(),
            steps,
            schedule_steps: timetable.full_size_from,
            densify_until: timetable.densify_until,
            options: config.scheduler,
            schedule,
            width_px,
            height_px,
            pixel_work: stages.iter().map(StageSpan::full_images).sum::<f64>() / f64::from(steps),
            stages,
            analysis_secs,
            analysis_cpu_secs,
        })
    }

    /// Two tables.
    pub fn tables(&self) -> String {
        let schedule = &self.schedule;
        let mut table = Table::default();
        table.row("views analysed", schedule.views);
        table.row("full size", format!("{}x{}", self.width_px, self.height_px));
        table.row("first scale", format!("{:.2}", schedule.s_max));
        if self.options.rules.set().removes_noise {
            table.row("noise", format!("{:.1} of 255", 255.0 * schedule.noise));
        }
        table.row("schedule ends", format!("at step {}", format_count(self.schedule_steps.into())));
        table.row("pixel work", format!("{:.0} % of full size throughout", 100.0 * self.pixel_work));
        let cpu = format_duration(self.analysis_cpu_secs);
        table.row("analysis", format!("{}, CPU {cpu}", format_duration(self.analysis_secs)));
        let row = |s: &StageSpan| {
            let (first, last) = (format_count(s.first_step.into()), format_count(s.last_step.into()));
            vec![
                format!("{first} - {last}"),
                match s.scale_from == s.scale_to {
                    true => format!("{:.2}", s.scale_from),
                    false => format!("{:.2} - {:.2}", s.scale_from, s.scale_to),
                },
                format!("{:.2}", s.render_scale),
                format!("{}x{}", s.width_px, s.height_px),
                s.texture_cap.to_string(),
                format!("{:.1} %", 100.0 * s.pixel_share),
            ]
        };
        let headings = ["steps", "scale", "render scale", "size", "texture cap", "pixel work"];
        let rows: Vec<Vec<String>> = self.stages.iter().map(row).collect();
        format!("{table}\n{}", columns(&headings, &rows))
    }
}

/// The size that most training views have; the largest if several are equally frequent.
fn usual_size(views: &dyn ViewSource) -> Option<(u32, u32)> {
    let mut sizes = std::collections::BTreeMap::new();
    for view in views.indices(Split::Train) {
        let p = views.camera(view).pinhole;
        *sizes.entry((p.width_px, p.height_px)).or_insert(0) += 1;
    }
    sizes.into_iter().max_by_key(|&(size, num)| (num, size)).map(|(size, _)| size)
}
