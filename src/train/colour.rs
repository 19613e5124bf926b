//! Colours of settings, as people type them.

use serde::{Deserialize, Deserializer, de::Error as _};

/// Reads a colour, display space: "black", "white", "#rrggbb" or "r,g,b" with numbers from 0 to 1.
fn parse_colour(text: &str) -> Result<[f32; 3], &'static str> {
    let wrong = "expected black, white, #rrggbb or r,g,b with numbers from 0 to 1; for another colour in each step: \
                 random-background=true";
    match text {
        "black" => return Ok([0.0; 3]),
        "white" => return Ok([1.0; 3]),
        _ => {}
    }
    if let Some(hex) = text.strip_prefix('#') {
        if hex.len() != 6 || !hex.bytes().all(|b| b.is_ascii_hexdigit()) {
            return Err(wrong);
        }
        let value = u32::from_str_radix(hex, 16).map_err(|_| wrong)?;
        return Ok([16, 8, 0].map(|shift| ((value >> shift) & 255) as f32 / 255.0));
    }
    let numbers: Vec<f32> =
        text.split(',').map(|part| part.trim().parse().map_err(|_| wrong)).collect::<Result<_, _>>()?;
    match numbers[..] {
        [r, g, b] if numbers.iter().all(|x| (0.0..=1.0).contains(x)) => Ok([r, g, b]),
        _ => Err(wrong),
    }
}

/// Reads a colour as three numbers or as text, for serde.
pub(super) fn deserialize_colour<'de, D: Deserializer<'de>>(deserializer: D) -> Result<[f32; 3], D::Error> {
    #[derive(Deserialize)]
    #[serde(untagged, expecting = "expected a colour: black, white, #rrggbb or three numbers from 0 to 1")]
    enum Typed {
        Numbers([f32; 3]),
        Text(String),
    }
    match Typed::deserialize(deserializer)? {
        Typed::Numbers(numbers) => Ok(numbers),
        Typed::Text(text) => parse_colour(&text).map_err(D::Error::custom),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn colours_are_parsed() {
        assert_eq!(parse_colour("white"), Ok([1.0; 3]));
        assert_eq!(parse_colour("#ff0033"), Ok([1.0, 0.0, 0.2]));
        assert_eq!(parse_colour("0, 0.5,1"), Ok([0.0, 0.5, 1.0]));
        for wrong in ["", "red", "#ff00", "#+f0000", "#ééé", "1,2,3", "0,0", "0,0,nan", "random"] {
            assert!(parse_colour(wrong).is_err(), "{wrong}");
        }
    }
}
