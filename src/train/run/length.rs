//! The length of a run and how long the rest of it takes.

use super::super::eta::Remaining;
use super::super::events::{Control, Sink, TrainEvent};
use super::super::pacing;
use super::trainer::Trainer;
use crate::Result;

impl Trainer<'_> {
    /// Last step of the run, as far as its changes of length are known.
    pub(super) fn last_step(&self) -> u32 {
        self.plan.last().map_or(self.config.steps, |change| change[1])
    }

    /// Whether the length of the run changes after a step: as the settings say, or because it is decided then.
    pub(super) fn may_change_length(&self, step: u32) -> bool {
        self.plan.iter().any(|change| change[0] == step)
            || self.timing.deadline_secs.is_some() && pacing::is_due(&self.schedule, self.decided_at(), step)
    }

    /// Step after which the length was last decided; 0: never.
    pub(super) fn decided_at(&self) -> u32 {
        self.plan.last().map_or(0, |change| change[0])
    }

    /// Changes the length of the run if that is due: as the settings say, else so that it ends at the deadline.
    pub(super) fn follow_plan(&mut self, sink: Sink<'_>) -> Result<Control> {
        let step = self.state.step;
        if !self.may_change_length(step) || self.schedule.changed_at() == step {
            return Ok(Control::Continue);
        }
        if let Some(&change) = self.plan.iter().find(|change| change[0] == step) {
            self.schedule = self.schedule.changed(change);
            return Ok(Control::Continue);
        }
        let deadline_secs = self.timing.deadline_secs.unwrap_or(f64::INFINITY);
        let left = self.remaining();
        let bounds = (deadline_secs - (self.timing.now)(), self.timing.most_steps);
        let last_step = pacing::last_step(&self.schedule, step, &left, bounds);
        self.plan.push([step, last_step]);
        self.schedule = self.schedule.changed([step, last_step]);
        sink(TrainEvent::Planned { step, last_step, remaining: self.remaining() })
    }

    /// ETA. While a decision is to come, the length is not what it will be, and the deadline tells more.
    pub(super) fn eta_secs(&self) -> f64 {
        let left = self.remaining();
        let last_decided = pacing::all_decided(&self.schedule, self.decided_at());
        match self.timing.deadline_secs.filter(|_| !last_decided) {
            Some(deadline_secs) => {
                let bounds = (deadline_secs - (self.timing.now)(), self.timing.most_steps);
                pacing::eta_secs(&self.schedule, self.state.step, &left, bounds)
            }
            None => left.secs(),
        }
    }

    /// What the rest of the run will take.
    pub(super) fn remaining(&self) -> Remaining {
        let scale = |step| self.stage_at(step).render_scale;
        self.eta.remaining(&self.schedule, self.state.step, self.size.splats, scale)
    }
}
