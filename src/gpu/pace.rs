//! Chooses the number of steps per submission and per call: enough to keep the device busy, but few enough that the host
//! responds within about half a second. It does not change the results.

/// Largest number of steps per submission, and entries of a part of the status ring.
pub(super) const BATCH: usize = 16;
/// Largest number of steps per call: the device waits for the host between calls, not between the submissions of one.
const MOST_STEPS: usize = 4 * BATCH;

/// Calls that take less time are doubled.
const SHORT_SECS: f64 = 0.3;
/// Calls that take more time are halved. Doubling a short call does not exceed this.
const LONG_SECS: f64 = 2.0 * SHORT_SECS;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Pace {
    /// Steps of a call.
    steps: usize,
    adapts: bool,
}

impl Pace {
    /// A fixed number of steps, one submission, or one that starts at 1 and adapts to the device.
    pub(super) fn new(fixed: Option<usize>) -> Self {
        Self { steps: fixed.unwrap_or(1).clamp(1, BATCH), adapts: fixed.is_none() }
    }

    /// Steps of the next call.
    pub(super) fn call_steps(self) -> usize {
        self.steps
    }

    /// Most steps of a call.
    pub(super) fn most_call_steps(self) -> usize {
        if self.adapts { MOST_STEPS } else { self.steps }
    }

    /// Steps of the next submission: as long as it may be.
    pub(super) fn steps(self) -> usize {
        self.steps.min(BATCH)
    }

    /// Steps of the next submission of a call of `call_steps` steps: half of a short one, so that the device has work while the
    /// host encodes the other half.
    pub(super) fn submission_steps(self, call_steps: usize) -> usize {
        let half = if self.adapts { call_steps.div_ceil(2).max(1) } else { usize::MAX };
        self.steps().min(half)
    }

    /// Adapts to the duration of a submission of `steps` steps.
    pub(super) fn learn(&mut self, steps: usize, secs: f64) {
        if !self.adapts || steps == 0 {
            return;
        }
        // It may have been shorter than a call: extrapolate to the full length.
        let secs = secs / steps as f64 * self.steps as f64;
        if secs < SHORT_SECS {
            self.steps = (2 * self.steps).min(MOST_STEPS);
        } else if secs > LONG_SECS {
            self.steps = (self.steps / 2).max(1);
        }
    }

    /// The number of steps per submission that it converges to if each takes `step_secs`.
    pub(super) fn at(step_secs: f64) -> usize {
        let mut pace = Self::new(None);
        (0..BATCH).for_each(|_| pace.learn(pace.steps(), step_secs * pace.steps() as f64));
        pace.steps()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn short_calls_double_and_long_ones_halve() {
        let mut pace = Pace::new(None);
        let mut seen = Vec::new();
        for secs in [0.01, 0.02, 0.04, 0.31, 0.31, 0.61, 0.1, 0.2, 0.2, 0.2, 0.2, 0.3] {
            seen.push((pace.call_steps(), pace.steps()));
            pace.learn(pace.call_steps(), secs);
        }
        let calls = [1, 2, 4, 8, 8, 8, 4, 8, 16, 32, 64, 64];
        assert_eq!(seen, calls.map(|steps| (steps, steps.min(BATCH))));
        // Submissions are extrapolated: 16 of 64 steps in 0.2 s mean 0.8 s for all.
        pace.learn(BATCH, 0.2);
        assert_eq!((pace.call_steps(), pace.steps()), (32, BATCH));
    }

    #[test]
    fn short_calls_are_two_submissions() {
        let mut pace = Pace::new(None);
        assert_eq!(pace.submission_steps(1), 1);
        (0..6).for_each(|_| pace.learn(pace.steps(), 0.01));
        assert_eq!((pace.call_steps(), Pace::new(None).most_call_steps()), (MOST_STEPS, MOST_STEPS));
        assert_eq!([0, 1, 2, 7, 16, 36, 64].map(|call| pace.submission_steps(call)), [1, 1, 1, 4, 8, 16, 16]);
        assert_eq!(Pace::new(Some(3)).submission_steps(4), 3);
    }

    #[test]
    fn slow_devices_get_single_steps_and_a_fixed_pace_does_not_adapt() {
        assert_eq!([0.0001, 0.02, 0.1, 0.31, 20.0].map(Pace::at), [16, 16, 4, 1, 1]);
        let mut fixed = Pace::new(Some(40));
        fixed.learn(16, 100.0);
        assert_eq!([fixed.call_steps(), fixed.most_call_steps(), fixed.steps()], [BATCH; 3]);
    }
}
