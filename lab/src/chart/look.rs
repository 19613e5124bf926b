//! Colour, marker and dashes of a series, determined by its index. The first sixty-four differ in colour or marker.

use std::fmt::Write;

/// Radius of large markers.
pub const MARK_PX: f64 = 4.8;

/// Colours of series on a light and on a dark background. They differ in lightness as well as in hue, and markers
/// differ in shape, for readers who do not distinguish the hues.
pub const PALETTE: [(&str, &str); 8] = [
    ("#0b62a4", "#5aa9e6"),
    ("#c8500a", "#ff9a55"),
    ("#0a7d55", "#3ecf97"),
    ("#8e3a9d", "#d99be6"),
    ("#8a6d00", "#e3c04a"),
    ("#b0203a", "#ff7a8c"),
    ("#0c7f92", "#52d0e0"),
    ("#4d545c", "#b9c0c9"),
];
/// Dashes and gaps of lines in pixels, one pattern for each round through the colours.
pub const DASHES: [&str; 4] = ["none", "8 3", "2 3", "9 3 2 3"];
/// Number of marker shapes.
const SHAPES: usize = 8;

/// Index of a series' colour in [`PALETTE`].
pub fn colour(look: usize) -> usize {
    look % PALETTE.len()
}

/// Index of a series' marker, shifted by one with every round through the colours.
fn shape(look: usize) -> usize {
    (look + look / PALETTE.len()) % SHAPES
}

/// CSS classes of a series' line.
pub fn line_class(look: usize) -> String {
    format!("lt-line lt-s{} lt-d{}", colour(look), look / PALETTE.len() % DASHES.len())
}

/// Outline of a series' marker as the `d` of an SVG path.
pub fn marker_path(look: usize, (x, y): (f64, f64), r: f64) -> String {
    let polygon = |points: &[(f64, f64)]| {
        let mut d = String::new();
        for (i, (dx, dy)) in points.iter().enumerate() {
            let _ = write!(d, "{}{:.1} {:.1}", if i == 0 { "M" } else { "L" }, x + dx * r, y + dy * r);
        }
        d + "Z"
    };
    // All shapes have about the area of the circle.
    match shape(look) {
        0 => format!(
            "M{:.1} {y:.1}a{r:.1} {r:.1} 0 1 0 {:.1} 0a{r:.1} {r:.1} 0 1 0 {:.1} 0Z",
            x - r,
            2.0 * r,
            -2.0 * r
        ),
        1 => polygon(&[(-0.9, -0.9), (0.9, -0.9), (0.9, 0.9), (-0.9, 0.9)]),
        2 => polygon(&[(0.0, -1.25), (1.2, 0.9), (-1.2, 0.9)]),
        3 => polygon(&[(0.0, -1.3), (1.3, 0.0), (0.0, 1.3), (-1.3, 0.0)]),
        4 => polygon(&[(0.0, 1.25), (1.2, -0.9), (-1.2, -0.9)]),
        5 => polygon(&[
            (-0.4, -1.2),
            (0.4, -1.2),
            (0.4, -0.4),
            (1.2, -0.4),
            (1.2, 0.4),
            (0.4, 0.4),
            (0.4, 1.2),
            (-0.4, 1.2),
            (-0.4, 0.4),
            (-1.2, 0.4),
            (-1.2, -0.4),
            (-0.4, -0.4),
        ]),
        6 => polygon(&[(0.0, -1.2), (1.15, -0.35), (0.7, 1.0), (-0.7, 1.0), (-1.15, -0.35)]),
        _ => polygon(&[(-1.4, -0.6), (1.4, -0.6), (1.4, 0.6), (-1.4, 0.6)]),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::HashSet;

    #[test]
    fn sixty_four_series_differ_in_colour_or_marker() {
        let looks =
            |n: usize| (0..n).map(|i| (colour(i), marker_path(i, (5.0, 5.0), 4.0))).collect::<HashSet<_>>();
        assert_eq!(looks(64).len(), 64);
        // Negative control: after that they repeat.
        assert_eq!(looks(65).len(), 64);
        // Within a round no marker repeats, and lines of equal colour differ in their dashes.
        assert_eq!(looks(8).into_iter().map(|(_, marker)| marker).collect::<HashSet<_>>().len(), 8);
        assert_eq!((0..32).map(line_class).collect::<HashSet<_>>().len(), 32);
    }
}
