//! From a time to image size and steps. The running training corrects the steps (`train::pacing`), the size stands.

use super::step_trial::Trial;
use crate::text::format_duration;
use crate::train::{Course, ExpectedSize, MOST_STEPS, Schedule, StepCosts, TrainConfig};
use crate::views::{Split, ViewSource};
use crate::{Error, Result};

/// Bounds of the longer side that a plan may choose.
const SIDES_PX: [u32; 8] = [160, 240, 320, 480, 640, 960, 1280, 1600];

/// Images are the largest that leave time to show every training view this often or, if those are fewer steps, for this many
/// steps per pixel of their longer side. Measured, one minute on two cores, views held out for the purpose, compared at 1600
/// pixels or full size (passes: PSNR / gradient-PSNR, dB). Fox: 320 pixels 56: 29.48 / 39.73, 480 44: 30.00 / 40.23, 640 30: 29.84 / 40.39, 960 11: 28.55 /
/// 40.12; bonsai: 320 139: 27.39 / 36.63, 480 61: 27.65 / 37.19, 640 39: 27.51 / 37.15; flower: 320 133: 27.89 / 34.84, 480 52:
/// 28.72 / 35.82, 640 32: 28.23 / 35.50. A video with 131 views: 320 pixels, 1,037 steps: 27.39 / 33.48, 480, 766: 27.55 / 33.93.
/// So a minute of the fox takes 640 pixels, which gains 0.16 dB of gradient-PSNR and loses as much PSNR.
const WANTED_PASSES: u32 = 40;
const WANTED_STEPS_PER_PIXEL: f64 = 1.5;

/// Views that a round of pruning probes at most.
const MOST_PROBES: f64 = crate::train::MOST_PROBES as f64;

/// Render scales expected by share of the run, before the photos are analysed (fox, 270 x 480).
const SCALES: [(f64, f64); 7] =
    [(0.1, 3.36), (0.2, 2.83), (0.27, 2.38), (0.36, 2.0), (0.44, 1.68), (0.52, 1.41), (0.62, 1.19)];

/// Seconds for files and the summary. Not measured.
const FILES_SECS: f64 = 1.0;

/// Pixels analysed in a second (fox: 43 photos of 2 MP in 2.9 s on two busy cores).
const ANALYSED_PIXELS_PER_SEC: f64 = 30e6;
const ANALYSED_VIEWS: f64 = 50.0;

/// What a plan follows from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Situation {
    /// Time from start to exit.
    pub time_secs: f64,
    /// Time gone.
    pub gone_secs: f64,
    /// Time to load the capture and make the model again at another size.
    pub reload_secs: f64,
    /// Measured on the device.
    pub trial: Trial,
    /// Splats at the start.
    pub splats: usize,
    /// Training and test views.
    pub views: [usize; 2],
    /// Longer side of the largest training view as loaded.
    pub side_px: u32,
    /// Pixels of a training view as loaded, on average.
    pub pixels: f64,
    /// Whether the user chose the image size.
    pub keeps_size: bool,
    /// Views evaluated at once.
    pub threads: f64,
    /// The most steps that pay, if nobody asked for the time: then it need not be used, and may be exceeded where it is too
    /// short.
    pub enough_steps: Option<u32>,
}

/// What to do in the time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Plan {
    /// Steps, corrected while they go on.
    pub steps: u32,
    /// Bound of the steps.
    pub most_steps: u32,
    /// Whether it will be over in time.
    pub fits: bool,
    /// Bound of the longer side, pixels; `None`: as loaded.
    pub max_resolution: Option<u32>,
    /// When it will be over, seconds after the start.
    pub done_secs: f64,
    /// Of which from the last step to the exit.
    pub end_secs: f64,
}

/// Seconds of a training on the views of a capture after step `done`, when the model has `splats`, if steps cost this much.
pub fn expected_secs(
    costs: StepCosts,
    config: &TrainConfig,
    capture: &dyn ViewSource,
    (done, splats): (u32, usize),
) -> f64 {
    let train = capture.indices(Split::Train);
    let views = train.len().max(1) as f64;
    let pixels =
        train.iter().map(|&view| capture.camera(view).pinhole.num_pixels() as f64).sum::<f64>() / views;
    let schedule = Schedule::of_run(config, train.len(), u32::MAX);
    let size = ExpectedSize::new(config, &schedule, splats, pixels);
    let course = Course { costs, size, pixels, probes: views.min(MOST_PROBES), end_secs: 0.0 };
    course_secs(&course, config, &schedule, (done, splats))
}

/// Seconds of a training after step `done`, when the model has `splats`, before its photos are analysed.
fn course_secs(
    course: &Course,
    config: &TrainConfig,
    schedule: &Schedule,
    (done, splats): (u32, usize),
) -> f64 {
    let is_scheduled = config.active_components().scheduler;
    let scale = |step| {
        let share = schedule.share(step);
        let found = SCALES.iter().find(|(until, _)| is_scheduled && share < *until);
        found.map_or(1.0, |&(_, scale)| scale)
    };
    course.remaining(schedule, done, splats as f64, scale).secs()
}

