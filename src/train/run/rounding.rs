//! The last phase of a run whose file has a wanted size: the numbers are trained as a reader of the file gets them
//! (method 10.2).

use super::super::window::go_on_with;
use super::trainer::{Clock, Trainer};
use crate::backend::WindowStatistics;
use crate::rounding::{LastRounding, Offsets};
use crate::{Error, Result};

impl Trainer<'_> {
    /// Whether the model is rounded after a step.
    pub(super) fn is_rounding_step(&self, step: u32) -> bool {
        self.rounder.is_some() && self.schedule.rounding.is_some_and(|phase| phase.is_due(step))
    }

    /// Rounds the model if that is due. Where the device has no room for it, the offsets of the last rounding still hold, and the next
    /// one follows; only the last of the run cannot be left out.
    pub(super) fn round(&mut self) -> Result<()> {
        let step = self.state.step;
        let is_last = step == self.schedule.last_step;
        let is_done = |last: &LastRounding| (last.step, last.is_last) == (step, is_last);
        if !self.is_rounding_step(step) || self.state.rounded.as_ref().is_some_and(is_done) {
            return Ok(());
        }
        match self.round_now(step, is_last) {
            Err(Error::DeviceFull(no_room)) if !is_last => {
                self.not_rounded(&no_room.what);
                Ok(())
            }
            outcome => outcome,
        }
    }

    fn round_now(&mut self, step: u32, is_last: bool) -> Result<()> {
        let Some(rounder) = self.rounder.as_deref_mut() else { return Ok(()) };
        let clock = Clock::start(self.timing);
        let (mut stored, mut adam) = self.backend.read_back()?;
        let mut exact = self.backend.read_flushed()?;
        let before = self.state.rounded.as_ref();
        if let Some(before) = before {
            before.offsets.apply(&mut exact, -1.0);
            before.offsets.apply(&mut stored, -1.0);
        }
        let chosen = before.map(|last| &last.steps);
        let steps = match chosen {
            Some(steps) if !self.schedule.rounding.is_some_and(|phase| phase.chooses(step)) => steps.clone(),
            chosen => rounder.choose(&exact, chosen, is_last)?,
        };
        let model = rounder.round(&exact, &steps, is_last)?;
        let offsets = Offsets::between(&exact, &model);
        if is_last {
            // What the file holds, bit for bit: nothing is pending any more.
            adam.last_step.iter_mut().filter(|last| **last > 0).for_each(|last| *last = adam.step);
            self.backend.upload(&model, &adam)?;
        } else {
            offsets.apply(&mut stored, 1.0);
            self.backend.upload(&stored, &adam)?;
        }
        self.backend.set_statistics(&WindowStatistics::empty(self.size.splats))?;
        self.state.rounded = Some(LastRounding { steps, step, is_last, offsets });
        self.state.history.rounding_wall_secs += clock.wall_secs();
        Ok(())
    }

    /// Gives the model its exact numbers back before its splats or maps change.
    pub(super) fn unround(&mut self) -> Result<()> {
        let Some(last) = &self.state.rounded else { return Ok(()) };
        let (mut model, adam) = self.backend.read_back()?;
        let statistics = self.backend.read_statistics()?;
        last.offsets.apply(&mut model, -1.0);
        self.backend.upload(&model, &adam)?;
        go_on_with(self.backend, &statistics, &mut self.state.window_views)?;
        self.state.rounded = None;
        Ok(())
    }
}
