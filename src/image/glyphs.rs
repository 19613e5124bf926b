//! Letters and digits as dot matrices, for lettering without a font.

/// 5 x 7 glyphs, rows from the top, most significant of five bits on the left. The sample's small print
/// draws from the first [`SMALL_PRINT`] glyphs, so changing their order changes its images.
pub(crate) const GLYPHS: [(char, [u8; 7]); 25] = [
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
    ('O', [14, 17, 17, 17, 17, 17, 14]),
    ('+', [0, 4, 4, 31, 4, 4, 0]),
    ('0', [14, 17, 19, 21, 25, 17, 14]),
    ('1', [4, 12, 4, 4, 4, 4, 14]),
    ('3', [31, 2, 4, 2, 1, 17, 14]),
    ('4', [2, 6, 10, 18, 31, 2, 2]),
    ('5', [31, 16, 30, 1, 1, 17, 14]),
    ('6', [6, 8, 16, 30, 17, 17, 14]),
    ('7', [31, 1, 2, 4, 8, 8, 8]),
    ('8', [14, 17, 17, 14, 17, 17, 14]),
    ('9', [14, 17, 17, 15, 1, 2, 12]),
];

/// Number of glyphs that the sample's small print uses.
pub(crate) const SMALL_PRINT: usize = 14;

/// Dots from the left edge of one glyph to that of the next.
pub(crate) const ADVANCE: usize = 6;

/// The rows of a character; `None` for characters without a glyph, which are left blank.
pub(crate) fn glyph(character: char) -> Option<&'static [u8; 7]> {
    GLYPHS.iter().find(|g| g.0 == character).map(|(_, rows)| rows)
}

/// Whether a glyph has ink in a column and row.
pub(crate) fn has_ink(rows: &[u8; 7], column: i64, row: i64) -> bool {
    (0..5).contains(&column) && (0..7).contains(&row) && rows[row as usize] >> (4 - column) & 1 == 1
}
