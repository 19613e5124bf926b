//! Depths and normals as images.

/// The range of depths that a depth image spreads its colours over: the 1 % and 99 % quantiles of the
/// positive, finite ones; `None` if there are none.
pub fn depth_range(depth: &[f32]) -> Option<(f32, f32)> {
    let mut drawn: Vec<f32> = depth.iter().copied().filter(|d| *d > 0.0 && d.is_finite()).collect();
    drawn.sort_unstable_by(f32::total_cmp);
    let last = drawn.len().checked_sub(1)?;
    let quantile = |q: f64| drawn[(q * last as f64).round() as usize];
    Some((quantile(0.01), quantile(0.99)))
}

/// Position of a depth between near (1) and far (0), linear in inverse depth, as parallax and hence visible
/// error are; `None` where nothing is drawn.
fn nearness(depth: f32, (near, far): (f32, f32)) -> Option<f64> {
    if !(depth > 0.0 && depth.is_finite()) {
        return None;
    }
    let inverse = |d: f32| 1.0 / f64::from(d);
    let span = inverse(near) - inverse(far);
    // A flat scene gets the middle of the ramp.
    Some(if span > 0.0 { ((inverse(depth) - inverse(far)) / span).clamp(0.0, 1.0) } else { 0.5 })
}

/// Depths as grey: near is white, far is dark; zero, negative and non-finite depths are black. `[n]`
pub fn grey_from_depth(depth: &[f32], range: (f32, f32)) -> Vec<u8> {
    depth.iter().map(|&d| nearness(d, range).map_or(0, |v| (25.0 + 230.0 * v).round() as u8)).collect()
}

/// Normals in camera axes (x right, y down, z forward) as the usual normal map: red grows to the
/// right, green upwards, blue towards the viewer; a zero or poisoned normal is black. `[n, 3]` both
pub fn rgb_from_normal(normal: &[f32]) -> Vec<u8> {
    normal
        .chunks_exact(3)
        .flat_map(|n| {
            let length = (n[0] * n[0] + n[1] * n[1] + n[2] * n[2]).sqrt();
            if length > 0.0 && length.is_finite() {
                [n[0], -n[1], -n[2]].map(|v| ((0.5 + 0.5 * v / length) * 255.0).round() as u8)
            } else {
                [0; 3]
            }
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn near_depths_are_bright_and_empty_pixels_black() {
        let depth = [0.0, 1.0, 2.0, 4.0, f32::NAN, -1.0, f32::INFINITY];
        let range = depth_range(&depth).unwrap();
        assert_eq!(range, (1.0, 4.0));
        let grey = grey_from_depth(&depth, range);
        assert_eq!(grey, [0, 255, 102, 25, 0, 0, 0]); // 1/2 lies at a third of 1/4..1
    }

    #[test]
    fn non_finite_depths_give_no_range_or_a_flat_one() {
        assert_eq!(depth_range(&[0.0, f32::NAN]), None);
        let flat = depth_range(&[3.0; 4]).unwrap();
        assert_eq!(grey_from_depth(&[3.0], flat), [140]);
    }

    #[test]
    fn depth_range_ignores_outliers() {
        let mut depth = vec![2.0; 1000];
        depth[0] = 1e-6;
        depth[1] = 1e6;
        assert_eq!(depth_range(&depth), Some((2.0, 2.0)));
    }

    #[test]
    fn a_normal_facing_the_camera_is_blue() {
        assert_eq!(rgb_from_normal(&[0.0, 0.0, -2.0]), [128, 128, 255]);
        assert_eq!(rgb_from_normal(&[0.0, -1.0, 0.0]), [128, 255, 128]); // upwards: green
        assert_eq!(rgb_from_normal(&[0.0, 0.0, 0.0, f32::NAN, 1.0, 0.0]), [0; 6]);
    }
}
