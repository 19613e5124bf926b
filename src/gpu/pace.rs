//! How many steps go into a submission: as many as keep the device busy, as few as keep the host waiting for
//! its answer no longer than a person would. It changes no bit of what is computed.

/// Most steps of a submission, and entries of the rings.
pub(super) const BATCH: usize = 16;

/// A batch that takes less is worth a longer one.
const SHORT_SECS: f64 = 0.3;
/// A batch that takes longer is too long: beyond what doubling a short one comes to.
const LONG_SECS: f64 = 2.0 * SHORT_SECS;

/// Steps of the next submission.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Pace {
    steps: usize,
    adapts: bool,
}

impl Pace {
    /// A fixed number of steps, or one that begins with 1 and follows the device.
    pub(super) fn new(fixed: Option<usize>) -> Self {
        Self { steps: fixed.unwrap_or(1).clamp(1, BATCH), adapts: fixed.is_none() }
    }

    /// Steps of the next submission.
    pub(super) fn steps(self) -> usize {
        self.steps
    }

    /// Follows the time of a submission of `steps` steps.
    pub(super) fn learn(&mut self, steps: usize, secs: f64) {
        if !self.adapts || steps == 0 {
            return;
        }
        // A batch may have been shorter than the pace: what counts is the time of one of full length.
        let secs = secs / steps as f64 * self.steps as f64;
        if secs < SHORT_SECS {
            self.steps = (2 * self.steps).min(BATCH);
        } else if secs > LONG_SECS {
            self.steps = (self.steps / 2).max(1);
        }
    }

    /// What it comes to on a device that takes `step_secs` for each step.
    pub(super) fn at(step_secs: f64) -> usize {
        let mut pace = Self::new(None);
        (0..BATCH).for_each(|_| pace.learn(pace.steps, step_secs * pace.steps as f64));
        pace.steps
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn batches_double_while_they_are_short_and_halve_once_they_are_long() {
        let mut pace = Pace::new(None);
        let mut seen = Vec::new();
        for secs in [0.01, 0.02, 0.04, 0.31, 0.31, 0.61, 0.1, 0.2, 0.2, 0.2] {
            seen.push(pace.steps());
            pace.learn(pace.steps(), secs);
        }
        assert_eq!(seen, [1, 2, 4, 8, 8, 8, 4, 8, 16, 16]);
        // A short batch is judged by its steps: 2 of 16 in 0.1 s would be 0.8 s.
        pace.learn(2, 0.1);
        assert_eq!(pace.steps(), 8);
    }

    #[test]
    fn a_slow_device_answers_after_each_step_and_a_fixed_pace_stays() {
        assert_eq!([0.0001, 0.02, 0.1, 0.31, 20.0].map(Pace::at), [16, 16, 4, 1, 1]);
        let mut fixed = Pace::new(Some(40));
        fixed.learn(16, 100.0);
        assert_eq!(fixed.steps(), BATCH);
    }
}
