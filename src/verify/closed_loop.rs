//! The closed loop of `.ltgs` files: renders what a reader will get, and moves the numbers that are rounded against the
//! error of its images, so that numbers rounded later make up for those rounded badly.

use super::gradients::{Gradients, ImageLoss, gradients};
use super::renderer::GoOn;
use crate::backend::{Backend, LossWeights, TargetImage};
use crate::bake::model_from_asset;
use crate::model::AdamState;
use crate::{Error, Result};
use litetex_exporters::ltgs::{Rounded, Sensitivities};
use litetex_exporters::{AssetCamera, SplatAsset, num_sh_coefficients};

/// Share of a diagonal Newton step that is taken: the numbers of overlapping splats and neighbouring texels move together. Fox, 480
/// pixels, eight passes: 2.6 % smaller files with 0.01 and with 0.03; with 0.1, the error doubles in each pass.
const DAMPING: f32 = 0.02;
/// Share of the mean sensitivity that is added to each: numbers that hardly show hardly move.
const UNSEEN: f32 = 0.05;
/// Furthest that a logarithm moves in a pass, and a coordinate in standard deviations.
const FURTHEST: f32 = 0.1;

/// What the images of a scene should be.
pub(super) struct ClosedLoop<'a> {
    /// Computes gradients.
    pub backend: Box<dyn Backend>,
    /// Views with the images that they should have.
    pub views: Vec<(AssetCamera, TargetImage)>,
    /// Of the scene before anything moved.
    pub sensitivities: &'a Sensitivities,
    /// Whether to go on, asked before each view.
    pub go_on: GoOn<'a>,
}

/// Derivatives of half the squared error of images, summed over views, by the numbers of an asset.
struct Slopes {
    positions: Vec<f32>,
    log_scales: Vec<f32>,
    log_opacities: Vec<f32>,
    sh: Vec<f32>,
    texels: Vec<f32>,
}

impl ClosedLoop<'_> {
    /// Moves the numbers of `asset`, of which `rounded` is what a reader gets, by a step against the error of its images.
    /// Returns the mean squared error before.
    ///
    /// # Errors
    /// What the device reports, [`Error::Interrupted`].
    pub fn pass(&mut self, asset: &mut SplatAsset, rounded: &Rounded) -> Result<f64> {
        let model = model_from_asset(&rounded.asset);
        let zeros = AdamState::zeros(&model);
        let mut slopes = Slopes::zeros(asset);
        let mut mse = 0.0;
        for (view, target) in &self.views {
            if !(self.go_on)() {
                return Err(Error::Interrupted);
            }
            // The gradient of half the squared error, summed over the values.
            let weights = LossWeights { mse: 0.5 * target.rgb.len() as f32, ..LossWeights::NONE };
            let background = asset.background;
            let loss = ImageLoss { view, target, background, weights, exposure: None };
            let (found, values) = gradients(self.backend.as_mut(), (&model, &zeros), &loss)?;
            mse += values.mse / f64::from(weights.mse) / self.views.len() as f64;
            slopes.add(&found, rounded, asset);
        }
        self.step(asset, &slopes);
        Ok(mse)
    }

    /// Moves each number by a damped Newton step with the diagonal of the Gauss-Newton matrix.
    fn step(&self, asset: &mut SplatAsset, slopes: &Slopes) {
        let h = self.sensitivities;
        let step = |slope: f32, h: f32, mean: f32| {
            let step = -DAMPING * slope / (h + UNSEEN * mean);
            if step.is_finite() { step } else { 0.0 }
        };
        let [positions, scales, opacities, colours, texels] =
            [&h.positions, &h.log_scales, &h.log_opacities, &h.colours, &h.texels].map(|all| mean(all));
        let width = 3 * num_sh_coefficients(asset.sh_degree);
        for splat in 0..asset.num_splats() {
            let furthest = FURTHEST * asset.scales[splat][0].min(asset.scales[splat][1]);
            for (axis, value) in asset.positions[splat].iter_mut().enumerate() {
                let by = step(slopes.positions[3 * splat + axis], h.positions[splat], positions);
                *value += by.clamp(-furthest, furthest);
            }
            for (axis, value) in asset.scales[splat].iter_mut().enumerate() {
                let by = step(slopes.log_scales[2 * splat + axis], h.log_scales[splat], scales);
                *value *= by.clamp(-FURTHEST, FURTHEST).exp();
            }
            let by = step(slopes.log_opacities[splat], h.log_opacities[splat], opacities);
            let opacity = &mut asset.opacities[splat];
            *opacity = (*opacity * by.clamp(-FURTHEST, FURTHEST).exp()).clamp(0.0, 1.0);
            let own = num_sh_coefficients(asset.sh_degrees[splat].into());
            for k in splat * width..splat * width + 3 * own {
                // Seen from few directions, all coefficients do the same.
                asset.sh[k] += step(slopes.sh[k], own as f32 * h.colours[splat], colours);
            }
        }
        for (k, value) in asset.texels.iter_mut().enumerate() {
            *value = (*value + step(slopes.texels[k], h.texels[k / 3], texels)).clamp(-1.0, 1.0);
        }
    }
}

