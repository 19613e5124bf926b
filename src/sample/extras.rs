//! What a stress adds to the sample scene: a poster that is a mirror or a checkerboard, wires, a sky, a walking
//! figure, crossing cards.

use super::noise::Noise;
use super::options::SampleOptions;
use super::ray::{Hit, Ray, Surface};
use super::stress::StressKind as Kind;
use super::texture::{self, POSTER};
use glam::{DVec2, DVec3};

/// Distance of the back wall, and of the wires, from a typical camera, metres: what a pixel of a typical view measures.
const WALL_DISTANCE: f64 = 3.0;
const WIRE_DISTANCE: f64 = 2.3;

/// Positions of the wires: x of each, and their z.
const WIRES_X: [f64; 7] = [-1.35, -0.95, -0.45, 0.02, 0.4, 0.9, 1.4];
const WIRES_Z: f64 = 0.75;

/// Height of the walls under a sky.
const LOW_WALL: f64 = 0.55;
/// Distance at which the sky is said to be.
pub const SKY_DISTANCE: f64 = 1e4;

/// Radius and height of the figure's body, radius of its head.
const BODY: (f64, f64) = (0.17, 1.1);
const HEAD: f64 = 0.14;

/// The cards: centre on the floor, half width, height.
const CARDS: (DVec3, f64, f64) = (DVec3::new(0.38, 0.0, -0.62), 0.22, 0.42);

/// The poster on the back wall.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Poster {
    /// Printed.
    Print,
    /// A checkerboard with this period, metres.
    Checker(f64),
    Mirror,
}

/// Additions to the scene.
#[derive(Clone, Copy, Debug)]
pub struct Extras {
    pub poster: Poster,
    /// Radius of the wires, metres.
    pub wires: Option<f64>,
    pub sky: bool,
    /// Where the figure stands on the floor.
    pub walker: Option<DVec3>,
    pub cards: bool,
}

impl Extras {
    /// What the options ask for. Lengths in pixels are those of a view with `focal_px`.
    pub fn new(options: &SampleOptions, focal_px: f64) -> Self {
        let level = |kind| options.stress.and_then(|s| s.level_of(kind));
        let checker = level(Kind::Checker).map(|px| Poster::Checker(px * WALL_DISTANCE / focal_px));
        Self {
            poster: match level(Kind::Mirror) {
                Some(_) => Poster::Mirror,
                None => checker.unwrap_or(Poster::Print),
            },
            wires: level(Kind::Wires).map(|px| 0.5 * px * WIRE_DISTANCE / focal_px),
            sky: level(Kind::Sky).is_some(),
            walker: None,
            cards: level(Kind::Cards).is_some(),
        }
    }

    /// Whether a hit belongs to what the stress is about.
    pub fn is_region(&self, hit: &Hit) -> bool {
        match hit.surface {
            Surface::Wire(_) | Surface::Figure(_) | Surface::Card(_) | Surface::Sky => true,
            Surface::Room(2, true) => self.poster != Poster::Print && on_poster(hit),
            _ => false,
        }
    }

    /// Whether a hit is on the mirror.
    pub fn is_mirror(&self, hit: &Hit) -> bool {
        self.poster == Poster::Mirror && hit.surface == Surface::Room(2, true) && on_poster(hit)
    }

    /// Whether the room ends in the sky at a position on its walls or ceiling.
    pub fn is_sky(&self, position: DVec3) -> bool {
        self.sky && position.y < -LOW_WALL
    }

    /// The nearest hit of the additions before `limit`.
    pub fn cast(&self, ray: &Ray, limit: f64) -> Option<Hit> {
        let mut best: Option<Hit> = None;
        let mut offer = |found: Option<(f64, DVec3, Surface)>| {
            let Some((t, normal, surface)) = found else { return };
            if t > 1e-9 && t < best.map_or(limit, |b| b.t) {
                best = Some(Hit { t, position: ray.origin + t * ray.direction, normal, surface });
            }
        };
        if let Some(radius) = self.wires {
            for (index, x) in WIRES_X.into_iter().enumerate() {
                let axis = DVec3::new(x, 0.0, WIRES_Z);
                offer(upright(ray, axis, radius, f64::INFINITY).map(|(t, n)| (t, n, Surface::Wire(index))));
            }
        }
        if let Some(foot) = self.walker {
            offer(upright(ray, foot, BODY.0, BODY.1).map(|(t, n)| (t, n, Surface::Figure(false))));
            let head = foot - DVec3::new(0.0, BODY.1 + HEAD, 0.0);
            offer(ball(ray, head, HEAD).map(|(t, n)| (t, n, Surface::Figure(true))));
        }
        if self.cards {
            for index in 0..2 {
                offer(card(ray, index).map(|(t, n)| (t, n, Surface::Card(index))));
            }
        }
        best
    }
}

