//! Adam in f32 (twin: `reference/adam.rs`), with lazy updates in place of dense ones: a parameter without gradient
//! for k steps is flushed in closed form before it is used again.

use crate::constants::{ADAM_BETA1, ADAM_BETA2, ADAM_EPSILON};

/// Bias corrections of a step.
#[derive(Clone, Copy, Debug)]
pub(super) struct AdamStep {
    /// 1 / (1 - beta1^t)
    m_correction: f32,
    /// 1 / sqrt(1 - beta2^t)
    v_correction_sqrt: f32,
}

impl AdamStep {
    /// Bias corrections of step `t`, which counts from 1.
    pub(super) fn new(t: u32) -> Self {
        let t = f64::from(t);
        Self {
            m_correction: (1.0 / (1.0 - ADAM_BETA1.powf(t))) as f32,
            v_correction_sqrt: (1.0 / (1.0 - ADAM_BETA2.powf(t)).sqrt()) as f32,
        }
    }

    /// One step on parameters with the same learning rate.
    #[inline(always)]
    pub(super) fn update(&self, p: &mut [f32], m: &mut [f32], v: &mut [f32], gradient: &[f32], rate: f32) {
        let (b1, b2) = (ADAM_BETA1 as f32, ADAM_BETA2 as f32);
        let scaled_rate = rate * self.m_correction;
        for (((p, m), v), g) in p.iter_mut().zip(m).zip(v).zip(gradient) {
            *m = b1 * *m + (1.0 - b1) * g;
            *v = b2 * *v + (1.0 - b2) * g * g;
            *p -= scaled_rate * *m / (v.sqrt() * self.v_correction_sqrt + ADAM_EPSILON as f32);
        }
    }
}

/// Closed form of the steps without gradient that a lazily updated parameter has skipped.
#[derive(Clone, Copy, Debug)]
pub(super) struct AdamSkip {
    from: AdamStep,
    /// Sum of the powers of beta1 / sqrt(beta2).
    sum: f32,
    m_decay: f32,
    v_decay: f32,
}

impl AdamSkip {
    /// The steps after `last`, up to and including `now`; `None` if there are none, or the parameter has never moved.
    pub(super) fn new(last: u32, now: u32) -> Option<Self> {
        if last == 0 || now <= last {
            return None;
        }
        let k = f64::from(now - last);
        let ratio = ADAM_BETA1 / ADAM_BETA2.sqrt();
        Some(Self {
            from: AdamStep::new(last),
            sum: (ratio * (1.0 - ratio.powf(k)) / (1.0 - ratio)) as f32,
            m_decay: ADAM_BETA1.powf(k) as f32,
            v_decay: ADAM_BETA2.powf(k) as f32,
        })
    }

    /// Flushes parameters with the same learning rate.
    #[inline(always)]
    pub(super) fn update(&self, p: &mut [f32], m: &mut [f32], v: &mut [f32], rate: f32) {
        let scaled_rate = rate * self.from.m_correction * self.sum;
        for ((p, m), v) in p.iter_mut().zip(m).zip(v) {
            *p -= scaled_rate * *m / (v.sqrt() * self.from.v_correction_sqrt + ADAM_EPSILON as f32);
            *m *= self.m_decay;
            *v *= self.v_decay;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::reference::{adam_dense, adam_skipped};

    /// Gradient of a parameter that is visible in every tenth step.
    fn gradient(step: u32) -> f64 {
        if step % 10 == 1 { 1e-4 * (1.0 + (f64::from(step) * 0.1).sin()) } else { 0.0 }
    }

    #[test]
    fn lazy_updates_match_dense_ones() {
        let rate = 1e-2;
        let mut dense = (0.0, 0.0, 0.0);
        let mut closed = (0.0, 0.0, 0.0);
        let (mut p, mut m, mut v) = ([0.0_f32], [0.0_f32], [0.0_f32]);
        let mut sparse = (0.0, 0.0, 0.0);
        let mut last = 0;
        for step in 1..=500 {
            dense = adam_dense(dense, gradient(step), rate, step);
            if gradient(step) == 0.0 {
                continue;
            }
            closed =
                adam_dense(adam_skipped(closed, rate, last, step - 1 - last), gradient(step), rate, step);
            if let Some(skip) = AdamSkip::new(last, step - 1) {
                skip.update(&mut p, &mut m, &mut v, rate as f32);
            }
            AdamStep::new(step).update(&mut p, &mut m, &mut v, &[gradient(step) as f32], rate as f32);
            sparse = adam_dense(sparse, gradient(step), rate, step);
            last = step;
        }
        closed = adam_skipped(closed, rate, last, 500 - last);
        if let Some(skip) = AdamSkip::new(last, 500) {
            skip.update(&mut p, &mut m, &mut v, rate as f32);
        }
        assert!((f64::from(p[0]) / closed.0 - 1.0).abs() < 2e-5, "{} {}", p[0], closed.0);
        // The bias corrections are constant over a gap: needed 6e-3, in the first steps.
        assert!((closed.0 / dense.0 - 1.0).abs() < 1e-2, "{} {}", closed.0, dense.0);
        assert!(
            (sparse.0 / dense.0 - 1.0).abs() > 0.2,
            "plain sparse Adam is far off: {} {}",
            sparse.0,
            dense.0
        );
    }
}
