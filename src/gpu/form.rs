//! The form in which a device gets the kernels: by its options, else by what it is.
//!
//! | Device | Tiles | `raster_bwd` |
//! |---|---|---|
//! | hardware, all of whose subgroups have 16 or 32 lanes | 16 x 16 pixels | by subgroups of these |
//! | other hardware | 16 x 16 pixels | through workgroup memory |
//! | software | 16 x 8 pixels | through workgroup memory |
//!
//! By subgroups, tiles of many pairs are visited in segments ([`super::segments`]).
//!
//! Where subgroups have several sizes, the driver chooses one for each kernel: wgpu cannot require a size.

use super::device::GpuDevice;
use super::kernels::RasterKernels;
use super::segments::{SEGMENT_PAIRS, SEGMENT_STEP, state_bytes_per_pair};
use super::shader::{HALF_TILE_ROWS_PX, HALF_TILES, SEGMENTS, SUM_LANES, TILE_PX};
use crate::Result;

/// Options of a [`super::GpuBackend`]. Only `hardware_kernels`, `sum_lanes` and `segment_pairs` change the results of a step, in
/// their last bits.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct GpuOptions {
    /// Steps per submission and preferred number per call, at most 16. `None`: as many as the device completes in less than a
    /// second, at most 64 per call, 16 per submission, and half of a call.
    pub batch_steps: Option<usize>,
    /// Whether to count pixel-splat pairs.
    pub count_pairs: bool,
    /// Whether to use the kernel variants for hardware: tiles of 16 x 16 pixels instead of 16 x 8, splats loaded
    /// through workgroup memory, and an atomic per tap for the texels of large windows. `None`: on hardware.
    pub hardware_kernels: Option<bool>,
    /// Lanes of a subgroup over which the backward pass sums: 4, 8, 16 or 32, at most those of the device's subgroups, which must
    /// all have one size; 0: without subgroups. `None`: on hardware whose subgroups have 16 or 32, these.
    pub sum_lanes: Option<u32>,
    /// Pairs of a tile that the backward pass by subgroups visits by one workgroup, a multiple of 64; 0: all. `None`: 256. For tests.
    pub segment_pairs: Option<u32>,
    /// Whether kernels are compiled without clamps of their indices. `None`: on hardware with Vulkan, whose devices check
    /// those of buffers themselves.
    pub unchecked_indices: Option<bool>,
    /// Whether to count the global atomics of the texel gradients, instead of faults. Ignored in steps with window
    /// statistics or terms on depths and normals.
    pub count_texel_atomics: bool,
    /// Whether to time every dispatch, if the device can: step reports then contain times by kernel.
    pub time_kernels: bool,
    /// Pairs to allocate buffers for at first; `None`: a guess from the number of splats.
    pub pair_capacity: Option<u64>,
    /// Largest number of pairs of a training step; `None`: as many as buffers hold. For tests with models that do not fit.
    pub most_pairs: Option<u64>,
}

/// Least bytes of a pair in the largest buffer that must hold all pairs at once, which limits the number of turns
/// ([`super::view_buffers::MOST_TURNS`]). Its splat and its texel window take as many (`shaders/common/projected.wgsl`).
pub(super) const LEAST_PAIR_BYTES: u64 = 12;

/// Subgroups of fewer lanes do not pay: more sums go through workgroup memory.
const LEAST_LANES: u32 = 16;

/// What all kernels are compiled with.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Form {
    /// Height of the rasterisation's tiles.
    pub tile_rows_px: u32,
    /// Lanes that kernels by subgroups sum over; 0 without such kernels.
    pub sum_lanes: u32,
    /// Pairs of a segment; 0: tiles are whole, always without subgroups.
    pub segment_pairs: u32,
    /// Whether indices are clamped.
    pub checks_indices: bool,
}

impl Form {
    /// The form for a device, and the variants of the rasterisation.
    ///
    /// # Errors
    /// [`crate::Error::Usage`] if the options ask for subgroups that the device does not have, or for other segments.
    pub(super) fn choose(device: &GpuDevice, options: &GpuOptions) -> Result<(Self, RasterKernels)> {
        let hardware = options.hardware_kernels.unwrap_or(device.choice.hardware);
        let sum_lanes = sum_lanes(device.subgroup_lanes(), hardware, options.sum_lanes)?;
        let unchecked = options
            .unchecked_indices
            .unwrap_or_else(|| device.choice.hardware && device.choice.bounds_buffers());
        let form = Self {
            tile_rows_px: if hardware { TILE_PX } else { HALF_TILE_ROWS_PX },
            sum_lanes,
            segment_pairs: if sum_lanes > 0 { segment_pairs(options.segment_pairs)? } else { 0 },
            checks_indices: !unchecked,
        };
        let (pairs, atomics) = (options.count_pairs, options.count_texel_atomics);
        Ok((form, RasterKernels::choose(hardware, sum_lanes > 0, pairs, atomics)))
    }

