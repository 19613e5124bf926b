//! What viewers show while a file arrives, and when that looks better than a stand-in.

use crate::Result;
use litetex_exporters::ltgs::{BlockKind, Reader};
use litetex_exporters::{AssetMap, SplatAsset, num_sh_coefficients};

/// About how many states are rendered at most, besides two for each layer.
const STATES_MAX: usize = 24;

/// Splats are drawn larger while others are missing, at most by this factor; as the web package does (`growthOf`).
const GROWTH_MAX: f64 = 2.5;

/// What of a file is shown once some of its bytes are there.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct State {
    /// Bytes of its blocks.
    bytes: u64,
    /// Splats that are shown; those of them with view-dependent colours; those in complete layers, which have textures, too.
    splats: usize,
    coloured: usize,
    complete: usize,
}

/// Bytes of the scene's blocks from which on its images are no worse than `stand_in_psnr`, and bytes of all blocks. `psnr` compares
/// images of an asset with those of the scene.
pub(super) fn better_from(
    reader: &Reader<'_>,
    scene: &SplatAsset,
    stand_in_psnr: f64,
    psnr: &mut dyn FnMut(&SplatAsset) -> Result<f64>,
) -> Result<(u64, u64)> {
    let states = states(reader);
    let all_bytes = states.last().map_or(0, |state| state.bytes);
    let mut until = all_bytes;
    // From the end, where images are best.
    for state in states.iter().rev().skip(1) {
        if psnr(&shown(scene, *state))? < stand_in_psnr {
            break;
        }
        until = state.bytes;
    }
    Ok((until, all_bytes))
}

/// States in the order of arrival: behind the geometry of chunks, the view-dependent colours of layers, and layers; the last one is the
/// whole.
fn states(reader: &Reader<'_>) -> Vec<State> {
    let (mut all, mut now) = (Vec::new(), State::default());
    let blocks: Vec<(BlockKind, usize, u64)> = reader.blocks().collect();
    for (at, &(kind, splats, bytes)) in blocks.iter().enumerate() {
        now.bytes += bytes;
        let is_last_of_its_kind = blocks.get(at + 1).is_none_or(|next| next.0 != kind);
        match kind {
            BlockKind::Geometry => now.splats += splats,
            BlockKind::Sh if is_last_of_its_kind => now.coloured = now.splats,
            BlockKind::Texels if is_last_of_its_kind => now.complete = now.splats,
            _ => continue,
        }
        all.push(now);
    }
    let every = all.len().div_ceil(STATES_MAX).max(1);
    let is_kept = |at: usize, state: &State| state.coloured == state.splats || at.is_multiple_of(every);
    all.iter().enumerate().filter(|&(at, state)| is_kept(at, state)).map(|(_, state)| *state).collect()
}

/// The scene as it is shown in a state.
fn shown(scene: &SplatAsset, state: State) -> SplatAsset {
    let mut shown = scene.clone();
    shown.retain(&(0..scene.num_splats()).map(|splat| splat < state.splats).collect::<Vec<_>>());
    let width = 3 * num_sh_coefficients(scene.sh_degree);
    let texels = scene.maps.get(state.complete).map_or(scene.num_texels(), |map| map.offset_texels as usize);
    for splat in state.complete..state.splats {
        let sh = &mut shown.sh[width * splat..][..width];
        sh[..3].copy_from_slice(&scene.untextured_dc(splat));
        if splat >= state.coloured {
            sh[3..].fill(0.0);
            shown.sh_degrees[splat] = 0;
        }
        shown.maps[splat] = AssetMap { offset_texels: texels as u32, ..AssetMap::default() };
    }
    shown.texels.truncate(3 * texels);
    // Those of a layer in arrival stay as they are, and what lies elsewhere stays grown.
    let grown = if state.complete > 0 { state.complete } else { state.splats };
    let growth = growth(grown, scene.num_splats());
    for splat in 0..grown {
        shown.scales[splat].iter_mut().for_each(|scale| *scale *= growth);
        shown.maps[splat].texel_sizes.iter_mut().for_each(|size| *size *= growth);
    }
    shown.fit_sh_degree();
    shown
}

