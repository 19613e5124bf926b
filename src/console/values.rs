//! Values on the command line: durations, sizes in bytes, counts, colours, sizes in pixels. Text in, numbers out; nothing
//! here opens a file. clap names the option and the text in front of the message.

use std::num::IntErrorKind;
use std::ops::RangeInclusive;

/// Reads a time as seconds: "90", "90s", "20m", "1.5h", "1h30m".
pub fn parse_duration_secs(text: &str) -> Result<f64, String> {
    let wrong = || "expected a time like 90s, 20m or 1h30m".to_owned();
    let mut secs = 0.0;
    let mut rest = text.trim();
    if let Ok(plain) = rest.parse::<f64>() {
        return positive(plain).ok_or_else(wrong);
    }
    while !rest.is_empty() {
        let digits = rest.find(|c: char| !(c.is_ascii_digit() || c == '.'));
        let (number, unit) = rest.split_at(digits.ok_or_else(wrong)?);
        let number: f64 = number.parse().map_err(|_| wrong())?;
        let factor = match unit.chars().next() {
            Some('h') => 3600.0,
            Some('m') => 60.0,
            Some('s') => 1.0,
            _ => return Err(wrong()),
        };
        secs += number * factor;
        rest = &unit[1..];
    }
    positive(secs).ok_or_else(wrong)
}

fn positive(x: f64) -> Option<f64> {
    (x.is_finite() && x > 0.0).then_some(x)
}

/// Reads a size as bytes: "4GiB", "512MiB", "2GB", "1000000".
pub fn parse_bytes(text: &str) -> Result<u64, String> {
    const UNITS: [(&str, f64); 9] = [
        ("KiB", 1024.0),
        ("MiB", 1_048_576.0),
        ("GiB", 1_073_741_824.0),
        ("kB", 1e3),
        ("KB", 1e3),
        ("MB", 1e6),
        ("GB", 1e9),
        ("TB", 1e12),
        ("B", 1.0),
    ];
    let text = text.trim();
    let (number, factor) = UNITS
        .iter()
        .find_map(|(unit, factor)| text.strip_suffix(unit).map(|number| (number, *factor)))
        .unwrap_or((text, 1.0));
    match number.trim().parse::<f64>() {
        Ok(n) if n >= 0.0 && n * factor < 1e18 => Ok((n * factor) as u64),
        _ => Err("expected a size like 4GiB, 512MiB or 2GB".to_owned()),
    }
}

/// Reads a count: "5000", "500k", "1.5M".
pub fn parse_count(text: &str) -> Result<usize, String> {
    let expected = || "expected a number of at least 1, such as 5000, 500k or 1.5M".to_owned();
    let (digits, unit) = match text.char_indices().next_back() {
        Some((at, 'k' | 'K')) => (&text[..at], 1e3),
        Some((at, 'm' | 'M')) => (&text[..at], 1e6),
        _ => (text, 1.0),
    };
    let number: f64 = digits.trim().parse().map_err(|_| expected())?;
    let count = number * unit;
    if (1.0..=1e12).contains(&count) { Ok(count as usize) } else { Err(expected()) }
}

/// A parser of whole numbers in a range; one that ends at the largest of all has no upper bound.
pub fn whole<T>(
    range: RangeInclusive<u64>,
) -> impl Fn(&str) -> Result<T, String> + Clone + Send + Sync + 'static
where
    T: TryFrom<u64> + Clone + Send + Sync + 'static,
{
    move |text| {
        let (least, most) = (range.start(), range.end());
        let expected = || match *most {
            u64::MAX => format!("expected a whole number of at least {least}"),
            _ => format!("expected a whole number from {least} to {most}"),
        };
        let number = match text.parse::<u64>() {
            Ok(number) if range.contains(&number) => number,
            Err(e) if *e.kind() == IntErrorKind::PosOverflow => return Err(TOO_LARGE.to_owned()),
            _ => return Err(expected()),
        };
        T::try_from(number).map_err(|_| TOO_LARGE.to_owned())
    }
}

const TOO_LARGE: &str = "the number is too large";

/// [`whole`] numbers without a bound: "0", "42".
pub fn parse_whole<T: TryFrom<u64> + Clone + Send + Sync + 'static>(text: &str) -> Result<T, String> {
    whole(0..=u64::MAX)(text)
}

/// Reads a number: "0.5", "3".
pub fn parse_number(text: &str) -> Result<f64, String> {
    text.parse().ok().filter(|x: &f64| x.is_finite()).ok_or_else(|| "expected a number".to_owned())
}

/// Reads a part of a list such as "2/5", as `(2, 5)`.
pub fn parse_shard(text: &str) -> Result<(usize, usize), String> {
    let parts = text.split_once('/').and_then(|(i, n)| Some((i.parse().ok()?, n.parse().ok()?)));
    match parts {
        Some((i, n)) if (1..=n).contains(&i) => Ok((i, n)),
        _ => Err("expected PART/PARTS with PART from 1 to PARTS, for example 1/3".to_owned()),
    }
}

