//! Behaviour of the image cache: its budget, order, prefetching and errors.

use super::*;
use crate::camera::Pinhole;
use crate::capture::lens::{Distortion, Lens};
use image::metadata::Orientation;
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
    ImageStore::new(recipes, budget_bytes)
}

#[test]
fn the_budget_is_kept_and_the_least_recently_used_photo_goes_first() {
    let folder = tempfile::tempdir().unwrap();
    let store = store(folder.path(), 4, 2 * BYTES + 10);
    for view in [0, 1, 0, 2] {
        assert_eq!(store.get(view).unwrap().rgb[0], view as u8);
        assert!(store.cached_bytes() <= 2 * BYTES + 10);
    }
    let decodes = |s: &ImageStore| s.shared.lock().decodes;
    assert_eq!(decodes(&store), 3);
    store.get(0).unwrap();
    assert_eq!(decodes(&store), 3, "0 was used after 1 and must have stayed");
    store.get(1).unwrap();
    assert_eq!(decodes(&store), 4, "1 must have gone");
}

#[test]
fn a_budget_below_one_photo_caches_nothing_but_still_decodes() {
    let folder = tempfile::tempdir().unwrap();
    let store = store(folder.path(), 2, 10);
    store.prefetch(&[0, 1]);
    assert_eq!(store.get(1).unwrap().rgb[0], 1);
    assert_eq!(store.cached_bytes(), 0);
}

#[test]
fn photos_do_not_depend_on_prefetching_or_threads() {
    let folder = tempfile::tempdir().unwrap();
    for budget_bytes in [0, BYTES, 5 * BYTES, 1 << 20] {
        let store = store(folder.path(), 12, budget_bytes);
        for round in 0..20 {
            store.prefetch(&(0..12).map(|i| (i * 5 + round) % 12).collect::<Vec<_>>());
            std::thread::scope(|scope| {
                for t in 0..3 {
                    let store = &store;
                    scope.spawn(move || {
                        for i in 0..12 {
                            let view = (i * 7 + t) % 12;
                            assert!(store.get(view).unwrap().rgb.iter().all(|&p| p == view as u8));
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
        store.prefetch(&views);
        // Bounded wait: about 10 s before the test fails.
        for _ in 0..10_000 {
            if decodes() == expected {
                break;
            }
            std::thread::sleep(std::time::Duration::from_millis(1));
        }
        assert_eq!(decodes(), expected, "{views:?}");
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
            store.prefetch(&views[first..views.len().min(first + 2 * BATCH)]);
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
    store.prefetch(&[1, 0, 99]);
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
