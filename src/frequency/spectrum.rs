//! A compact description of an image's spectrum: amplitudes by box scale, which the windows of the stages need, and
//! by direction, which the noise floor needs (method 7.1).
//!
//! The window of render scale s keeps the frequencies with max(|fx|, |fy|) <= 1 / 2s (cycles per pixel).
//! With rho = 2 max(|fx|, |fy|), from 0 at the mean to 1 at the highest frequency, that is rho <= 1/s
//! for any image size, so that views of different sizes share one description.

use realfft::num_complex::Complex;

/// Number of rings of equal width in rho: finer than the lines of images up to 1024 pixels wide.
pub(super) const RINGS: usize = 512;

/// Number of directions, in equal steps of min(|fx|, |fy|) / max(|fx|, |fy|). The first contains the axes, where
/// the edges of the image show (its periodic continuation, the zero padding of the gradient).
pub(super) const SECTORS: usize = 8;

/// Sums over the frequencies of one cell.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Cell {
    /// Sum of |F| / sqrt(pixels).
    pub amplitude: f64,
    /// Sum of |F|^2 / pixels; for white noise each term is its variance, at any image size.
    pub power: f64,
    /// Number of frequencies; not an integer, since lines are shared between rings.
    pub count: f64,
}

impl Cell {
    /// Adds another cell times `weight`.
    pub fn add(&mut self, other: &Self, weight: f64) {
        self.amplitude += weight * other.amplitude;
        self.power += weight * other.power;
        self.count += weight * other.count;
    }
}

/// The spectrum of an image, with what is needed to estimate its noise.
///
/// All sums are divided by the number of pixels, so that a stationary texture gives the same numbers at
/// any image size and a large view weighs no more than a small one. (For views of one size this is a
/// common factor that cancels in every use.)
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Spectrum {
    /// `[RINGS, SECTORS]`
    pub cells: Vec<[Cell; SECTORS]>,
    /// Sum of the squared weights of the unmasked pixels over the number of all pixels: white noise of variance 1
    /// in the photo has this power at every frequency.
    pub mean_square_weight: f64,
    /// Variance of the finest detail at quiet places, see `noise::fine_variance`.
    pub fine_variance: f64,
}

impl Spectrum {
    /// Amplitude of each ring. `[RINGS]`
    pub fn rings(&self) -> Vec<f64> {
        self.cells.iter().map(|ring| ring.iter().map(|cell| cell.amplitude).sum()).collect()
    }
}

/// Sums of an image's coefficients by spectral line. The frequencies of a line share their larger component and
/// so their rho.
pub(super) struct Lines {
    width: usize,
    height: usize,
    /// |fx| larger or equal. `[width / 2 + 1, SECTORS]`
    vertical: Vec<[Cell; SECTORS]>,
    /// |fy| larger. `[height / 2 + 1, SECTORS]`
    horizontal: Vec<[Cell; SECTORS]>,
}

impl Lines {
    pub fn new(width: usize, height: usize) -> Self {
        let lines = |side: usize| vec![[Cell::default(); SECTORS]; side / 2 + 1];
        Self { width, height, vertical: lines(width), horizontal: lines(height) }
    }

    /// Adds the column of horizontal frequency `kx` of a plane's half spectrum.
    pub fn add_column(&mut self, kx: usize, column: &[Complex<f64>]) {
        let (width, height) = (self.width, self.height);
        // The other half of the spectrum has the same amplitudes.
        let multiplicity = if kx == 0 || 2 * kx == width { 1.0 } else { 2.0 };
        for (index, coefficient) in column.iter().enumerate() {
            let ky = index.min(height - index);
            // rho_x : rho_y, in integers so that ties are ties.
            let (x, y) = (kx * height, ky * width);
            let (line, low, high) =
                if x >= y { (&mut self.vertical[kx], y, x) } else { (&mut self.horizontal[ky], x, y) };
            // The mean (0 : 0) has no direction and goes to the first sector.
            let sector = (SECTORS * low).checked_div(high).unwrap_or(0).min(SECTORS - 1);
            let power = coefficient.norm_sqr();
            line[sector].add(&Cell { amplitude: power.sqrt(), power, count: 1.0 }, multiplicity);
        }
    }

    /// The cells of all columns added. A line covers the interval of rho that reaches half-way to the lines next to
    /// it, so that windows which end between two lines get their share.
    pub fn cells(&self) -> Vec<[Cell; SECTORS]> {
        let mut cells = vec![[Cell::default(); SECTORS]; RINGS];
        let pixels = (self.width * self.height) as f64;
        for (lines, side) in [(&self.vertical, self.width), (&self.horizontal, self.height)] {
            for (k, line) in lines.iter().enumerate() {
                let edge =
                    |offset: f64| ((2.0 * k as f64 + offset) / side as f64).clamp(0.0, 1.0) * RINGS as f64;
                let (begin, end) = (edge(-1.0), edge(1.0));
                for ring in begin as usize..(end.ceil() as usize).min(RINGS) {
                    let covered = end.min((ring + 1) as f64) - begin.max(ring as f64);
                    let share = covered / (end - begin) / pixels;
                    for (cell, sum) in cells[ring].iter_mut().zip(line) {
                        let normal = Cell {
                            amplitude: sum.amplitude / pixels.sqrt(),
                            power: sum.power / pixels,
                            count: sum.count,
                        };
                        cell.add(&normal, share);
                    }
                }
            }
        }
        cells
    }
}

