// Adam with lazy updates in place of dense ones (twin: reference/adam.rs).

struct Moments {
    p: f32,
    m: f32,
    v: f32,
}

// One step on one parameter, with the bias corrections of `step`.
fn adam_step(state: Moments, gradient: f32, rate: f32) -> Moments {
    return adam_step_of(state, gradient, rate, step.m_correction, step.v_correction_sqrt);
}

// One step with the bias corrections of any step.
fn adam_step_of(state: Moments, gradient: f32, rate: f32, m_correction: f32, v_correction_sqrt: f32) -> Moments {
    let m = ADAM_BETA1 * state.m + (1.0 - ADAM_BETA1) * gradient;
    let v = ADAM_BETA2 * state.v + (1.0 - ADAM_BETA2) * gradient * gradient;
    let change = rate * m_correction * m / (sqrt(v) * v_correction_sqrt + ADAM_EPSILON);
    return Moments(state.p - change, m, v);
}

// Closed form of the steps without gradient that a lazily updated parameter has skipped.
struct Skip {
    any: bool,
    rate_factor: f32,
    v_correction_sqrt: f32,
    m_decay: f32,
    v_decay: f32,
}

// The steps after `last`, up to and including `now`.
fn adam_skip(last: u32, now: u32) -> Skip {
    if last == 0u || now <= last {
        return Skip(false, 0.0, 1.0, 1.0, 1.0);
    }
    let k = f32(now - last);
    let t = f32(last);
    let ln_ratio = ADAM_LN_BETA1 - 0.5 * ADAM_LN_BETA2;
    // Sum of the powers 1..k of the ratio.
    let sum = exp(ln_ratio) * one_minus_exp(-k * ln_ratio) / one_minus_exp(-ln_ratio);
    return Skip(
        true,
        sum / one_minus_exp(-t * ADAM_LN_BETA1),
        1.0 / sqrt(one_minus_exp(-t * ADAM_LN_BETA2)),
        exp(k * ADAM_LN_BETA1),
        exp(k * ADAM_LN_BETA2),
    );
}

fn adam_skipped(state: Moments, skip: Skip, rate: f32) -> Moments {
    let change = rate * skip.rate_factor * state.m / (sqrt(state.v) * skip.v_correction_sqrt + ADAM_EPSILON);
    return Moments(state.p - change, state.m * skip.m_decay, state.v * skip.v_decay);
}

// Learning rate of the texels of a map: larger maps learn faster, up to a limit (twin: map_rate in
// reference/adam.rs).
fn map_rate(rate: f32, growth: f32, limit: f32, num_texels: u32) -> f32 {
    if growth == 0.0 {
        return rate;
    }
    return rate * clamp(pow(max(f32(num_texels) / 4.0, 1.0), growth), 1.0, max(limit, 1.0));
}
