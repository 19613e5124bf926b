//! The splats that a stand-in begins with.

use crate::Result;
use crate::verify::{Backends, Contribution};
use litetex_exporters::{AssetCamera, SplatAsset, num_sh_coefficients};

/// The splats that contribute most, without textures, grown to cover what the others did.
pub fn first_splats(scene: &SplatAsset, views: &[AssetCamera], count: usize, sh_degree: u32, backends: &Backends<'_>) -> Result<SplatAsset> {
    let mut first = scene.untextured();
    let mut backend = (backends.statistics)()?;
    let weights = Contribution::measure(backend.as_mut(), scene, views, backends.go_on)?.weight_px;
    let mut order: Vec<usize> = (0..first.num_splats()).collect();
    order.sort_by(|&a, &b| weights[b].total_cmp(&weights[a]).then(a.cmp(&b)));
    let mut keep = vec![false; first.num_splats()];
    order.iter().take(count).for_each(|&splat| keep[splat] = true);
    first.retain(&keep);
    let growth = (scene.num_splats() as f32 / first.num_splats() as f32).powf(super::env("LT_GROW", 0.25) as f32).min(super::env("LT_GMAX", 2.5) as f32);
    first.scales.iter_mut().flatten().for_each(|scale| *scale *= growth);
    let width = 3 * num_sh_coefficients(first.sh_degree);
    let kept = 3 * num_sh_coefficients(sh_degree);
    for (splat, sh) in first.sh.chunks_exact_mut(width).enumerate() {
        sh[kept.min(width)..].fill(0.0);
        first.sh_degrees[splat] = first.sh_degrees[splat].min(sh_degree as u8).max(super::env("LT_MIND", 0.0) as u8);
    }
    first.fit_sh_degree();
    Ok(first)
}
