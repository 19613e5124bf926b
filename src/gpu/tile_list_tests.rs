//! Tests of the kernels that list the splats of each tile, separately and together, against straightforward
//! computations in Rust.

use super::device::UNIFORM_STRIDE;
use super::encode::Dispatch;
use super::harness::Harness;
use super::kernels::{Buf, Groups, KernelId, NUM_GROUPS};
use super::layout::{DispatchArgs, PAIR_SUMS, Status, StepUniform};
use super::resources::UniformOffsets;
use super::shader::{BLOCK, DEPTH_KEY_BITS, DIGIT_BITS, GROUP, MAX_GROUPS};
use super::sort::{
    first_args, first_counts, folded_groups, num_tile_passes, order_and_bin, pair_slots, sort_args,
    visible_list,
};
use super::sort_tests::{SORT, STEP, fill_junk, open_all};
use super::tile_list_twin::{TestBounds, TileListCase, grid_of, group_lists};
use rand::{RngExt as _, SeedableRng as _, seq::SliceRandom as _};
use rand_pcg::Pcg32;

const SLOTS: [KernelId; 2] = [KernelId::PrefixBlocks, KernelId::PrefixSums];
const VISIBLE: [KernelId; 2] = [KernelId::VisibleSums, KernelId::ListVisible];
const LISTS: [KernelId; 2] = [KernelId::TileEmit, KernelId::GatherPairs];

#[test]
fn folded_dispatches_cover_all_workgroups() {
    assert_eq!(folded_groups(0), DispatchArgs { x: 0, y: 1, z: 1 });
    assert_eq!(folded_groups(MAX_GROUPS), DispatchArgs { x: MAX_GROUPS, y: 1, z: 1 });
    assert_eq!(folded_groups(MAX_GROUPS + 1), DispatchArgs { x: 32_768, y: 2, z: 1 });
    for groups in [1, 70_000, 131_070, 131_071, 1 << 24, MAX_GROUPS * MAX_GROUPS] {
        let DispatchArgs { x, y, .. } = folded_groups(groups);
        assert!(x <= MAX_GROUPS && y <= MAX_GROUPS, "{groups}: {x} x {y}");
        let (held, wanted) = (u64::from(x) * u64::from(y), u64::from(groups));
        assert!(held >= wanted && held < wanted + u64::from(y), "{groups}: {x} x {y}");
    }
}

/// Runs the prefix sums over tile counts by rank, with the splats in a shuffled order.
fn run_prefix(harness: &mut Harness, counts: &[u32]) {
    let n = counts.len();
    let mut order: Vec<u32> = (0..n as u32).collect();
    order.shuffle(&mut Pcg32::seed_from_u64(4));
    let mut bounds = vec![TestBounds::default(); n];
    order.iter().zip(counts).for_each(|(&splat, &count)| bounds[splat as usize].num_tiles = count);
    harness.fill(Buf::ValuesA, &order);
    harness.fill(Buf::Bounds, &bounds);
    harness.zeros(Buf::SlotOffsets, 4 * n);
    harness.zeros(Buf::BlockSums, 4 * n.div_ceil(BLOCK as usize));
    harness.fill(Buf::Args, &sort_args(n as u32));
    harness.set_groups(Groups::OneLater, 1, 1);
    harness.fill(Buf::Status, &[Status { visible: n as u32, ..Status::default() }]);
    harness.set_step(0, &StepUniform::default());
    harness.run(&pair_slots(STEP)[..2]);
}

/// First slot of each splat, by rank.
fn first_slots(harness: &Harness, n: usize) -> Vec<u32> {
    let blocks = harness.read::<u32>(Buf::BlockSums, n.div_ceil(BLOCK as usize));
    let offsets = harness.read::<u32>(Buf::SlotOffsets, n);
    offsets.iter().enumerate().map(|(rank, offset)| offset + blocks[rank / BLOCK as usize]).collect()
}