/// win(s): the amplitude within the window of a scale, as a cumulative sum over rings.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Windows {
    /// Sums of the rings below each edge. `[RINGS + 1]`
    sums: Vec<f64>,
}

impl Windows {
    /// Sums up the amplitudes of the rings.
    pub fn new(rings: impl Iterator<Item = f64>) -> Self {
        let mut sums = vec![0.0];
        let mut sum = 0.0;
        sums.extend(rings.map(|amplitude| {
            sum += amplitude;
            sum
        }));
        Self { sums }
    }

    /// win(1), the whole amplitude.
    pub fn total(&self) -> f64 {
        self.sums[self.sums.len() - 1]
    }

    /// win(s) for s >= 1.
    pub fn within(&self, scale: f64) -> f64 {
        let at = (self.sums.len() - 1) as f64 / scale;
        let ring = (at as usize).min(self.sums.len() - 2);
        let (low, high) = (self.sums[ring], self.sums[ring + 1]);
        low + (high - low) * (at - ring as f64)
    }

    /// The scale whose window holds `amplitude`, at most `highest`, by bisection of 1/s, with which windows grow
    /// (method 7.2). 64 steps exhaust f64.
    pub fn solve(&self, amplitude: f64, highest: f64) -> f64 {
        let (mut low, mut high) = (1.0 / highest, 1.0);
        if self.within(highest) >= amplitude {
            return highest;
        }
        for _ in 0..64 {
            let middle = 0.5 * (low + high);
            if self.within(1.0 / middle) < amplitude {
                low = middle;
            } else {
                high = middle;
            }
        }
        1.0 / high
    }
}

#[cfg(test)]
mod tests {
    use super::super::fft::PlaneTransform;
    use super::*;

    fn value(i: usize) -> f64 {
        let x = (i as f64 * 12.9898).sin() * 43_758.547;
        x - x.floor() - 0.3
    }

    /// Amplitudes of a plane by signed frequency, from its half spectrum.
    fn amplitudes(width: usize, height: usize, lines: &mut Lines) -> Vec<(i64, i64, f64)> {
        let mut plane: Vec<f64> = (0..width * height).map(value).collect();
        let transform = PlaneTransform::new(width, height);
        let mut all = vec![];
        transform.visit_columns(&mut plane, &mut transform.workspace(), |kx, column| {
            lines.add_column(kx, column);
            for (ky, c) in column.iter().enumerate() {
                let signed = if 2 * ky > height { ky as i64 - height as i64 } else { ky as i64 };
                all.push((kx as i64, signed, c.norm()));
                if kx > 0 && 2 * kx != width {
                    all.push((-(kx as i64), -signed, c.norm()));
                }
            }
        });
        all
    }

    #[test]
    fn windows_match_the_boxes_of_their_definition() {
        for (width, height) in [(64, 64), (81, 135), (96, 32)] {
            let mut lines = Lines::new(width, height);
            let all = amplitudes(width, height, &mut lines);
            assert_eq!(all.len(), width * height);
            let spectrum = Spectrum { cells: lines.cells(), mean_square_weight: 1.0, fine_variance: 0.0 };
            let windows = Windows::new(spectrum.rings().into_iter());
            let total: f64 = all.iter().map(|a| a.2).sum();
            let count: f64 = spectrum.cells.iter().flatten().map(|cell| cell.count).sum();
            assert!((count - 1.0).abs() < 1e-12, "{count}");
            let share = |scale: f64| windows.within(scale) / windows.total();
            for odd in [9, 15, 21, 33] {
                // Scales at which windows have an odd number of columns and of rows.
                let half = odd / 2;
                let half_rows = (odd as usize * height / width / 2) as i64;
                let box_of = |half: i64| {
                    let inside = |a: &&(i64, i64, f64)| a.0.abs() <= half && a.1.abs() <= half_rows;
                    all.iter().filter(inside).map(|a| a.2).sum::<f64>() / total
                };
                let got = share(width as f64 / odd as f64);
                let error = |want: f64| (got / want - 1.0).abs();
                // Needed: 4.3e-4 where lines and rings do not align, else 1e-14.
                assert!(error(box_of(half)) < 1e-3, "{width}x{height}, {odd}: {}", error(box_of(half)));
                assert!(error(box_of(half + 1)) > 0.01, "negative control: one more column");
            }
            assert_eq!(share(1.0), 1.0);
            let half = windows.solve(0.5 * windows.total(), 100.0);
            assert!((share(half) - 0.5).abs() < 1e-9, "{half}");
            assert_eq!(windows.solve(0.0, 4.0), 4.0);
            assert!((windows.solve(2.0 * windows.total(), 4.0) - 1.0).abs() < 1e-12);
        }
    }
}
