//! A poster with the content of photos: shapes of all sizes with sharp borders, which cover each other as things do in
//! photos, each with noise of its own whose amplitude falls as 1/f, and lettering. No smallest model of it is known.

use super::lettering::{small_print, text};
use super::noise::Noise;
use super::random::{Stream, stream, uniform};
use glam::{DMat3, DVec2, DVec3};
use serde::Serialize;

/// Width and height, metres: every photo of 4 to 3 on the cap shows all of it.
pub const SIZE: DVec2 = DVec2::new(1.24, 0.93);

/// Colours of paper and ink, display space, and the width of the paper around the rest, metres.
const PAPER: DVec3 = DVec3::new(0.92, 0.9, 0.86);
const INK: DVec3 = DVec3::new(0.08, 0.08, 0.11);
const MARGIN: f64 = 0.025;

/// Range of values within shapes, display space.
const VALUES: [f64; 2] = [0.04, 0.96];

/// Large lettering: text, its centre (right, up) and the edge of a dot, metres.
const LINES: [(&str, DVec2, f64); 2] = [
    ("LITETEX", DVec2::new(0.0, 0.31), TITLE_DOT),
    ("2D GAUSSIAN SPLATS", DVec2::new(0.0, 0.175), 0.5 * TITLE_DOT),
];
const TITLE_DOT: f64 = 0.0192;

/// From large letters to their shadows, right and down, dots.
const SHADOW: f64 = 0.8;

/// Changes (right, up) to (right, down) and back; itself one step right and down.
const DOWN: DVec2 = DVec2::new(1.0, -1.0);

/// Centre (right, up) and half size of the panel with small print, metres.
const PANEL: (DVec2, DVec2) = (DVec2::new(-0.17, -0.27), DVec2::new(0.38, 0.13));

/// Number of shapes, and the range of their half sizes, metres; the number per size falls with its third power, so that
/// enlarged parts resemble the whole. They leave 8 to 20 % of the ground uncovered (measured, six seeds).
const SHAPES: usize = 220;
const HALF_SIZES: [f64; 2] = [0.025, 0.4];

/// Smallest ratio of a shape's half sizes.
const ASPECT_MIN: f64 = 0.4;

/// Distance by which noise bends the borders of round shapes, and the length of a bend, metres.
const BEND: (f64, f64) = (0.06, 0.15);

/// Axes of colours, as photos have them: brightness, yellow to blue, red to green.
const AXES: DMat3 = DMat3::from_cols(DVec3::ONE, DVec3::new(0.5, 0.5, -1.0), DVec3::new(1.0, -1.0, 0.0));

/// Range of a shape's mean brightness, and largest deviations along the other axes.
const BRIGHTNESS: [f64; 2] = [0.25, 0.75];
const TINTS: [f64; 2] = [0.16, 0.1];

/// Range of the standard deviation that one octave of brightness has in a shape, and those of the other axes relative to it:
/// photos vary in brightness most.
const CONTRASTS: [f64; 2] = [0.02, 0.08];
const CHROMA: [f64; 2] = [0.25, 0.12];

/// Standard deviation of one octave of lattice noise, from its interpolation.
const OCTAVE_SD: f64 = 0.2145;

/// Turn from one octave to the next, radians, so that their lattices do not coincide.
const OCTAVE_TURN: f64 = 2.4;

/// A part of the poster with one kind of content.
#[derive(Clone, Debug, Serialize)]
struct Shape {
    /// Its centre (right, up) from that of the poster, metres.
    centre: DVec2,
    /// Half sizes, metres, and the direction of the first, a unit vector.
    half: DVec2,
    axis: DVec2,
    /// Bent ellipses, or rectangles.
    is_round: bool,
    /// Mean colour, display space.
    mean: DVec3,
    /// Standard deviation of an octave of brightness.
    contrast: f64,
    /// Where in the noise the shape lies.
    offset: DVec2,
}

/// The poster, seen from the front.
#[derive(Clone, Debug, Serialize)]
pub struct Poster {
    /// Octaves of noise; the coarsest has two cells across the poster, each other one cells half as large.
    octaves: u32,
    /// From the top; the last is the ground.
    shapes: Vec<Shape>,
    #[serde(skip)]
    noise: Noise,
}

impl Poster {
    /// The poster of a seed. More octaves refine it: coarser ones stay.
    pub fn new(octaves: u32, seed: u64) -> Self {
        let mut rng = stream(seed, Stream::Grids, 2);
        let mut between = |low: f64, high: f64| low + (high - low) * uniform(&mut rng);
        let [smallest, largest] = HALF_SIZES.map(|half| half.powi(-2));
        let mut shape = || {
            // The inverse of the distribution of sizes.
            let half = between(largest, smallest).powf(-0.5);
            let aspect = between(ASPECT_MIN, 1.0);
            let [yellow, red] = TINTS.map(|largest| between(-largest, largest));
            Shape {
                centre: SIZE * DVec2::new(between(-0.5, 0.5), between(-0.5, 0.5)),
                half: half * DVec2::new(1.0, aspect),
                axis: DVec2::from_angle(between(0.0, std::f64::consts::PI)),
                is_round: between(0.0, 1.0) < 0.6,
                mean: AXES * DVec3::new(between(BRIGHTNESS[0], BRIGHTNESS[1]), yellow, red),
                contrast: between(CONTRASTS[0].ln(), CONTRASTS[1].ln()).exp(),
                offset: DVec2::new(between(-1e3, 1e3), between(-1e3, 1e3)),
            }
        };
        let mut shapes: Vec<Shape> = (0..SHAPES).map(|_| shape()).collect();
        // The ground: nothing asks whether it covers a place.
        shapes.push(shape());
        Self { octaves, shapes, noise: Noise::new(seed) }
    }

