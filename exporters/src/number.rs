//! Numbers as text: every spelling of those that are none is read, and few digits are written.

/// The number that a word spells. C and C++ programs write `-nan(ind)`, `nan(snan)` or `1.#QNAN` for what is no number, and
/// `1.#INF` for infinity: readers must see such a number to leave out what it belongs to.
pub fn parse_number(word: &str) -> Option<f64> {
    let number = word.parse().ok();
    number.or_else(|| {
        let unsigned = word.strip_prefix(['-', '+']).unwrap_or(word).to_ascii_lowercase();
        let is_nan =
            unsigned.strip_prefix("nan").is_some_and(|rest| rest.starts_with('(') && rest.ends_with(')'))
                || ["1.#ind", "1.#qnan", "1.#snan", "1.#j"].iter().any(|name| is_padded(&unsigned, name));
        match is_nan {
            true => Some(f64::NAN),
            false if !is_padded(&unsigned, "1.#inf") => None,
            false if word.starts_with('-') => Some(f64::NEG_INFINITY),
            false => Some(f64::INFINITY),
        }
    })
}

/// Old run-time libraries pad with zeros to the number of digits asked for: `1.#IND00`.
fn is_padded(word: &str, name: &str) -> bool {
    word.strip_prefix(name).is_some_and(|rest| rest.bytes().all(|b| b == b'0'))
}

/// The nearest number of at most this many significant digits, which are all that is printed of it.
pub fn rounded(number: f64, digits: usize) -> f64 {
    format!("{number:.*e}", digits.saturating_sub(1)).parse().unwrap_or(number)
}

/// The nearest number that has no more decimal places than a step needs: those of the largest power of ten, at most 1, that does
/// not exceed it. A step of 0, or none, keeps all digits.
pub fn to_decimals(number: f64, step: f64) -> f64 {
    let places = (0..=17).find(|&places| 10_f64.powi(-places) <= step);
    let text = places.map(|places| format!("{number:.*}", places as usize));
    // No negative zero.
    text.and_then(|text| text.parse::<f64>().ok()).map_or(number, |number| number + 0.0)
}

#[cfg(test)]
mod tests {
    use super::{parse_number, rounded, to_decimals};

    #[test]
    fn every_spelling_of_no_number_is_read() {
        for word in
            ["nan", "-NaN", "-nan(ind)", "nan(snan)", "NAN(0x8000)", "-1.#IND", "1.#QNAN", "1.#IND00", "1.#J"]
        {
            assert!(parse_number(word).is_some_and(f64::is_nan), "{word}");
        }
        for (word, number) in
            [("-1.#INF", f64::NEG_INFINITY), ("1.#INF00", f64::INFINITY), ("-inf", f64::NEG_INFINITY)]
        {
            assert_eq!(parse_number(word), Some(number), "{word}");
        }
        assert_eq!(parse_number("-1.5e-3"), Some(-1.5e-3), "negative control");
        for word in ["", "nancy", "nan(", "1.#", "1.#INFx", "x", "1,5", "--1"] {
            assert_eq!(parse_number(word), None, "{word}");
        }
    }

    #[test]
    fn numbers_are_rounded_to_significant_digits() {
        assert_eq!(
            [rounded(3.0 * 0.3048, 9), rounded(123_456.0, 3), rounded(0.0, 3)],
            [0.9144, 123_000.0, 0.0]
        );
        assert_eq!([rounded(-1.26e-20, 2), rounded(f64::INFINITY, 3)], [-1.3e-20, f64::INFINITY]);
        assert!(rounded(f64::NAN, 3).is_nan());
    }

    #[test]
    fn numbers_are_rounded_to_decimal_places() {
        let of = |step| to_decimals(-1234.56789, step);
        assert_eq!([of(7.0), of(1.0), of(0.99), of(0.01)], [-1235.0, -1235.0, -1234.6, -1234.57]);
        assert_eq!([of(0.0), of(1e-30), of(f64::NAN)], [-1234.56789; 3]);
        assert!(to_decimals(-1e-9, 0.1).is_sign_positive() && to_decimals(f64::NAN, 0.1).is_nan());
    }
}
