//! How much images change with the numbers of an asset, measured by gradients of random losses: where every value of an image
//! pulls up or down with equal strength, at random, the expected square of a number's gradient is the sum of its squared
//! derivatives over all values (Hutchinson's estimate of the diagonal of a Gauss-Newton matrix).

use super::gradients::{Gradients, ImageLoss, gradients};
use super::renderer::GoOn;
use crate::backend::{Backend, ColourMap, LossWeights, TargetImage};
use crate::bake::model_from_asset;
use crate::model::AdamState;
use crate::{Error, Result};
use litetex_exporters::ltgs::Sensitivities;
use litetex_exporters::{AssetCamera, SplatAsset};
use rand::{Rng, SeedableRng};
use rand_pcg::Pcg64Mcg;

/// Fewest random losses over all views.
const PROBES_MIN: usize = 24;

/// By how much images are compressed around grey: values from -1.5 to 2.5 lie between black and white then, and the sign of the
/// difference from either is known.
const CONTRAST: f32 = 0.25;

/// Measures an asset on a backend, which keeps the asset's model.
///
/// # Errors
/// What the device reports, [`Error::Interrupted`].
pub(super) fn sensitivities(
    backend: &mut dyn Backend,
    asset: &SplatAsset,
    views: &[AssetCamera],
    go_on: GoOn<'_>,
) -> Result<Sensitivities> {
    let model = model_from_asset(asset);
    let adam = AdamState::zeros(&model);
    let mut sums = zeros(asset);
    let rounds = PROBES_MIN.div_ceil(views.len().max(1));
    for round in 0..rounds {
        for (index, view) in views.iter().enumerate() {
            if !go_on() {
                return Err(Error::Interrupted);
            }
            let target = random_image(view, (round * views.len() + index) as u64);
            let grey = 0.5 - 0.5 * CONTRAST;
            let contrast = |channel: usize| {
                let mut row = [0.0, 0.0, 0.0, grey];
                row[channel] = CONTRAST;
                row
            };
            let weights = LossWeights { l1: target.rgb.len() as f32 / CONTRAST, ..LossWeights::NONE };
            let exposure = Some(ColourMap([0, 1, 2].map(contrast)));
            let loss = ImageLoss { view, target: &target, background: asset.background, weights, exposure };
            add(&mut sums, asset, &gradients(backend, (&model, &adam), &loss)?.0);
        }
    }
    divide(&mut sums, rounds as f32);
    Ok(sums)
}

/// Turns sums over rounds into means.
fn divide(sums: &mut Sensitivities, rounds: f32) {
    let Sensitivities { positions, tilts, twists, log_scales, log_opacities, colours, texels } = sums;
    let all = [positions, tilts, twists, log_scales, log_opacities, colours, texels];
    all.into_iter().flatten().for_each(|h| *h /= rounds);
}

fn zeros(asset: &SplatAsset) -> Sensitivities {
    let of_splats = vec![0.0; asset.num_splats()];
    Sensitivities {
        positions: of_splats.clone(),
        tilts: of_splats.clone(),
        twists: of_splats.clone(),
        log_scales: of_splats.clone(),
        log_opacities: of_splats.clone(),
        colours: of_splats,
        texels: vec![0.0; asset.num_texels()],
    }
}

/// Black or white in every channel of every pixel.
fn random_image(view: &AssetCamera, seed: u64) -> TargetImage {
    let (width_px, height_px) = (view.width_px, view.height_px);
    let mut rgb = vec![0; 3 * width_px as usize * height_px as usize];
    Pcg64Mcg::seed_from_u64(seed).fill_bytes(&mut rgb);
    rgb.iter_mut().for_each(|value| *value = if *value < 128 { 0 } else { 255 });
    TargetImage::opaque(width_px, height_px, rgb)
}

/// Adds the squares of the gradients of a loss, turned into derivatives by the numbers that [`Sensitivities`] names.
fn add(sums: &mut Sensitivities, asset: &SplatAsset, found: &Gradients) {
    let splats = &found.splats;
    for splat in 0..asset.num_splats() {
        sums.positions[splat] += mean_square(&splats.positions[3 * splat..][..3]);
        sums.log_scales[splat] += mean_square(&splats.log_scales[2 * splat..][..2]);
        let quaternion = &splats.quaternions[4 * splat..][..4];
        let [around_u, around_v, around_n] = by_angles(asset.rotations[splat], quaternion);
        sums.tilts[splat] += mean_square(&[around_u, around_v]);
        sums.twists[splat] += around_n * around_n;
        let by_log = found.by_log_opacity(splat, asset.opacities[splat]);
        sums.log_opacities[splat] += by_log * by_log;
        sums.colours[splat] += mean_square(&splats.sh_of(splat)[..3]);
    }
    for (texel, sum) in sums.texels.iter_mut().enumerate() {
        let by_value = |c: usize| found.by_texel(3 * texel + c, asset.texels[3 * texel + c]);
        *sum += mean_square(&[0, 1, 2].map(by_value));
    }
}

