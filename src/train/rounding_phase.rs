//! The last phase of a run whose file has a wanted size (method 10.2): when the model is rounded, and how fast it learns.

/// First step of the phase (published timetable).
pub const FROM: f64 = 28_000.0;

/// Steps between two roundings.
const INTERVAL: u32 = 10;

/// Parts of the phase, with quantisation steps chosen at the beginning of each.
const PARTS: u32 = 3;

/// Factor to which learning rates fall.
const RATES_END: f64 = 0.1;

/// The steps of the phase.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RoundingPhase {
    /// Step after which the model is rounded first. Splats and maps stay as they are from then on.
    pub start: u32,
    /// Last step of the run, after which it is rounded for the file.
    pub last: u32,
}

impl RoundingPhase {
    /// Whether the model is rounded after a step.
    pub fn is_due(self, step: u32) -> bool {
        step == self.last || step.checked_sub(self.start).is_some_and(|gone| gone.is_multiple_of(INTERVAL))
    }

    /// Whether quantisation steps are chosen anew when it is.
    pub fn chooses(self, step: u32) -> bool {
        let length = self.last.saturating_sub(self.start).max(1);
        let part = |step: u32| step.saturating_sub(self.start) * PARTS / length;
        step <= self.start || part(step) > part(step.saturating_sub(INTERVAL))
    }

    /// Number of roundings after step `done`.
    pub fn roundings_after(self, done: u32) -> u32 {
        let from = (done + 1).max(self.start);
        (from..=self.last).filter(|&step| self.is_due(step)).count() as u32
    }

    /// Factor on the learning rates of a step: at full rates, numbers hop between quantisation steps.
    pub fn rates(self, step: u32) -> f32 {
        if step <= self.start {
            return 1.0;
        }
        let share = f64::from(step - self.start) / f64::from(self.last - self.start);
        RATES_END.powf(share.min(1.0)) as f32
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_phase_is_rounded_at_intervals_and_at_its_end() {
        let phase = RoundingPhase { start: 933, last: 1_000 };
        let due: Vec<u32> = (1..=1_000).filter(|&step| phase.is_due(step)).collect();
        assert_eq!(due, [933, 943, 953, 963, 973, 983, 993, 1_000]);
        let chosen: Vec<u32> = due.iter().copied().filter(|&step| phase.chooses(step)).collect();
        assert_eq!(chosen, [933, 963, 983, 1_000]);
        assert_eq!([0, 932, 933, 990, 1_000].map(|done| phase.roundings_after(done)), [8, 8, 7, 2, 0]);
        let rates = [1, 933, 934, 1_000].map(|step| phase.rates(step));
        assert_eq!([rates[0], rates[1], rates[3]], [1.0, 1.0, 0.1]);
        assert!((0.9..1.0).contains(&rates[2]), "{rates:?}");
        // Of a run that is too short for the phase, only the end is left.
        let short = RoundingPhase { start: 30, last: 30 };
        assert!((1..30).all(|step| !short.is_due(step)) && short.is_due(30) && short.rates(30) == 1.0);
    }
}
