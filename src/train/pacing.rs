//! When a run that has a time decides how long its rest will be, and how it decides.

use super::eta::Remaining;
use super::schedule::Schedule;
use super::step_costs::StepCosts;

/// Shares of a run after which the length of its rest is decided again; none while the model is pruned. Early decisions see
/// how images and model grow on this device, the last ones make good what growth and pruning took.
const MILESTONES: [f64; 6] = [0.12, 0.3, 0.5, 0.64, 0.84, 0.93];

/// How far the rest may be shortened or stretched against the first plan, while the model grows and after it was pruned.
/// If shortened further, density control would have too few views in a window, or texels too few steps. Measured: lego at 160 px
/// begins with random splats, of which a third stays, so steps are three times as fast as planned; stretched 2.5 times at most,
/// 60 s took 42 s. Flower at 240 px has steps twice as fast once it is pruned; stretched 5 times at most from then on, 60 s took 47 s.
const GROWING: [f64; 2] = [0.4, 5.0];
const PRUNED: [f64; 2] = [0.2, 10.0];

/// No run with a time gets longer than the published timetable.
pub const MOST_STEPS: u32 = 30_000;

/// The time of a run.
#[derive(Clone, Copy)]
pub struct Timing<'a> {
    /// Seconds since the run began, those of earlier programs included if it was interrupted.
    pub now: &'a dyn Fn() -> f64,
    /// When the run should be over, to the exit of the program; `None`: when its steps are done.
    pub deadline_secs: Option<f64>,
    /// With a deadline: the run is not made longer than this, and ends early if there is time left then. [`MOST_STEPS`], or fewer.
    pub most_steps: u32,
    /// What a step costs on this device, as far as it is known.
    pub costs: StepCosts,
    /// Seconds from the last step to the exit of the program.
    pub end_secs: f64,
}

impl<'a> Timing<'a> {
    /// That of a run by a number of steps.
    pub fn by_steps(now: &'a dyn Fn() -> f64) -> Self {
        Self { now, deadline_secs: None, most_steps: MOST_STEPS, costs: StepCosts::CPU, end_secs: 0.0 }
    }
}

/// Whether the length is decided after a step, if it was last decided after step `before` (0: never).
pub fn is_due(schedule: &Schedule, before: u32, step: u32) -> bool {
    let [from, to] = [before, step].map(|step| schedule.share(step));
    let passes = MILESTONES.iter().any(|&share| from < share && share <= to);
    // Between density-control steps a window of statistics is open.
    let grows = schedule.is_density_step(step) && !schedule.prunes_by(step);
    passes && step < schedule.last_step && (grows || schedule.is_pruned(step))
}

/// Whether no decision is left after the one that followed step `before` (0: none was made).
pub fn all_decided(schedule: &Schedule, before: u32) -> bool {
    MILESTONES.iter().all(|&share| share <= schedule.share(before))
}

/// Steps left that take `secs` with all else, within what may be decided, of a run that gets no longer than `most_steps`.
fn steps_left(schedule: &Schedule, step: u32, remaining: &Remaining, (secs, most_steps): (f64, u32)) -> f64 {
    let per_step = remaining.steps_secs / f64::from(schedule.last_step - step).max(1.0);
    let affordable = (secs - remaining.other_secs()) / per_step.max(f64::MIN_POSITIVE);
    let original = schedule.original_steps_left(step);
    let [least, most] = if schedule.prunes_by(step) { PRUNED } else { GROWING };
    let bound = f64::from(most_steps.max(schedule.last_step).saturating_sub(step));
    affordable.clamp(least * original, most * original).min(bound)
}

/// What the rest takes if it is decided now, to take `secs` with `most_steps` at most.
pub fn eta_secs(schedule: &Schedule, step: u32, remaining: &Remaining, bounds: (f64, u32)) -> f64 {
    let left = f64::from(schedule.last_step - step);
    if left == 0.0 {
        return remaining.secs();
    }
    remaining.other_secs() + remaining.steps_secs / left * steps_left(schedule, step, remaining, bounds)
}

/// The step at which the run should end so that its rest takes `secs`, with `most_steps` of the whole run at most.
pub fn last_step(schedule: &Schedule, step: u32, remaining: &Remaining, bounds: (f64, u32)) -> u32 {
    step + steps_left(schedule, step, remaining, bounds).round().max(1.0) as u32
}
