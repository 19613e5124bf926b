//! Resampling by area: every pixel of the result is the mean of the source over the rectangle that it
//! covers, fractions of pixels included.

/// The source pixels that one pixel of the result covers, along one axis.
struct Span {
    first: usize,
    /// Weights in the mean, one per source pixel from `first`; their sum is 1.
    weights: Vec<f32>,
}

/// The spans of all pixels of the result along one axis.
fn spans(source: usize, target: usize) -> Vec<Span> {
    let scale = source as f64 / target as f64;
    (0..target)
        .map(|index| {
            let begin = index as f64 * scale;
            // Exactly, despite rounding.
            let end = if index + 1 == target { source as f64 } else { (index + 1) as f64 * scale };
            let first = (begin.floor() as usize).min(source - 1);
            let last = (end.ceil() as usize).clamp(first + 1, source);
            let weights = (first..last)
                .map(|pixel| {
                    let covered = end.min((pixel + 1) as f64) - begin.max(pixel as f64);
                    (covered.max(0.0) / (end - begin)) as f32
                })
                .collect();
            Span { first, weights }
        })
        .collect()
}

/// Resamples an image of `channels` interleaved channels whose rows `fill_row(y, row)` makes, in ascending
/// order and at most once for each row of the result that they touch.
///
/// Enlarging works too: each pixel then shows the pixels that it lies over.
pub(crate) fn by_area(
    source_size: (u32, u32),
    target_size: (u32, u32),
    channels: usize,
    mut fill_row: impl FnMut(usize, &mut [f32]),
) -> Vec<f32> {
    let (source_width, source_height) = (source_size.0 as usize, source_size.1 as usize);
    let (width, height) = (target_size.0 as usize, target_size.1 as usize);
    let columns = spans(source_width, width);
    let mut out = Vec::with_capacity(width * height * channels);
    let mut row = vec![0.0_f32; source_width * channels];
    let mut filled = None;
    let mut sum = vec![0.0_f32; source_width * channels];
    for span in spans(source_height, height) {
        // Rows first: these loops run over whole rows and vectorise.
        sum.fill(0.0);
        for (offset, &weight) in span.weights.iter().enumerate() {
            let y = span.first + offset;
            if filled != Some(y) {
                fill_row(y, &mut row);
                filled = Some(y);
            }
            for (s, &v) in sum.iter_mut().zip(&row) {
                *s += weight * v;
            }
        }
        for column in &columns {
            let first = column.first * channels;
            for channel in 0..channels {
                let pixels = sum[first + channel..].iter().step_by(channels);
                out.push(column.weights.iter().zip(pixels).map(|(w, v)| w * v).sum());
            }
        }
    }
    out
}

/// Nearest byte.
pub(crate) fn to_byte(value: f32) -> u8 {
    // `as` saturates.
    (value + 0.5) as u8
}

#[cfg(test)]
mod tests {
    use super::*;

    fn image(width: u32, height: u32, channels: usize) -> Vec<u8> {
        let mut state = 1_u32;
        (0..width as usize * height as usize * channels)
            .map(|_| {
                state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                (state >> 24) as u8
            })
            .collect()
    }

    /// Straight from the definition, in f64: coverage of every source pixel for every result pixel.
    fn reference(pixels: &[u8], source: (u32, u32), target: (u32, u32), channels: usize) -> Vec<f64> {
        let overlap = |i: u32, n: u32, s: u32, j: u32| {
            let scale = f64::from(s) / f64::from(n);
            let begin = (f64::from(i) * scale).max(f64::from(j));
            let end = (f64::from(i + 1) * scale).min(f64::from(j + 1));
            (end - begin).max(0.0) / scale
        };
        let mut out = Vec::new();
        for y in 0..target.1 {
            for x in 0..target.0 {
                for c in 0..channels {
                    let mut sum = 0.0;
                    for sy in 0..source.1 {
                        for sx in 0..source.0 {
                            let weight =
                                overlap(x, target.0, source.0, sx) * overlap(y, target.1, source.1, sy);
                            let at = (sy as usize * source.0 as usize + sx as usize) * channels + c;
                            sum += weight * f64::from(pixels[at]);
                        }
                    }
                    out.push(sum);
                }
            }
        }
        out
    }

    fn worst(source: (u32, u32), target: (u32, u32), channels: usize, shift: usize) -> f64 {
        let pixels = image(source.0, source.1, channels);
        let stride = source.0 as usize * channels;
        let got = by_area(source, target, channels, |y, row| {
            for (r, &p) in row.iter_mut().zip(&pixels[y * stride..]) {
                *r = f32::from(p);
            }
        });
        let want = reference(&pixels, source, target, channels);
        assert_eq!(got.len(), want.len());
        let last = want.len() - shift;
        got[..last].iter().zip(&want[shift..]).map(|(a, b)| (f64::from(*a) - b).abs()).fold(0.0, f64::max)
    }

    #[test]
    fn area_means_match_the_definition_at_any_ratio() {
        for (source, target) in [
            ((12, 8), (12, 8)),
            ((12, 8), (6, 4)),
            ((31, 57), (8, 14)),
            ((19, 23), (7, 22)),
            ((5, 4), (1, 1)),
            ((3, 2), (7, 5)),
        ] {
            for channels in [1, 3, 4] {
                // Needed: 4e-5 of 255.
                let error = worst(source, target, channels, 0);
                assert!(error < 1e-4, "{source:?} to {target:?}: {error}");
            }
        }
    }

    #[test]
    fn a_shift_by_one_value_is_detected() {
        assert!(worst((31, 57), (8, 14), 3, 1) > 1.0);
    }

    #[test]
    fn weights_of_a_span_sum_to_one() {
        for (source, target) in [(1899, 480), (1067, 270), (7, 3), (1000, 999)] {
            for span in spans(source, target) {
                let sum: f32 = span.weights.iter().sum();
                assert!((sum - 1.0).abs() < 1e-5);
                assert!(span.first + span.weights.len() <= source);
            }
        }
    }
}