/// Position on the poster of a hit on the back wall, relative to the poster's centre.
pub fn poster_coordinates(position: DVec3) -> DVec2 {
    DVec2::new(position.x, -position.y - 1.0) - POSTER.0
}

fn on_poster(hit: &Hit) -> bool {
    poster_coordinates(hit.position).abs().cmplt(POSTER.1).all()
}

/// Entry into an upright cylinder on the floor: t and normal.
fn upright(ray: &Ray, foot: DVec3, radius: f64, height: f64) -> Option<(f64, DVec3)> {
    let (o, d) = (ray.origin - foot, ray.direction);
    let (o2, d2) = (DVec2::new(o.x, o.z), DVec2::new(d.x, d.z));
    let t = enter(d2.length_squared(), o2.dot(d2), o2.length_squared() - radius * radius)?;
    let at = o + t * d;
    (at.y <= 0.0 && at.y >= -height).then(|| (t, DVec3::new(at.x, 0.0, at.z) / radius))
}

/// Entry into a ball: t and normal.
fn ball(ray: &Ray, centre: DVec3, radius: f64) -> Option<(f64, DVec3)> {
    let (o, d) = (ray.origin - centre, ray.direction);
    let t = enter(d.length_squared(), o.dot(d), o.length_squared() - radius * radius)?;
    Some((t, (o + t * d) / radius))
}

/// Smaller root of `a t^2 + 2 b t + c`.
fn enter(a: f64, b: f64, c: f64) -> Option<f64> {
    let discriminant = b * b - a * c;
    (discriminant > 0.0).then(|| (-b - discriminant.sqrt()) / a)
}

/// Direction of a card along the floor.
fn card_axis(index: usize) -> DVec3 {
    let angle = [0.35_f64, 0.35 + std::f64::consts::FRAC_PI_2][index];
    DVec3::new(angle.cos(), 0.0, angle.sin())
}

/// Position on a card, and its half size.
fn card_coordinates(position: DVec3, index: usize) -> (DVec2, DVec2) {
    let (foot, half_width, height) = CARDS;
    let from_foot = position - foot;
    (
        DVec2::new(from_foot.dot(card_axis(index)), -from_foot.y - 0.5 * height),
        DVec2::new(half_width, 0.5 * height),
    )
}

fn card(ray: &Ray, index: usize) -> Option<(f64, DVec3)> {
    let normal = card_axis(index).cross(DVec3::Y);
    let t = (CARDS.0 - ray.origin).dot(normal) / ray.direction.dot(normal);
    let (at, half) = card_coordinates(ray.origin + t * ray.direction, index);
    let towards = -ray.direction.dot(normal).signum();
    at.abs().cmplt(half).all().then_some((t, towards * normal))
}

/// Albedo of the additions, linear light; of the sky its radiance.
pub fn albedo(noise: &Noise, hit: &Hit) -> DVec3 {
    match hit.surface {
        Surface::Wire(index) if index % 2 == 0 => DVec3::splat(0.02),
        Surface::Wire(_) => DVec3::new(0.85, 0.8, 0.2),
        Surface::Figure(true) => DVec3::new(0.6, 0.38, 0.27),
        Surface::Figure(false) => {
            let stripe = (hit.position.y / 0.12).floor().rem_euclid(2.0) < 0.5;
            if stripe { DVec3::new(0.05, 0.08, 0.3) } else { DVec3::new(0.75, 0.7, 0.65) }
        }
        Surface::Card(index) => {
            let (at, half) = card_coordinates(hit.position, index);
            if index == 0 {
                texture::carton_face(noise, at, half)
            } else {
                texture::crate_face(noise, at, half)
            }
        }
        _ => sky(noise, hit.position / SKY_DISTANCE),
    }
}

/// Clouds over a gradient; `direction` is a unit vector, y down.
fn sky(noise: &Noise, direction: DVec3) -> DVec3 {
    let up = (-direction.y).clamp(0.0, 1.0);
    let clear = DVec3::new(0.55, 0.68, 0.85).lerp(DVec3::new(0.13, 0.3, 0.68), up.sqrt());
    let at = DVec2::new(direction.x, direction.z) / (up + 0.15);
    let cloud = ((noise.fractal(1.7 * at) - 0.5) * 3.0).clamp(0.0, 1.0);
    clear.lerp(DVec3::splat(0.85), cloud)
}
