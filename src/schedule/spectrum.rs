//! What is kept of a picture's spectrum: amplitudes by box scale, which is all that the windows of the
//! stages ask for, and by direction, which the noise floor needs.
//!
//! The window of render scale s keeps the frequencies with max(|fx|, |fy|) <= 1 / 2s (cycles per pixel).
//! With rho = 2 max(|fx|, |fy|), from 0 at the mean to 1 at the highest frequency, that is rho <= 1/s
//! whatever the picture's size, so that views of different sizes share one description.

use realfft::num_complex::Complex;

/// Rings of equal width in rho. Finer than the lines of pictures up to 1024 pixels wide.
pub(super) const RINGS: usize = 512;

/// Directions: equal steps of min(|fx|, |fy|) / max(|fx|, |fy|). The first holds the axes, where the
/// picture's edges (its periodic continuation, the zero padding of the gradient) leave their mark.
pub(super) const SECTORS: usize = 8;

/// Sums over the frequencies of one cell.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Cell {
    /// Of |F| / sqrt(pixels).
    pub amplitude: f64,
    /// Of |F|^2 / pixels: for white noise its variance, whatever the picture's size.
    pub power: f64,
    /// Number of frequencies.
    pub count: f64,
}

impl Cell {
    fn add(&mut self, other: &Self, weight: f64) {
        self.amplitude += weight * other.amplitude;
        self.power += weight * other.power;
        self.count += weight * other.count;
    }
}

/// One picture's spectrum. `[RINGS, SECTORS]`
///
/// All sums are divided by the number of pixels, so that a stationary texture gives the same numbers at
/// any picture size and a larger view weighs no more than a small one. (For views of one size this is a
/// common factor, which drops out of every use.)
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Spectrum {
    pub cells: Vec<[Cell; SECTORS]>,
}

/// Collects the coefficients of one picture by spectral line: all frequencies whose larger component is
/// the line's have one rho.
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
            let sector = if high == 0 { 0 } else { (SECTORS * low / high).min(SECTORS - 1) };
            let power = coefficient.norm_sqr();
            line[sector].add(&Cell { amplitude: power.sqrt(), power, count: 1.0 }, multiplicity);
        }
    }

    /// The spectrum of what was added. A line's frequencies stand for the interval of rho that reaches
    /// half-way to the next lines, so that windows which end between two lines get their share.
    pub fn spectrum(&self) -> Spectrum {
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
        Spectrum { cells }
    }
}

/// win(s): the amplitude within the window of a scale, cumulated over rings.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Windows {
    /// Sum of the rings below. `[RINGS + 1]`
    sums: Vec<f64>,
}

impl Windows {
    /// From the amplitude of each ring.
    pub fn new(rings: impl Iterator<Item = f64>) -> Self {
        let mut sums = vec![0.0];
        let mut sum = 0.0;
        sums.extend(rings.map(|amplitude| {
            sum += amplitude;
            sum
        }));
        Self { sums }
    }

    /// win(1): everything.
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

    /// The scale whose window holds `amplitude`, up to `highest`: bisection of 1/s, in which windows
    /// grow (method section 8.2). 64 steps exhaust f64.
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
