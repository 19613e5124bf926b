//! Submissions of steps whose statuses have not been read.

use super::encode::Dispatch;
use super::pace::BATCH;
use super::view_buffers::RequiredCapacity;
use crate::model::LearningRates;
use std::ops::Range;
use std::time::{Duration, Instant};

/// Submissions under way at once: the device does one while the host encodes the next. Each has a part of the status ring.
pub(super) const MOST_IN_FLIGHT: usize = 2;

/// A submitted step whose status has not been read.
#[derive(Clone, Copy, Debug)]
pub(super) struct PendingStep {
    pub(super) step: u32,
    pub(super) rates: LearningRates,
    pub(super) counts_in_window: bool,
}

/// A submission whose statuses have not been read.
#[derive(Clone, Debug)]
pub(super) struct InFlight {
    /// Its part of the status ring, and its staging buffer.
    pub part: usize,
    /// Number of requests.
    pub requests: usize,
    /// Its steps; none for comparisons, during which the clock stands still.
    pub steps: Vec<PendingStep>,
    /// The capacity that it had; more pairs are needed where they did not fit.
    pub needs: RequiredCapacity,
    pub dispatches: Vec<Dispatch>,
    /// Where the dispatches of each request end.
    pub ends: Vec<usize>,
    /// When the host began to prepare it or had read the one before, whichever came later.
    pub began: Instant,
    pub index: wgpu::SubmissionIndex,
}

impl InFlight {
    /// Its entries of the status ring.
    pub(super) fn slots(&self) -> Range<usize> {
        self.part * BATCH..self.part * BATCH + self.requests
    }

    /// Times of each request by kernel, from those of the dispatches, if they were timed.
    pub(super) fn stages(&self, times: &[Duration]) -> Vec<KernelTimes> {
        let starts = std::iter::once(&0).chain(&self.ends);
        let stage = |(&start, &end): (&usize, &usize)| {
            times_by_kernel(&self.dispatches[start..end], times.get(start..end).unwrap_or_default())
        };
        starts.zip(&self.ends).map(stage).collect()
    }
}

/// Time by kernel, in the order of their first dispatch.
pub(super) type KernelTimes = Vec<(&'static str, Duration)>;

fn times_by_kernel(dispatches: &[Dispatch], times: &[Duration]) -> KernelTimes {
    let mut out: KernelTimes = Vec::new();
    for (dispatch, time) in dispatches.iter().zip(times) {
        let name = dispatch.kernel.kernel().name;
        match out.iter_mut().find(|(n, _)| *n == name) {
            Some((_, sum)) => *sum += *time,
            None => out.push((name, *time)),
        }
    }
    out
}
