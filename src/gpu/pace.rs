//! Chooses the number of steps per submission: enough to keep the device busy, but few enough that the host
//! responds within about half a second. It does not change the results.

/// Largest number of steps per submission, and entries of the status ring.
pub(super) const BATCH: usize = 16;

/// Batches that take less time are doubled.
const SHORT_SECS: f64 = 0.3;
/// Batches that take more time are halved. Doubling a short batch does not exceed this.
const LONG_SECS: f64 = 2.0 * SHORT_SECS;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Pace {
    steps: usize,
    adapts: bool,
}

impl Pace {
    /// A fixed number of steps, or one that starts at 1 and adapts to the device.
    pub(super) fn new(fixed: Option<usize>) -> Self {
        Self { steps: fixed.unwrap_or(1).clamp(1, BATCH), adapts: fixed.is_none() }
    }

    /// Steps of the next submission.
    pub(super) fn steps(self) -> usize {
        self.steps
    }

    /// Adapts to the duration of a submission of `steps` steps.
    pub(super) fn learn(&mut self, steps: usize, secs: f64) {
        if !self.adapts || steps == 0 {
            return;
        }
        // The batch may have been shorter than planned: extrapolate to the full length.
        let secs = secs / steps as f64 * self.steps as f64;
        if secs < SHORT_SECS {
            self.steps = (2 * self.steps).min(BATCH);
        } else if secs > LONG_SECS {
            self.steps = (self.steps / 2).max(1);
        }
    }

    /// The number of steps that it converges to if each takes `step_secs`.
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
    fn short_batches_double_and_long_ones_halve() {
        let mut pace = Pace::new(None);
        let mut seen = Vec::new();
        for secs in [0.01, 0.02, 0.04, 0.31, 0.31, 0.61, 0.1, 0.2, 0.2, 0.2] {
            seen.push(pace.steps());
            pace.learn(pace.steps(), secs);
        }
        assert_eq!(seen, [1, 2, 4, 8, 8, 8, 4, 8, 16, 16]);
        // Shorter batches are extrapolated: 2 of 16 steps in 0.1 s mean 0.8 s for all.
        pace.learn(2, 0.1);
        assert_eq!(pace.steps(), 8);
    }

    #[test]
    fn slow_devices_get_single_steps_and_a_fixed_pace_does_not_adapt() {
        assert_eq!([0.0001, 0.02, 0.1, 0.31, 20.0].map(Pace::at), [16, 16, 4, 1, 1]);
        let mut fixed = Pace::new(Some(40));
        fixed.learn(16, 100.0);
        assert_eq!(fixed.steps(), BATCH);
    }
}