/// Derivatives by the angles around the surfel's axes u, v and n, from those by the quaternion wxyz.
fn by_angles([w, x, y, z]: [f32; 4], gradient: &[f32]) -> [f32; 3] {
    // Turning by an angle a around an axis e multiplies the quaternion from the right by (1, a / 2 e).
    let slopes = [[-x, w, z, -y], [-y, -z, w, x], [-z, y, -x, w]];
    slopes.map(|slope| 0.5 * slope.iter().zip(gradient).map(|(s, g)| s * g).sum::<f32>())
}

fn mean_square(values: &[f32]) -> f32 {
    values.iter().map(|v| v * v).sum::<f32>() / values.len() as f32
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::cpu::CpuBackend;
    use crate::verify::SceneRenderer;
    use glam::{Quat, Vec3};
    use litetex_exporters::AssetMap;

    /// A camera at the origin that looks along z.
    pub fn camera() -> AssetCamera {
        AssetCamera {
            name: "a".to_owned(),
            width_px: 64,
            height_px: 48,
            focal_px: [60.0; 2],
            principal_px: [32.0, 24.0],
            rotation_rows: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
            ..AssetCamera::default()
        }
    }

    /// A textured splat in front of a grey background, tilted, and a camera.
    fn scene() -> (SplatAsset, AssetCamera) {
        let asset = SplatAsset {
            sh_degrees: vec![0],
            positions: vec![[0.05, -0.02, 2.0]],
            rotations: vec![[0.8, 0.48, 0.0, 0.36]],
            scales: vec![[0.3, 0.15]],
            opacities: vec![0.7],
            sh: vec![0.8, 0.4, -0.6],
            maps: vec![AssetMap { rows: 2, cols: 1, texel_sizes: [0.2; 2], ..AssetMap::default() }],
            texels: vec![0.2, -0.1, 0.3, -0.25, 0.15, 0.0],
            background: [0.2, 0.5, 0.4],
            ..SplatAsset::default()
        };
        (asset, camera())
    }

    #[test]
    fn random_losses_measure_how_much_images_change() {
        let (asset, view) = scene();
        let mut backend = CpuBackend::new(Some(1)).unwrap();
        let views = vec![view.clone(); 200];
        let found = sensitivities(&mut backend, &asset, &views, &|| true).unwrap();
        let mut renderer = SceneRenderer::new(Box::new(backend), &|| true);
        let mut image = |change: &dyn Fn(&mut SplatAsset)| {
            let mut changed = asset.clone();
            change(&mut changed);
            renderer.images(&changed, std::slice::from_ref(&view)).unwrap().remove(0).rgb
        };
        // Sum of squared derivatives over the image, by central differences: large ones, since those across the edge of the
        // splat, where alpha jumps to 0, do not count in gradients.
        let mut slope = |size: f32, change: &dyn Fn(&mut SplatAsset, f32)| {
            let [less, more] = [-size, size].map(|size| image(&|a| change(a, size)));
            let pairs = less.iter().zip(&more).map(|(a, b)| f64::from((b - a) / (2.0 * size)).powi(2));
            pairs.sum::<f64>() as f32
        };
        let position = [0, 1, 2].map(|axis| slope(5e-3, &|a, e| a.positions[0][axis] += e));
        let scale = [0, 1].map(|axis| slope(0.05, &|a, e| a.scales[0][axis] *= e.exp()));
        let turned = |a: &mut SplatAsset, axis: usize, angle: f32| {
            let [w, x, y, z] = a.rotations[0];
            let turn = Quat::from_axis_angle(Vec3::AXES[axis], angle);
            let q = Quat::from_xyzw(x, y, z, w) * turn;
            a.rotations[0] = [q.w, q.x, q.y, q.z];
        };
        let angle = [0, 1, 2].map(|axis| slope(0.05, &|a, e| turned(a, axis, e)));
        let colour = [0, 1, 2].map(|c| slope(0.05, &|a, e| a.sh[c] += e));
        let texel = [0, 1, 2].map(|c| slope(0.05, &|a, e| a.texels[3 + c] += e));
        let views = views.len() as f32;
        for (name, found, expected) in [
            ("position", found.positions[0], position.iter().sum::<f32>() / 3.0),
            ("scale", found.log_scales[0], scale.iter().sum::<f32>() / 2.0),
            ("tilt", found.tilts[0], (angle[0] + angle[1]) / 2.0),
            ("twist", found.twists[0], angle[2]),
            ("opacity", found.log_opacities[0], slope(0.05, &|a, e| a.opacities[0] *= e.exp())),
            ("colour", found.colours[0], colour.iter().sum::<f32>() / 3.0),
            ("texel", found.texels[1], texel.iter().sum::<f32>() / 3.0),
        ] {
            let found = found / views;
            // 200 squares of normal numbers: the mean is off by 10 % (one standard deviation), by less for several numbers.
            assert!((found / expected - 1.0).abs() < 0.3, "{name}: {found} {expected}");
        }
        // Negative control: the axes of the rotation differ by more than that.
        let found = found.twists[0] / views;
        assert!(
            (found / angle[0] - 1.0).abs() > 0.3 && (found / angle[1] - 1.0).abs() > 0.3,
            "{found} {angle:?}"
        );
    }
}
