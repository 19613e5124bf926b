//! The bytes that these kernels must move in a step, compared with the floor of the method's cost model.
//!
//! Traffic is ideal: every element that a kernel must read or write counts once per dispatch, as if caches were
//! perfect within a kernel and empty between kernels; where tiles read splat records, they count once per pair.
//! With `N` splats, `Nv` of them visible, `Nl` visible ones that must be flushed, `K` tile pairs, `P` pixels, `T`
//! tiles, `Mv` and `Ml` texels in the maps of `Nv` and `Nl`, `C` SH floats per splat, and `A` global atomics of
//! texel gradients, the floor is
//!
//! | Item | Bytes |
//! |---|---|
//! | preprocess | `236 N + 64 Nv` |
//! | sort | `6 * 24 K` |
//! | forward | `56 K + 16 Mv + 24 P` (every texel of a visible map once) |
//! | loss | `150 P` |
//! | backward | `56 K + 2 * 4 * 14 K + 8 A` (partial sums written and read, texel sums read and written) |
//! | adam | `28 (10 N + C Nv + 3 Mv)` |

use crate::gpu::kernels::KernelId;
use crate::gpu::layout::{
    BOUNDS_BYTES, DispatchArgs, PAIR_SUMS, PROJECTED_BYTES, SPLAT_SUMS_BYTES, SplatInfo, Status,
};
use crate::gpu::segments::STATE_BYTES;
use crate::gpu::shader::{BLOCK, DIGIT_BITS, GROUP};
use serde::Serialize;

/// Input of the traffic model; means over steps.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct TrafficCounts {
    /// `N`, splats of the model.
    pub splats: f64,
    /// `Nv`, visible splats.
    pub visible: f64,
    /// `Nl`, visible splats that must be flushed.
    pub lagging: f64,
    /// `K`, tile-splat pairs.
    pub pairs: f64,
    /// `P`, pixels of the image.
    pub pixels: f64,
    /// `T`, tiles of the image.
    pub tiles: f64,
    /// Pairs with texel windows: none where the backward pass is by subgroups.
    pub windows: f64,
    /// Pixels' states at the boundaries of segments.
    pub states: f64,
    /// `Mv`, texels of visible splats.
    pub visible_texels: f64,
    /// `Ml`, texels that must be flushed.
    pub lagging_texels: f64,
    /// `C`, SH floats per splat, on average over all splats.
    pub sh_floats: f64,
    /// `A`, global atomics of texel gradients.
    pub texel_atomics: f64,
    /// Passes of the sort by depth.
    pub depth_passes: f64,
    /// Passes of the sort by tile.
    pub tile_passes: f64,
}

/// Items of the cost model.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum TrafficItem {
    /// Projection of the splats.
    Preprocess,
    /// Sorting splats and pairs, and listing the pairs of each tile.
    Sort,
    /// Forward pass.
    Forward,
    /// Loss and its derivative with respect to the image.
    Loss,
    /// Backward pass: derivatives with respect to splats and texels.
    Backward,
    /// Updates of parameters and moments, including flushes.
    Adam,
    /// Status for the host; not part of the cost model.
    Status,
}

impl TrafficItem {
    /// All items, in the order of a step.
    pub const ALL: [Self; 7] =
        [Self::Preprocess, Self::Sort, Self::Forward, Self::Loss, Self::Backward, Self::Adam, Self::Status];

    /// Bytes by the cost model.
    pub fn floor(self, c: &TrafficCounts) -> f64 {
        match self {
            Self::Preprocess => 236.0 * c.splats + 64.0 * c.visible,
            Self::Sort => 6.0 * 24.0 * c.pairs,
            Self::Forward => 56.0 * c.pairs + 16.0 * c.visible_texels + 24.0 * c.pixels,
            Self::Loss => 150.0 * c.pixels,
            Self::Backward => (56.0 + 2.0 * 4.0 * 14.0) * c.pairs + ATOMIC * c.texel_atomics,
            Self::Adam => 28.0 * (GEOMETRY * c.splats + c.sh_floats * c.visible + 3.0 * c.visible_texels),
            Self::Status => 0.0,
        }
    }
}

