//! Adam, dense, and the closed form for steps in which a parameter received no gradient.

use crate::constants::{ADAM_BETA1 as BETA1, ADAM_BETA2 as BETA2, ADAM_EPSILON as EPSILON};

/// One step on one parameter; `step` counts from 1. `state` is (parameter, m, v).
pub fn adam_dense(state: (f64, f64, f64), gradient: f64, rate: f64, step: u32) -> (f64, f64, f64) {
    let (p, m, v) = state;
    let m = BETA1 * m + (1.0 - BETA1) * gradient;
    let v = BETA2 * v + (1.0 - BETA2) * gradient * gradient;
    let m_hat = m / (1.0 - BETA1.powf(f64::from(step)));
    let v_hat = v / (1.0 - BETA2.powf(f64::from(step)));
    (p - rate * m_hat / (v_hat.sqrt() + EPSILON), m, v)
}

/// `skipped` steps without gradient after `step`, in closed form: the update of each is the last one
/// times a power of beta1 / sqrt(beta2), bias corrections taken as of `step`.
pub fn adam_skipped(state: (f64, f64, f64), rate: f64, step: u32, skipped: u32) -> (f64, f64, f64) {
    let (p, m, v) = state;
    if skipped == 0 || step == 0 {
        return state;
    }
    let m_hat = m / (1.0 - BETA1.powf(f64::from(step)));
    let v_hat = v / (1.0 - BETA2.powf(f64::from(step)));
    let ratio = BETA1 / BETA2.sqrt();
    let k = f64::from(skipped);
    let sum = ratio * (1.0 - ratio.powf(k)) / (1.0 - ratio);
    (p - rate * m_hat / (v_hat.sqrt() + EPSILON) * sum, m * BETA1.powf(k), v * BETA2.powf(k))
}
