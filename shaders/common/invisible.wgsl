// The last step of Adam on a splat that was invisible in it, with a zero gradient; SH are updated lazily (twin:
// reference/adam.rs). Requires `splat_p`, `splat_m` and `splat_v` bound.

fn last_rate(f: u32) -> f32 {
    if f < QUATERNION {
        return step.last_rate_position;
    }
    if f < LOG_SCALE {
        return step.last_rate_quaternion;
    }
    return select(step.last_rate_opacity, step.last_rate_log_scale, f < OPACITY);
}

fn step_invisible(first: u32) {
    for (var f = 0u; f < SH; f += 1u) {
        let at = first + f;
        let state = Moments(splat_p[at], splat_m[at], splat_v[at]);
        var now = adam_step_of(state, 0.0, last_rate(f), step.last_m_correction, step.last_v_correction_sqrt);
        if f >= LOG_SCALE && f < OPACITY {
            now.p = clamp(now.p, LOG_SCALE_MIN, LOG_SCALE_MAX);
        }
        splat_p[at] = now.p;
        splat_m[at] = now.m;
        splat_v[at] = now.v;
    }
}
