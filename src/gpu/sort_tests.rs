//! Tests of the radix sort against Rust's stable sort.

use super::harness::Harness;
use super::kernels::{Buf, Groups, KernelId};
use super::layout::{Status, StepUniform};
use super::resources::UniformOffsets;
use super::sort::{depth_sort, first_counts, histogram_entries, sort_args, sort_passes};
use rand::{RngExt as _, SeedableRng as _, seq::SliceRandom as _};
use rand_pcg::Pcg32;
use std::collections::BTreeSet;

pub(super) const SORT: [KernelId; 2] = [KernelId::SortScan, KernelId::SortScatter];

/// The first entry of the uniform ring.
pub(super) const STEP: UniformOffsets = UniformOffsets { step: 0, sort_pass: 0 };

/// Harnesses with the table of sort passes set.
pub(super) fn open_all(kernels: &[KernelId]) -> impl Iterator<Item = Harness> {
    Harness::on_each_driver(kernels).map(|mut harness| {
        for (slot, pass) in (0..).zip(sort_passes()) {
            harness.set_sort_pass(slot, &pass);
        }
        harness.fill(Buf::Status, &[Status::default(); 4]);
        harness
    })
}

/// Fills the buffers of sorts of up to `most` keys with junk that must not be read.
pub(super) fn fill_junk(harness: &mut Harness, most: usize) {
    for name in [Buf::KeysA, Buf::ValuesA, Buf::KeysB, Buf::ValuesB] {
        harness.fill(name, &vec![0xabcd_ef01_u32; most.max(1)]);
    }
    for name in [Buf::HistogramA, Buf::HistogramB] {
        harness.fill(name, &vec![0xabcd_ef01_u32; histogram_entries(most as u32) as usize]);
    }
}

/// Sets the buffers of a sort of these keys by depth, with these values.
fn fill_sort(harness: &mut Harness, keys: &[u32], values: &[u32]) {
    fill_junk(harness, keys.len());
    if !keys.is_empty() {
        harness.fill(Buf::KeysA, keys);
        harness.fill(Buf::ValuesA, values);
    }
    harness.fill(Buf::HistogramA, &first_counts(keys));
    harness.fill(Buf::Args, &sort_args(keys.len() as u32));
    harness.fill(Buf::Status, &[Status { visible: keys.len() as u32, ..Status::default() }]);
    harness.set_step(0, &StepUniform::default());
}

/// As [`fill_sort`], with the indices of the keys as values.
fn fill_indexed(harness: &mut Harness, keys: &[u32]) {
    fill_sort(harness, keys, &(0..keys.len() as u32).collect::<Vec<_>>());
}

/// Keys of 28 bits with only `distinct` values, spread over all digits; some are those of invisible splats.
fn random_keys(count: usize, distinct: u32, rng: &mut Pcg32) -> Vec<u32> {
    let mask = (1 << 28) - 1;
    let mut key = || match rng.random_range(0..distinct + distinct / 16) {
        i if i < distinct => i.wrapping_mul(0x9e37_79b1) & mask,
        _ => mask,
    };
    (0..count).map(|_| key()).collect()
}

/// Indices in the order of the keys, then by index.
fn sorted_indices(keys: &[u32]) -> Vec<u32> {
    let mut order: Vec<u32> = (0..keys.len() as u32).collect();
    order.sort_by_key(|&i| keys[i as usize]);
    order
}

#[test]
fn the_order_is_that_of_a_stable_sort_in_rust() {
    for mut harness in open_all(&SORT) {
        let mut rng = Pcg32::seed_from_u64(1);
        for (count, distinct) in [0, 1, 255, 256, 1023, 1024, 1025, 5000, 16_384, 16_385, 70_000, 1_060_000]
            .into_iter()
            .flat_map(|count| [(count, 1), (count, 40), (count, 1 << 28)])
        {
            let keys = random_keys(count, distinct, &mut rng);
            fill_indexed(&mut harness, &keys);
            harness.run(&depth_sort(STEP));
            let order = sorted_indices(&keys);
            assert!(harness.read::<u32>(Buf::ValuesA, count) == order, "{count} keys, {distinct} different");
            let sorted: Vec<u32> = order.iter().map(|&i| keys[i as usize]).collect();
            assert!(harness.read::<u32>(Buf::KeysA, count) == sorted, "{count} keys, {distinct} different");
        }
    }
}

#[test]
fn shuffled_ties_are_detected() {
    for mut harness in open_all(&SORT) {
        let mut rng = Pcg32::seed_from_u64(2);
        let keys = random_keys(5000, 40, &mut rng);
        // Starts from indices shuffled as by an unstable sort.
        let mut shuffled: Vec<u32> = (0..5000).collect();
        for tie in keys.iter().copied().collect::<BTreeSet<u32>>() {
            let places: Vec<usize> = (0..5000).filter(|&i| keys[i] == tie).collect();
            let mut values: Vec<u32> = places.iter().map(|&i| i as u32).collect();
            values.shuffle(&mut rng);
            places.iter().zip(values).for_each(|(&i, value)| shuffled[i] = value);
        }
        fill_sort(&mut harness, &keys, &shuffled);
        harness.run(&depth_sort(STEP));
        let got = harness.read::<u32>(Buf::ValuesA, 5000);
        assert!(got.is_sorted_by_key(|&i| keys[i as usize]), "it is sorted by key");
        assert_ne!(got, sorted_indices(&keys));
    }
}

#[test]
fn a_folded_dispatch_sorts_like_an_unfolded_one() {
    for mut harness in open_all(&SORT) {
        let keys = random_keys(5000, 700, &mut Pcg32::seed_from_u64(3));
        fill_indexed(&mut harness, &keys);
        // Five blocks in six workgroups.
        harness.set_groups(Groups::VisibleBlocks, 2, 3);
        harness.run(&depth_sort(STEP));
        assert_eq!(harness.read::<u32>(Buf::ValuesA, 5000), sorted_indices(&keys));
        fill_indexed(&mut harness, &keys);
        harness.set_groups(Groups::VisibleBlocks, 2, 2);
        harness.run(&depth_sort(STEP));
        assert_ne!(harness.read::<u32>(Buf::ValuesA, 5000), sorted_indices(&keys), "a block is missing");
    }
}
