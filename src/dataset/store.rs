//! Photos in memory: decoded when asked for, or shortly before by background threads, and dropped in
//! the order of their last use when a budget of bytes is spent, those that wait for their use last.
//! Never changes what a photo looks like.

use super::decode::Recipe;
use crate::Result;
use crate::image::TargetImage;
use std::collections::{HashMap, HashSet, VecDeque};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;

/// Background threads that decode ahead; training needs the other cores.
const PREFETCH_THREADS: usize = 2;

struct Cached {
    image: Arc<TargetImage>,
    last_use: u64,
    /// Decoded ahead and not asked for yet.
    unused: bool,
}

#[derive(Default)]
struct State {
    cached: HashMap<usize, Cached>,
    bytes: u64,
    unused_bytes: u64,
    clock: u64,
    in_flight: HashSet<usize>,
    queue: VecDeque<usize>,
    stopped: bool,
    decodes: u64,
}

struct Shared {
    recipes: Vec<Recipe>,
    budget_bytes: u64,
    state: Mutex<State>,
    /// A decode ended.
    decoded: Condvar,
    /// There is work for the background threads, or the end.
    work: Condvar,
}

/// Photos of a capture on demand.
pub(crate) struct ImageStore {
    shared: Arc<Shared>,
    threads: Mutex<Vec<JoinHandle<()>>>,
}

/// Clears the mark of a decode even if it panics, so that nobody waits for it for ever.
struct InFlight<'a> {
    shared: &'a Shared,
    view: usize,
}

impl Drop for InFlight<'_> {
    fn drop(&mut self) {
        self.shared.lock().in_flight.remove(&self.view);
        self.shared.decoded.notify_all();
    }
}

fn num_bytes(image: &TargetImage) -> u64 {
    (image.rgb.len() + image.mask.as_ref().map_or(0, Vec::len)) as u64
}

impl State {
    /// Takes an image out of the cache.
    fn remove(&mut self, view: usize) {
        if let Some(old) = self.cached.remove(&view) {
            let bytes = num_bytes(&old.image);
            self.bytes -= bytes;
            self.unused_bytes -= if old.unused { bytes } else { 0 };
        }
    }

    /// Keeps an image, dropping the least recently used ones; one above the budget is not kept.
    fn insert(&mut self, view: usize, image: &Arc<TargetImage>, unused: bool, budget_bytes: u64) {
        let bytes = num_bytes(image);
        self.decodes += 1;
        self.remove(view);
        if bytes > budget_bytes {
            return;
        }
        while self.bytes + bytes > budget_bytes {
            // One that was decoded ahead goes last: it would be decoded again at once.
            let oldest = self.cached.iter().min_by_key(|(_, c)| (c.unused, c.last_use)).map(|(&v, _)| v);
            match oldest {
                Some(oldest) => self.remove(oldest),
                None => break,
            }
        }
        self.clock += 1;
        self.bytes += bytes;
        self.unused_bytes += if unused { bytes } else { 0 };
        let cached = Cached { image: Arc::clone(image), last_use: self.clock, unused };
        self.cached.insert(view, cached);
    }

    /// Images decoded for an earlier wish no longer wait for their use: they may go like all others.
    fn forget_wishes_except(&mut self, views: &[usize]) {
        let wanted: HashSet<&usize> = views.iter().collect();
        let mut forgotten = 0;
        for (view, cached) in &mut self.cached {
            if cached.unused && !wanted.contains(view) {
                cached.unused = false;
                forgotten += num_bytes(&cached.image);
            }
        }
        self.unused_bytes -= forgotten;
    }

    /// An image from the cache, marked as used.
    fn take(&mut self, view: usize) -> Option<Arc<TargetImage>> {
        self.clock += 1;
        let cached = self.cached.get_mut(&view)?;
        cached.last_use = self.clock;
        if std::mem::take(&mut cached.unused) {
            self.unused_bytes -= num_bytes(&cached.image);
        }
        Some(Arc::clone(&cached.image))
    }
}

impl Shared {
    /// The state stays consistent between any two statements, so a panic elsewhere does not spoil it.
    fn lock(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Next view for a background thread; `None` at the end.
    fn next_ahead(&self) -> Option<usize> {
        let mut state = self.lock();
        loop {
            if state.stopped {
                return None;
            }
            // Half of the budget at most waits unused: else photos would push each other out unseen.
            if let Some(&view) = state.queue.front() {
                if state.cached.contains_key(&view) || state.in_flight.contains(&view) {
                    state.queue.pop_front();
                    continue;
                }
                if state.unused_bytes + self.recipes[view].num_bytes() <= self.budget_bytes / 2 {
                    state.queue.pop_front();
                    state.in_flight.insert(view);
                    return Some(view);
                }
            }
            state = self.work.wait(state).unwrap_or_else(PoisonError::into_inner);
        }
    }

    fn run_ahead(&self) {
        while let Some(view) = self.next_ahead() {
            let _mark = InFlight { shared: self, view };
            // Whoever asks for the view decodes it again and gets the error.
            if let Ok(image) = self.recipes[view].decode() {
                self.lock().insert(view, &Arc::new(image), true, self.budget_bytes);
            }
        }
    }
}

impl ImageStore {
    pub fn new(recipes: Vec<Recipe>, budget_bytes: u64) -> Self {
        Self {
            shared: Arc::new(Shared {
                recipes,
                budget_bytes,
                state: Mutex::default(),
                decoded: Condvar::new(),
                work: Condvar::new(),
            }),
            threads: Mutex::default(),
        }
    }