impl Situation {
    /// Seconds from the start to the exit with this many steps, and those after the last step.
    fn secs(&self, config: &TrainConfig, steps: u32, side_px: u32) -> (f64, f64) {
        let config = TrainConfig { steps, ..config.clone() };
        let schedule = Schedule::new(&config, self.views[0]);
        let ratio = (f64::from(side_px) / f64::from(self.side_px)).min(1.0);
        let pixels = self.pixels * ratio * ratio;
        let [train, test] = self.views.map(|views| views as f64);
        let per_view = pixels * self.trial.evaluation_secs_per_pixel;
        // Compared by several threads, rendered again for the frame rate.
        let end_secs =
            FILES_SECS + per_view * (test + test.clamp(8.0, 64.0) / 3.0) / self.threads.clamp(1.0, 2.0);
        let course = Course {
            costs: self.trial.costs,
            size: ExpectedSize::new(&config, &schedule, self.splats, pixels),
            pixels,
            probes: train.min(MOST_PROBES),
            end_secs,
        };
        let photos_secs = (train + test) * self.trial.photo_secs / self.threads.max(1.0);
        let analysis_secs = train.min(ANALYSED_VIEWS) * pixels / ANALYSED_PIXELS_PER_SEC;
        let reload_secs = if side_px < self.side_px { self.reload_secs } else { 0.0 };
        let rest = course_secs(&course, &config, &schedule, (0, self.splats));
        (self.gone_secs + reload_secs + photos_secs + analysis_secs + rest, end_secs)
    }

    /// The fewest steps after which the model can be pruned.
    fn least_steps(&self, config: &TrainConfig) -> u32 {
        let prunes = |steps| {
            let config = TrainConfig { steps, ..config.clone() };
            Schedule::new(&config, self.views[0]).prune_rounds > 0
        };
        (60..=2_000).step_by(10).find(|&steps| prunes(steps)).unwrap_or(60)
    }

    /// The most steps of a run that has all the time.
    fn most_steps(&self, config: &TrainConfig) -> u32 {
        self.enough_steps.map_or(MOST_STEPS, |enough| MOST_STEPS.min(enough.max(self.least_steps(config))))
    }

    /// The most steps for which there is time.
    fn affordable_steps(&self, config: &TrainConfig, side_px: u32) -> u32 {
        let most = self.most_steps(config);
        let (mut fits, mut too_many) = (0, most + 1);
        while fits + 1 < too_many {
            let middle = fits.midpoint(too_many);
            if self.secs(config, middle, side_px).0 <= self.time_secs {
                fits = middle
            } else {
                too_many = middle
            }
        }
        fits
    }