#[test]
fn slots_are_prefix_sums_across_blocks() {
    for mut harness in open_all(&SLOTS) {
        let mut rng = Pcg32::seed_from_u64(5);
        // The last has more blocks than a single scan handles.
        for n in [1, 1023, 1024, 1025, 5000, 1_050_000] {
            let mut counts: Vec<u32> = (0..n).map(|_| rng.random_range(0..9)).collect();
            run_prefix(&mut harness, &counts);
            let sums = |counts: &[u32]| -> Vec<u32> {
                let running = |sum: &mut u32, &count: &u32| Some(std::mem::replace(sum, *sum + count));
                counts.iter().scan(0, running).collect()
            };
            let got = first_slots(&harness, n);
            assert!(got == sums(&counts), "{n} splats");
            if n > 1 {
                counts[n / 2 - 1] += 1;
                assert!(got != sums(&counts), "negative control: one tile more");
            }
        }
    }
}

/// Splats that touch these numbers of tiles, with random depths.
fn touching(counts: &[u32]) -> Vec<TestBounds> {
    let mut rng = Pcg32::seed_from_u64(8);
    let mut bounds = |&num_tiles: &u32| {
        let mut bounds = TestBounds::default();
        (bounds.num_tiles, bounds.depth_key) = (num_tiles, rng.random_range(0..1 << DEPTH_KEY_BITS));
        bounds
    };
    counts.iter().map(&mut bounds).collect()
}

/// Lists the visible ones of these splats, in step 0 with entry 2 of the status ring.
fn run_visible(harness: &mut Harness, bounds: &[TestBounds], step: StepUniform) {
    let n = bounds.len() as u32;
    fill_junk(harness, bounds.len());
    harness.fill(Buf::Bounds, bounds);
    harness.fill(Buf::GroupLists, &group_lists(bounds));
    harness.fill(Buf::Visible, &vec![0xabcd_ef01_u32; bounds.len() + 1]);
    harness.fill(Buf::Args, &first_args(n));
    harness.fill(Buf::Status, &[Status::default(); 4]);
    harness.set_step(0, &StepUniform { num_splats: n, status_slot: 2, ..step });
    harness.run(&visible_list(STEP));
}

#[test]
fn visible_splats_are_listed_in_their_order() {
    for mut harness in open_all(&VISIBLE) {
        let mut rng = Pcg32::seed_from_u64(9);
        // The last has more groups than a single scan handles.
        for (n, share) in [(1, 1.0), (255, 0.5), (257, 0.9), (5000, 0.0), (5000, 0.01), (300_000, 0.3)] {
            let counts: Vec<u32> =
                (0..n).map(|_| u32::from(rng.random_bool(share)) * rng.random_range(1..9)).collect();
            let mut bounds = touching(&counts);
            run_visible(
                &mut harness,
                &bounds,
                StepUniform { pair_capacity: 1 << 30, ..StepUniform::default() },
            );
            let seen: Vec<u32> = (0..n).filter(|&i| counts[i as usize] > 0).collect();
            let keys = |bounds: &[TestBounds]| -> Vec<u32> {
                seen.iter().map(|&i| bounds[i as usize].depth_key).collect()
            };
            let got = |name, count| harness.read::<u32>(name, count);
            assert!(got(Buf::ValuesA, seen.len()) == seen, "{n} splats");
            let visible = got(Buf::Visible, 1 + seen.len());
            assert!(visible[0] as usize == seen.len() && visible[1..] == seen);
            assert!(got(Buf::KeysA, seen.len()) == keys(&bounds));
            let counted = seen.len().div_ceil(BLOCK as usize) << DIGIT_BITS;
            assert!(got(Buf::HistogramA, counted) == first_counts(&keys(&bounds))[..counted]);
            let status = harness.read::<Status>(Buf::Status, 4);
            let sums = [seen.len() as u32, counts.iter().sum()];
            assert_eq!([status[2].visible, status[2].needed_pairs], sums);
            assert_eq!([0, 1, 3].map(|i| status[i]), [Status::default(); 3], "status of other steps");
            if let Some(&last) = seen.last() {
                bounds[last as usize].depth_key ^= 1;
                let changed = keys(&bounds);
                assert!(got(Buf::KeysA, seen.len()) != changed, "negative control: another key");
                assert!(got(Buf::HistogramA, counted) != first_counts(&changed)[..counted]);
            }
        }
    }
}

