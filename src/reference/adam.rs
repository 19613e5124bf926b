//! Dense Adam, and the closed form for steps in which a parameter received no gradient.

use crate::constants::{ADAM_BETA1 as BETA1, ADAM_BETA2 as BETA2, ADAM_EPSILON as EPSILON};
use crate::model::LearningRates;

/// One step on one parameter, where `state` is (parameter, m, v) and `step` counts from 1. Returns the new state.
pub fn adam_dense(state: (f64, f64, f64), gradient: f64, rate: f64, step: u32) -> (f64, f64, f64) {
    let (p, m, v) = state;
    let m = BETA1 * m + (1.0 - BETA1) * gradient;
    let v = BETA2 * v + (1.0 - BETA2) * gradient * gradient;
    let m_hat = m / (1.0 - BETA1.powf(f64::from(step)));
    let v_hat = v / (1.0 - BETA2.powf(f64::from(step)));
    (p - rate * m_hat / (v_hat.sqrt() + EPSILON), m, v)
}

/// `skipped` steps without gradient after `step`, in closed form: each update is that of `step` times a power of
/// beta1 / sqrt(beta2), with the bias corrections of `step`.
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

/// Learning rate of the texels of a map: larger maps learn faster, up to a limit.
pub fn map_rate(rates: &LearningRates, num_texels: usize) -> f64 {
    let growth = (num_texels as f64 / 4.0).powf(f64::from(rates.texel_growth));
    f64::from(rates.texel) * growth.min(f64::from(rates.texel_growth_limit)).max(1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn larger_maps_learn_faster_up_to_a_limit() {
        let rates = |texel_growth, texel_growth_limit| LearningRates {
            texel: 2e-3,
            texel_growth,
            texel_growth_limit,
            ..LearningRates::default()
        };
        for (num_texels, factor) in
            [(0, 1.0), (1, 1.0), (4, 1.0), (16, 2.0), (36, 3.0), (64, 4.0), (900, 4.0)]
        {
            let rates = rates(0.5, 4.0);
            let rate = map_rate(&rates, num_texels);
            assert!((rate / (f64::from(rates.texel) * factor) - 1.0).abs() < 1e-12, "{num_texels}: {rate}");
        }
        // The backends use `LearningRates::of_map`.
        for rates in [rates(0.5, 4.0), rates(0.37, 3.0), rates(0.0, 4.0), rates(0.5, 0.0)] {
            for num_texels in [0, 1, 4, 12, 45, 1000] {
                let ratio = f64::from(rates.of_map(num_texels)) / map_rate(&rates, num_texels);
                assert!((ratio - 1.0).abs() < 3e-7, "{rates:?}, {num_texels} texels: {ratio}");
            }
        }
    }
}
