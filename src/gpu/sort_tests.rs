//! Tests of the radix sort against Rust's stable sort.

use super::harness::Harness;
use super::kernels::{Buf, Groups, KernelId};
use super::layout::{Status, StepUniform};
use super::resources::UniformOffsets;
use super::sort::{depth_sort, first_args, histogram_entries, sort_passes};
use rand::{RngExt as _, SeedableRng as _, seq::SliceRandom as _};
use rand_pcg::Pcg32;
use std::collections::BTreeSet;

pub(super) const SORT: [KernelId; 3] = [KernelId::SortCount, KernelId::SortScan, KernelId::SortScatter];

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

/// Sets the buffers of a sort by depth; everything except the keys is filled with junk that must not be read.
pub(super) fn fill_sort(harness: &mut Harness, keys: &[u32], most: usize) {
    let junk = vec![0xabcd_ef01_u32; most.max(1)];
    let mut padded = junk.clone();
    padded[..keys.len()].copy_from_slice(keys);
    harness.fill(Buf::KeysA, &padded);
    for name in [Buf::ValuesA, Buf::KeysB, Buf::ValuesB] {
        harness.fill(name, &junk);
    }
    harness.fill(Buf::Histogram, &vec![0xabcd_ef01_u32; histogram_entries(most as u32) as usize]);
    harness.fill(Buf::Args, &first_args(keys.len() as u32));
    harness.set_step(0, &StepUniform { num_splats: keys.len() as u32, ..StepUniform::default() });
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
        for (count, distinct) in [0, 1, 255, 256, 1023, 1024, 1025, 5000, 70_000]
            .into_iter()
            .flat_map(|count| [(count, 1), (count, 40), (count, 1 << 28)])
        {
            let keys = random_keys(count, distinct, &mut rng);
            fill_sort(&mut harness, &keys, count);
            harness.run(&depth_sort(STEP));
            let order = sorted_indices(&keys);
            assert!(harness.read::<u32>(Buf::ValuesB, count) == order, "{count} keys, {distinct} different");
            let sorted: Vec<u32> = order.iter().map(|&i| keys[i as usize]).collect();
            assert!(harness.read::<u32>(Buf::KeysB, count) == sorted, "{count} keys, {distinct} different");
        }
    }
}

#[test]
fn shuffled_ties_are_detected() {
    for mut harness in open_all(&SORT) {
        let mut rng = Pcg32::seed_from_u64(2);
        let keys = random_keys(5000, 40, &mut rng);
        fill_sort(&mut harness, &keys, keys.len());
        // Starts from the values in ValuesA instead of the indices, shuffled as by an unstable sort.
        let mut passes = sort_passes();
        passes[0].identity_values = 0;
        harness.set_sort_pass(0, &passes[0]);
        let mut shuffled: Vec<u32> = (0..5000).collect();
        for tie in keys.iter().copied().collect::<BTreeSet<u32>>() {
            let places: Vec<usize> = (0..5000).filter(|&i| keys[i] == tie).collect();
            let mut values: Vec<u32> = places.iter().map(|&i| i as u32).collect();
            values.shuffle(&mut rng);
            places.iter().zip(values).for_each(|(&i, value)| shuffled[i] = value);
        }
        harness.fill(Buf::ValuesA, &shuffled);
        harness.run(&depth_sort(STEP));
        let got = harness.read::<u32>(Buf::ValuesB, 5000);
        assert!(got.is_sorted_by_key(|&i| keys[i as usize]), "it is sorted by key");
        assert_ne!(got, sorted_indices(&keys));
    }
}

#[test]
fn a_folded_dispatch_sorts_like_an_unfolded_one() {
    for mut harness in open_all(&SORT) {
        let keys = random_keys(5000, 700, &mut Pcg32::seed_from_u64(3));
        fill_sort(&mut harness, &keys, keys.len());
        // Five blocks in six workgroups.
        harness.set_groups(Groups::SplatBlocks, 2, 3);
        harness.run(&depth_sort(STEP));
        assert_eq!(harness.read::<u32>(Buf::ValuesB, 5000), sorted_indices(&keys));
        fill_sort(&mut harness, &keys, keys.len());
        harness.set_groups(Groups::SplatBlocks, 2, 2);
        harness.run(&depth_sort(STEP));
        assert_ne!(harness.read::<u32>(Buf::ValuesB, 5000), sorted_indices(&keys), "a block is missing");
    }
}