#[test]
fn workgroup_counts_of_later_dispatches_are_folded() {
    for mut harness in open_all(&VISIBLE) {
        let (n, seen) = (2500, 1500);
        let counts: Vec<u32> = (0..n).map(|i| if i % 5 < 3 { 1_000_000 } else { 0 }).collect();
        let step = StepUniform {
            pair_capacity: 1_500_000_000,
            grid: [4096, 4095],
            size_px: [65_536, 1_600],
            partial_stride: PAIR_SUMS,
            segment_pairs: 256,
            ..StepUniform::default()
        };
        run_visible(&mut harness, &touching(&counts), step);
        let (num_tiles, total) = (4096_u32 * 4095, 1_500_000_000_u32);
        let mut expected = first_args(n);
        for (groups, count) in [
            (Groups::OneLater, 1),
            (Groups::ListedBlocks, u32::div_ceil(seen, BLOCK)),
            (Groups::EachListed, seen),
            (Groups::EachVisible, seen),
            (Groups::Visible, u32::div_ceil(seen, GROUP)),
            (Groups::VisibleBlocks, u32::div_ceil(seen, BLOCK)),
            (Groups::VisibleDigits, 1),
            (Groups::PairDigits, 1 << DIGIT_BITS),
            (Groups::Tiles, num_tiles),
            (Groups::Segments, num_tiles + (total - 1) / 256),
            (Groups::LossTiles, 4096 * 100),
            (Groups::PairsAndTiles, total.div_ceil(GROUP)),
            (Groups::PairBlocks, total.div_ceil(BLOCK)),
            (Groups::VisibleTotals, (seen * PAIR_SUMS).div_ceil(GROUP)),
        ] {
            expected[groups as usize] = folded_groups(count);
        }
        let got = harness.read::<DispatchArgs>(Buf::Args, NUM_GROUPS as usize);
        assert_eq!(got, expected);
        assert!(
            got[Groups::PairsAndTiles as usize].y > 1 && got[Groups::Tiles as usize].y > 1,
            "some are folded"
        );
    }
}

#[test]
fn overflowing_sums_saturate() {
    for mut harness in open_all(&VISIBLE) {
        for counts in [vec![0x4000_0000; 5], vec![0x0010_0001; 4096]] {
            let step = StepUniform { pair_capacity: 1 << 30, ..StepUniform::default() };
            run_visible(&mut harness, &touching(&counts), step);
            assert_eq!(harness.read::<Status>(Buf::Status, 4)[2].needed_pairs, u32::MAX);
            let mut expected = vec![DispatchArgs::default(); NUM_GROUPS as usize];
            // What `project` has begun to flush is flushed.
            let seen = counts.len() as u32;
            expected[Groups::ListedBlocks as usize] = folded_groups(seen.div_ceil(BLOCK));
            expected[Groups::EachListed as usize] = folded_groups(seen);
            assert_eq!(harness.read::<DispatchArgs>(Buf::Args, NUM_GROUPS as usize), expected);
        }
    }
}

/// Sets all buffers; those that kernels must write before reading are filled with junk.
fn fill_case(harness: &mut Harness, case: &TileListCase, capacity: u32) {
    let n = case.bounds.len();
    fill_junk(harness, n.max(capacity as usize));
    harness.fill(Buf::Args, &first_args(n as u32));
    fill_lists(harness, case);
    // A binding holds at least one element.
    let none = [TestBounds::default()];
    harness.fill(Buf::Bounds, if case.bounds.is_empty() { &none[..] } else { &case.bounds });
    harness.zeros(Buf::SlotOffsets, 4 * n);
    harness.zeros(Buf::Visible, 4 * (n + 1));
    harness.zeros(Buf::BlockSums, 4 * n.div_ceil(BLOCK as usize));
    for (name, bytes) in [
        (Buf::Slots, 4 * capacity as usize),
        (Buf::Pairs, 12 * capacity as usize),
        (Buf::TileRanges, 8 * case.num_tiles() as usize),
    ] {
        harness.fill(name, &vec![0xabcd_ef01_u32; bytes / 4]);
    }
    harness.fill(Buf::Status, &[Status::default(); 4]);
    for slot in 0..2 {
        harness.set_step(slot, &step_of(case, slot, capacity));
    }
}

