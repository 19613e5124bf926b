//! Training steps without the trainer, for any backend: a scene with views of two sizes, requests and a plan.

use litetex_gs::backend::{
    DensityPlan, Grid, LearningRates, LossWeights, MapChange, SplatEdit, StepRequest, TargetImage,
};
use litetex_gs::camera::{Camera, RigidTransform};
use litetex_gs::model::{Model, SplatGroup};
use litetex_gs::selftest::{RandomScene, SceneOptions, random_scene};

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

pub fn scene(seed: u64) -> RandomScene {
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

/// Views of the scene from several sides and in two sizes: splats become visible and invisible, and so lag behind.
pub fn views(scene: &RandomScene) -> Vec<(Camera, TargetImage)> {
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
        (camera.resized(w, h), TargetImage::opaque(w, h, rgb))
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
            photo: Some(view as u32),
            target: &views[view].1,
            background: [0.1, 0.2, 0.3],
            sh_degree: (step / 8).min(3),
            loss: LossWeights { mse: 0.03, ..LossWeights::PUBLISHED },
            rates: RATES,
            accumulate_statistics: step.is_multiple_of(3),
            exposure: None,
        }
    };
    steps.map(request).collect()
}

/// Every kind of change to a map. All but the resampled ones are bit-identical on every backend.
pub fn changes() -> Vec<MapChange> {
    let moment_scale = [0.3, 0.07];
    let by_axis = |grids, [rows, cols]: [u16; 2], [first_row, first_col]: [i32; 2]| MapChange::Regrid {
        grids,
        rows,
        cols,
        first_row,
        first_col,
        shift: [rows as i16 - 4, -1],
        moment_scale,
    };
    let regrid = |grid, size, first| by_axis([grid; 2], size, first);
    let shift_texels = [0.3, -1.7];
    let resample =
        |rows, cols, texel_sizes| MapChange::Resample { rows, cols, texel_sizes, shift_texels, moment_scale };
    vec![
        MapChange::Keep,
        // Maps have up to 16 x 12 texels: these windows are larger, smaller, shifted, outside, empty.
        regrid(Grid::Same, [18, 15], [-1, -2]),
        regrid(Grid::Same, [2, 3], [1, 1]),
        regrid(Grid::Same, [4, 4], [-1, 2]),
        regrid(Grid::Same, [3, 2], [i32::MIN, i32::MAX]),
        regrid(Grid::Same, [0, 0], [0, 0]),
        regrid(Grid::Finer, [8, 8], [0, 0]),
        regrid(Grid::Finer, [5, 11], [3, -1]),
        regrid(Grid::Coarser, [6, 4], [0, 0]),
        regrid(Grid::Coarser, [4, 7], [-1, 1]),
        by_axis([Grid::Finer, Grid::Coarser], [9, 3], [-1, -1]),
        by_axis([Grid::Same, Grid::Finer], [3, 7], [1, 2]),
        resample(0, 0, [0.1; 2]),
        resample(9, 4, [0.02, 0.03]),
        resample(2, 3, [0.2; 2]),
    ]
}

/// Removes every fourth splat, duplicates every seventh, changes maps and SH degrees in every way, and edits every fifth splat.
pub fn plan(num_splats: usize) -> DensityPlan {
    let changes = changes();
    let mut plan = DensityPlan::default();
    for i in (0..num_splats).filter(|i| i % 4 != 0) {
        for copy in 0..1 + usize::from(i % 7 == 0) {
            plan.maps.push(changes[plan.sources.len() % changes.len()]);
            let splat = plan.sources.len() as u32;
            plan.sh_degrees.push((splat % 4) as u8);
            plan.sources.push(i as u32);
            if splat.is_multiple_of(5) {
                let at = [0.1, -0.1, 1.0].map(|x| x * (i + copy) as f32 / num_splats as f32);
                plan.edits.push(SplatEdit {
                    splat,
                    position: at,
                    log_scales: [-3.0 - at[0], -3.5],
                    opacity_logit: at[2] - 0.5,
                });
            }
        }
    }
    plan
}

/// For every group of parameters, the root mean square of the difference between `a` and `b` over that of the
/// change since `start`.
pub fn differences(start: &Model, a: &Model, b: &Model) -> Vec<(String, f64)> {
    let difference = |start: &[f32], a: &[f32], b: &[f32]| {
        let square =
            |x: &[f32], y: &[f32]| x.iter().zip(y).map(|(x, y)| f64::from(x - y).powi(2)).sum::<f64>();
        (square(a, b) / square(start, b)).sqrt()
    };
    let mut out: Vec<(String, f64)> = SplatGroup::ALL
        .into_iter()
        .map(|g| (format!("{g:?}"), difference(start.splats.group(g), a.splats.group(g), b.splats.group(g))))
        .collect();
    let texels = difference(&start.textures.texels, &a.textures.texels, &b.textures.texels);
    out.push(("Texel".into(), texels));
    out
}
