//! Behaviour of the image cache: its budget, order, prefetching and errors.

use super::*;
use crate::camera::Pinhole;
use crate::capture::lens::{Distortion, Lens};
use image::metadata::Orientation;
use rand::SeedableRng as _;
use rand::seq::SliceRandom as _;
use rand_pcg::Pcg64Mcg;
use std::path::Path;

const SIDE: u32 = 10;
const BYTES: u64 = 300;

fn store(folder: &Path, count: u8, budget_bytes: u64) -> ImageStore {
    let recipes = (0..count)
        .map(|i| {
            let photo = folder.join(format!("{i}.png"));
            image::RgbImage::from_pixel(SIDE, SIDE, image::Rgb([i; 3])).save(&photo).unwrap();
            Recipe {
                photo,
                photo_size: (SIDE, SIDE),
                turn: Orientation::NoTransforms,
                has_alpha: false,
                photo_bytes: BYTES,
                mask_turn: Orientation::NoTransforms,
                mask: None,
                mask_bytes: 0,
                mask_invert: false,
                lens: Lens {
                    pinhole: Pinhole {
                        width_px: SIDE,
                        height_px: SIDE,
                        fx_px: 1.0,
                        fy_px: 1.0,
                        cx_px: 0.0,
                        cy_px: 0.0,
                    },
                    distortion: Distortion::None,
                },
                focal_scale: 1.0,
                memory_bytes: BYTES,
                size: (SIDE, SIDE),
                background: [0.0; 3],
                keep_alpha: false,
            }
        })
        .collect();
    ImageStore::new(recipes, |_| true, budget_bytes)
}

/// Orders of 40 views, a new one for each epoch.
fn epochs(count: u64) -> Vec<usize> {
    let order = |seed: u64| {
        let mut views: Vec<usize> = (0..40).collect();
        views.shuffle(&mut Pcg64Mcg::seed_from_u64(seed));
        views
    };
    (0..count).flat_map(order).collect()
}

/// Photos to decode if those used last stay.
fn decodes_of_last_used(order: &[usize], photos: usize) -> u64 {
    let mut cached: Vec<usize> = Vec::new();
    let mut decodes = 0;
    for &view in order {
        match cached.iter().position(|&v| v == view) {
            Some(at) => drop(cached.remove(at)),
            None => decodes += 1,
        }
        cached.push(view);
        if cached.len() > photos {
            cached.remove(0);
        }
    }
    decodes
}

#[test]
fn of_a_cache_for_part_of_the_photos_a_fixed_set_stays() {
    let folder = tempfile::tempdir().unwrap();
    // 28 of 40 photos: 24 stay, 4 are the window.
    let store = store(folder.path(), 40, 28 * BYTES + 10);
    let order = epochs(20);
    for &view in &order {
        assert_eq!(store.get(view).unwrap().rgb[0], view as u8);
        assert!(store.cached_bytes() <= 28 * BYTES + 10);
    }
    let decodes = store.shared.lock().decodes;
    let of_last_used = decodes_of_last_used(&order, 28);
    println!("{decodes} decodes of {} draws, {of_last_used} if those used last stay", order.len());
    // 40 at first, then 16 an epoch less those that the window happens to have.
    assert!(decodes <= 40 + 19 * 16, "{decodes}");
    // Negative control: the window as large as the cache.
    assert!(of_last_used > decodes + 80, "{of_last_used}");
    let stays: Vec<usize> = (0..40).filter(|&view| store.shared.lock().kept.contains_key(&view)).collect();
    assert_eq!(stays, (0..24).collect::<Vec<_>>());
}

#[test]
fn a_budget_below_one_photo_caches_nothing_but_still_decodes() {
    let folder = tempfile::tempdir().unwrap();
    let store = store(folder.path(), 2, 10);
    store.prefetch(&WantedPhoto::full(&[0, 1]));
    assert_eq!(store.get(1).unwrap().rgb[0], 1);
    assert!(store.cached_bytes() == 0 && !store.keeps_all());
}