/// How much larger splats are drawn while others are missing.
pub(super) fn growth(splats: usize, all: usize) -> f32 {
    (all as f64 / splats.max(1) as f64).powf(0.25).clamp(1.0, GROWTH_MAX) as f32
}

#[cfg(test)]
mod tests {
    use super::*;
    use litetex_exporters::ltgs::{LtgsOptions, PerSplat, encode};
    use litetex_exporters::{Quality, ReadLimits};
    use std::path::Path;

    /// 9,000 splats of SH degree 1, one in 40 with a map, in three layers.
    fn file() -> Vec<u8> {
        let n = 9_000;
        let mut asset = SplatAsset { sh_degree: 1, near: 0.1, ..SplatAsset::default() };
        for splat in 0..n {
            let x = splat as f32 / n as f32;
            asset.positions.push([x, 1.0 - x, 2.0]);
            asset.rotations.push([1.0, 0.0, 0.0, 0.0]);
            asset.scales.push([0.01, 0.02]);
            asset.opacities.push(0.5);
            asset.sh_degrees.push(1);
            asset.sh.extend([0.25; 12]);
            let offset_texels = asset.num_texels() as u32;
            asset.maps.push(AssetMap { offset_texels, ..AssetMap::default() });
            if splat % 40 == 0 {
                let map = AssetMap { rows: 2, cols: 1, texel_sizes: [0.01; 2], ..asset.maps[splat] };
                asset.maps[splat] = map;
                asset.texels.extend([0.5; 6]);
            }
        }
        let contributions: Vec<f32> = (0..n).map(|splat| splat as f32).collect();
        let per_splat = PerSplat { contributions: &contributions, ..PerSplat::default() };
        encode(&asset, &LtgsOptions { quality: Quality::Balanced, per_splat, ..LtgsOptions::default() })
            .unwrap()
    }

    #[test]
    fn states_follow_the_blocks_of_a_file() {
        let bytes = file();
        let reader = Reader::open(&bytes, Path::new(""), &ReadLimits::default()).unwrap();
        let scene = reader.decode().unwrap().asset;
        let states = states(&reader);
        // Geometry of each chunk, then colours and texels, of three layers, the last of which has two chunks.
        assert_eq!((reader.num_layers(), reader.num_chunks(), states.len()), (3, 4, 10));
        let last = *states.last().unwrap();
        assert_eq!((last.splats, last.coloured, last.complete), (9_000, 9_000, 9_000));
        assert!(states.is_sorted_by(|a, b| a.bytes < b.bytes && a.splats <= b.splats));
        assert_eq!(shown(&scene, last), scene);
        for state in &states {
            let shown = shown(&scene, *state);
            shown.validate().unwrap();
            assert_eq!(shown.num_splats(), state.splats);
            let textured = shown.maps.iter().rposition(|map| map.rows > 0).map_or(0, |last| last + 1);
            assert!(textured <= state.complete && state.complete < textured + 40, "{state:?}");
            let coloured = shown.sh_degrees.iter().filter(|&&degree| degree == 1).count();
            assert_eq!(coloured, state.coloured);
        }
        // What is missing makes the first layer larger.
        let first = shown(&scene, states[2]);
        assert!(first.scales[0][0] > 1.2 * scene.scales[0][0]);
    }

    #[test]
    fn a_stand_in_is_shown_until_nothing_worse_follows() {
        let bytes = file();
        let reader = Reader::open(&bytes, Path::new(""), &ReadLimits::default()).unwrap();
        let scene = reader.decode().unwrap().asset;
        let states = states(&reader);
        // Images get better with splats, but in the first state of the third layer, where they are worse once more.
        let quality =
            |splats: usize| if splats == states[6].splats { 21.0 } else { 20.0 + splats as f64 / 1_000.0 };
        let until = |own: f64| {
            better_from(&reader, &scene, own, &mut |shown| Ok(quality(shown.num_splats()))).unwrap()
        };
        let all = states[9].bytes;
        assert_eq!(until(10.0), (states[0].bytes, all));
        assert_eq!(until(21.5), (states[7].bytes, all), "{states:?}");
        assert_eq!(until(99.0), (all, all));
    }
}
