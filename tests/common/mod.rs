//! Helpers that tests share. Here: comparison of arrays that counts outliers, which entries next to a
//! discontinuity may be.
#![allow(dead_code, reason = "each test binary uses a part")]
#![allow(clippy::unwrap_used, reason = "a failing test may panic")]

pub mod assets;
pub mod cli;
pub mod full_method;
#[cfg(feature = "gpu")]
pub mod gpu;
pub mod moved;
pub mod need;
pub mod page;
pub mod plans;
pub mod poison;
pub mod room;
pub mod sized;
pub mod steps;
pub mod training;
pub mod twin;

/// Difference of two arrays, relative to the largest magnitude of the expected one.
#[derive(Debug)]
pub struct Difference {
    /// Number of entries.
    pub entries: usize,
    /// Expected entries above 1e-6 of the largest.
    pub non_zero: usize,
    /// Root mean square of the difference over that of the expected array.
    pub rms: f64,
    /// Number of outliers: entries whose difference exceeds the limit.
    pub beyond: usize,
    /// Largest difference of the other entries, over the largest magnitude.
    pub worst: f64,
}

/// Compares two arrays; `limit` is relative to the largest expected magnitude.
pub fn compare(got: &[f32], expected: &[f64], limit: f64) -> Difference {
    assert_eq!(got.len(), expected.len());
    let largest = expected.iter().fold(1e-30_f64, |m, v| m.max(v.abs()));
    let mut out = Difference { entries: got.len(), non_zero: 0, rms: 0.0, beyond: 0, worst: 0.0 };
    let (mut square, mut expected_square) = (0.0, 1e-60);
    for (g, e) in got.iter().zip(expected) {
        assert!(g.is_finite(), "not finite: {g}, expected {e}");
        let d = (f64::from(*g) - e).abs() / largest;
        out.non_zero += usize::from(e.abs() > 1e-6 * largest);
        square += (f64::from(*g) - e).powi(2);
        expected_square += e * e;
        if d > limit {
            out.beyond += 1;
        } else {
            out.worst = out.worst.max(d);
        }
    }
    out.rms = (square / expected_square).sqrt();
    out
}
