//! From spectra to stages: at which scale a run starts and when each next part of the significance
//! comes into the image (method section 8.2).

use super::options::FrequencyOptions;
use super::spectrum::Windows;

/// Numbers are rounded to a billionth: far below anything that a schedule can notice, and short decimal
/// numbers survive text files bit for bit, so that a resumed run follows the very same schedule.
const STEPS: f64 = 1e9;

/// If less than this part of the significance comes after the first stage, there is nothing to wait
/// for. (Rounding of the transform leaves about 1e-13 in a constant image.)
const LEAST_GAIN: f64 = 1e-6;

/// The scale of the first stage: the window that holds 1 / beta of the significance, as the given
/// quantile over single views has it.
pub(super) fn start_scale(views: &[Windows], options: &FrequencyOptions) -> f64 {
    let scales = views.iter().map(|view| view.solve(view.total() / options.beta, options.max_scale));
    quantile(scales.collect(), options.quantile).unwrap_or(1.0)
}

/// A quantile of numbers, linear between neighbours; `None` of nothing.
pub(super) fn quantile(mut values: Vec<f64>, share: f64) -> Option<f64> {
    values.sort_by(f64::total_cmp);
    let at = share * values.len().checked_sub(1)? as f64;
    let (low, high) = (values[at as usize], values[at.ceil() as usize]);
    Some(low + (high - low) * at.fract())
}

/// To the nearest of [`STEPS`] per unit.
pub(super) fn rounded(value: f64) -> f64 {
    // Divided, not multiplied by 1e-9: this gives the number nearest to the decimal.
    (value * STEPS).round() / STEPS
}

/// Nodes (time as a fraction of T_r, scale): each stage opens the window by the same amount of
/// significance of the mean image, and lasts as the logarithm of the significance seen grows.
/// One node (0, 1) if there is nothing to schedule.
pub(super) fn nodes(mean: &Windows, s_max: f64, levels: usize) -> Vec<(f64, f64)> {
    let (least, total) = (mean.within(s_max), mean.total());
    let flat = vec![(0.0, 1.0)];
    // Negated, so that NaN counts as nothing.
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