    /// Colour of a place (right, up) relative to the centre, display space; `None` beside the poster.
    pub fn colour(&self, at: DVec2) -> Option<DVec3> {
        let from_edge = (0.5 * SIZE - at.abs()).min_element();
        if from_edge < 0.0 {
            return None;
        }
        if from_edge < MARGIN {
            return Some(PAPER);
        }
        Some(self.lettering(at).unwrap_or_else(|| self.content(at)))
    }

    /// Whether a place (right, up) is in a box around lettering.
    pub fn is_lettering(&self, at: DVec2) -> bool {
        let in_box = |centre: DVec2, half: DVec2| (at - centre).abs().cmplt(half).all();
        let in_line = |(line, centre, dot): (&str, DVec2, f64)| {
            in_box(centre, dot * DVec2::new(3.0 * line.len() as f64, 4.5))
        };
        LINES.into_iter().any(in_line) || in_box(PANEL.0, PANEL.1)
    }

    /// What lettering shows at a place, if it is on any or on the panel.
    fn lettering(&self, at: DVec2) -> Option<DVec3> {
        for (line, centre, dot) in LINES {
            let has_ink = |shift: f64| text(line, at - centre - shift * dot * DOWN, dot);
            if has_ink(0.0) {
                return Some(PAPER);
            }
            if has_ink(SHADOW) {
                return Some(INK);
            }
        }
        let (centre, half) = PANEL;
        let from_centre = at - centre;
        if (half - from_centre.abs()).min_element() < 0.0 {
            return None;
        }
        let (dot, block) = self.small_print();
        let from_corner = from_centre + 0.5 * block * DOWN;
        let right_down = from_corner * DOWN;
        let is_within = right_down.cmpge(DVec2::ZERO).all() && right_down.cmplt(block).all();
        Some(if is_within && small_print(&self.noise, from_corner, dot) { INK } else { PAPER })
    }

    /// Edge of a dot of the small print, and the size of as many whole letters and lines as the panel holds, metres. Dots are as
    /// large as the finest octave's cells, but not larger than the title's.
    fn small_print(&self) -> (f64, DVec2) {
        let finest = 0.5 * SIZE.x / 2_f64.powi(self.octaves as i32 - 1);
        let dot = finest.min(TITLE_DOT);
        let letter = dot * DVec2::new(6.0, 10.0);
        (dot, letter * (2.0 * (PANEL.1 - MARGIN) / letter).floor())
    }

    /// What the poster shows apart from lettering.
    fn content(&self, at: DVec2) -> DVec3 {
        let shape = &self.shapes[self.shape(at)];
        let along = |axis: usize| octaves(&self.noise, at + shape.offset + 100.0 * axis as f64, self.octaves);
        let offset = shape.contrast * DVec3::new(along(0), CHROMA[0] * along(1), CHROMA[1] * along(2));
        (shape.mean + AXES * offset).clamp(DVec3::splat(VALUES[0]), DVec3::splat(VALUES[1]))
    }

    /// The topmost shape at a place.
    fn shape(&self, at: DVec2) -> usize {
        let (distance, length) = BEND;
        let bend = |offset: f64| self.noise.fractal(at / length + offset) - 0.5;
        let bent = at + distance * DVec2::new(bend(300.0), bend(600.0));
        let ground = self.shapes.len() - 1;
        self.shapes[..ground]
            .iter()
            .position(|s| s.covers(if s.is_round { bent } else { at }))
            .unwrap_or(ground)
    }
}

impl Shape {
    fn covers(&self, at: DVec2) -> bool {
        let from_centre = at - self.centre;
        let along = DVec2::new(from_centre.dot(self.axis), from_centre.dot(self.axis.perp())) / self.half;
        if self.is_round { along.length_squared() < 1.0 } else { along.abs().max_element() < 1.0 }
    }
}

/// Noise of `count` octaves whose standard deviations are 1 each. Equal ones make amplitudes fall as 1/f: an octave has four
/// times as many frequencies as the one before.
fn octaves(noise: &Noise, at: DVec2, count: u32) -> f64 {
    let octave = |k: u32| {
        let cells_per_metre = 2.0 / SIZE.x * 2_f64.powi(k as i32);
        let turn = DVec2::from_angle(OCTAVE_TURN * f64::from(k));
        (noise.value(turn.rotate(at) * cells_per_metre) - 0.5) / OCTAVE_SD
    };
    (0..count).map(octave).sum()
}

#[cfg(test)]
#[path = "poster_tests.rs"]
mod tests;