    /// The plan. Where nobody asked for the time and it is too short, the shortest possible.
    ///
    /// # Errors
    /// [`Error::Usage`] if the time is too short, with the shortest that is not.
    pub fn plan(&self, config: &TrainConfig) -> Result<Plan> {
        let smaller = SIDES_PX.into_iter().filter(|&side| side < self.side_px && !self.keeps_size);
        let sides: Vec<u32> = smaller.chain([self.side_px]).collect();
        let least = self.least_steps(config);
        let wanted = |side: u32| {
            let passes = WANTED_PASSES.saturating_mul(self.views[0] as u32);
            let steps = passes.min((WANTED_STEPS_PER_PIXEL * f64::from(side)) as u32);
            steps.min(self.enough_steps.unwrap_or(steps)).max(least)
        };
        let steps_at = |side: u32| self.affordable_steps(config, side);
        let enough = sides.iter().rev().find(|&&side| steps_at(side) >= wanted(side));
        let side = *enough.unwrap_or(&sides[0]);
        let affordable = steps_at(side);
        let fits = affordable >= least;
        if !fits && self.enough_steps.is_none() {
            let shortest = self.secs(config, least, side).0.ceil();
            return Err(Error::Usage(format!(
                "--time {}: too short for this capture on this device: the shortest is about {}, of which {} are gone \
                 before the first step",
                format_duration(self.time_secs),
                format_duration(shortest),
                format_duration(self.gone_secs)
            )));
        }
        let steps = affordable.max(least);
        let (done_secs, end_secs) = self.secs(config, steps, side);
        Ok(Plan {
            steps,
            most_steps: self.most_steps(config),
            fits,
            max_resolution: (side < self.side_px).then_some(side),
            done_secs,
            end_secs,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const FOX: Situation = Situation {
        time_secs: 600.0,
        gone_secs: 2.0,
        reload_secs: 1.0,
        trial: Trial {
            costs: StepCosts {
                fixed_secs: 0.008,
                secs_per_pixel: 0.2e-6,
                secs_per_splat: 0.7e-6,
                ..StepCosts::CPU
            },
            photo_secs: 0.05,
            evaluation_secs_per_pixel: 1e-6,
        },
        splats: 14_500,
        views: [43, 7],
        side_px: 1600,
        pixels: 900.0 * 1600.0,
        keeps_size: false,
        threads: 2.0,
        enough_steps: None,
    };

    #[test]
    fn more_time_means_larger_images_or_more_steps() {
        let config = TrainConfig::default();
        let of = |time_secs| Situation { time_secs, ..FOX }.plan(&config).unwrap();
        let plans = [30.0, 60.0, 180.0, 600.0, 3_600.0].map(of);
        let side = |plan: &Plan| plan.max_resolution.unwrap_or(1600);
        for pair in plans.windows(2) {
            assert!(side(&pair[0]) < side(&pair[1]) || pair[0].steps < pair[1].steps, "{plans:?}");
        }
        for (plan, time) in plans.iter().zip([30.0, 60.0, 180.0, 600.0]) {
            assert!((0.9..=1.0).contains(&(plan.done_secs / time)), "{plan:?}");
        }
        // The published timetable is the longest: a small capture is done before its time.
        let small = Situation { time_secs: 36_000.0, side_px: 160, pixels: 19_200.0, ..FOX };
        let plan = small.plan(&config).unwrap();
        assert!(plan.steps == 30_000 && plan.done_secs < 36_000.0 && plan.max_resolution.is_none());
        // Where the time need not be used, a small capture is done earlier; a large one takes what it gets.
        let enough = Situation { enough_steps: Some(4_000), ..small }.plan(&config).unwrap();
        assert!(enough.steps == 4_000 && enough.done_secs < 0.3 * plan.done_secs, "{enough:?}");
        let large = Situation { enough_steps: Some(12_000), ..FOX };
        assert_eq!(large.plan(&config).unwrap(), Plan { most_steps: 12_000, ..of(600.0) });
        let kept = Situation { keeps_size: true, ..FOX }.plan(&config).unwrap();
        assert_eq!(kept.max_resolution, None);
    }

    #[test]
    fn density_control_on_the_host_counts_where_a_gpu_trains() {
        // Measured, H100: 8,600 steps of the fox at 1600 pixels take 121 s, of which density control 59 s.
        let config = TrainConfig::default();
        let secs = |costs: StepCosts| {
            let trial = Trial { costs, photo_secs: 0.05, evaluation_secs_per_pixel: 1e-8 };
            Situation { trial, threads: 16.0, ..FOX }.secs(&config, 8_600, 1600).0
        };
        let expected = secs(StepCosts::GPU);
        assert!((0.5..2.0).contains(&(expected / 121.0)), "{expected}");
        let renders = StepCosts { density_secs_per_splat: 0.0, round_secs_per_splat: 0.0, ..StepCosts::GPU };
        assert!(secs(renders) < 0.5 * 121.0, "negative control: {}", secs(renders));
    }

    #[test]
    fn a_time_that_nobody_asked_for_is_exceeded_where_it_is_too_short() {
        let config = TrainConfig::default();
        let asked = Situation { time_secs: 60.0, keeps_size: true, ..FOX };
        assert!(asked.plan(&config).is_err());
        let plan = Situation { enough_steps: Some(8_600), ..asked }.plan(&config).unwrap();
        let least = FOX.least_steps(&config);
        assert!(!plan.fits && plan.steps == least && plan.done_secs > 60.0, "{plan:?}");
        // Negative control: a time that is enough is kept.
        let enough = Situation { enough_steps: Some(8_600), time_secs: 1.2 * plan.done_secs, ..asked };
        let plan = enough.plan(&config).unwrap();
        assert!(plan.fits && plan.steps > least && plan.done_secs <= enough.time_secs, "{plan:?}");
        // Even with the smallest images.
        let hopeless = Situation { time_secs: 1.0, keeps_size: false, enough_steps: Some(8_600), ..FOX };
        let plan = hopeless.plan(&config).unwrap();
        assert_eq!((plan.fits, plan.max_resolution), (false, Some(SIDES_PX[0])));
    }

    #[test]
    fn a_time_that_is_too_short_is_refused_with_the_shortest() {
        let config = TrainConfig::default();
        let refused = |time_secs| Situation { time_secs, ..FOX }.plan(&config).unwrap_err().to_string();
        assert!(refused(5.0).contains("the shortest is about"), "{}", refused(5.0));
        // The time that it names is enough.
        let least = FOX.least_steps(&config);
        let shortest = FOX.secs(&config, least, SIDES_PX[0]).0.ceil();
        assert!(refused(5.0).contains(&format_duration(shortest)));
        let plan = Situation { time_secs: shortest, ..FOX }.plan(&config).unwrap();
        assert!(plan.steps >= least);
        let planned = TrainConfig { steps: plan.steps, ..config };
        assert!(Schedule::new(&planned, 43).prune_rounds > 0, "pruning always finishes");
    }
}
