//! The splats that the training of a stand-in begins with.

use super::arrival::growth;
use crate::Result;
use crate::verify::{Backends, Contribution};
use litetex_exporters::{AssetCamera, SplatAsset, num_sh_coefficients};

/// The `count` splats that contribute most, without textures and with SH of at most this degree, grown to cover what the others did.
pub(super) fn first_splats(
    scene: &SplatAsset,
    views: &[AssetCamera],
    (count, sh_degree): (usize, u32),
    backends: &Backends<'_>,
) -> Result<SplatAsset> {
    let mut backend = (backends.statistics)()?;
    let weights = Contribution::measure(backend.as_mut(), scene, views, backends.go_on)?.weight_px;
    let mut order: Vec<usize> = (0..scene.num_splats()).collect();
    order.sort_by(|&a, &b| weights[b].total_cmp(&weights[a]).then(a.cmp(&b)));
    let mut keep = vec![false; order.len()];
    order.iter().take(count.max(1)).for_each(|&splat| keep[splat] = true);
    let mut first = scene.untextured();
    first.retain(&keep);
    let growth = growth(first.num_splats(), scene.num_splats());
    first.scales.as_flattened_mut().iter_mut().for_each(|scale| *scale *= growth);
    let [width, kept] = [first.sh_degree, sh_degree].map(|degree| 3 * num_sh_coefficients(degree));
    first.sh.chunks_exact_mut(width).for_each(|sh| sh[kept.min(width)..].fill(0.0));
    first.sh_degrees.iter_mut().for_each(|degree| *degree = (*degree).min(sh_degree as u8));
    first.fit_sh_degree();
    Ok(first)
}
