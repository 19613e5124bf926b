//! From spectra to stages: the scale at which a run starts, and the times at which images get finer (method 7.2).

use super::options::FrequencyOptions;
use super::spectrum::Windows;

/// Numbers are rounded to multiples of its inverse, a billionth: far below what matters to a schedule, and short
/// decimal numbers survive text files bit for bit, so that a resumed run follows exactly the same schedule.
const STEPS: f64 = 1e9;

/// If the later stages add less than this part of the significance, there is only one stage. (Rounding of the
/// transform leaves about 1e-13 in a constant image.)
const LEAST_GAIN: f64 = 1e-6;

/// The scale of the first stage: a quantile over views of the scale whose window holds 1 / beta of a view's
/// significance.
pub(super) fn start_scale(views: &[Windows], options: &FrequencyOptions, share: f64) -> f64 {
    let scales = views.iter().map(|view| view.solve(view.total() / options.beta, options.max_scale));
    quantile(scales.collect(), share).unwrap_or(1.0)
}

/// A quantile of numbers, linearly interpolated; `None` without numbers.
pub(super) fn quantile(mut values: Vec<f64>, share: f64) -> Option<f64> {
    values.sort_by(f64::total_cmp);
    let at = share * values.len().checked_sub(1)? as f64;
    let (low, high) = (values[at as usize], values[at.ceil() as usize]);
    Some(low + (high - low) * at.fract())
}

/// Rounds to the nearest multiple of 1 / [`STEPS`].
pub(super) fn rounded(value: f64) -> f64 {
    // Dividing, unlike multiplying by 1e-9, gives the f64 nearest to the decimal.
    (value * STEPS).round() / STEPS
}

/// Nodes as (time as a fraction of T_r, scale): each stage widens the window by the same amount of significance of
/// the mean image, at times that follow the logarithm of the significance shown. A single node (0, 1) if coarser
/// images would show all of it.
pub(super) fn nodes(mean: &Windows, s_max: f64, levels: usize) -> Vec<(f64, f64)> {
    let (least, total) = (mean.within(s_max), mean.total());
    let flat = vec![(0.0, 1.0)];
    // Negated, so that NaN gives a single stage.
    if !(least > 0.0 && total - least > LEAST_GAIN * total) || s_max <= 1.0 {
        return flat;
    }
    let last = levels - 1;
    let mut nodes: Vec<(f64, f64)> = Vec::with_capacity(levels);
    for i in 0..levels {
        let energy = least + (total - least) * i as f64 / last as f64;
        let node = match i {
            0 => (0.0, s_max),
            _ if i == last => (1.0, 1.0),
            _ => ((energy / least).ln() / (total / least).ln(), mean.solve(energy, s_max)),
        };
        nodes.push((rounded(node.0), rounded(node.1)));
    }
    nodes
}
