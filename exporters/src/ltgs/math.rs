//! Powers and logarithms of two from only +, -, * and / of f64 in a fixed order, so that every machine gets the same bits.
//! Functions of libraries may differ in the last bit, on which decisions of the decoder depend.

/// The natural logarithm of 2.
const LN_2: f64 = std::f64::consts::LN_2;

/// `2^exponent`, clamped to normal f64.
pub fn two_to(exponent: i32) -> f64 {
    f64::from_bits(((exponent.clamp(-1022, 1023) + 1023) as u64) << 52)
}

/// `2^x` for |x| <= 1000: the series of `e^(f ln 2)` to the 15th power, f being the distance to the nearest integer.
pub fn exp2(x: f64) -> f64 {
    let x = x.clamp(-1000.0, 1000.0);
    let whole = (x + 0.5).floor();
    let y = (x - whole) * LN_2;
    let mut sum = 1.0;
    for n in (1..=15).rev() {
        sum = 1.0 + sum * y / f64::from(n);
    }
    sum * two_to(whole as i32)
}

/// `floor(log2 x)` of a positive normal number.
pub fn floor_log2(x: f64) -> i32 {
    ((x.to_bits() >> 52) & 0x7ff) as i32 - 1023
}

/// `log2 x` of a positive normal number in units of 1/256, rounded down; squaring yields the bits of the fraction.
pub fn log2_in_256ths(x: f64) -> i32 {
    let whole = floor_log2(x);
    let mut y = x * two_to(-whole);
    let mut fraction = 0;
    for _ in 0..8 {
        y *= y;
        fraction *= 2;
        if y >= 2.0 {
            y *= 0.5;
            fraction += 1;
        }
    }
    256 * whole + fraction
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn powers_and_logarithms_agree_with_the_standard_library() {
        let mut worst = 0.0_f64;
        for i in -2000..2000 {
            let x = f64::from(i) * 0.0137;
            worst = worst.max((exp2(x) / x.exp2() - 1.0).abs());
            let y = x.exp2();
            assert_eq!(f64::from(floor_log2(y)), y.log2().floor(), "{x}");
            let error = y.log2() * 256.0 - f64::from(log2_in_256ths(y));
            assert!((-1e-9..1.0 + 1e-9).contains(&error), "{x}: {error}");
        }
        assert!(worst < 1e-15, "{worst:e}"); // needed 5e-16
        assert_eq!([two_to(0), two_to(-3), exp2(4.0), exp2(-1.0)], [1.0, 0.125, 16.0, 0.5]);
    }
}