/// Size of an image to make.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ImageSize {
    /// The longer side, pixels; the aspect ratio is kept.
    Longer(u32),
    /// Width and height, pixels.
    Exact(u32, u32),
}

/// Reads decibels: "0.1dB", "0.1 dB" or "0.1".
pub fn parse_decibels(text: &str) -> Result<f64, String> {
    let lower = text.trim().to_ascii_lowercase();
    let number = lower.strip_suffix("db").unwrap_or(&lower).trim_end();
    let value = number.parse::<f64>().ok().filter(|v| v.is_finite() && *v >= 0.0);
    value.ok_or_else(|| "expected decibels, such as 0.1dB".to_owned())
}

/// Reads the size of an image: "960" (longer side) or "1920x1080".
pub fn parse_image_size(text: &str) -> Result<ImageSize, String> {
    let side = |part: &str| part.parse().ok().filter(|px| (1..=32_768).contains(px));
    let size = match text.split_once('x') {
        Some((w, h)) => side(w).zip(side(h)).map(|(w, h)| ImageSize::Exact(w, h)),
        None => side(text).map(ImageSize::Longer),
    };
    size.ok_or_else(|| "expected WIDTHxHEIGHT or the longer side, 1 to 32768".to_owned())
}

/// Reads three finite numbers: "1,-2,0.5".
pub fn numbers(text: &str) -> Option<[f64; 3]> {
    let values: Option<Vec<f64>> =
        text.split(',').map(|v| v.trim().parse().ok().filter(|v: &f64| v.is_finite())).collect();
    values?.try_into().ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn durations_are_parsed() {
        assert_eq!(parse_duration_secs("90"), Ok(90.0));
        assert_eq!(parse_duration_secs("20m"), Ok(1200.0));
        assert_eq!(parse_duration_secs("1h30m"), Ok(5400.0));
        assert_eq!(parse_duration_secs("0.5s"), Ok(0.5));
        for wrong in ["", "m", "-3", "0", "3d", "1h30", "nan", "inf", "1é"] {
            assert!(parse_duration_secs(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn byte_sizes_are_parsed() {
        assert_eq!(parse_bytes("4GiB"), Ok(4 << 30));
        assert_eq!(parse_bytes("1.5 MiB"), Ok(3 << 19));
        assert_eq!(parse_bytes("2GB"), Ok(2_000_000_000));
        assert_eq!(parse_bytes("17"), Ok(17));
        for wrong in ["", "GiB", "-1GiB", "1e30GiB", "4Gi"] {
            assert!(parse_bytes(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn whole_numbers_are_parsed() {
        assert_eq!((parse_whole("0"), parse_whole("42")), (Ok(0_u64), Ok(42_usize)));
        for wrong in ["", "-1", "1.5", "x"] {
            assert!(parse_whole::<u64>(wrong).unwrap_err().contains("at least 0"), "{wrong}");
        }
        assert!(parse_whole::<u64>("18446744073709551616").unwrap_err().contains("too large"));
        assert!(parse_whole::<u16>("65536").unwrap_err().contains("too large"));
        let page = whole::<u8>(1..=9);
        assert_eq!((page("1"), page("9")), (Ok(1), Ok(9)));
        for wrong in ["0", "10", "300", "-1", "x"] {
            assert_eq!(page(wrong).unwrap_err(), "expected a whole number from 1 to 9");
        }
        for (text, found) in [("0.5", Some(0.5)), ("-3", Some(-3.0)), ("inf", None), ("x", None)] {
            assert_eq!(parse_number(text).ok(), found, "{text}");
        }
    }

    #[test]
    fn shards_are_parsed() {
        assert_eq!([parse_shard("2/3"), parse_shard("1/1")], [Ok((2, 3)), Ok((1, 1))]);
        for wrong in ["", "0/3", "4/3", "1", "1/0", "a/b", "-1/3", "1/3/3"] {
            assert!(parse_shard(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn decibels_are_parsed() {
        assert_eq!(["0.1dB", " 40 db", "3"].map(parse_decibels), [Ok(0.1), Ok(40.0), Ok(3.0)]);
        for wrong in ["", "dB", "-1dB", "nan", "1 bel"] {
            assert!(parse_decibels(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn image_sizes_are_parsed() {
        assert_eq!(parse_image_size("960"), Ok(ImageSize::Longer(960)));
        assert_eq!(parse_image_size("17x13"), Ok(ImageSize::Exact(17, 13)));
        for wrong in ["", "0", "x", "10x", "40000", "3x-1"] {
            assert!(parse_image_size(wrong).is_err(), "{wrong}");
        }
    }
}
