//! Dot-matrix lettering on the sample scene's surfaces: detail whose loss is obvious.

use super::noise::Noise;
use crate::image::glyphs::{GLYPHS, SMALL_PRINT, glyph, has_ink};
use glam::DVec2;

/// Whether a centred line of text has ink at the offset `at` (right, up) from its centre. Glyphs have
/// 5 x 7 dots of edge `dot`.
pub fn text(line: &str, at: DVec2, dot: f64) -> bool {
    let length = line.chars().count() as f64;
    let x = at.x / dot + 3.0 * length;
    let row = (3.5 - at.y / dot).floor() as i64;
    if x < 0.0 {
        return false;
    }
    let rows = line.chars().nth((x / 6.0) as usize).and_then(glyph);
    rows.is_some_and(|rows| has_ink(rows, (x % 6.0) as i64, row))
}

/// Whether a block of small print has ink at `at`: pseudo-random words, one line every 10 dots.
pub fn small_print(noise: &Noise, at: DVec2, dot: f64) -> bool {
    let (x, y) = ((at.x / dot).floor() as i64, (-at.y / dot).floor() as i64);
    let (letter, line) = (x.div_euclid(6), y.div_euclid(10));
    let draw = noise.cell(letter, line);
    let letter = (draw * SMALL_PRINT as f64) as usize % SMALL_PRINT;
    draw > 0.16 && has_ink(&GLYPHS[letter].1, x.rem_euclid(6), y.rem_euclid(10))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn text_is_upright_and_not_mirrored() {
        // An L has its stem on the left and its foot at the bottom.
        let ink = |x: f64, y: f64| text("L", DVec2::new(x, y), 1.0);
        assert!(ink(-2.5, 3.0) && ink(-2.5, -3.0) && ink(1.5, -3.0));
        assert!(!ink(1.5, 3.0) && !ink(-2.5, 4.0) && !ink(-3.5, 0.0));
    }
}
