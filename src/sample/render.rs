//! Images and depths of the sample scene by ray casting: Lambertian shading under an area light, a
//! fill light and ambient light. Nothing is view-dependent, so every surface point has one colour in
//! all images.

use super::patch::Patch;
use super::random::{Stream, normal_pair, stream, uniform};
use super::ray::{Hit, Ray, Surface};
use super::scene::Scene;
use super::views::View;
use crate::camera::{Pinhole, RigidTransform};
use glam::{DVec2, DVec3};
use rayon::prelude::*;

/// Share of the light that the mirror reflects.
const REFLECTANCE: f64 = 0.85;

/// Light samples along an edge of the area light.
const LIGHT_GRID: u32 = 3;
/// Centre of the area light: above, in front and to the left.
const LIGHT_CENTRE: DVec3 = DVec3::new(-1.0, -2.45, -1.3);
/// Edge length of the area light.
const LIGHT_EDGE: f64 = 0.7;

/// Linear radiance at a hit. Sample number `sample` of the `LIGHT_GRID^2` on the area light stands for
/// all of it.
fn radiance(scene: &Scene, hit: &Hit, sample: u32) -> DVec3 {
    let cell = |i: u32| (f64::from(i) + 0.5) / f64::from(LIGHT_GRID) - 0.5;
    let on_light = DVec3::new(cell(sample % LIGHT_GRID), 0.0, cell(sample / LIGHT_GRID % LIGHT_GRID));
    let origin = hit.position + 1e-6 * hit.normal;
    let direction = LIGHT_CENTRE + LIGHT_EDGE * on_light - origin;
    let distance_squared = direction.length_squared();
    let cosine = direction.dot(hit.normal) / distance_squared.sqrt();
    let key = if cosine > 0.0 && !scene.occludes(&Ray { origin, direction }) {
        9.0 * cosine / (1.0 + distance_squared)
    } else {
        0.0
    };
    let fill = 0.16 * hit.normal.dot(DVec3::new(0.5, -0.45, -0.74)).max(0.0);
    // Ambient light is stronger from above.
    let ambient = (0.25 - 0.07 * hit.normal.y) * scene.openness(hit);
    let light = key * DVec3::new(1.0, 0.95, 0.86)
        + fill * DVec3::new(0.85, 0.93, 1.0)
        + ambient * DVec3::new(0.93, 0.97, 1.0);
    scene.albedo(hit) * light
}

/// Linear radiance along a ray.
fn seen(scene: &Scene, ray: &Ray, sample: u32) -> DVec3 {
    let hit = scene.cast(ray);
    if hit.surface == Surface::Sky {
        return scene.albedo(&hit);
    }
    if !scene.extras.is_mirror(&hit) {
        return radiance(scene, &hit, sample);
    }
    let direction = ray.direction - 2.0 * ray.direction.dot(hit.normal) * hit.normal;
    let reflected = scene.cast(&Ray { origin: hit.position + 1e-6 * hit.normal, direction });
    REFLECTANCE * radiance(scene, &reflected, sample)
}

/// sRGB transfer function, clipped to [0, 1].
pub fn display_from_linear(linear: f64) -> f64 {
    let v = linear.clamp(0.0, 1.0);
    if v <= 0.003_130_8 { 12.92 * v } else { 1.055 * v.powf(1.0 / 2.4) - 0.055 }
}

/// The 8 bits of a value in display space, clipped to [0, 1].
pub fn byte(display: f64) -> u8 {
    (display.clamp(0.0, 1.0) * 255.0).round() as u8
}

fn rgb8(linear: DVec3) -> [u8; 3] {
    linear.to_array().map(|v| byte(display_from_linear(v)))
}

/// Colour of a surface point under all light samples, 8 bits, display space.
pub fn point_colour(scene: &Scene, hit: &Hit) -> [u8; 3] {
    let samples = LIGHT_GRID * LIGHT_GRID;
    let sum: DVec3 = (0..samples).map(|s| radiance(scene, hit, s)).sum();
    rgb8(sum / f64::from(samples))
}

/// Ray through an image position. The `t` of a hit is its depth along the optical axis.
pub fn ray_through(pinhole: &Pinhole, camera_from_scene: &RigidTransform, position_px: DVec2) -> Ray {
    Ray {
        origin: camera_from_scene.origin_of_a_in_b(),
        direction: camera_from_scene.rotation.transpose() * pinhole.direction_in_camera(position_px),
    }
}

/// Photo with `supersampling`^2 rays per pixel, averaged in linear light; 8 bits, display space.
/// `[height, width, 3]`
pub fn photo(scene: &Scene, view: &View, supersampling: u32) -> Vec<u8> {
    exposed(scene, view, supersampling, &|_| view.camera_from_capture)
}

