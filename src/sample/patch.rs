//! Scenes in the plane z = 0: squares with interpolated grids of colours, which fade continuously into the grey around
//! them, so that no edge is harder than the colours themselves; and the poster, which has hard edges.

use super::poster::{self, Poster};
use super::random::{Stream, stream, uniform};
use super::ray::Ray;
use super::scenes::{NamedScene, SceneKind as Kind};
use glam::{DVec2, DVec3};
use rand_pcg::Pcg32;
use serde::Serialize;

/// Everything around a scene, display space; photos round it to 128 of 255.
pub const GREY: f64 = 0.5;

/// Range of random colours, display space.
const VALUES: [f64; 2] = [0.2, 0.8];

/// Side of the square, metres.
const SIDE: f64 = 1.0;

/// Stripes across the square, and grid lines along them: the stripes fade within a quarter of the square at either end.
const STRIPES: [usize; 2] = [15, 3];

/// Grids of the quilt: colours along each side.
const QUILT: [usize; 2] = [16, 32];

/// Colours at the sides of the ramp.
const RAMP: [f64; 2] = [0.3, 0.7];

/// Colours along each side of the wall with a gloss, and their range: with the gloss none is clipped.
const GLOSSY_WALL: usize = 8;
const GLOSSY_VALUES: [f64; 2] = [0.2, 0.7];

/// Exponent of the gloss (Phong), and what it adds at most.
const GLOSS_EXPONENT: f64 = 20.0;
const GLOSS_STRENGTH: f64 = 0.3;

/// Share of the square on which the gloss has at least half its strength.
const GLOSS_SHARE: f64 = 0.1;

/// Direction into which the gloss is strongest, not normalised; the cameras are at negative z.
const GLOSS_TOWARDS: DVec3 = DVec3::new(0.15, -0.2, -1.0);

/// A square with a grid of colours, interpolated linearly along both axes, which fade to grey within one cell.
#[derive(Clone, Debug, Serialize)]
pub struct Grid {
    /// Centre of the square, metres.
    centre: DVec2,
    /// Direction of its first axis, a unit vector; the second is perpendicular.
    axis: DVec2,
    /// Side of the square, metres.
    side: f64,
    /// Number of colours along both axes.
    counts: [usize; 2],
    /// Colours minus grey, the first axis fastest.
    values: Vec<DVec3>,
}

impl Grid {
    fn new(centre: DVec2, side: f64, counts: [usize; 2], mut value: impl FnMut([usize; 2]) -> DVec3) -> Self {
        let values =
            (0..counts[0] * counts[1]).map(|i| value([i % counts[0], i / counts[0]]) - GREY).collect();
        Self { centre, axis: DVec2::X, side, counts, values }
    }

    /// Random colours of a range along each side.
    fn random(centre: DVec2, side: f64, count: usize, range: [f64; 2], rng: &mut Pcg32) -> Self {
        Self::new(centre, side, [count; 2], |_| random_colour(range, rng))
    }

    /// What the grid adds to grey.
    fn offset(&self, at: DVec2) -> DVec3 {
        let from_centre = at - self.centre;
        let along =
            DVec2::new(from_centre.dot(self.axis), from_centre.dot(self.axis.perp())) / self.side + 0.5;
        let [u, v] = [0, 1].map(|k| along[k] * (self.counts[k] + 1) as f64 - 1.0);
        let mut sum = DVec3::ZERO;
        for (di, dj) in [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (1.0, 1.0)] {
            let (i, j) = (u.floor() + di, v.floor() + dj);
            let weight = (1.0 - (u - i).abs()) * (1.0 - (v - j).abs());
            let is_inside = |x: f64, k: usize| x >= 0.0 && x < self.counts[k] as f64;
            if is_inside(i, 0) && is_inside(j, 1) {
                sum += weight * self.values[i as usize + self.counts[0] * j as usize];
            }
        }
        sum
    }
}

fn random_colour([low, high]: [f64; 2], rng: &mut Pcg32) -> DVec3 {
    DVec3::from_array([0; 3].map(|_| low + (high - low) * uniform(rng)))
}

/// A scene of grids or a poster in one plane.
#[derive(Clone, Debug, Serialize)]
pub struct Patch {
    kind: Kind,
    grids: Vec<Grid>,
    #[serde(skip_serializing_if = "Option::is_none")]
    poster: Option<Poster>,
    /// Largest change of a value before it is rounded, of 255.
    pub dither: f64,
}