/// Bytes of a float or integer.
const WORD: f64 = 4.0;
/// Bytes of an atomic addition: a read and a write.
const ATOMIC: f64 = 2.0 * WORD;
/// Floats of a splat without SH.
const GEOMETRY: f64 = 10.0;
/// Bytes to update a parameter: value and both moments, read and written.
const STATE: f64 = 6.0 * WORD;
/// Bytes of a pair's splat, and of its texel window (`shaders/common/projected.wgsl`).
const PAIR: f64 = 4.0;
const WINDOW: f64 = 8.0;
const PROJECTED: f64 = PROJECTED_BYTES as f64;
const BOUNDS: f64 = BOUNDS_BYTES as f64;
const INFO: f64 = size_of::<SplatInfo>() as f64;
const STATE_OF_PIXEL: f64 = STATE_BYTES as f64;
const PARTIALS: f64 = PAIR_SUMS as f64 * WORD;

/// Bytes by item that all dispatches of a kernel move in a step without window statistics.
pub(super) fn traffic(kernel: KernelId, c: &TrafficCounts) -> Vec<(TrafficItem, f64)> {
    use KernelId as K;
    use TrafficItem as I;
    // Keys that the passes of both sorts handle: visible splats by depth, then pairs by tile.
    let sorted = c.depth_passes * c.visible + c.tile_passes * c.pairs;
    let histograms = sorted / f64::from(BLOCK) * f64::from(1 << DIGIT_BITS) * WORD;
    // The first pass by tile generates its values instead of reading them. The emitting kernels count the digits of the first
    // passes; the others clear and add to the counts of the next.
    let values = sorted - c.pairs;
    let counted = sorted - (c.visible + c.pairs);
    let [first, by_pair] =
        [c.visible, c.pairs].map(|keys| keys / f64::from(BLOCK) * f64::from(1 << DIGIT_BITS) * WORD);
    let cleared = histograms - (first + by_pair);
    let block_sums = c.visible / f64::from(BLOCK) * WORD;
    let group_sums = c.splats / f64::from(GROUP) * WORD;
    let block_status = (c.visible / f64::from(GROUP)).ceil() * SPLAT_SUMS_BYTES as f64;
    // Pairs, splats and texels that the rasterisation reads. The forward pass writes the windows, the backward pass
    // reads them.
    let scene = 8.0 * c.tiles + (PAIR + PROJECTED) * c.pairs + WINDOW * c.windows + 16.0 * c.visible_texels;
    match kernel {
        K::Project => {
            let all = (GEOMETRY * WORD + BOUNDS + WORD) * c.splats + 2.0 * group_sums;
            let visible = (INFO + c.sh_floats * WORD + PROJECTED + WORD) * c.visible;
            // Both moments are read, values and moments written.
            let lagging = 5.0 * WORD * c.sh_floats * c.lagging;
            // The others take the step before.
            let unseen = WORD * c.splats + STATE * GEOMETRY * (c.splats - c.visible);
            vec![(I::Preprocess, all + visible), (I::Adam, lagging + unseen)]
        }
        K::FlushTexel => {
            let records = (WORD + INFO) * c.visible + WORD * c.lagging;
            vec![(I::Adam, records + (STATE + WORD) * 3.0 * c.lagging_texels)]
        }
        K::VisibleSums => {
            let table = f64::from(crate::gpu::kernels::NUM_GROUPS) * size_of::<DispatchArgs>() as f64;
            vec![(I::Sort, 3.0 * group_sums + table)]
        }
        // List, key, and both where they are sorted, the list of all; places of the groups.
        K::ListVisible => vec![(I::Sort, 5.0 * WORD * c.visible + group_sums + first)],
        K::SortScan => vec![(I::Sort, 2.0 * histograms + cleared)],
        K::SortScatter => {
            vec![(I::Sort, histograms + 3.0 * WORD * sorted + WORD * values + ATOMIC * counted)]
        }
        K::PrefixBlocks => vec![(I::Sort, 3.0 * WORD * c.visible + block_sums)],
        K::PrefixSums => vec![(I::Sort, 2.0 * block_sums)],
        // Splats in depth order, with their slots and bounds; the pairs' tiles and splats.
        K::TileEmit => {
            let splats = (2.0 * WORD + BOUNDS + WORD) * c.visible + block_sums;
            vec![(I::Sort, splats + 2.0 * WORD * c.pairs + by_pair)]
        }
        // Slots, splats and places of the pairs; binary searches for both ends of a tile's range.
        K::GatherPairs => {
            let ranges = c.tiles * (8.0 + 2.0 * WORD * c.pairs.max(1.0).log2().ceil());
            vec![(I::Sort, (3.0 * WORD + PAIR) * c.pairs + ranges)]
        }
        K::RasterFwd | K::RasterFwdCount | K::RasterFwdBatched | K::RasterFwdBatchedCount => {
            // States are completed when the colours behind are known.
            vec![(I::Forward, scene + (16.0 + 8.0) * c.pixels + 3.0 * STATE_OF_PIXEL * c.states)]
        }
        // Image, photo, SSIM maps, loss map.
        K::LossFwd => vec![(I::Loss, (16.0 + 4.0 + 36.0 + 4.0) * c.pixels + 16.0 * c.tiles)],
        // Reads the same, writes the derivative.
        K::LossBwd => vec![(I::Loss, (16.0 + 4.0 + 36.0 + 4.0 + 16.0) * c.pixels)],
        K::RasterBwd
        | K::RasterBwdStatistics
        | K::RasterBwdScatter
        | K::RasterBwdStatisticsScatter
        | K::RasterBwdCount
        | K::RasterBwdScatterCount
        | K::RasterBwdSubgroups
        | K::RasterBwdSubgroupsStatistics
        | K::RasterBwdSubgroupsCount => {
            let sums = PARTIALS * c.pairs + ATOMIC * c.texel_atomics;
            vec![(I::Backward, scene + (8.0 + 16.0) * c.pixels + STATE_OF_PIXEL * c.states + sums)]
        }
        // The splats with number of pairs and first slot; the places of the pairs.
        K::SumPairs => {
            vec![(I::Backward, 3.0 * WORD * c.visible + WORD * c.pairs + PARTIALS * (c.pairs + c.visible))]
        }
        K::ProjectBwd => {
            // The splats with place of their parameters, opacity and faults.
            let sums = (4.0 * WORD + PROJECTED + PARTIALS) * c.visible;
            let state = STATE * (GEOMETRY + c.sh_floats) * c.visible;
            vec![(I::Backward, sums), (I::Adam, state)]
        }
        K::AdamTexel => {
            // The splats with box, residual sum and record. Gradients
            // are read and zeroed, activated texels written.
            let records = (5.0 * WORD + INFO) * c.visible;
            vec![(I::Adam, records + (STATE + 3.0 * WORD) * 3.0 * c.visible_texels)]
        }
        K::FinishBlocks => vec![(I::Status, 4.0 * WORD * c.visible + block_status)],
        K::Finish => vec![(I::Status, block_status + 16.0 * c.tiles + size_of::<Status>() as f64)],
        // Not part of a step, or only used for depths and normals or exposures.
        K::ProjectGeometry
        | K::RasterFwdGeometry
        | K::RasterFwdBatchedGeometry
        | K::GeometryLoss
        | K::RasterBwdGeometry
        | K::RasterBwdGeometryScatter
        | K::RasterBwdSubgroupsGeometry
        | K::ProjectBwdGeometry
        | K::FinishGeometry
        | K::FlushSplat
        | K::ExposureFwd
        | K::ExposureBwd
        | K::ExposureSums
        | K::GatherSplats
        | K::EditSplats
        | K::RegridMaps
        | K::ResampleMaps
        | K::PrepareProbes
        | K::ProbeCosts => Vec::new(),
    }
}

