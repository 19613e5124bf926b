//! The time that the rest of a run will take. Images grow during a run and steps slow down with them, so extrapolating
//! the mean speed so far would be far too optimistic.

/// The weight of a measured time falls by a factor of e over this share of the run's work.
const MEMORY_SHARE: f64 = 0.02;

/// Work of a step that does not depend on its pixels, as a share of the work on an image of full size. Measured on
/// fox at 960: a step at render scale 4 takes 0.034 s, one at full size 0.4 s.
const FIXED_WORK: f64 = 0.025;

/// The work of each step of a run, and the recent time per unit of work.
pub(super) struct Eta {
    /// Work of the first `i` steps at index `i`. `[steps + 1]`
    work: Vec<f64>,
    secs: f64,
    measured: f64,
}

impl Eta {
    /// For a run whose step `i + 1` has the `i`-th of these render scales.
    pub fn new(scales: impl Iterator<Item = f64>) -> Self {
        let mut work = vec![0.0];
        for scale in scales {
            work.push(work[work.len() - 1] + FIXED_WORK + 1.0 / (scale * scale));
        }
        Self { work, secs: 0.0, measured: 0.0 }
    }

    /// Takes in that steps `from + 1` to `to` took `secs`, and returns the seconds that all later steps will take.
    pub fn observe(&mut self, from: u32, to: u32, secs: f64) -> f64 {
        let at = |step: u32| self.work[(step as usize).min(self.work.len() - 1)];
        let (done, all) = (at(to) - at(from), self.work[self.work.len() - 1]);
        let kept = (-done / (MEMORY_SHARE * all)).exp();
        let left = all - at(to);
        self.secs = kept * self.secs + secs;
        self.measured = kept * self.measured + done;
        if self.measured > 0.0 { left * self.secs / self.measured } else { 0.0 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_eta_accounts_for_growing_images_and_adapts_to_slowdowns() {
        let scales = || (0..1_000).map(|i| if i < 500 { 4.0 } else { 1.0 });
        let secs_of = |scale: f64| 0.1 * (FIXED_WORK + 1.0 / (scale * scale));
        let mut eta = Eta::new(scales());
        let all: f64 = scales().map(secs_of).sum();
        let mut gone = 0.0;
        for (i, scale) in (0..1_000_u32).zip(scales()) {
            gone += secs_of(scale);
            let left = eta.observe(i, i + 1, secs_of(scale));
            // Needed 1.5e-14: sums of a thousand numbers.
            assert!((left - (all - gone)).abs() < 1e-12 * all, "step {i}: {left}");
        }
        assert!(eta.observe(1_000, 1_000, 1.0) == 0.0, "nothing is left");
        // Resumed, and half as fast from then on.
        let mut resumed = Eta::new(scales());
        resumed.observe(600, 650, 50.0 * secs_of(1.0));
        let left = resumed.observe(650, 750, 200.0 * secs_of(1.0));
        assert!((left / (500.0 * secs_of(1.0)) - 1.0).abs() < 0.01, "{left}"); // needed 3e-5
    }
}
