//! Random scenes for comparing renderers: splats of all orientations in front of a camera, with maps of various
//! sizes, and a photo that does not resemble them.

use crate::camera::{Camera, Pinhole, RigidTransform, Similarity};
use crate::image::TargetImage;
use crate::model::{Filter, Model, SplatArrays, TextureMap, TexturePool};
use glam::{DMat3, DQuat, DVec3};
use rand::{Rng, RngExt as _, SeedableRng as _};
use rand_pcg::Pcg64Mcg;

/// Options of a random scene.
#[derive(Clone, Debug)]
pub struct SceneOptions {
    /// Number of splats.
    pub num_splats: usize,
    /// Largest SH degree: splat i has the smaller of this and i mod 5.
    pub sh_degree: u32,
    /// Rows and columns of the maps, drawn at random for each splat; (0, 0) is untextured.
    pub map_sizes: Vec<(u16, u16)>,
    /// Width of the image.
    pub width_px: u32,
    /// Height of the image.
    pub height_px: u32,
    /// Range of the standard deviations, local units, log-uniform.
    pub scales: (f64, f64),
    /// Range of the opacities, uniform.
    pub opacities: (f64, f64),
    /// Range of the centres' depths, uniform.
    pub depths: (f64, f64),
    /// Low-pass filter in the image.
    pub filter: Filter,
    /// Seed of the random numbers.
    pub seed: u64,
}

impl Default for SceneOptions {
    fn default() -> Self {
        Self {
            num_splats: 2_000,
            sh_degree: 3,
            map_sizes: vec![(4, 4), (2, 2), (9, 5), (3, 8), (0, 0), (16, 12)],
            width_px: 150,
            height_px: 101,
            scales: (0.01, 0.2),
            opacities: (0.02, 0.999),
            depths: (0.3, 3.0),
            filter: Filter::Ewa,
            seed: 1,
        }
    }
}

/// A random model, with a camera that sees it and a photo.
pub struct RandomScene {
    /// Splats and texture maps.
    pub model: Model,
    /// Camera of the view.
    pub camera: Camera,
    /// Photo of the view.
    pub target: TargetImage,
}

/// Near plane of the random scenes.
const NEAR: f32 = 0.04;

/// Generates a random scene.
///
/// # Panics
/// If its maps have too many texels for 32-bit indices.
pub fn random_scene(options: &SceneOptions) -> RandomScene {
    let mut rng = Pcg64Mcg::seed_from_u64(options.seed);
    let camera = random_camera(options, &mut rng);
    let local_from_camera = camera.camera_from_local.inverse();
    let n = options.num_splats;
    let mut splats = SplatArrays::zeros(n, options.sh_degree);
    let degrees: Vec<u8> = (0..n).map(|i| (i % 5).min(options.sh_degree as usize) as u8).collect();
    let mut maps = Vec::new();
    for i in 0..n {
        let depth = rng.random_range(options.depths.0..=options.depths.1);
        let px = glam::DVec2::new(
            rng.random_range(-0.1..1.1) * f64::from(options.width_px),
            rng.random_range(-0.1..1.1) * f64::from(options.height_px),
        );
        let position = local_from_camera.transform_point(camera.pinhole.direction_in_camera(px) * depth);
        (0..3).for_each(|k| splats.positions[3 * i + k] = position[k] as f32);
        (0..4).for_each(|k| splats.quaternions[4 * i + k] = normal(&mut rng) as f32);
        let log_range = options.scales.0.ln()..=options.scales.1.ln();
        (0..2).for_each(|k| splats.log_scales[2 * i + k] = rng.random_range(log_range.clone()) as f32);
        let opacity: f64 = rng.random_range(options.opacities.0..=options.opacities.1);
        splats.opacity_logits[i] = (opacity / (1.0 - opacity)).ln() as f32;
        for (k, c) in splats.sh_of_mut(i).iter_mut().enumerate() {
            let spread = if k < 3 { 1.2 } else { 0.25 };
            *c = (spread * normal(&mut rng)) as f32;
        }
        let (rows, cols) = options.map_sizes[rng.random_range(0..options.map_sizes.len())];
        let half = 2.5 * splats.log_scales[2 * i].max(splats.log_scales[2 * i + 1]).exp();
        let size = 2.0 * half / f32::from(rows.max(cols).max(2) - 1);
        // Edges that differ along the axes, and maps off the centre, the same for a splat in every scene.
        let edges = [[size; 2], [size, 0.7 * size], [0.8 * size, size]][i % 3];
        let shift = [[0, 0], [1, -1], [0, 2], [-3, 0], [0, 0]][i % 5];
        maps.push(TextureMap { shift, ..TextureMap::centred(rows, cols, edges) });
    }
    splats.set_sh_degrees(&degrees);
    let mut textures = TexturePool::neutral(maps).expect("random scenes have few texels");
    textures.texels.iter_mut().for_each(|t| *t = (1.5 * normal(&mut rng)) as f32);
    let model = Model {
        splats,
        textures,
        near: NEAR,
        filter: options.filter,
        capture_from_local: Similarity::IDENTITY,
    };
    let target = random_target(options, &mut rng);
    RandomScene { model, camera, target }
}

fn random_camera(options: &SceneOptions, rng: &mut Pcg64Mcg) -> Camera {
    let (w, h) = (f64::from(options.width_px), f64::from(options.height_px));
    let rotation =
        DMat3::from_quat(DQuat::from_xyzw(normal(rng), normal(rng), normal(rng), normal(rng)).normalize());
    Camera {
        pinhole: Pinhole {
            width_px: options.width_px,
            height_px: options.height_px,
            fx_px: 0.9 * w.max(h),
            fy_px: 0.95 * w.max(h),
            cx_px: 0.47 * w,
            cy_px: 0.55 * h,
        },
        camera_from_local: RigidTransform {
            rotation,
            translation: DVec3::new(normal(rng), normal(rng), normal(rng)) * 0.3,
        },
    }
}

/// Smooth coloured waves, which differ from the rendered image everywhere, so that no pixel is at the kink of
/// the L1 term.
fn random_target(options: &SceneOptions, rng: &mut Pcg64Mcg) -> TargetImage {
    let mut rgb = Vec::new();
    let frequencies: [f64; 3] = [0.05, 0.083, 0.11].map(|f| f * rng.random_range(0.8..1.2));
    for y in 0..options.height_px {
        for x in 0..options.width_px {
            for (c, f) in frequencies.iter().enumerate() {
                let wave = (f64::from(x) * f + c as f64).sin() * (f64::from(y) * f * 0.7 + 1.0).cos();
                rgb.push((127.5 + 110.0 * wave) as u8);
            }
        }
    }
    TargetImage::opaque(options.width_px, options.height_px, rgb)
}

/// Standard normal variate (Box-Muller).
fn normal(rng: &mut impl Rng) -> f64 {
    let radius = (-2.0 * (1.0 - rng.random::<f64>()).ln()).sqrt();
    radius * (std::f64::consts::TAU * rng.random::<f64>()).cos()
}
