//! Letters of dots: detail on the sample scene's surfaces whose loss anyone sees.

use super::noise::Noise;
use glam::DVec2;

/// 5 x 7 glyphs, rows from the top, most significant of five bits on the left.
const GLYPHS: [(char, [u8; 7]); 14] = [
    ('A', [14, 17, 17, 31, 17, 17, 17]),
    ('D', [30, 17, 17, 17, 17, 17, 30]),
    ('E', [31, 16, 16, 30, 16, 16, 31]),
    ('G', [14, 17, 16, 23, 17, 17, 14]),
    ('I', [14, 4, 4, 4, 4, 4, 14]),
    ('L', [16, 16, 16, 16, 16, 16, 31]),
    ('N', [17, 25, 21, 19, 17, 17, 17]),
    ('P', [30, 17, 17, 30, 16, 16, 16]),
    ('R', [30, 17, 17, 30, 20, 18, 17]),
    ('S', [15, 16, 16, 14, 1, 1, 30]),
    ('T', [31, 4, 4, 4, 4, 4, 4]),
    ('U', [17, 17, 17, 17, 17, 17, 14]),
    ('X', [17, 17, 10, 4, 10, 17, 17]),
    ('2', [14, 17, 1, 2, 4, 8, 31]),
];

fn glyph_has_ink(rows: &[u8; 7], column: i64, row: i64) -> bool {
    (0..5).contains(&column) && (0..7).contains(&row) && rows[row as usize] >> (4 - column) & 1 == 1
}

/// Whether a centred line of text has ink at a place (right, up) from its centre; `dot` is the edge
/// of one of the glyphs' 5 x 7 dots.
pub fn text(line: &str, at: DVec2, dot: f64) -> bool {
    let length = line.chars().count() as f64;
    let x = at.x / dot + 3.0 * length;
    let row = (3.5 - at.y / dot).floor() as i64;
    if x < 0.0 {
        return false;
    }
    let glyph = line.chars().nth((x / 6.0) as usize).and_then(|c| GLYPHS.iter().find(|g| g.0 == c));
    glyph.is_some_and(|(_, rows)| glyph_has_ink(rows, (x % 6.0) as i64, row))
}

/// A block of small print: pseudo-random words in lines of 10 dots.
pub fn small_print(noise: &Noise, at: DVec2, dot: f64) -> bool {
    let (x, y) = ((at.x / dot).floor() as i64, (-at.y / dot).floor() as i64);
    let (letter, line) = (x.div_euclid(6), y.div_euclid(10));
    let draw = noise.cell(letter, line);
    draw > 0.16 && glyph_has_ink(&GLYPHS[(draw * 14.0) as usize % 14].1, x.rem_euclid(6), y.rem_euclid(10))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn text_reads_from_left_to_right_and_from_the_top() {
        // The L has its stem on the left and its foot below.
        let ink = |x: f64, y: f64| text("L", DVec2::new(x, y), 1.0);
        assert!(ink(-2.5, 3.0) && ink(-2.5, -3.0) && ink(1.5, -3.0));
        assert!(!ink(1.5, 3.0) && !ink(-2.5, 4.0) && !ink(-3.5, 0.0));
    }
}
