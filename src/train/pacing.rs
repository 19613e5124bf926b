//! When a run that has a time decides how long its rest will be, and how it decides.

use super::eta::Remaining;
use super::schedule::Schedule;

/// Shares of a run after which the length of its rest is decided again; none while the model is pruned. Early decisions see
/// how images and model grow on this device, the last ones make good what growth and pruning took.
const MILESTONES: [f64; 6] = [0.12, 0.3, 0.5, 0.64, 0.84, 0.93];

/// How far the rest may be shortened or stretched against the first plan, while the model grows and after it was pruned.
/// Outside, density control would have too few views in a window, or texels too few steps.
const GROWING: [f64; 2] = [0.4, 2.5];
const PRUNED: [f64; 2] = [0.2, 5.0];

/// No run gets longer than the published timetable.
pub const MOST_STEPS: u32 = 30_000;

/// The time of a run.
#[derive(Clone, Copy)]
pub struct Timing<'a> {
    /// Seconds since the run began, those of earlier programs included if it was interrupted.
    pub now: &'a dyn Fn() -> f64,
    /// When the run should be over, to the exit of the program; `None`: when its steps are done.
    pub deadline_secs: Option<f64>,
    /// What a step costs on this device, as far as it is known.
    pub costs: super::step_costs::StepCosts,
    /// Seconds from the last step to the exit of the program.
    pub end_secs: f64,
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

/// Steps left that take `secs` with all else, within what may be decided.
fn steps_left(schedule: &Schedule, step: u32, remaining: &Remaining, secs: f64) -> f64 {
    let per_step = remaining.steps_secs / f64::from(schedule.last_step - step).max(1.0);
    let affordable = (secs - remaining.other_secs()) / per_step.max(f64::MIN_POSITIVE);
    let original = schedule.original_steps_left(step);
    let [least, most] = if schedule.prunes_by(step) { PRUNED } else { GROWING };
    affordable.clamp(least * original, most * original)
}

/// What the rest takes if it is decided now, to take `secs`.
pub fn eta_secs(schedule: &Schedule, step: u32, remaining: &Remaining, secs: f64) -> f64 {
    let left = f64::from(schedule.last_step - step);
    if left == 0.0 {
        return remaining.secs();
    }
    remaining.other_secs() + remaining.steps_secs / left * steps_left(schedule, step, remaining, secs)
}

/// The step at which the run should end so that its rest takes `secs`.
pub fn last_step(schedule: &Schedule, step: u32, remaining: &Remaining, secs: f64) -> u32 {
    let steps = steps_left(schedule, step, remaining, secs).round().max(1.0);
    let bound = MOST_STEPS.max(schedule.last_step);
    (f64::from(step) + steps).min(f64::from(bound)) as u32
}