/// The same while the camera moves: `pose_at` says where it is from the beginning, 0, to the end of the exposure, 1. The rays
/// of each pixel are spread over that time.
pub fn exposed(
    scene: &Scene,
    view: &View,
    supersampling: u32,
    pose_at: &(dyn Fn(f64) -> RigidTransform + Sync),
) -> Vec<u8> {
    let pinhole = &view.pinhole;
    let mut rgb = vec![0; 3 * pinhole.num_pixels()];
    let (rays, samples) = (f64::from(supersampling), supersampling * supersampling);
    // Neither direction within the pixel goes with time: the motion would seem longer one way than the other.
    let step = (7 * samples / 9..).find(|step| is_coprime(*step, samples)).unwrap_or(1);
    let time_of = |sample: u32| (f64::from(sample * step % samples) + 0.5) / f64::from(samples);
    let poses: Vec<RigidTransform> = (0..samples).map(|sample| pose_at(time_of(sample))).collect();
    rgb.par_chunks_exact_mut(3 * pinhole.width_px as usize).enumerate().for_each(|(y, row)| {
        for (x, pixel) in row.chunks_exact_mut(3).enumerate() {
            let mut sum = DVec3::ZERO;
            for sample in 0..samples {
                let (i, j) = (sample % supersampling, sample / supersampling);
                let within = DVec2::new(f64::from(i) + 0.5, f64::from(j) + 0.5) / rays;
                let at = DVec2::new(x as f64, y as f64) + within;
                let ray = ray_through(pinhole, &poses[sample as usize], at);
                // 7 and 9 are coprime: the 3 x 3 rays of a pixel sample each part of the light once.
                sum += seen(scene, &ray, 7 * sample + (x + 2 * y) as u32 % 9);
            }
            pixel.copy_from_slice(&rgb8(view.gain * sum / (rays * rays)));
        }
    });
    rgb
}

fn is_coprime(a: u32, b: u32) -> bool {
    if b == 0 { a == 1 } else { is_coprime(b, a % b) }
}

/// Photo of a patch with `supersampling`^2 rays per pixel, averaged in display space. `[height, width]`
pub fn patch(patch: &Patch, view: &View, supersampling: u32) -> Vec<DVec3> {
    let (pinhole, rays) = (&view.pinhole, f64::from(supersampling));
    let width = pinhole.width_px as usize;
    let pixel = |i: usize| {
        let corner = DVec2::new((i % width) as f64, (i / width) as f64);
        let samples = (0..supersampling * supersampling).map(|sample| {
            let (i, j) = (sample % supersampling, sample / supersampling);
            let at = corner + DVec2::new(f64::from(i) + 0.5, f64::from(j) + 0.5) / rays;
            patch.seen(&ray_through(pinhole, &view.camera_from_capture, at))
        });
        samples.sum::<DVec3>() / (rays * rays)
    };
    (0..pinhole.num_pixels()).into_par_iter().map(pixel).collect()
}

/// The 8 bits of colours in display space, each changed before by up to `dither`, of 255; `photo` selects the random
/// numbers.
pub fn dithered(colours: &[DVec3], dither: f64, seed: u64, photo: usize) -> Vec<u8> {
    let mut rng = stream(seed, Stream::PhotoNoise, photo);
    let mut value = |v: f64| {
        let change = if dither > 0.0 { dither * (2.0 * uniform(&mut rng) - 1.0) } else { 0.0 };
        byte(v + change / 255.0)
    };
    colours.iter().flat_map(|colour| colour.to_array().map(&mut value)).collect()
}

/// Adds Gaussian noise of standard deviation `sd`, of 255; `photo` selects the random numbers.
pub fn add_noise(rgb: &mut [u8], sd: f64, seed: u64, photo: usize) {
    let mut rng = stream(seed, Stream::PhotoNoise, photo);
    for pair in rgb.chunks_mut(2) {
        for (value, noise) in pair.iter_mut().zip(normal_pair(&mut rng).to_array()) {
            *value = (f64::from(*value) + sd * noise).round().clamp(0.0, 255.0) as u8;
        }
    }
}

/// Which pixels show, in their centres, what the stress is about: 255 or 0. `[height, width]`
pub fn region(
    is_region: impl Fn(&Ray) -> bool,
    pinhole: &Pinhole,
    camera_from_scene: &RigidTransform,
) -> Vec<u8> {
    at_centres(pinhole, camera_from_scene, |ray| if is_region(ray) { 255 } else { 0 })
}

/// Depth along the optical axis at pixel centres, metres. `[height, width]`
pub fn depth(scene: &Scene, pinhole: &Pinhole, camera_from_scene: &RigidTransform) -> Vec<f32> {
    at_centres(pinhole, camera_from_scene, |ray| scene.cast(ray).t as f32)
}

fn at_centres<T>(pinhole: &Pinhole, camera_from_scene: &RigidTransform, value: impl Fn(&Ray) -> T) -> Vec<T> {
    let width = pinhole.width_px as usize;
    (0..pinhole.num_pixels())
        .map(|i| {
            let at = DVec2::new((i % width) as f64 + 0.5, (i / width) as f64 + 0.5);
            value(&ray_through(pinhole, camera_from_scene, at))
        })
        .collect()
}
