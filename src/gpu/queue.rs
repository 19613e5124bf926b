//! Feeds the device: it does one submission while the host prepares the next and reads the statuses of the one before.

use super::encode::Dispatch;
use super::in_flight::{InFlight, MOST_IN_FLIGHT, PendingStep};
use super::kernels::Buf;
use super::layout::Status;
use super::pace::BATCH;
use super::state::GpuBackend;
use super::submission::{Task, check_request};
use super::view_buffers::RequiredCapacity;
use crate::backend::{StepReport, StepRequest};
use crate::{Error, Result};
use std::time::Instant;

impl GpuBackend {
    /// Runs requests as submissions, which grow the buffers where pairs do not fit. Returns a report for each.
    pub(super) fn run(&mut self, task: Task, requests: &[StepRequest<'_>]) -> Result<Vec<StepReport>> {
        self.check()?;
        self.count_unread()?;
        requests.iter().try_for_each(check_request)?;
        if requests.iter().any(|r| r.loss.needs_geometry()) {
            self.compile_geometry(true)?;
        }
        let mut reports = Vec::new();
        while reports.len() < requests.len() {
            let mut sent = Ok(());
            while sent.is_ok() && self.in_flight.len() < self.most_in_flight() {
                let under_way: usize = self.in_flight.iter().map(|flight| flight.requests).sum();
                match &requests[reports.len() + under_way..] {
                    [] => break,
                    rest => {
                        let most = self.pace.submission_steps(requests.len());
                        sent = self.send(task, &rest[..rest.len().min(most)]);
                    }
                }
            }
            let outcome = match sent {
                Err(error) if self.in_flight.is_empty() => Err(error),
                // First what is under way. The next attempt meets the error again.
                _ => self.receive(task, &requests[reports.len()..]),
            };
            match outcome {
                Ok(some) => reports.extend(some),
                // Training steps before it count.
                Err(Error::DeviceFull(_)) if task == Task::Train && !reports.is_empty() => break,
                Err(error) => return Err(error),
            }
        }
        Ok(reports)
    }

    /// The timer holds the times of one submission.
    fn most_in_flight(&self) -> usize {
        if self.timer.is_some() { 1 } else { MOST_IN_FLIGHT }
    }

    /// Submits these requests, or the first of them where not all of their photos fit. The statuses of the submission before need
    /// not have been read: if one of its steps is not applied, neither is any of these.
    fn send(&mut self, task: Task, requests: &[StepRequest<'_>]) -> Result<()> {
        let began = Instant::now();
        let photos: Vec<_> = requests.iter().map(|r| (r.photo, r.target)).collect();
        let fitting = self.photos.prepare(&self.device, &mut self.resources, &photos)?;
        let (batch, photos) = (&requests[..fitting], &photos[..fitting]);
        let statistics = batch.iter().any(|r| r.accumulate_statistics);
        let needs = RequiredCapacity {
            geometry: batch.iter().any(|r| r.loss.needs_geometry()),
            ..self.needs(batch.iter().map(|r| r.camera), true, statistics)
        };
        // A submission under way loses nothing: the queue writes photos in their places after it, and keeps the buffers that
        // it uses when others replace them.
        self.capacity.ensure(&self.device, &mut self.resources, &needs)?;
        let photos_px = self.photos.place(&self.device, &self.resources, photos)?;
        let mut inputs = self.uniform_inputs();
        inputs.pair_capacity = self.capacity.training_pairs as u32;
        let before = self.in_flight.back();
        let part = before.map_or(0, |flight| (flight.part + 1) % MOST_IN_FLIGHT);
        if let Some(last) = before.and_then(|flight| flight.steps.last()) {
            (inputs.flushed_step, inputs.flushed_rates) = (last.step, last.rates);
        }
        if before.is_none() {
            // Only then: a step that was not applied leaves counts of zero, which keep those behind it from being applied.
            self.arm();
        } else {
            self.clear_statuses(part);
        }
        let (dispatches, ends) = self.batch_dispatches(task, batch, &photos_px, part, inputs);
        let index = self.submit_for_statuses(&dispatches, part, batch.len())?;
        if !self.in_flight.is_empty() {
            self.device.count(|work| &work.overlapping);
        }
        let step = |r: &StepRequest<'_>| PendingStep {
            step: r.step,
            rates: r.rates,
            counts_in_window: r.accumulate_statistics,
        };
        let steps = batch.iter().filter(|_| task != Task::Compare).map(step).collect();
        let requests = batch.len();
        self.in_flight.push_back(InFlight { part, requests, steps, needs, dispatches, ends, began, index });
        Ok(())
    }

    /// Waits for the oldest submission under way, and grows the buffers if pairs do not fit. Returns a report for each of its
    /// requests that was carried out; they are the first of `requests`.
    fn receive(&mut self, task: Task, requests: &[StepRequest<'_>]) -> Result<Vec<StepReport>> {
        let statuses: Vec<Status> = match self.in_flight.front() {
            Some(InFlight { part, requests, index, .. }) => {
                self.device.read_staged(&self.staging[*part], *requests, index.clone())?
            }
            None => Vec::new(),
        };
        let behind = self.in_flight.get(1).map(|flight| flight.index.clone());
        let Some((flight, applied)) = self.settle(&statuses) else {
            return Err(self.device.error("no submission is under way"));
        };
        let times = match &self.timer {
            Some(timer) => timer.read(&self.device, flight.dispatches.len())?,
            None => Vec::new(),
        };
        // The time of a batch that was cut short does not predict that of a whole one.
        if task == Task::Train && applied == flight.requests {
            self.pace.learn(applied, flight.began.elapsed().as_secs_f64());
        }
        if let Some(next) = self.in_flight.front_mut() {
            next.began = Instant::now();
        }
        let stages = flight.stages(&times);
        let done = requests.iter().zip(&statuses).zip(stages).take(applied);
        let reports = done.map(|((request, status), stages)| self.report(request, status, stages)).collect();
        if let Some(unfit) = statuses.get(applied) {
            // It has nothing to do, but holds the buffers.
            behind.map_or(Ok(()), |index| self.device.wait_for(index))?;
            match self.grow_pairs(unfit, &flight.needs) {
                // The next submission meets it again.
                Err(Error::DeviceFull(_)) if applied > 0 => {}
                grown => grown?,
            }
        }
        Ok(reports)
    }

    /// Ends the oldest submission under way, given its statuses, and updates the clock to its last step that was applied.
    /// Returns it with the number of its requests that were carried out.
    fn settle(&mut self, statuses: &[Status]) -> Option<(InFlight, usize)> {
        let flight = self.in_flight.pop_front()?;
        let applied = statuses.iter().take(flight.requests).take_while(|s| s.done == 1).count();
        let steps = &flight.steps[..applied.min(flight.steps.len())];
        if let Some(last) = steps.last() {
            (self.clock.step, self.clock.rates) = (last.step, last.rates);
        }
        self.window_views += steps.iter().filter(|p| p.counts_in_window).count() as u32;
        if applied < flight.requests {
            // Nor was any step behind it.
            self.in_flight.clear();
        }
        Some((flight, applied))
    }

    /// Counts submitted steps whose statuses could not be read, from the ring on the device; also after refused commands.
    ///
    /// # Errors
    /// [`crate::Error::Device`] if the device was lost.
    pub(super) fn count_unread(&mut self) -> Result<()> {
        if self.in_flight.is_empty() {
            return Ok(());
        }
        let ring = self.resources.buffer(Buf::Status);
        let statuses: Vec<Status> = self.device.rescue(ring, MOST_IN_FLIGHT * BATCH)?;
        while let Some(slots) = self.in_flight.front().map(InFlight::slots) {
            self.settle(&statuses[slots]);
        }
        Ok(())
    }

    /// Submits dispatches and a copy of the first `count` statuses of a part of the ring.
    ///
    /// # Errors
    /// [`crate::Error::Device`] if a command was refused: later ones must not build on it.
    pub(super) fn submit_for_statuses(
        &mut self,
        dispatches: &[Dispatch],
        part: usize,
        count: usize,
    ) -> Result<wgpu::SubmissionIndex> {
        let mut encoder = self.encoded(dispatches);
        let [at, bytes] = [part * BATCH, count].map(|statuses| (statuses * size_of::<Status>()) as u64);
        encoder.copy_buffer_to_buffer(self.resources.buffer(Buf::Status), at, &self.staging[part], 0, bytes);
        self.device.check()?;
        Ok(self.device.submit(encoder))
    }
}
