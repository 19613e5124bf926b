//! Legends of coloured images: swatches with labels.

use super::glyphs::{ADVANCE, glyph, has_ink};

/// Pixels per dot of the lettering.
const DOT_PX: usize = 2;
/// Layout of the swatches.
const SWATCH_PX: [usize; 2] = [36, 20];
const GAP_PX: usize = 6;
const MARGIN_PX: usize = 10;

const PAPER: u8 = 255;
const INK: u8 = 34;

/// An image with a title above and a swatch with its label on each line: width, height, `[height, width, 3]`.
/// Lettering is in capitals; characters without a glyph are left blank.
pub fn legend(title: &str, entries: &[(String, [u8; 3])]) -> (u32, u32, Vec<u8>) {
    let text_px = |text: &str| DOT_PX * ADVANCE * text.chars().count();
    let label_px = entries.iter().map(|(label, _)| text_px(label)).max().unwrap_or(0);
    let width = 2 * MARGIN_PX + text_px(title).max(SWATCH_PX[0] + GAP_PX + label_px);
    let line_px = SWATCH_PX[1] + GAP_PX;
    let height = 2 * MARGIN_PX + (entries.len() + 1) * line_px - GAP_PX;
    let mut image = Image { width, rgb: vec![PAPER; 3 * width * height] };
    // Capitals are 7 dots high.
    let centred = (SWATCH_PX[1] - 7 * DOT_PX) / 2;
    image.text([MARGIN_PX, MARGIN_PX + centred], title);
    for (line, (label, colour)) in (1..).zip(entries) {
        let y = MARGIN_PX + line * line_px;
        // A frame, so that light colours stand out from the paper.
        image.fill([MARGIN_PX, y], SWATCH_PX, [INK; 3]);
        image.fill([MARGIN_PX + 1, y + 1], SWATCH_PX.map(|side| side - 2), *colour);
        image.text([MARGIN_PX + SWATCH_PX[0] + GAP_PX, y + centred], label);
    }
    (width as u32, height as u32, image.rgb)
}

struct Image {
    width: usize,
    rgb: Vec<u8>,
}

impl Image {
    fn fill(&mut self, [x, y]: [usize; 2], [width, height]: [usize; 2], colour: [u8; 3]) {
        for row in y..y + height {
            let first = 3 * (row * self.width + x);
            let pixels = self.rgb[first..first + 3 * width].chunks_exact_mut(3);
            pixels.for_each(|pixel| pixel.copy_from_slice(&colour));
        }
    }

    fn text(&mut self, [x, y]: [usize; 2], text: &str) {
        for (at, character) in text.to_uppercase().chars().enumerate() {
            let Some(rows) = glyph(character) else { continue };
            for (column, row) in (0..5).flat_map(|c| (0..7).map(move |r| (c, r))) {
                if has_ink(rows, column as i64, row as i64) {
                    let left = x + DOT_PX * (ADVANCE * at + column);
                    self.fill([left, y + DOT_PX * row], [DOT_PX; 2], [INK; 3]);
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_legend_shows_each_colour_with_a_label() {
        let entries = [("none".to_owned(), [1, 2, 3]), ("256".to_owned(), [250, 240, 10])];
        let (width, height, rgb) = legend("TEXELS", &entries);
        assert_eq!(rgb.len(), 3 * (width * height) as usize);
        let pixel = |x: usize, y: usize| &rgb[3 * (y * width as usize + x)..][..3];
        for (line, (_, colour)) in (1..).zip(&entries) {
            let y = MARGIN_PX + line * (SWATCH_PX[1] + GAP_PX) + SWATCH_PX[1] / 2;
            assert_eq!(pixel(MARGIN_PX + 5, y), colour);
            let right = MARGIN_PX + SWATCH_PX[0] + GAP_PX..width as usize - MARGIN_PX;
            assert!(right.clone().any(|x| pixel(x, y)[0] == INK), "line {line}");
        }
        let (_, _, other) = legend("TEXELS", &[entries[0].clone(), ("265".to_owned(), [250, 240, 10])]);
        assert!(other.len() == rgb.len() && other != rgb, "labels can be told apart");
    }

    #[test]
    fn the_labels_in_use_have_glyphs() {
        for character in "NONETEXELSASIDEPIXELSPERTEXEL0123456789+PX".chars() {
            assert!(glyph(character).is_some(), "{character}");
        }
        assert!(glyph('?').is_none());
    }
}