/// Floor and bytes of an item.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct TrafficShare {
    /// The item; `null` for the sum over all items.
    pub item: Option<TrafficItem>,
    /// Bytes by the cost model.
    pub floor_bytes: f64,
    /// Bytes that the kernels move.
    pub bytes: f64,
    /// Bytes over floor; `null` if the floor is zero.
    pub ratio: Option<f64>,
}

/// Bytes that a step moves.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Traffic {
    /// Kernel name and bytes per step.
    pub kernels: Vec<(&'static str, f64)>,
    /// Bytes by item, compared with the floor; the sum is last.
    pub items: Vec<TrafficShare>,
}

impl Traffic {
    /// Traffic of a step that runs `kernels`, each listed once.
    pub(super) fn of(kernels: &[KernelId], counts: &TrafficCounts) -> Self {
        let by_kernel: Vec<_> = kernels.iter().map(|&k| (k.kernel().name, traffic(k, counts))).collect();
        let of_item = |item| {
            let parts = by_kernel.iter().flat_map(|(_, parts)| parts).filter(|(i, _)| *i == item);
            parts.map(|(_, bytes)| bytes).sum::<f64>()
        };
        let share = |item, floor_bytes: f64, bytes| {
            let ratio = (floor_bytes > 0.0).then(|| bytes / floor_bytes);
            TrafficShare { item, floor_bytes, bytes, ratio }
        };
        let mut items: Vec<_> =
            TrafficItem::ALL.map(|item| share(Some(item), item.floor(counts), of_item(item))).into();
        let [floor, bytes] = [|s: &TrafficShare| s.floor_bytes, |s: &TrafficShare| s.bytes]
            .map(|part| items.iter().map(part).sum::<f64>());
        items.push(share(None, floor, bytes));
        let sum = |parts: &Vec<(TrafficItem, f64)>| parts.iter().map(|(_, bytes)| bytes).sum();
        Self { kernels: by_kernel.iter().map(|(name, parts)| (*name, sum(parts))).collect(), items }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Counts that are all different.
    fn counts() -> TrafficCounts {
        TrafficCounts {
            splats: 10_240.0,
            visible: 4_096.0,
            lagging: 100.0,
            pairs: 20_480.0,
            windows: 20_480.0,
            states: 0.0,
            pixels: 65_536.0,
            tiles: 256.0,
            visible_texels: 65_536.0,
            lagging_texels: 1_600.0,
            sh_floats: 48.0,
            texel_atomics: 30_000.0,
            depth_passes: 4.0,
            tile_passes: 2.0,
        }
    }

    #[test]
    fn the_traffic_of_a_step_is_the_sum_over_its_kernels() {
        let kernels: Vec<_> = KernelId::all().filter(|&k| !traffic(k, &counts()).is_empty()).collect();
        let traffic = Traffic::of(&kernels, &counts());
        let total = traffic.items.last().unwrap();
        let sum: f64 = traffic.kernels.iter().map(|(_, bytes)| bytes).sum();
        assert!((total.bytes / sum - 1.0).abs() < 1e-12 && total.item.is_none());
        assert!(traffic.kernels.iter().all(|(_, bytes)| *bytes > 0.0));
        let one_less = Traffic::of(&kernels[1..], &counts());
        assert!(one_less.items.last().unwrap().bytes < total.bytes, "negative control: one kernel less");
    }

    #[test]
    fn traffic_agrees_with_figures_computed_by_hand() {
        let c = counts();
        let of = |kernel| traffic(kernel, &c).iter().map(|(_, bytes)| bytes).sum::<f64>();
        assert_eq!(of(KernelId::LossFwd), 60.0 * 65_536.0 + 4_096.0);
        // Searches of 15 steps for both ends of 256 ranges.
        assert_eq!(of(KernelId::GatherPairs), 16.0 * 20_480.0 + 256.0 * 128.0);
        // 57,344 keys in 56 blocks of 256 counts each, of which 32 are those of later passes.
        assert_eq!(of(KernelId::SortScan), (2.0 * 56.0 + 32.0) * 1024.0);
        let moved = 57_344.0 * 16.0 - 20_480.0 * 4.0;
        assert_eq!(of(KernelId::SortScatter), 56.0 * 1024.0 + moved + 32.0 * 1024.0 * 8.0);
        let c = TrafficCounts { windows: 0.0, states: 512.0, ..c };
        let by_segments = |kernel| traffic(kernel, &c).iter().map(|(_, bytes)| bytes).sum::<f64>();
        let fewer = |kernel, per_state| of(kernel) - 8.0 * 20_480.0 + 512.0 * per_state;
        assert_eq!(by_segments(KernelId::RasterFwdBatched), fewer(KernelId::RasterFwdBatched, 48.0));
        assert_eq!(by_segments(KernelId::RasterBwdSubgroups), fewer(KernelId::RasterBwdSubgroups, 16.0));
        assert_eq!(TrafficItem::Sort.floor(&c), 144.0 * 20_480.0);
        assert_eq!(TrafficItem::Backward.floor(&c), 168.0 * 20_480.0 + 240_000.0);
    }
}