    /// The photo of a view.
    pub fn get(&self, view: usize) -> Result<Arc<TargetImage>> {
        let shared = &*self.shared;
        let mut state = shared.lock();
        // Its wish is granted here: decoded again later, it would wait for nobody.
        if let Some(at) = state.queue.iter().position(|&v| v == view) {
            state.queue.remove(at);
        }
        loop {
            if let Some(image) = state.take(view) {
                // Room for the background threads.
                shared.work.notify_all();
                return Ok(image);
            }
            if state.in_flight.insert(view) {
                break;
            }
            state = shared.decoded.wait(state).unwrap_or_else(PoisonError::into_inner);
        }
        drop(state);
        let _mark = InFlight { shared, view };
        let image = Arc::new(shared.recipes[view].decode()?);
        shared.lock().insert(view, &image, false, shared.budget_bytes);
        Ok(image)
    }

    /// Decodes these views in the background, in this order; replaces an earlier wish.
    pub fn prefetch(&self, views: &[usize]) {
        let num_recipes = self.shared.recipes.len();
        let mut state = self.shared.lock();
        state.queue = views.iter().copied().filter(|&v| v < num_recipes).collect();
        state.forget_wishes_except(views);
        drop(state);
        let mut threads = self.threads.lock().unwrap_or_else(PoisonError::into_inner);
        while threads.len() < PREFETCH_THREADS {
            let shared = Arc::clone(&self.shared);
            let spawned = std::thread::Builder::new()
                .name("photo-prefetch".to_owned())
                .spawn(move || shared.run_ahead());
            match spawned {
                Ok(thread) => threads.push(thread),
                // Photos are decoded when asked for.
                Err(_) => break,
            }
        }
        self.shared.work.notify_all();
    }

    /// Bytes held now.
    pub fn cached_bytes(&self) -> u64 {
        self.shared.lock().bytes
    }
}

impl Drop for ImageStore {
    fn drop(&mut self) {
        self.shared.lock().stopped = true;
        self.shared.work.notify_all();
        for thread in self.threads.get_mut().unwrap_or_else(PoisonError::into_inner).drain(..) {
            // A panic there has already been paid for: the view was decoded in the foreground.
            let _ = thread.join();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::Pinhole;
    use crate::dataset::lens::{Distortion, Lens};
    use image::metadata::Orientation;
    use std::path::Path;

    const SIDE: u32 = 10;
    const BYTES: u64 = 300;

    fn store(folder: &Path, count: u8, budget_bytes: u64) -> ImageStore {
        let recipes = (0..count)
            .map(|i| {
                let image = folder.join(format!("{i}.png"));
                image::RgbImage::from_pixel(SIDE, SIDE, image::Rgb([i; 3])).save(&image).unwrap();
                Recipe {
                    image,
                    image_size: (SIDE, SIDE),
                    turn: Orientation::NoTransforms,
                    mask: None,
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
                    size: (SIDE, SIDE),
                    background: [0.0; 3],
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
    fn a_budget_below_one_photo_keeps_none_but_still_serves() {
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
    fn photos_nobody_asked_for_do_not_block_later_prefetching() {
        let folder = tempfile::tempdir().unwrap();
        let store = store(folder.path(), 6, 4 * BYTES);
        let decodes = || store.shared.lock().decodes;
        for (wish, expected) in [([0, 1], 2), ([2, 3], 4), ([4, 5], 6)] {
            store.prefetch(&wish);
            // Bounded wait: about 10 s before the test fails.
            for _ in 0..10_000 {
                if decodes() == expected {
                    break;
                }
                std::thread::sleep(std::time::Duration::from_millis(1));
            }
            assert_eq!(decodes(), expected, "{wish:?}");
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
                let held: Vec<_> =
                    views[first..first + BATCH].iter().map(|&v| store.get(v).unwrap()).collect();
                assert!(held.iter().zip(&views[first..]).all(|(image, &v)| image.rgb[0] == v as u8));
                assert!(store.cached_bytes() <= photos * BYTES);
            }
            assert_eq!(store.shared.lock().decodes, 64, "budget of {photos} photos");
        }
    }

    #[test]
    fn errors_of_prefetched_photos_surface_when_they_are_asked_for() {
        let folder = tempfile::tempdir().unwrap();
        let store = store(folder.path(), 2, 1 << 20);
        std::fs::write(folder.path().join("1.png"), b"no image").unwrap();
        store.prefetch(&[1, 0, 99]);
        assert!(store.get(0).is_ok());
        for _ in 0..2 {
            let error = store.get(1).unwrap_err().to_string();
            assert!(error.contains("1.png"), "{error}");
        }
    }
}
