//! Buffers whose size depends on the images and the number of pairs. They only grow, until the next upload of a
//! model frees them.

use super::device::GpuDevice;
use super::kernels::Buf;
use super::resources::Resources;
use super::shader::BLOCK;
use super::sort::histogram_entries;
use super::uniform::partial_stride;
use crate::Result;

/// Current capacity of the buffers.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Capacity {
    splats: u64,
    /// Pairs of an image.
    pub pairs: u64,
    /// Pairs of a training step, which also need partial sums. Images may have needed more.
    pub training_pairs: u64,
    /// Floats of the partial sums.
    partials: u64,
    pixels: u64,
    training_pixels: u64,
    tiles: u64,
    // For depths and normals.
    geometry_splats: u64,
    geometry_pixels: u64,
    geometry_training_pixels: u64,
    geometry_tiles: u64,
}

/// Capacity that a submission needs.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct RequiredCapacity {
    pub splats: u64,
    pub pairs: u64,
    pub pixels: u64,
    pub tiles: u64,
    /// Whether there is a backward pass.
    pub training: bool,
    /// Whether the backward pass sums window statistics.
    pub statistics: bool,
    /// Whether depths and normals are computed.
    pub geometry: bool,
}

/// All buffers that this module allocates.
const BUFFERS: [Buf; 22] = [
    Buf::KeysA,
    Buf::KeysB,
    Buf::ValuesA,
    Buf::ValuesB,
    Buf::Histogram,
    Buf::SlotSplat,
    Buf::Pairs,
    Buf::SlotOffsets,
    Buf::BlockSums,
    Buf::Partials,
    Buf::Pixels,
    Buf::PixelState,
    Buf::PixelGrad,
    Buf::SsimMaps,
    Buf::LossMap,
    Buf::TileRanges,
    Buf::LossPartials,
    Buf::Normals,
    Buf::Geometry,
    Buf::PixelRecords,
    Buf::GeometryPartials,
    Buf::ExposurePartials,
];

impl Capacity {
    /// Frees all buffers.
    pub(super) fn release(&mut self, resources: &mut Resources) {
        BUFFERS.into_iter().for_each(|name| resources.remove(name));
        *self = Self::default();
    }

    /// Pairs that fit in training steps, or in images.
    pub(super) fn pairs_of(&self, training: bool) -> u64 {
        if training { self.training_pairs } else { self.pairs }
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
        if needs.pairs > self.pairs || needs.splats > self.splats {
            let (pairs, splats) = (needs.pairs.max(self.pairs), needs.splats.max(self.splats));
            let keys = pairs.max(splats);
            for name in [Buf::KeysA, Buf::KeysB, Buf::ValuesA, Buf::ValuesB] {
                resources.set(name, device.buffer("sort keys", keys, 4)?);
            }
            resources
                .set(Buf::Histogram, device.buffer("sort histograms", histogram_entries(keys as u32), 4)?);
            resources.set(Buf::SlotSplat, device.buffer("tile-splat pairs", pairs, 4)?);
            resources.set(Buf::Pairs, device.buffer("tile-splat pairs", pairs, 16)?);
            resources.set(Buf::SlotOffsets, device.buffer("prefix sums", splats, 4)?);
            resources
                .set(Buf::BlockSums, device.buffer("prefix sums", splats.div_ceil(u64::from(BLOCK)), 4)?);
            (self.pairs, self.splats) = (pairs, splats);
        }
        if needs.training {
            let stride = partial_stride(needs.geometry, needs.statistics);
            let pairs = needs.pairs.max(self.training_pairs);
            let floats = pairs * u64::from(stride);
            if floats > self.partials {
                let what = "partial sums of tile-splat pairs";
                resources.set(Buf::Partials, device.buffer(what, pairs, 4 * u64::from(stride))?);
                self.partials = floats;
            }
            self.training_pairs = pairs;
        }
        if needs.pixels > self.pixels {
            resources.set(Buf::Pixels, device.buffer("pixels", needs.pixels, 16)?);
            resources.set(Buf::PixelState, device.buffer("pixels", needs.pixels, 8)?);
            self.pixels = needs.pixels;
        }
        if needs.training && needs.pixels > self.training_pixels {
            resources.set(Buf::PixelGrad, device.buffer("pixel gradients", needs.pixels, 16)?);
            resources.set(Buf::SsimMaps, device.buffer("SSIM maps", needs.pixels, 36)?);
            resources.set(Buf::LossMap, device.buffer("loss per pixel", needs.pixels, 4)?);
            self.training_pixels = needs.pixels;
        }
        if needs.tiles > self.tiles {
            resources.set(Buf::TileRanges, device.buffer("tile ranges", needs.tiles, 8)?);
            resources.set(Buf::LossPartials, device.buffer("loss per tile", needs.tiles, 16)?);
            resources.set(Buf::ExposurePartials, device.buffer("colour sums per tile", needs.tiles, 96)?);
            self.tiles = needs.tiles;
        }
        if needs.geometry { self.ensure_geometry(device, resources, needs) } else { Ok(()) }
    }

    /// Grows the additional buffers for depths, normals and the terms on them.
    fn ensure_geometry(
        &mut self,
        device: &GpuDevice,
        resources: &mut Resources,
        needs: &RequiredCapacity,
    ) -> Result<()> {
        if needs.splats > self.geometry_splats {
            resources.set(Buf::Normals, device.buffer("normals of splats", needs.splats, 16)?);
            self.geometry_splats = needs.splats;
        }
        if needs.pixels > self.geometry_pixels {
            resources.set(Buf::Geometry, device.buffer("depths and normals", needs.pixels, 32)?);
            self.geometry_pixels = needs.pixels;
        }
        if needs.training && needs.pixels > self.geometry_training_pixels {
            resources.set(Buf::PixelRecords, device.buffer("pixel gradients", needs.pixels, 48)?);
            self.geometry_training_pixels = needs.pixels;
        }
        if needs.training && needs.tiles > self.geometry_tiles {
            resources.set(Buf::GeometryPartials, device.buffer("loss per tile", needs.tiles, 8)?);
            self.geometry_tiles = needs.tiles;
        }
        Ok(())
    }
}