/// All dispatches that list the pairs of each tile.
fn listed(step: UniformOffsets, case: &TileListCase) -> Vec<Dispatch> {
    [visible_list(step), order_and_bin(step, case.num_tiles())].concat()
}

/// The lists of visible splats, which each step overwrites.
fn fill_lists(harness: &mut Harness, case: &TileListCase) {
    let mut lists = group_lists(&case.bounds);
    lists.resize(lists.len().max(1), 0);
    harness.fill(Buf::GroupLists, &lists);
}

fn step_of(case: &TileListCase, slot: u32, capacity: u32) -> StepUniform {
    StepUniform {
        num_splats: case.bounds.len() as u32,
        size_px: case.size_px,
        grid: grid_of(case.size_px),
        status_slot: slot,
        pair_capacity: capacity,
        partial_stride: PAIR_SUMS,
        ..StepUniform::default()
    }
}

/// Splats of each tile as the device lists them. Also checks that the slots lead to the pairs of their splats.
fn read_lists(harness: &Harness, case: &TileListCase) -> Vec<Vec<u32>> {
    let total = harness.read::<Status>(Buf::Status, 1)[0].needed_pairs as usize;
    let pairs = harness.read::<u32>(Buf::Pairs, total);
    let bounds = harness.read::<TestBounds>(Buf::Bounds, case.bounds.len());
    let places = harness.read::<u32>(Buf::Slots, total);
    let mut sorted = places.clone();
    sorted.sort_unstable();
    assert!(sorted.into_iter().eq(0..total as u32), "each place has one slot");
    let ranges = harness.read::<[u32; 2]>(Buf::TileRanges, case.num_tiles() as usize);
    let listed: u32 = ranges.iter().map(|&[first, past]| past - first).sum();
    // A splat must sum only pairs that are in a tile: no kernel writes the others.
    for (splat, TestBounds { first_slot, num_tiles, .. }) in
        (0..).zip(&bounds).filter(|(_, b)| b.num_tiles > 0)
    {
        let own = &places[*first_slot as usize..(first_slot + num_tiles) as usize];
        assert!(own.iter().all(|&place| place < listed && pairs[place as usize] == splat), "splat {splat}");
        assert!(own.is_sorted(), "its pairs have the same order by slot and by place");
    }
    assert_eq!(bounds.iter().map(|b| b.num_tiles).sum::<u32>(), listed);
    ranges.iter().map(|&[a, b]| pairs[a as usize..b as usize].to_vec()).collect()
}

#[test]
fn every_tile_lists_its_splats_in_depth_order() {
    for mut harness in open_all(&[&VISIBLE[..], &SORT, &SLOTS, &LISTS].concat()) {
        // One pass; two, where only the last key needs the second digit; two; three; and an empty scene.
        for (seed, size_px, n, passes) in [
            (1, [80, 48], 700, 1),
            (2, [256, 256], 1025, 2),
            (3, [500, 400], 3000, 2),
            (4, [4096, 4096], 2500, 3),
            (5, [64, 64], 0, 1),
        ] {
            let mut case = TileListCase::random(seed, size_px, n);
            assert_eq!(num_tile_passes(case.num_tiles()), passes);
            let total: u32 = case.bounds.iter().map(|b| b.num_tiles).sum();
            fill_case(&mut harness, &case, total.max(1));
            harness.run(&listed(STEP, &case));
            let got = read_lists(&harness, &case);
            assert!(got == case.lists(), "{size_px:?}");
            // Negative control: exchanges two neighbours of equal depth.
            if let Some(list) = got.iter().find(|l| l.windows(2).any(|w| case.same_depth(w[0], w[1]))) {
                let pair = list.windows(2).find(|w| case.same_depth(w[0], w[1])).unwrap();
                case.bounds[pair[0] as usize].depth_key += 1;
                assert!(got != case.lists());
            } else {
                assert!(n == 0 || passes == 3, "there are ties, but where splats are few in a tile");
            }
        }
    }
}

