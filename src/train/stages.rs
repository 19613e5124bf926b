//! The resolution stages of a training laid out over its steps, known before it begins.

use super::config::TrainConfig;
use super::schedule::Schedule;
use crate::frequency::FrequencySchedule;
use serde::{Deserialize, Serialize};

/// Consecutive steps with one render scale and one texture cap.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct StageSpan {
    /// First step, from 1.
    pub first_step: u32,
    /// Last step.
    pub last_step: u32,
    /// Continuous scale at the first step.
    pub scale_from: f64,
    /// Continuous scale at the last step.
    pub scale_to: f64,
    /// Full image size over the size rendered.
    pub render_scale: f64,
    /// Width rendered.
    pub width_px: u32,
    /// Height rendered.
    pub height_px: u32,
    /// Largest map side that the stage allows.
    pub texture_cap: u16,
    /// Share of the pixels of the whole training.
    pub pixel_share: f64,
}

impl StageSpan {
    /// Pixels of all its steps, as a number of images of full size.
    pub fn full_images(&self) -> f64 {
        // Not the last step plus 1, which may be one too many for its type.
        (f64::from(self.last_step - self.first_step) + 1.0) / self.render_scale.powi(2)
    }
}

/// The stages of a training whose images have this size, in order.
pub fn stage_spans(
    schedule: &FrequencySchedule,
    timetable: &Schedule,
    config: &TrainConfig,
    (width_px, height_px): (u32, u32),
) -> Vec<StageSpan> {
    let rules = config.scheduler.rules.set();
    // Steps done before this one: the first is rendered at the scale of the start.
    let share = |step: u32| timetable.stage_share(step - 1);
    let level = |step: u32| {
        let t = share(step);
        let render_scale = schedule.render_scale(t, rules.scale, width_px.min(height_px));
        (render_scale, schedule.texture_cap(t, rules.cap))
    };
    let mut stages: Vec<StageSpan> = Vec::new();
    let mut next = Some(1);
    while let Some(first_step) = next.filter(|&step| step <= config.steps) {
        let (render_scale, texture_cap) = level(first_step);
        let last_step = last_alike(first_step, config.steps, level);
        stages.push(StageSpan {
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
    let total: f64 = stages.iter().map(StageSpan::full_images).sum();
    for stage in &mut stages {
        stage.pixel_share = stage.full_images() / total;
    }
    stages
}

/// The last of the steps `first..=end` whose level is that of `first`. By bisection, since a run may have billions of
/// steps; levels are monotonic, so that none comes back.
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frequency::{FrequencyOptions, ScheduleRules};

    /// Stages of a schedule with several nodes, from 900x700 px.
    fn of(steps: u32, rules: ScheduleRules) -> (Vec<StageSpan>, impl Fn(u32) -> (f64, u16)) {
        let nodes = vec![(0.0, 3.7), (0.2, 2.9), (0.21, 1.8), (0.7, 1.2), (1.0, 1.0)];
        let schedule = FrequencySchedule { s_max: 3.7, nodes, views: 3, noise: 0.0 };
        let scheduler = FrequencyOptions { rules, ..FrequencyOptions::default() };
        let set = rules.set();
        let config = TrainConfig { steps, scheduler, ..TrainConfig::default() };
        let timetable = Schedule::new(&config, 10);
        let stages = stage_spans(&schedule, &timetable, &config, (900, 700));
        let level = move |step: u32| {
            let t = timetable.stage_share(step - 1);
            (schedule.render_scale(t, set.scale, 700), schedule.texture_cap(t, set.cap))
        };
        (stages, level)
    }

    #[test]
    fn stages_equal_those_counted_step_by_step() {
        for steps in [1, 2, 3, 10, 299, 1_000, 30_000] {
            for rules in [ScheduleRules::Default, ScheduleRules::Paper, ScheduleRules::Authors] {
                let (stages, level) = of(steps, rules);
                let found = stages.iter().flat_map(|s| {
                    (s.first_step..=s.last_step).map(|step| (step, (s.render_scale, s.texture_cap)))
                });
                assert!(found.eq((1..=steps).map(|step| (step, level(step)))), "{steps} {rules:?}");
                assert!(stages.windows(2).all(|s| level(s[0].last_step) != level(s[1].first_step)));
            }
        }
    }

    #[test]
    fn stages_of_the_longest_run_match_those_of_the_usual_one() {
        let (mut usual, _) = of(30_000, ScheduleRules::Default);
        let (mut longest, _) = of(u32::MAX, ScheduleRules::Default);
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
