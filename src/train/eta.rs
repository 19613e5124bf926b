//! The time that the rest of a run will take, by its parts. Images and models grow during a run and steps slow down with
//! them, so extrapolating the mean speed so far would be far too optimistic.

use super::expected_size::ExpectedSize;
use super::schedule::Schedule;
use super::step_costs::StepCosts;

/// The weight of a measured time falls by a factor of e over this share of the run's steps.
const MEMORY_SHARE: f64 = 0.03;

/// Time of the renders of a round of pruning before one is measured, in steps on full images for each view that it
/// probes. Measured: 1.6 (fox, 270 x 480), 2.2 (flower, 480 x 360), 0.9 (fox, 1067 x 1899, no budget).
const ROUND_STEPS_PER_PROBE: f64 = 1.6;

/// Time of the renders of a density-control step before one is measured, in steps on full images (fox, 270 x 480: 0.3 to 0.8).
const DENSITY_STEPS: f64 = 0.5;

/// Time of measuring quantisation steps for a file of a wanted size, and of each rounding to its numbers, in steps on full images.
/// Measured, all of it: about 60 on fox, 40 on bonsai (480 pixels, 1,000 steps, 8 roundings).
const MEASURING_STEPS: f64 = 35.0;
const ROUNDING_STEPS: f64 = 1.5;

/// Seconds that the parts of the rest of a run will take.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Remaining {
    /// Training steps.
    pub steps_secs: f64,
    /// Density-control steps.
    pub density_secs: f64,
    /// Rounds of pruning.
    pub pruning_secs: f64,
    /// Rounding of the model to the numbers of its file.
    pub rounding_secs: f64,
    /// Evaluation, files and the summary.
    pub end_secs: f64,
}

impl Remaining {
    /// All of it.
    pub fn secs(&self) -> f64 {
        self.steps_secs + self.other_secs()
    }

    /// What does not depend on the number of steps.
    pub fn other_secs(&self) -> f64 {
        self.density_secs + self.pruning_secs + self.rounding_secs + self.end_secs
    }
}

/// What the time of a run depends on besides its timetable.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Course {
    /// What a step costs; measured times correct it by a factor.
    pub costs: StepCosts,
    /// How the model grows.
    pub size: ExpectedSize,
    /// Pixels of a training view at full size, on average.
    pub pixels: f64,
    /// Views that a round of pruning probes.
    pub probes: f64,
    /// Seconds from the last step to the exit of the program.
    pub end_secs: f64,
}

impl Course {
    /// Seconds of a step at a render scale.
    fn step_secs(&self, scale: f64, splats: f64) -> f64 {
        self.costs.step_secs(self.pixels / (scale * scale), splats, self.size.initial())
    }

    /// Seconds of a density-control step before one is measured.
    fn density_secs(&self, splats: f64) -> f64 {
        DENSITY_STEPS * self.step_secs(1.0, splats) + splats * self.costs.density_secs_per_splat
    }

    /// Seconds of a round of pruning before one is measured.
    fn round_secs(&self, splats: f64) -> f64 {
        ROUND_STEPS_PER_PROBE * self.probes * self.step_secs(1.0, splats)
            + splats * self.costs.round_secs_per_splat
    }

    /// Seconds of all that comes after step `done`, when the model has `splats`, before anything is measured.
    pub fn remaining(
        &self,
        schedule: &Schedule,
        done: u32,
        splats: f64,
        scale: impl Fn(u32) -> f64,
    ) -> Remaining {
        let now = (schedule.share(done), splats);
        let mut left = Remaining { end_secs: self.end_secs, ..Remaining::default() };
        let mut from = done;
        while from < schedule.last_step {
            let next = schedule.next_density_step(from);
            let splats = self.size.splats(schedule.share(from), now);
            let steps = f64::from(next.min(schedule.last_step) - from);
            left.steps_secs += steps * self.step_secs(scale(schedule.last_density_step(from)), splats);
            if schedule.is_density_step(next) {
                left.density_secs += self.density_secs(splats);
            }
            if schedule.rounds_left(next) > 0 {
                left.pruning_secs += self.round_secs(splats);
            }
            from = next;
        }
        if let Some(phase) = schedule.rounding {
            let measuring = if done < phase.start { MEASURING_STEPS } else { 0.0 };
            let steps = measuring + ROUNDING_STEPS * f64::from(phase.roundings_after(done));
            left.rounding_secs = steps * self.step_secs(1.0, self.size.splats(1.0, now));
        }
        left
    }
}

/// The course of a run, corrected by what was measured.
pub(super) struct Eta {
    pub course: Course,
    /// Measured and expected seconds of the last steps, of density-control steps and of rounds of pruning.
    steps: [f64; 2],
    density: [f64; 2],
    pruning: [f64; 2],
}

/// Measured over expected seconds; `None` before anything is measured.
fn ratio([measured, expected]: [f64; 2]) -> Option<f64> {
    (expected > 0.0).then(|| measured / expected)
}