#[test]
fn photos_do_not_depend_on_prefetching_or_threads() {
    let folder = tempfile::tempdir().unwrap();
    for budget_bytes in [0, BYTES, 5 * BYTES, 1 << 20] {
        let store = store(folder.path(), 12, budget_bytes);
        for round in 0..20 {
            let wanted = |i: usize| {
                let full = WantedPhoto { view: (i * 5 + round) % 12, reduced_px: None };
                if round % 3 == 0 { half(full.view) } else { full }
            };
            store.prefetch(&(0..12).map(wanted).collect::<Vec<_>>());
            std::thread::scope(|scope| {
                for t in 0..3 {
                    let store = &store;
                    scope.spawn(move || {
                        for i in 0..12 {
                            let view = (i * 7 + t) % 12;
                            assert!(store.get(view).unwrap().rgb.iter().all(|&p| p == view as u8));
                            let half = store.get_reduced(view, (SIDE / 2, SIDE / 2)).unwrap();
                            assert!(half.rgb.len() == 75 && half.rgb.iter().all(|&p| p == view as u8));
                            assert!(store.cached_bytes() <= budget_bytes);
                        }
                    });
                }
            });
        }
    }
}

#[test]
fn prefetched_photos_that_are_never_requested_do_not_block_later_prefetches() {
    let folder = tempfile::tempdir().unwrap();
    let store = store(folder.path(), 6, 4 * BYTES);
    let decodes = || store.shared.lock().decodes;
    for (views, expected) in [([0, 1], 2), ([2, 3], 4), ([4, 5], 6)] {
        store.prefetch(&WantedPhoto::full(&views));
        wait_until(|| decodes() == expected);
        assert_eq!(decodes(), expected, "{views:?}");
    }
}

/// Bounded: about 10 s before a test fails.
fn wait_until(is_so: impl Fn() -> bool) {
    for _ in 0..10_000 {
        if is_so() {
            break;
        }
        std::thread::sleep(std::time::Duration::from_millis(1));
    }
}

/// Photo of a view at half its size.
fn half(view: usize) -> WantedPhoto {
    WantedPhoto { view, reduced_px: Some((SIDE / 2, SIDE / 2)) }
}

#[test]
fn photos_of_a_smaller_size_are_made_ahead_for_one_use() {
    let folder = tempfile::tempdir().unwrap();
    // All stay, and none: then two fit that wait, the full one while it is made.
    for budget_bytes in [1 << 20, 2 * BYTES] {
        let store = store(folder.path(), 4, budget_bytes);
        let has = |view| store.shared.lock().has(half(view));
        let get = |view| store.get_reduced(view, (SIDE / 2, SIDE / 2)).unwrap();
        store.prefetch(&[half(2), half(0)]);
        wait_until(|| has(0) && has(2));
        assert!(has(0) && has(2) && !has(1));
        let decodes = store.shared.lock().decodes;
        let image = get(2);
        assert_eq!((image.width_px, image.height_px, image.rgb[0]), (SIDE / 2, SIDE / 2, 2));
        assert_eq!(store.shared.lock().decodes, decodes, "it was there");
        assert!(!has(2) && has(0), "for one use");
        // Another size is another photo.
        assert_eq!(store.get_reduced(0, (3, 2)).unwrap().rgb.len(), 18);
        assert!(has(0));
        store.prefetch(&[half(3)]);
        assert!(!has(0), "no longer wanted");
        assert_eq!(get(3).rgb[0], 3);
        assert_eq!(store.shared.lock().waiting_bytes, 0);
        // On demand, also of a photo in the cache.
        assert_eq!(store.get(1).unwrap().reduced(SIDE / 2, SIDE / 2), *get(1));
    }
}

