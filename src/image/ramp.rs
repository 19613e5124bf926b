//! The colour ramp of errors as polynomials: magma is perceptually uniform, and small errors are dark.

/// Colour of `value` in [0, 1] (clamped; NaN: as 0) on the magma ramp. 8 bits per channel.
///
/// Degree-6 fit (public domain, Matt Zucker) of the table by Smith and van der Walt.
pub fn magma(value: f64) -> [u8; 3] {
    const COEFFICIENTS: [[f64; 7]; 3] = [
        [
            -0.002_136_485_05,
            0.251_660_540_74,
            8.353_717_279_22,
            -27.668_733_085_77,
            52.176_139_812_34,
            -50.768_525_364_74,
            18.655_705_065_92,
        ],
        [
            -0.000_749_655_05,
            0.677_523_243_68,
            -3.577_719_514_96,
            14.264_730_780_97,
            -27.943_606_071_68,
            29.046_582_821_27,
            -11.489_773_519_98,
        ],
        [
            -0.005_386_127_86,
            2.494_026_599_31,
            0.314_467_903_01,
            -13.649_213_188_14,
            12.944_169_442_38,
            4.234_152_993_85,
            -5.601_961_508_73,
        ],
    ];
    COEFFICIENTS.map(|c| polynomial(&c, value))
}

fn polynomial(coefficients: &[f64], value: f64) -> u8 {
    // NaN fails every comparison: it is drawn as 0.
    let x = if value > 0.0 { value.min(1.0) } else { 0.0 };
    let y = coefficients.iter().rev().fold(0.0, |sum, c| sum * x + c);
    (y.clamp(0.0, 1.0) * 255.0).round() as u8
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Every 15th entry of the 256 of magma (Smith and van der Walt, public domain).
    const MAGMA: [[u8; 3]; 18] = [
        [0, 0, 4],
        [9, 7, 32],
        [26, 16, 66],
        [49, 17, 101],
        [74, 16, 121],
        [98, 25, 128],
        [121, 34, 130],
        [145, 43, 129],
        [170, 51, 125],
        [194, 59, 117],
        [217, 70, 107],
        [236, 88, 96],
        [247, 114, 92],
        [252, 142, 100],
        [254, 170, 116],
        [254, 198, 138],
        [253, 226, 163],
        [252, 253, 191],
    ];

    fn largest_difference(table: &[[u8; 3]], ramp: impl Fn(f64) -> [u8; 3]) -> u8 {
        table
            .iter()
            .enumerate()
            .flat_map(|(i, rgb)| {
                let ours = ramp(15.0 * i as f64 / 255.0);
                (0..3).map(move |c| rgb[c].abs_diff(ours[c]))
            })
            .max()
            .unwrap()
    }

    #[test]
    fn magma_follows_the_published_table() {
        // Needed 5 of 255.
        assert!(largest_difference(&MAGMA, magma) <= 6);
        // Negative control: another ramp.
        assert!(largest_difference(&MAGMA, |v| [(255.0 * v) as u8; 3]) > 60);
    }

    #[test]
    fn non_finite_values_have_colours() {
        assert_eq!(magma(f64::NAN), magma(0.0));
        assert_eq!(magma(f64::INFINITY), magma(1.0));
        assert_eq!(magma(-3.0), magma(0.0));
    }
}
