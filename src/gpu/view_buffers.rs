//! Buffers whose size depends on the images and the number of pairs. They only grow.

use super::device::GpuDevice;
use super::form::LEAST_PAIR_BYTES;
use super::kernels::Buf;
use super::layout::PAIR_SUMS_GEOMETRY;
use super::resources::Resources;
use super::shader::BLOCK;
use super::sort::{group_list_entries, histogram_entries};
use super::uniform::partial_stride;
use crate::Result;
use std::collections::BTreeMap;

/// Most parts of a buffer's size that the partial sums of all pairs take; one more for rounding.
pub(super) const MOST_TURNS: usize = (4 * PAIR_SUMS_GEOMETRY as u64 / LEAST_PAIR_BYTES) as usize + 1;

/// Current capacity of the buffers.
#[derive(Clone, Debug, Default)]
pub(super) struct Capacity {
    /// Pairs of an image.
    pub pairs: u64,
    /// Pairs of a training step. Images may have needed more.
    pub training_pairs: u64,
    /// Bytes of each buffer.
    bytes: BTreeMap<Buf, u64>,
}

/// Capacity that a submission needs.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct RequiredCapacity {
    pub splats: u64,
    pub pairs: u64,
    /// Bytes of a pair in the buffer of pairs.
    pub pair_bytes: u64,
    pub pixels: u64,
    pub tiles: u64,
    /// Whether there is a backward pass.
    pub training: bool,
    /// Whether the backward pass sums window statistics.
    pub statistics: bool,
    /// Whether depths and normals are computed.
    pub geometry: bool,
}

impl Capacity {
    /// Pairs that fit in training steps, or in images.
    pub(super) fn pairs_of(&self, training: bool) -> u64 {
        if training { self.training_pairs } else { self.pairs }
    }

    /// Pairs whose partial sums fit at a time, with `stride` floats each.
    pub(super) fn partial_pairs(&self, stride: u32) -> u64 {
        self.bytes.get(&Buf::Partials).map_or(1, |bytes| bytes / (4 * u64::from(stride)))
    }

    /// Grows the buffers that are too small.
    ///
    /// # Errors
    /// [`crate::Error::Device`] with the sizes if they exceed a limit or allocation fails.
    pub(super) fn ensure(
        &mut self,
        device: &GpuDevice,
        resources: &mut Resources,
        needs: &RequiredCapacity,
    ) -> Result<()> {
        let &RequiredCapacity { splats, pairs, pair_bytes, pixels, tiles, training, statistics, geometry } =
            needs;
        let keys = pairs.max(splats);
        let histogram = histogram_entries(keys as u32);
        let training_pairs = if training { pairs.max(self.training_pairs) } else { self.training_pairs };
        let partial_bytes = 4 * u64::from(partial_stride(geometry, statistics));
        let partials = training_pairs.min(device.most_buffer_bytes() / 16 * 16 / partial_bytes);
        // Whether it is needed, what its elements are, how many, and the bytes of each.
        for (is_needed, name, what, elements, element_bytes) in [
            (true, Buf::KeysA, "sort keys", keys, 4),
            (true, Buf::KeysB, "sort keys", keys, 4),
            (true, Buf::ValuesA, "sort keys", keys, 4),
            (true, Buf::ValuesB, "sort keys", keys, 4),
            (true, Buf::HistogramA, "sort histograms", histogram, 4),
            (true, Buf::HistogramB, "sort histograms", histogram, 4),
            (true, Buf::GroupLists, "lists of visible splats", group_list_entries(splats), 4),
            (true, Buf::Slots, "tile-splat pairs", pairs, 4),
            (true, Buf::Pairs, "tile-splat pairs", pairs, pair_bytes),
            (true, Buf::SlotOffsets, "prefix sums", splats, 4),
            (true, Buf::BlockSums, "prefix sums", splats.div_ceil(u64::from(BLOCK)), 4),
            (training, Buf::Partials, "partial sums of tile-splat pairs", partials, partial_bytes),
            (true, Buf::Pixels, "pixels", pixels, 16),
            (true, Buf::PixelState, "pixels", pixels, 8),
            (training, Buf::PixelGrad, "pixel gradients", pixels, 16),
            (training, Buf::SsimMaps, "SSIM maps", pixels, 36),
            (training, Buf::LossMap, "loss per pixel", pixels, 4),
            (true, Buf::TileRanges, "tile ranges", tiles, 8),
            (true, Buf::LossPartials, "loss per tile", tiles, 16),
            (true, Buf::ExposurePartials, "colour sums per tile", tiles, 96),
            (geometry, Buf::Normals, "normals of splats", splats, 16),
            (geometry, Buf::Geometry, "depths and normals", pixels, 32),
            (geometry && training, Buf::PixelRecords, "pixel gradients", pixels, 48),
            (geometry && training, Buf::GeometryPartials, "loss per tile", tiles, 8),
        ] {
            let bytes = elements * element_bytes;
            if is_needed && self.bytes.get(&name).is_none_or(|have| *have < bytes) {
                resources.set(name, device.buffer(what, elements, element_bytes)?);
                self.bytes.insert(name, bytes);
            }
        }
        self.pairs = self.pairs.max(pairs);
        self.training_pairs = training_pairs;
        Ok(())
    }
}
