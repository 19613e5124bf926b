//! Distributes the available time over the parts of a measurement: each part once, then all in turn, until each has its
//! requested repetitions or the time is up.

use std::time::{Duration, Instant};

/// Repetitions of the parts of a measurement.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Repetitions {
    /// Steps timed by the wall clock.
    pub steps: u32,
    /// Steps timed by the device's clock.
    pub timed: u32,
    /// Steps whose pairs and atomics are counted.
    pub counted: u32,
    /// Steps that are run twice and compared.
    pub repeated: u32,
    /// Steps of each variant of the rasterisation.
    pub variants: u32,
}

/// Cost of the first and of every further repetition of each part, in steps. Ordered by importance.
const COSTS: [(f64, f64); 5] = [
    (1.0, 1.0),
    (1.0, 1.0),
    // The state is read back after each.
    (2.0, 1.5),
    (2.0, 2.0),
    // A warm-up and a measurement of both variants, and a step of the other variant to count its pairs; the variant
    // that is not meant for the device may be slower.
    (13.0, 8.0),
];

impl Repetitions {
    /// As many repetitions as fit into the time of `steps` steps, up to `wanted`.
    pub(super) fn planned(wanted: Self, steps: f64) -> Self {
        let wanted = [wanted.steps, wanted.timed, wanted.counted, wanted.repeated, wanted.variants];
        let (mut planned, mut left) = ([0; 5], steps);
        loop {
            let mut added = false;
            for part in 0..planned.len() {
                let (first, next) = COSTS[part];
                let cost = if planned[part] == 0 { first } else { next };
                if planned[part] < wanted[part] && cost <= left {
                    planned[part] += 1;
                    left -= cost;
                    added = true;
                }
            }
            if !added {
                let [steps, timed, counted, repeated, variants] = planned;
                return Self { steps, timed, counted, repeated, variants };
            }
        }
    }
}

/// End of the available time, if it is limited.
#[derive(Clone, Copy, Debug)]
pub struct Deadline(Option<Instant>);

impl Deadline {
    /// A deadline at `end`; `None` for unlimited time.
    pub fn new(end: Option<Instant>) -> Self {
        Self(end)
    }

    /// Time left; `None` if it is unlimited.
    pub fn left(self) -> Option<Duration> {
        self.0.map(|end| end.saturating_duration_since(Instant::now()))
    }

    /// Whether work of `secs` seconds ends before the deadline.
    pub fn allows(self, secs: f64) -> bool {
        self.left().is_none_or(|left| left.as_secs_f64() >= secs)
    }

    /// How often work of `secs` seconds fits before the deadline.
    pub(super) fn fitting(self, secs: f64) -> f64 {
        self.left().map_or(f64::INFINITY, |left| left.as_secs_f64() / secs.max(1e-9))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const WANTED: Repetitions = Repetitions { steps: 16, timed: 16, counted: 4, repeated: 8, variants: 4 };

    #[test]
    fn unlimited_time_fits_all_parts_and_short_time_the_first() {
        assert_eq!(Repetitions::planned(WANTED, f64::INFINITY), WANTED);
        assert_eq!(Repetitions::planned(WANTED, 0.9), Repetitions::default());
        let one = Repetitions { steps: 1, ..Repetitions::default() };
        assert_eq!(Repetitions::planned(WANTED, 1.0), one);
        assert_eq!(Repetitions::planned(WANTED, 2.9), Repetitions { timed: 1, ..one });
        let each = Repetitions { steps: 1, timed: 1, counted: 1, repeated: 1, variants: 1 };
        assert_eq!(Repetitions::planned(WANTED, 19.0), each);
    }

    #[test]
    fn the_plan_fits_into_the_available_time() {
        for steps in 0..200 {
            let p = Repetitions::planned(WANTED, f64::from(steps));
            let cost: f64 = [p.steps, p.timed, p.counted, p.repeated, p.variants]
                .into_iter()
                .zip(COSTS)
                .filter(|(n, _)| *n > 0)
                .map(|(n, (first, next))| first + f64::from(n - 1) * next)
                .sum();
            assert!(cost <= f64::from(steps), "{steps}: {p:?}");
        }
    }
}