impl Slopes {
    fn zeros(asset: &SplatAsset) -> Self {
        let n = asset.num_splats();
        Self {
            positions: vec![0.0; 3 * n],
            log_scales: vec![0.0; 2 * n],
            log_opacities: vec![0.0; n],
            sh: vec![0.0; asset.sh.len()],
            texels: vec![0.0; asset.texels.len()],
        }
    }

    /// Adds the gradients of a view, of the rounded scene, to the slopes of the asset that was rounded.
    fn add(&mut self, found: &Gradients, rounded: &Rounded, asset: &SplatAsset) {
        let width = 3 * num_sh_coefficients(asset.sh_degree);
        let add = |sums: &mut [f32], more: &[f32]| sums.iter_mut().zip(more).for_each(|(a, b)| *a += b);
        let splats = &found.splats;
        for (place, &splat) in rounded.order.iter().enumerate() {
            let splat = splat as usize;
            add(&mut self.positions[3 * splat..], &splats.positions[3 * place..][..3]);
            add(&mut self.log_scales[2 * splat..], &splats.log_scales[2 * place..][..2]);
            self.log_opacities[splat] += found.by_log_opacity(place, rounded.asset.opacities[place]);
            add(&mut self.sh[splat * width..], splats.sh_of(place));
            let map = &rounded.asset.maps[place];
            let from = 3 * map.offset_texels as usize;
            let to = 3 * asset.maps[splat].offset_texels as usize;
            for k in 0..3 * map.num_texels() {
                self.texels[to + k] += found.by_texel(from + k, rounded.asset.texels[from + k]);
            }
        }
    }
}

fn mean(values: &[f32]) -> f32 {
    values.iter().sum::<f32>() / values.len().max(1) as f32
}

#[cfg(test)]
mod tests {
    use super::super::difference::target_of;
    use super::super::sensitivity::{sensitivities, tests::camera};
    use super::*;
    use crate::cpu::CpuBackend;
    use crate::verify::SceneRenderer;
    use litetex_exporters::AssetMap;
    use litetex_exporters::ltgs::{PerSplat, oriented, rounded};

    /// Overlapping splats with maps, in front of the camera.
    fn scene() -> SplatAsset {
        let n = 24;
        let wave = |i: usize, k: f32| (i as f32 * k).sin();
        let map = |i: usize| AssetMap {
            offset_texels: 4 * i as u32,
            rows: 2,
            cols: 2,
            texel_sizes: [0.2; 2],
            ..AssetMap::default()
        };
        let asset = SplatAsset {
            sh_degrees: vec![0; n],
            positions: (0..n)
                .map(|i| [0.5 * wave(i, 1.7), 0.4 * wave(i, 2.3), 2.0 + 0.3 * wave(i, 0.9)])
                .collect(),
            rotations: (0..n).map(|i| [0.9, 0.3 * wave(i, 1.1), 0.3 * wave(i, 3.1), 0.2]).collect(),
            scales: (0..n).map(|i| [0.25 + 0.05 * wave(i, 0.7), 0.15]).collect(),
            opacities: (0..n).map(|i| 0.6 + 0.3 * wave(i, 1.3)).collect(),
            sh: (0..3 * n).map(|i| wave(i, 0.6)).collect(),
            maps: (0..n).map(map).collect(),
            texels: (0..12 * n).map(|i| 0.2 * wave(i, 2.9)).collect(),
            background: [0.2, 0.5, 0.4],
            ..SplatAsset::default()
        };
        oriented(&asset)
    }

    #[test]
    fn passes_lower_the_error_that_rounding_makes() {
        let (asset, view) = (scene(), camera());
        let mut backend = CpuBackend::new(Some(1)).unwrap();
        let found = sensitivities(&mut backend, &asset, std::slice::from_ref(&view), &|| true).unwrap();
        let (steps, exponents) = found.rounding(&asset);
        let steps = steps.scaled(16.0);
        let mut renderer = SceneRenderer::new(Box::new(CpuBackend::new(Some(1)).unwrap()), &|| true);
        let expected = renderer.images(&asset, std::slice::from_ref(&view)).unwrap();
        let errors = |sensitivities: &Sensitivities| -> Vec<f64> {
            let views = vec![(view.clone(), target_of(&expected[0]))];
            let backend = Box::new(CpuBackend::new(Some(1)).unwrap());
            let mut closed = ClosedLoop { backend, views, sensitivities, go_on: &|| true };
            let mut adapted = asset.clone();
            let pass = |_| {
                let per_splat = PerSplat { exponents: &exponents, ..PerSplat::default() };
                let rounded = rounded(&adapted, &steps, per_splat).unwrap();
                closed.pass(&mut adapted, &rounded).unwrap()
            };
            (0..12).map(pass).collect()
        };
        let closed = errors(&found);
        let least = closed.iter().copied().fold(f64::INFINITY, f64::min);
        assert!(least < 0.7 * closed[0], "{closed:?}");
        // Negative control: numbers that are said to change images a lot hardly move.
        let mut stiff = found.clone();
        for all in [
            &mut stiff.positions,
            &mut stiff.log_scales,
            &mut stiff.log_opacities,
            &mut stiff.colours,
            &mut stiff.texels,
        ] {
            all.iter_mut().for_each(|h| *h *= 1e6);
        }
        let open = errors(&stiff);
        assert!(open.iter().all(|error| *error > 0.9 * open[0]), "{open:?}");
    }
}