impl Eta {
    pub fn new(course: Course) -> Self {
        Self { course, steps: [0.0; 2], density: [0.0; 2], pruning: [0.0; 2] }
    }

    /// Takes in that `steps` steps, a share of the run, took `secs`.
    pub fn observe_steps(&mut self, steps: u32, share: f64, secs: f64, (scale, splats): (f64, usize)) {
        let kept = (-share / MEMORY_SHARE).exp();
        let expected = f64::from(steps) * self.course.step_secs(scale, splats as f64);
        self.steps = [kept * self.steps[0] + secs, kept * self.steps[1] + expected];
    }

    /// Takes in that a density-control step took `secs`.
    pub fn observe_density(&mut self, secs: f64, splats: usize) {
        self.density[0] += secs;
        self.density[1] += self.course.density_secs(splats as f64);
    }

    /// Takes in that a round of pruning took `secs`.
    pub fn observe_round(&mut self, secs: f64, splats: usize) {
        self.pruning[0] += secs;
        self.pruning[1] += self.course.round_secs(splats as f64);
    }

    /// What is left after step `done`.
    pub fn remaining(
        &self,
        schedule: &Schedule,
        done: u32,
        splats: usize,
        scale: impl Fn(u32) -> f64,
    ) -> Remaining {
        let left = self.course.remaining(schedule, done, splats as f64, scale);
        let of_steps = ratio(self.steps).unwrap_or(1.0);
        Remaining {
            steps_secs: left.steps_secs * of_steps,
            density_secs: left.density_secs * ratio(self.density).unwrap_or(of_steps),
            pruning_secs: left.pruning_secs * ratio(self.pruning).unwrap_or(of_steps),
            rounding_secs: left.rounding_secs * of_steps,
            end_secs: left.end_secs,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::train::TrainConfig;

    #[test]
    fn the_eta_accounts_for_growing_images_and_adapts_to_slowdowns() {
        let config = TrainConfig { steps: 1_000, ..TrainConfig::default() };
        let schedule = Schedule::new(&config, 43);
        // Pixels for 14,000 splats: the model grows.
        let size = ExpectedSize::new(&config, &schedule, 10_000, 448_000.0);
        let course = Course { costs: StepCosts::CPU, size, pixels: 1e5, probes: 43.0, end_secs: 3.0 };
        let scale = |step: u32| if step < 500 { 4.0 } else { 1.0 };
        let mut eta = Eta::new(course);
        let before = eta.remaining(&schedule, 0, 10_000, scale);
        assert_eq!(before.end_secs, 3.0);
        // Two rounds of 1.6 steps on each of 43 views.
        let full = course.costs.step_secs(1e5, 14_000.0, 10_000.0);
        assert!((before.pruning_secs / (2.0 * 1.6 * 43.0 * full) - 1.0).abs() < 1e-9, "{before:?}");
        assert_eq!(before.rounding_secs, 0.0);
        let sized = Schedule::new(&TrainConfig { max_bytes: Some(100_000), ..config.clone() }, 43);
        let rounding = Eta::new(course).remaining(&sized, 0, 10_000, scale).rounding_secs;
        assert!((rounding / ((35.0 + 1.5 * 8.0) * full) - 1.0).abs() < 1e-9, "{rounding}");
        // Steps cost what is expected: the time passes as it was told.
        let mut gone = 0.0;
        let mut from = 0;
        while from < 1_000 {
            let to = schedule.next_density_step(from).min(1_000);
            let splats = size.splats(schedule.share(from), (0.0, 10_000.0));
            let secs = f64::from(to - from) * course.step_secs(scale(from), splats);
            eta.observe_steps(
                to - from,
                schedule.share(to) - schedule.share(from),
                secs,
                (scale(from), splats as usize),
            );
            gone += secs;
            from = to;
            let splats = size.splats(schedule.share(from), (0.0, 10_000.0)) as usize;
            let left = eta.remaining(&schedule, from, splats, scale).steps_secs;
            assert!(
                (gone + left - before.steps_secs).abs() < 0.02 * before.steps_secs,
                "step {from}: {gone} {left}"
            );
        }
        // Half as fast from then on, and a round of pruning that took four times as long.
        let mut slow = Eta::new(course);
        slow.observe_steps(500, 0.5, 2.0 * 500.0 * course.step_secs(4.0, 10_000.0), (4.0, 10_000));
        let [was, is] = [&eta, &slow].map(|eta| eta.remaining(&schedule, 500, 14_000, scale));
        assert!((is.steps_secs / was.steps_secs - 2.0).abs() < 0.01, "{was:?} {is:?}");
        slow.observe_round(4.0 * 1.6 * 43.0 * full, 14_000);
        let then = slow.remaining(&schedule, 500, 14_000, scale);
        assert!((then.pruning_secs / was.pruning_secs - 4.0).abs() < 0.01, "{was:?} {then:?}");
    }
}
