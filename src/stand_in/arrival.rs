//! What viewers show while a file arrives, and when that looks better than a stand-in.

use crate::Result;
use litetex_exporters::ltgs::{BlockKind, Reader};
use litetex_exporters::{AssetMap, SplatAsset, num_sh_coefficients};

/// States that are rendered, at most.
const STATES_MAX: usize = 24;

/// Splats are drawn larger while others are missing, at most by this factor; as the web package does (`growthOf`).
const GROWTH_MAX: f64 = 2.5;

/// What of a file is shown once some of its bytes are there.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct State {
    /// Bytes of its blocks.
    bytes: u64,
    /// Splats that are shown, and those of them in complete layers: the others have neither textures nor view-dependent colours.
    splats: usize,
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

/// States in the order of arrival: behind the geometry of chunks, and behind layers; the last one is the whole.
fn states(reader: &Reader<'_>) -> Vec<State> {
    let (mut all, mut now) = (Vec::new(), State { bytes: 0, splats: 0, complete: 0 });
    let blocks: Vec<(BlockKind, usize, u64)> = reader.blocks().collect();
    for (at, &(kind, splats, bytes)) in blocks.iter().enumerate() {
        now.bytes += bytes;
        if kind == BlockKind::Geometry {
            now.splats += splats;
        }
        let is_layer_end =
            kind == BlockKind::Texels && blocks.get(at + 1).is_none_or(|next| next.0 == BlockKind::Geometry);
        if is_layer_end {
            now.complete = now.splats;
        }
        if kind == BlockKind::Geometry || is_layer_end {
            all.push(now);
        }
    }
    let count = all.len();
    let every = count.div_ceil(STATES_MAX).max(1);
    let is_kept = |(at, state): (usize, &State)| state.complete == state.splats || at.is_multiple_of(every);
    all.iter().enumerate().filter(|&at| is_kept(at)).map(|(_, state)| *state).collect()
}

/// The scene as it is shown in a state.
fn shown(scene: &SplatAsset, state: State) -> SplatAsset {
    let mut shown = scene.clone();
    shown.retain(&(0..scene.num_splats()).map(|splat| splat < state.splats).collect::<Vec<_>>());
    let width = 3 * num_sh_coefficients(scene.sh_degree);
    let texels = scene.maps.get(state.complete).map_or(scene.num_texels(), |map| map.offset_texels as usize);
    for splat in state.complete..state.splats {
        let sh = &mut shown.sh[width * splat..][..width];
        sh.fill(0.0);
        sh[..3].copy_from_slice(&scene.untextured_dc(splat));
        shown.sh_degrees[splat] = 0;
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
    shown
}

/// How much larger splats are drawn while others are missing.
pub(super) fn growth(splats: usize, all: usize) -> f32 {
    (all as f64 / splats.max(1) as f64).powf(0.25).clamp(1.0, GROWTH_MAX) as f32
}
