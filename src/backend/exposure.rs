//! The exposure of a photo: an affine map of display-space colours, and the sums from which it is estimated.

/// Maps the colours of a rendered image to those of its photo: rows of `[r, g, b, 1]` factors.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ColourMap(pub [[f32; 4]; 3]);

impl ColourMap {
    /// The map that changes nothing.
    pub const IDENTITY: Self = Self([[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]]);

    /// The colour of the photo where the image has the colour `rgb`.
    #[inline(always)]
    pub fn apply(&self, rgb: [f32; 3]) -> [f32; 3] {
        self.0.map(|m| m[0] * rgb[0] + m[1] * rgb[1] + m[2] * rgb[2] + m[3])
    }

    /// The derivative with respect to the image, from the derivative with respect to the mapped image.
    #[inline(always)]
    pub fn apply_transposed(&self, gradient: [f32; 3]) -> [f32; 3] {
        let [r, g, b] = self.0;
        [0, 1, 2].map(|c| r[c] * gradient[0] + g[c] * gradient[1] + b[c] * gradient[2])
    }
}

/// Number of sums of a view.
pub const NUM_COLOUR_SUMS: usize = 22;

/// Sums over the pixels of a view that count, with x the rendered colour before its map and y the photo's: pixels; x;
/// the products xx of r r, r g, r b, g g, g b, b b; y; the products x y, by channel of x, then of y.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ColourSums(pub [f64; NUM_COLOUR_SUMS]);

impl ColourSums {
    /// Adds a pixel.
    #[inline(always)]
    pub fn add(&mut self, x: [f64; 3], y: [f64; 3]) {
        let [a, b, c] = x;
        let of = |x: f64| y.map(|y| x * y);
        let terms: [&[f64]; 7] =
            [&[1.0], &x, &[a * a, a * b, a * c, b * b, b * c, c * c], &y, &of(a), &of(b), &of(c)];
        self.0.iter_mut().zip(terms.into_iter().flatten()).for_each(|(sum, term)| *sum += term);
    }

    /// Adds the sums over other pixels.
    pub fn merge(&mut self, other: &Self) {
        self.0.iter_mut().zip(other.0).for_each(|(sum, term)| *sum += term);
    }
}
