// Arithmetic that stays accurate whatever liberties a driver takes.

// Tests the bits: WGSL allows implementations to assume that NaN and infinity do not occur.
fn is_finite(x: f32) -> bool {
    return (bitcast<u32>(x) & 0x7f800000u) != 0x7f800000u;
}

// 1 - e^-x for x >= 0, without cancellation for small x.
fn one_minus_exp(x: f32) -> f32 {
    if x > 0.2 {
        return 1.0 - exp(-x);
    }
    return x * (1.0 - x / 2.0 * (1.0 - x / 3.0 * (1.0 - x / 4.0 * (1.0 - x / 5.0 * (1.0 - x / 6.0)))));
}

fn sigmoid(x: f32) -> f32 {
    return 1.0 / (1.0 + exp(-x));
}

// tanh(t / 2), the activation of texels. Exactly odd, so that a neutral texel adds exactly 0.
fn texel_value(t: f32) -> f32 {
    let e = one_minus_exp(min(abs(t), 60.0));
    return sign(t) * e / (2.0 - e);
}

// Derivative of texel_value with respect to its value v.
fn texel_value_slope(v: f32) -> f32 {
    return 0.5 * (1.0 - v * v);
}
