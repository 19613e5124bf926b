//! Fixed-point texel gradients of poisoned images.

use super::fault_tests::{backend, request};
use super::form::GpuOptions;
use crate::backend::{Backend as _, LossWeights, StepRequest};
use crate::model::AdamState;
use crate::selftest::{SceneOptions, random_scene};

#[test]
fn poisoned_texel_gradients_are_clamped_and_counted_and_never_wrap_around() {
    if let Some(mut backend) = backend() {
        // Splats of some 20 px with texels of just over 1 px: the hardware variant adds tap by tap, seven taps per
        // texel. If each tap had the limit of a tile's pixels, the sums would wrap around (tried).
        let mut scene = random_scene(&SceneOptions {
            num_splats: 60,
            width_px: 64,
            height_px: 64,
            map_sizes: vec![(14, 14)],
            scales: (0.055, 0.06),
            depths: (0.95, 1.05),
            opacities: (0.9, 0.99),
            sh_degree: 0,
            ..SceneOptions::default()
        });
        scene.target.rgb.fill(0);
        scene.model.textures.texels.fill(0.0);
        let mut gradients = Vec::new();
        let lanes = backend.device.subgroup_lanes().min(4);
        for (hardware, sum_lanes, rgb) in
            [(true, 0, 1.0), (true, 0, 1e4), (false, 0, 1e4), (true, lanes, 1e4)]
        {
            let options = GpuOptions {
                hardware_kernels: Some(hardware),
                sum_lanes: Some(sum_lanes),
                ..GpuOptions::default()
            };
            backend.set_options(options).unwrap();
            scene.model.splats.sh.fill(((rgb - 0.5) / crate::constants::SH_0) as f32);
            backend.upload(&scene.model, &AdamState::zeros(&scene.model)).unwrap();
            let loss = LossWeights { mse: 1.0, ..LossWeights::NONE };
            let report = backend.step(&StepRequest { loss, ..request(&scene, 1) }).unwrap();
            // The image is brighter than the black photo everywhere, so no gradient is negative, clamped or not.
            let (_, adam) = backend.read_back().unwrap();
            assert!(
                adam.texels_m.iter().all(|&m| m >= 0.0),
                "a sum has wrapped around: {hardware} {sum_lanes} {rgb}"
            );
            assert_eq!(report.non_finite_gradients > 0, rgb > 10.0, "{hardware} {sum_lanes} {rgb}");
            gradients.push(adam.texels_m.iter().map(|&m| f64::from(m)).sum::<f64>());
        }
        assert!(gradients[1..].iter().all(|&poisoned| poisoned > gradients[0]), "{gradients:?}");
    }
}