#[test]
fn pairs_that_do_not_fit_disable_all_later_dispatches() {
    for mut harness in open_all(&[&VISIBLE[..], &SORT, &SLOTS, &LISTS].concat()) {
        let case = TileListCase::random(6, [200, 120], 1500);
        let total: u32 = case.bounds.iter().map(|b| b.num_tiles).sum();
        let second = UniformOffsets { step: UNIFORM_STRIDE as u32, ..STEP };
        let run_both = |harness: &mut Harness| {
            for step in [STEP, second] {
                fill_lists(harness, &case);
                harness.run(&listed(step, &case));
            }
        };
        let off = vec![[0; 2]; NUM_GROUPS as usize];

        fill_case(&mut harness, &case, total);
        harness.set_step(0, &step_of(&case, 0, total - 1));
        run_both(&mut harness);
        let args = harness.read::<DispatchArgs>(Buf::Args, NUM_GROUPS as usize);
        assert_eq!(args.iter().map(|a| [a.x, a.x * a.y]).collect::<Vec<_>>(), off);
        let needed = |harness: &Harness| {
            harness.read::<Status>(Buf::Status, 2).iter().map(|s| s.needed_pairs).collect()
        };
        let status: Vec<u32> = needed(&harness);
        assert_eq!(status, [total, 0], "the second step fits, but follows one that does not");
        let untouched = vec![0xabcd_ef01_u32; total as usize];
        assert_eq!(harness.read::<u32>(Buf::Pairs, total as usize), untouched);

        // Negative control: with room for one more pair, both steps are applied.
        fill_case(&mut harness, &case, total);
        run_both(&mut harness);
        let args = harness.read::<DispatchArgs>(Buf::Args, NUM_GROUPS as usize);
        assert!(args.iter().all(|a| a.x * a.y * a.z > 0), "{args:?}");
        let status: Vec<u32> = needed(&harness);
        assert_eq!(status, [total, total]);
        assert_ne!(harness.read::<u32>(Buf::Pairs, total as usize), untouched);
    }
}

#[test]
fn tile_counts_that_differ_by_rounding_do_no_harm() {
    for mut harness in open_all(&[&VISIBLE[..], &SORT, &SLOTS, &LISTS].concat()) {
        let case = TileListCase::random(7, [64, 64], 900);
        let lists = case.lists();
        let mut run = |changes: &[(usize, i32)]| {
            let mut changed = case.clone();
            for &(splat, by) in changes {
                let count = &mut changed.bounds[splat].num_tiles;
                *count = count.checked_add_signed(by).unwrap();
            }
            let total: u32 = changed.bounds.iter().map(|b| b.num_tiles).sum();
            fill_case(&mut harness, &changed, total);
            harness.run(&listed(STEP, &case));
            // An odd number of passes leaves the sorted keys in KeysB.
            let keys = harness.read::<u32>(Buf::KeysB, total as usize);
            let leftover = keys.iter().filter(|&&key| key == case.num_tiles()).count();
            (read_lists(&harness, &changed), leftover)
        };
        let seen: Vec<usize> = (0..900).filter(|&i| case.bounds[i].num_tiles > 0).collect();
        let unseen = (0..900).find(|&i| case.bounds[i].num_tiles == 0).unwrap();
        assert!(run(&[]) == (lists.clone(), 0));
        assert!(run(&[(seen[3], 2), (seen[100], 1), (unseen, 1)]) == (lists.clone(), 4), "spare slots");
        // With one slot too few, the splat is missing from its last tile, and nothing else changes.
        let (got, leftover) = run(&[(seen[7], -1)]);
        let mut expected = lists.clone();
        let last = expected.iter_mut().rev().find(|l| l.contains(&(seen[7] as u32))).unwrap();
        last.retain(|&splat| splat as usize != seen[7]);
        assert!(got == expected && got != lists && leftover == 0);
    }
}