#[test]
fn photos_reduced_ahead_keep_within_the_budget() {
    let folder = tempfile::tempdir().unwrap();
    // All four photos stay; beside them is room for two of the smaller ones, for none, or for all.
    for (room_bytes, ahead) in [(150, 2), (74, 0), (300, 4)] {
        let store = store(folder.path(), 4, 4 * BYTES + room_bytes);
        assert!(store.keeps_all());
        let made = || (0..4).filter(|&view| store.shared.lock().has(half(view))).count();
        store.check_all();
        store.prefetch(&[0, 1, 2, 3].map(half));
        wait_until(|| made() == ahead);
        // Time for one more.
        std::thread::sleep(std::time::Duration::from_millis(20));
        assert_eq!(made(), ahead, "{room_bytes} bytes");
        assert_eq!(store.cached_bytes(), 4 * BYTES + 75 * ahead as u64);
        // The use of one makes room for the next.
        assert_eq!(store.get_reduced(0, (SIDE / 2, SIDE / 2)).unwrap().rgb[0], 0);
        wait_until(|| made() == ahead.min(3));
        assert_eq!(made(), ahead.min(3), "{room_bytes} bytes");
        assert!(store.cached_bytes() <= store.budget_bytes());
    }
}

#[test]
fn a_photo_that_is_being_made_is_made_ahead_at_another_size_after_that() {
    let folder = tempfile::tempdir().unwrap();
    let store = store(folder.path(), 2, 1 << 20);
    let has = |view| store.shared.lock().has(half(view));
    let at = |reduced_px| WantedPhoto { view: 0, reduced_px };
    for (in_flight, is_queued) in [(at(Some((3, 2))), true), (at(None), true), (half(0), false)] {
        store.shared.lock().in_flight.insert(0, in_flight);
        store.prefetch(&[half(0), half(1)]);
        wait_until(|| has(1));
        assert!(has(1) && !has(0));
        let queued: Vec<_> = store.shared.lock().queue.iter().copied().collect();
        // The same size need not be made twice.
        assert_eq!(queued, if is_queued { vec![half(0)] } else { vec![] });
        drop(InFlight { shared: &store.shared, view: 0, held_bytes: 0 });
        wait_until(|| has(0) == is_queued);
        assert_eq!(has(0), is_queued);
        store.prefetch(&[]);
    }
}

#[test]
fn batches_longer_than_the_cache_decode_each_photo_once() {
    const BATCH: usize = 16;
    let folder = tempfile::tempdir().unwrap();
    // Below one batch, and below two: the photos of a batch and of the next one do not fit.
    for photos in [8, 24] {
        let store = store(folder.path(), 64, photos * BYTES);
        let views: Vec<usize> = (0..64).map(|i| (i * 5) % 64).collect();
        for first in (0..64).step_by(BATCH) {
            store.prefetch(&WantedPhoto::full(&views[first..views.len().min(first + 2 * BATCH)]));
            let held: Vec<_> = views[first..first + BATCH].iter().map(|&v| store.get(v).unwrap()).collect();
            assert!(held.iter().zip(&views[first..]).all(|(image, &v)| image.rgb[0] == v as u8));
            assert!(store.cached_bytes() <= photos * BYTES);
        }
        assert_eq!(store.shared.lock().decodes, 64, "budget of {photos} photos");
    }
}

#[test]
fn errors_of_prefetched_photos_surface_on_request() {
    let folder = tempfile::tempdir().unwrap();
    let store = store(folder.path(), 2, 1 << 20);
    std::fs::write(folder.path().join("1.png"), b"no photo").unwrap();
    store.prefetch(&WantedPhoto::full(&[1, 0, 99]));
    assert!(store.get(0).is_ok());
    for _ in 0..2 {
        let error = store.get(1).unwrap_err().to_string();
        assert!(error.contains("1.png"), "{error}");
    }
}

#[test]
fn photos_decoded_at_once_are_bounded_by_threads_and_memory() {
    const MIB: u64 = 1 << 20;
    let at_once =
        |needs: &[u64], threads| decoded_at_once(needs.iter().map(|mib| mib * MIB).collect(), threads) / MIB;
    assert_eq!(at_once(&[], 2), 0);
    assert_eq!(at_once(&[3, 5, 4], 2), 9);
    assert_eq!(at_once(&[600, 1], 2), 600, "a single one may need more");
    // Two do not fit, so that the second waits for the first.
    assert_eq!(at_once(&[280; 6], 2), 280);
    assert_eq!(at_once(&[165; 10], 8), 495);
    assert_eq!(at_once(&[280, 280, 200], 2), 480);
}
