//! Luma and two chroma differences of colours. Noise in luma reaches all three channels, noise in chroma fewer: its steps
//! are coarser.

/// Luma, green against magenta, red against blue.
pub fn luma_chroma([r, g, b]: [f64; 3]) -> [f64; 3] {
    [0.25 * (r + b) + 0.5 * g, g - 0.5 * (r + b), r - b]
}

/// The inverse of [`luma_chroma`].
pub fn rgb([luma, green, red]: [f64; 3]) -> [f64; 3] {
    let other = luma - 0.5 * green;
    [other + 0.5 * red, luma + 0.5 * green, other - 0.5 * red]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn colours_round_trip_through_luma_and_chroma() {
        for colour in [[0.5, -0.25, 1.0], [0.0, 0.75, -1.0], [1.0, 1.0, 1.0]] {
            assert_eq!(rgb(luma_chroma(colour)), colour);
        }
        assert_eq!(luma_chroma([0.5; 3]), [0.5, 0.0, 0.0]);
    }
}
