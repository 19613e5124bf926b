//! Segments of a tile's pairs, which the backward pass by subgroups visits by a workgroup each: otherwise a device would end a step
//! with its longest tile. The forward pass stores the states of pixels at the boundaries between them, in place of texel windows
//! (`shaders/common/segments.wgsl`).

use super::shader::{RASTER_BATCH, TILE_PX};

/// Pairs of a segment. A state takes 16 bytes a pixel: as many as a tile has pixels, and so as many bytes a pair.
pub(super) const SEGMENT_PAIRS: u32 = 256;
/// Segments have a multiple of these: whole batches of the forward pass.
pub(super) const SEGMENT_STEP: u32 = RASTER_BATCH;

/// Bytes of a pixel's state: a colour, a transmittance.
pub(super) const STATE_BYTES: u64 = 16;

/// Bytes of the states, per pair; 0 if tiles are whole.
pub(super) fn state_bytes_per_pair(segment_pairs: u32, tile_rows_px: u32) -> u64 {
    let per_boundary = STATE_BYTES * u64::from(TILE_PX * tile_rows_px);
    // At most (pairs - 1) / segment_pairs boundaries.
    if segment_pairs > 0 { per_boundary.div_ceil(segment_pairs.into()) } else { 0 }
}

/// Boundaries between the segments of tiles with these numbers of pairs.
pub(super) fn num_boundaries(tiles: impl Iterator<Item = u32>, segment_pairs: u32) -> u64 {
    let of_tile = |pairs: u32| pairs.saturating_sub(1).checked_div(segment_pairs).unwrap_or(0);
    tiles.map(|pairs| u64::from(of_tile(pairs))).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::ops::Range;

    /// Twin of `segment_of`.
    fn segment_of(group: u32, ranges: &[[u32; 2]], pairs_each: u32) -> Option<Range<u32>> {
        let num_tiles = ranges.len() as u32;
        if group < num_tiles {
            let [first, past] = ranges[group as usize];
            return Some(first..past.min(first + pairs_each));
        }
        let pair = (group - num_tiles + 1) * pairs_each;
        let [tile_first, past] = *ranges.iter().rfind(|[first, _]| *first <= pair)?;
        let first = tile_first + (pair - tile_first).next_multiple_of(pairs_each);
        (first > tile_first && first < past).then(|| first..past.min(first + pairs_each))
    }

    /// Ranges of tiles with these numbers of pairs.
    fn ranges(pairs: &[u32]) -> Vec<[u32; 2]> {
        let mut past = 0;
        pairs
            .iter()
            .map(|pairs| {
                past += pairs;
                [past - pairs, past]
            })
            .collect()
    }

    #[test]
    fn segments_cover_every_pair_once_and_boundaries_have_places_of_their_own() {
        let tiles = [0, 5, 128, 0, 64, 65, 1, 0, 193, 64, 63, 700, 0, 0];
        let ranges = ranges(&tiles);
        let total: u32 = tiles.iter().sum();
        for pairs_each in [64, 128, 256, 1024] {
            let groups = tiles.len() as u32 + (total - 1) / pairs_each;
            // Some more, as dispatches are folded.
            let segments: Vec<_> = (0..groups + 5).map(|g| segment_of(g, &ranges, pairs_each)).collect();
            let mut visits = vec![0; total as usize];
            for segment in segments.iter().flatten() {
                assert!(segment.len() <= pairs_each as usize);
                segment.clone().for_each(|pair| visits[pair as usize] += 1);
            }
            assert!(visits.iter().all(|visits| *visits == 1), "{pairs_each}: {visits:?}");
            let behind = segments[tiles.len()..].iter().flatten();
            let mut places: Vec<u32> = behind.map(|segment| segment.start / pairs_each).collect();
            let count = places.len();
            places.sort_unstable();
            places.dedup();
            assert!(places.len() == count && !places.contains(&0));
            assert_eq!(count as u64, num_boundaries(tiles.into_iter(), pairs_each));
            // Negative control: a segment may be longer than 256.
            let longest = segments.iter().flatten().map(|s| s.len()).max();
            assert_eq!(longest == Some(700), pairs_each == 1024);
        }
    }
}
