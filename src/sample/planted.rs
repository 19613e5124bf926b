//! A scene that is a model: splats with texture maps that do not overlap, rendered by the reference with several rays
//! per pixel and without a low-pass filter.

use super::patch::GREY;
use super::random::{Stream, normal_vector, stream, uniform};
use crate::backend::ColourMap;
use crate::camera::{Camera, Pinhole, RigidTransform, Similarity};
use crate::constants::{NEAR_MAX, SH_0};
use crate::model::{Filter, Model, SplatArrays, TextureMap, TexturePool};
use crate::reference::{AlphaCutoff, ColourGradient, Params, Settings, pixel_bounds, project, raster_fwd};
use glam::{DQuat, DVec3};
use rayon::prelude::*;
use serde_json::{Value, json};

/// Splats along each side, and the distance between their centres, metres.
const SIDE: usize = 8;
const SPACING: f64 = 0.145;

/// Range of the standard deviations, metres. The support of the largest is half the spacing.
const SIGMAS: [f64; 2] = [0.016, 0.021];

/// Opacity of all splats.
const OPACITY: f64 = 0.9;

/// Rows and columns of the maps; they extend to three standard deviations.
const MAP_SIDE: u16 = 8;

/// Residuals of texels, up or down: little of a photo shows the splats, so that weaker ones would hardly count.
const RESIDUAL: f64 = 0.45;

/// Largest tilt of a splat, degrees, and largest distance of its centre from the plane z = 0, metres.
const TILT_DEG: f64 = 25.0;
const DEPTH: f64 = 0.03;

/// Distance of points from the centres of their splats, in standard deviations of the splat.
const POINT_JITTER: f64 = 0.7;

/// The model of the scene `planted`, in the frame of the capture: 64 splats of degree 0, each with a map of 8 x 8
/// texels, grey but for their residuals.
pub fn planted_model(seed: u64) -> Model {
    let mut rng = stream(seed, Stream::Grids, 1);
    let mut between = |low: f64, high: f64| low + (high - low) * uniform(&mut rng);
    let n = SIDE * SIDE;
    let mut splats = SplatArrays::zeros(n, 0);
    let mut maps = Vec::with_capacity(n);
    for i in 0..n {
        let along = |k: usize| (k as f64 - 0.5 * (SIDE as f64 - 1.0)) * SPACING;
        let centre = DVec3::new(along(i % SIDE), along(i / SIDE), between(-DEPTH, DEPTH));
        let tilt_axis = between(0.0, std::f64::consts::TAU);
        let tilt = between(0.0, TILT_DEG.to_radians());
        let rotation = DQuat::from_axis_angle(DVec3::new(tilt_axis.cos(), tilt_axis.sin(), 0.0), tilt)
            * DQuat::from_rotation_z(between(0.0, std::f64::consts::TAU));
        let sigmas = [0; 2].map(|_| between(SIGMAS[0], SIGMAS[1]));
        let write = |to: &mut [f32], from: &[f64]| {
            to.iter_mut().zip(from).for_each(|(to, from)| *to = *from as f32);
        };
        write(&mut splats.positions[3 * i..], &centre.to_array());
        write(&mut splats.quaternions[4 * i..], &[rotation.w, rotation.x, rotation.y, rotation.z]);
        write(&mut splats.log_scales[2 * i..], &sigmas.map(f64::ln));
        splats.opacity_logits[i] = (OPACITY / (1.0 - OPACITY)).ln() as f32;
        splats.sh[3 * i..3 * i + 3].fill(((GREY - 0.5) / SH_0) as f32);
        let texel_size = 6.0 * sigmas[0].max(sigmas[1]) / f64::from(MAP_SIDE);
        maps.push(TextureMap::square(MAP_SIDE, MAP_SIDE, texel_size as f32));
    }
    let mut textures = TexturePool::neutral(maps).unwrap_or_default();
    textures.texels.iter_mut().for_each(|texel| {
        let sign = if between(0.0, 1.0) < 0.5 { -1.0 } else { 1.0 };
        *texel = (2.0 * sign * RESIDUAL.atanh()) as f32;
    });
    Model {
        splats,
        textures,
        near: NEAR_MAX as f32,
        filter: Filter::None,
        capture_from_local: Similarity::IDENTITY,
    }
}

/// The model, ready to be seen.
#[derive(Clone, Debug)]
pub struct Planted {
    params: Params,
    seed: u64,
}

impl Planted {
    /// The scene of a seed.
    pub fn new(seed: u64) -> Self {
        Self { params: Params::from_model(&planted_model(seed)), seed }
    }

    /// Colours of a photo, display space: means over `rays` x `rays` rays per pixel. `[height, width]`
    pub fn photo(&self, pinhole: &Pinhole, pose: &RigidTransform, rays: u32) -> Vec<DVec3> {
        let fine = pinhole.resized(rays * pinhole.width_px, rays * pinhole.height_px);
        let row = |y: u32| {
            let cy_px = fine.cy_px - f64::from(rays * y);
            let band = Pinhole { height_px: rays, cy_px, ..fine };
            self.means(&Camera { pinhole: band, camera_from_local: *pose }, rays as usize)
        };
        (0..pinhole.height_px).into_par_iter().flat_map_iter(row).collect()
    }

    /// Means over squares of `rays` x `rays` pixels of an image that is one square high.
    fn means(&self, camera: &Camera, rays: usize) -> Vec<DVec3> {
        let settings = Settings {
            cutoff: AlphaCutoff::Hard,
            colour_gradient: ColourGradient::Strict,
            near: NEAR_MAX,
            filter_px2: 0.0,
            sh_degree: 0,
            background: [GREY; 3],
            exposure: ColourMap::IDENTITY,
        };
        let projected: Vec<_> = (0..self.params.splats.len())
            .map(|i| project(&self.params, i, camera, &settings))
            .map(|p| p.filter(|p| pixel_bounds(p, camera, NEAR_MAX).is_some()))
            .collect();
        let rgb = raster_fwd(&self.params, &projected, camera, &settings).rgb;
        let mut out = vec![DVec3::ZERO; camera.pinhole.width_px as usize / rays];
        for (i, pixel) in rgb.as_chunks::<3>().0.iter().enumerate() {
            out[i % camera.pinhole.width_px as usize / rays] += DVec3::from(*pixel);
        }
        out.iter().map(|sum| sum / (rays * rays) as f64).collect()
    }

    /// Centres, standard deviations along both axes, and rotations of the splats.
    pub fn description(&self) -> Value {
        let splat = |i: usize| {
            json!({
                "centre": self.params.position(i).to_array(),
                "sigmas": self.params.scales(i),
                "quaternion_wxyz": self.params.quaternion(i),
            })
        };
        (0..self.params.splats.len()).map(splat).collect()
    }

    /// `count` points near the centres of the splats, in turn.
    pub fn points(&self, count: usize) -> Vec<DVec3> {
        let mut rng = stream(self.seed, Stream::Points, 0);
        let place = |i: usize| {
            let splat = i % self.params.splats.len();
            let sigmas = self.params.scales(splat);
            let jitter = POINT_JITTER * normal_vector(&mut rng).truncate();
            let [u, v] = [0, 1].map(|k| self.params.rotation(splat).col(k) * sigmas[k]);
            self.params.position(splat) + jitter.x * u + jitter.y * v
        };
        (0..count).map(place).collect()
    }
}