    /// Preprocessor flags of all kernels.
    pub(super) fn flags(self) -> Vec<&'static str> {
        let tiles = (self.tile_rows_px == HALF_TILE_ROWS_PX).then_some(HALF_TILES);
        let lanes =
            SUM_LANES.iter().filter(|(lanes, _)| *lanes == self.sum_lanes).flat_map(|(_, flags)| *flags);
        let segments = (self.sum_lanes > 0).then_some(SEGMENTS);
        tiles.into_iter().chain(lanes.copied()).chain(segments).collect()
    }

    /// Bytes of a pair in the largest buffer that must hold all pairs at once: its splat, then its texel window or states of pixels.
    pub(super) fn pair_bytes(self) -> u64 {
        (4 + state_bytes_per_pair(self.segment_pairs, self.tile_rows_px)).max(LEAST_PAIR_BYTES)
    }
}

fn segment_pairs(wanted: Option<u32>) -> Result<u32> {
    match wanted.unwrap_or(SEGMENT_PAIRS) {
        pairs if pairs.is_multiple_of(SEGMENT_STEP) && pairs <= 1 << 24 => Ok(pairs),
        pairs => Err(usage!(
            "segments of {pairs} pairs: expected a multiple of {SEGMENT_STEP}, at most {}",
            1 << 24
        )),
    }
}

/// Lanes to sum over on a device whose subgroups all have `fixed` lanes; 0: no subgroups.
fn sum_lanes(fixed: u32, hardware: bool, wanted: Option<u32>) -> Result<u32> {
    let fits = |lanes: u32| fixed <= 32 && lanes <= fixed && SUM_LANES.iter().any(|(n, _)| *n == lanes);
    match wanted {
        None => Ok(if hardware && fixed >= LEAST_LANES && fits(fixed) { fixed } else { 0 }),
        Some(lanes) if lanes == 0 || fits(lanes) => Ok(lanes),
        Some(lanes) => Err(usage!(
            "sums over {lanes} lanes: the device has subgroups of {fixed} (0: of several sizes or none)"
        )),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_hardware_with_one_size_of_16_or_32_sums_by_subgroups() {
        for (fixed, lanes) in [(0, 0), (4, 0), (8, 0), (16, 16), (32, 32), (64, 0)] {
            assert_eq!(sum_lanes(fixed, true, None).unwrap(), lanes, "{fixed}");
            assert_eq!(sum_lanes(fixed, false, None).unwrap(), 0);
            assert_eq!(sum_lanes(fixed, true, Some(0)).unwrap(), 0);
        }
        // Any part of a subgroup can be asked for, but not more, and not what no kernel is made for.
        assert_eq!(sum_lanes(8, false, Some(4)).unwrap(), 4);
        for (fixed, lanes) in [(8, 16), (0, 4), (64, 32), (32, 2), (32, 12)] {
            assert!(sum_lanes(fixed, true, Some(lanes)).is_err(), "{lanes} of {fixed}");
        }
    }

    #[test]
    fn segments_are_whole_batches_and_their_states_have_a_place() {
        assert_eq!([None, Some(0), Some(64)].map(|n| segment_pairs(n).unwrap()), [SEGMENT_PAIRS, 0, 64]);
        for pairs in [1, 32, 100, 1 << 25] {
            assert!(segment_pairs(Some(pairs)).is_err(), "{pairs}");
        }
        for (tile_rows_px, sum_lanes, segment_pairs, bytes) in [
            (16, 0, 0, 12),
            (8, 0, 0, 12),
            (16, 32, 256, 20),
            (16, 32, 0, 12),
            (8, 8, 192, 15),
            (16, 8, 64, 68),
        ] {
            let form = Form { tile_rows_px, sum_lanes, segment_pairs, checks_indices: true };
            assert_eq!(form.pair_bytes(), bytes, "{form:?}");
        }
    }
}