impl Patch {
    /// The patch of a scene; that of `Planted` is empty.
    pub fn new(scene: NamedScene, seed: u64) -> Self {
        let mut rng = stream(seed, Stream::Grids, 0);
        let rng = &mut rng;
        let grids = match scene.kind {
            Kind::Wall => vec![Grid::random(DVec2::ZERO, SIDE, scene.level as usize, VALUES, rng)],
            Kind::Gloss => vec![Grid::random(DVec2::ZERO, SIDE, GLOSSY_WALL, GLOSSY_VALUES, rng)],
            Kind::Stripes => {
                let colours: Vec<DVec3> = (0..STRIPES[0]).map(|_| random_colour(VALUES, rng)).collect();
                let axis = DVec2::from_angle(scene.level.to_radians());
                vec![Grid { axis, ..Grid::new(DVec2::ZERO, SIDE, STRIPES, |[stripe, _]| colours[stripe]) }]
            }
            Kind::Quilt => {
                let quarter = 0.25 * SIDE;
                let [coarse, fine] = QUILT;
                vec![
                    Grid::new(DVec2::new(quarter, -quarter), 0.5 * SIDE, [2; 2], |[i, _]| {
                        DVec3::splat(RAMP[i])
                    }),
                    Grid::random(DVec2::new(-quarter, quarter), 0.5 * SIDE, coarse, VALUES, rng),
                    Grid::random(DVec2::new(quarter, quarter), 0.5 * SIDE, fine, VALUES, rng),
                ]
            }
            Kind::Flat | Kind::Planted | Kind::Poster => Vec::new(),
        };
        let dither = if scene.kind == Kind::Flat { scene.level } else { 0.0 };
        let poster = (scene.kind == Kind::Poster).then(|| Poster::new(scene.level as u32, seed));
        Self { kind: scene.kind, grids, poster, dither }
    }

    /// Colour along a ray, display space.
    pub fn seen(&self, ray: &Ray) -> DVec3 {
        hit(ray).map_or(DVec3::splat(GREY), |at| self.colour(at, -ray.direction))
    }

    /// Colour of a place as seen from a direction of any length, display space.
    pub fn colour(&self, at: DVec2, towards: DVec3) -> DVec3 {
        if let Some(poster) = &self.poster {
            return poster.colour(right_up(at)).unwrap_or(DVec3::splat(GREY));
        }
        let gloss = if self.kind == Kind::Gloss { gloss(at, towards) } else { 0.0 };
        self.grids.iter().map(|grid| grid.offset(at)).sum::<DVec3>() + GREY + gloss
    }

    /// Whether the scene is about the place that a ray meets: the easy quadrants of the quilt, the gloss,
    /// the lettering of the poster.
    pub fn is_region(&self, ray: &Ray) -> bool {
        hit(ray).is_some_and(|at| match self.kind {
            Kind::Quilt => at.abs().max_element() < 0.5 * SIDE && at.y < 0.0,
            Kind::Gloss => at.length() < gloss_radius(),
            Kind::Poster => self.poster.as_ref().is_some_and(|poster| poster.is_lettering(right_up(at))),
            _ => false,
        })
    }

    /// A random place on the square or the poster.
    pub fn place(&self, rng: &mut Pcg32) -> DVec2 {
        let size = if self.poster.is_some() { poster::SIZE } else { DVec2::splat(SIDE) };
        let within = size * (DVec2::new(uniform(rng), uniform(rng)) - 0.5);
        self.grids.first().map_or(within, |grid| grid.axis.rotate(within))
    }
}

/// Where a ray meets the plane.
fn hit(ray: &Ray) -> Option<DVec2> {
    let t = -ray.origin.z / ray.direction.z;
    (t > 0.0 && t.is_finite()).then(|| (ray.origin + t * ray.direction).truncate())
}

/// A place as the cameras see it: y is down in the plane.
fn right_up(at: DVec2) -> DVec2 {
    DVec2::new(at.x, -at.y)
}

/// Distance from the centre at which the gloss has half its strength.
fn gloss_radius() -> f64 {
    SIDE * (GLOSS_SHARE / std::f64::consts::PI).sqrt()
}

fn gloss(at: DVec2, towards: DVec3) -> f64 {
    let cosine = GLOSS_TOWARDS.normalize().dot(towards.normalize()).max(0.0);
    let share = 0.5_f64.powf(at.length_squared() / gloss_radius().powi(2));
    GLOSS_STRENGTH * share * cosine.powf(GLOSS_EXPONENT)
}
