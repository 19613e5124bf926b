//! Steps by hand, for backends of any kind: a scene with views in two sizes, requests and a plan.

use litetex_gs::backend::{LearningRates, LossWeights, MapChange, StepRequest, StructurePlan, TargetImage};
use litetex_gs::camera::{Camera, RigidTransform};
use litetex_gs::selftest::{Scene, SceneOptions, random_scene};

const RATES: LearningRates = LearningRates {
    position: 2e-4,
    quaternion: 1e-3,
    log_scale: 5e-3,
    opacity: 0.02,
    sh_dc: 2.5e-3,
    sh_rest: 1.25e-4,
    texel: 2e-3,
    texel_growth: 0.5,
    texel_growth_limit: 4.0,
};

pub fn scene(seed: u64) -> Scene {
    random_scene(&SceneOptions {
        num_splats: 600,
        scales: (0.02, 0.15),
        opacities: (0.05, 0.8),
        width_px: 83,
        height_px: 61,
        seed,
        ..SceneOptions::default()
    })
}

/// The scene from a few sides and in two sizes: splats come into sight and leave it, and lag behind.
pub fn views(scene: &Scene) -> Vec<(Camera, TargetImage)> {
    let turned = |k: usize| {
        let angle = (k as f64 - 2.0) * 0.35;
        let turn = glam::DMat3::from_rotation_y(angle);
        let pose = scene.camera.camera_from_local;
        let camera_from_local =
            RigidTransform { rotation: turn * pose.rotation, translation: turn * pose.translation };
        let camera = Camera { camera_from_local, ..scene.camera };
        if k.is_multiple_of(2) {
            return (camera, scene.target.clone());
        }
        let (w, h) = (40, 33);
        let rgb = (0..3 * w * h).map(|i| (i * 37 % 251) as u8).collect();
        (camera.resized(w, h), TargetImage { width_px: w, height_px: h, rgb, mask: None })
    };
    (0..5).map(turned).collect()
}

pub fn requests(
    views: &[(Camera, TargetImage)],
    steps: std::ops::RangeInclusive<u32>,
) -> Vec<StepRequest<'_>> {
    let request = |step: u32| {
        let view = step as usize * 3 % views.len();
        StepRequest {
            step,
            camera: views[view].0,
            photo: view as u32,
            target: &views[view].1,
            background: [0.1, 0.2, 0.3],
            sh_degree: (step / 8).min(3),
            loss: LossWeights { mse: 0.03, ..LossWeights::default() },
            rates: RATES,
            accumulate_statistics: step.is_multiple_of(3),
        }
    };
    steps.map(request).collect()
}

/// Every fourth splat goes, every seventh comes twice, maps are kept, enlarged, shrunk or dropped.
pub fn plan(num_splats: usize) -> StructurePlan {
    let mut plan = StructurePlan::default();
    for i in (0..num_splats).filter(|i| i % 4 != 0) {
        for copy in 0..1 + usize::from(i % 7 == 0) {
            let resample = |rows, cols, texel_size| MapChange::Resample {
                rows,
                cols,
                texel_size,
                shift_texels: [0.3, 0.0],
                moment_scale: [0.25, 0.0625],
            };
            plan.sources.push(i as u32);
            plan.maps.push(match (i + copy) % 4 {
                0 => resample(9, 4, 0.02),
                1 => resample(0, 0, 0.1),
                2 => resample(2, 3, 0.2),
                _ => MapChange::Keep,
            });
        }
    }
    plan
}
