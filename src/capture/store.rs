//! The image cache: photos decoded on demand, or shortly before by background threads. When its budget of
//! bytes is spent, the least recently used photo is dropped first, and those decoded ahead last.

use super::decode::{Decoded, Recipe};
use super::jpeg_end;
use crate::Result;
use crate::image::TargetImage;
use rayon::prelude::*;
use std::collections::{HashMap, HashSet, VecDeque};
use std::path::PathBuf;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;

/// Background threads that decode ahead; training needs the other cores.
const PREFETCH_THREADS: usize = 2;

/// Memory for decoding several photos at once; a single one may need more.
const DECODING_BYTES_MAX: u64 = 512 << 20;

struct Cached {
    image: Arc<TargetImage>,
    last_use: u64,
    /// Decoded ahead and not requested yet.
    unused: bool,
}

#[derive(Default)]
struct State {
    cached: HashMap<usize, Cached>,
    bytes: u64,
    unused_bytes: u64,
    clock: u64,
    in_flight: HashSet<usize>,
    /// Working memory of the decodes under way.
    decoding_bytes: u64,
    queue: VecDeque<usize>,
    stopped: bool,
    decodes: u64,
}

struct Shared {
    recipes: Vec<Recipe>,
    budget_bytes: u64,
    state: Mutex<State>,
    /// Signalled when a decode has ended.
    decoded: Condvar,
    /// Signalled when the background threads have work or must stop.
    work: Condvar,
}

/// What making a photo showed.
pub(crate) struct CheckedPhoto {
    /// Whether its mask leaves any pixel.
    pub has_pixels: bool,
    /// Share of the pixels that its mask leaves out; `None` without mask.
    pub masked_share: Option<f64>,
    /// Those of its files that end early but can be decoded.
    pub cut_off: Vec<PathBuf>,
}

/// Photos of a capture on demand.
pub(crate) struct ImageStore {
    shared: Arc<Shared>,
    threads: Mutex<Vec<JoinHandle<()>>>,
}

/// Clears the mark of a decode even if it panics, so that no thread waits for it forever.
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

/// Working memory that a decode holds.
struct Working<'a> {
    shared: &'a Shared,
    bytes: u64,
}

impl Drop for Working<'_> {
    fn drop(&mut self) {
        self.shared.lock().decoding_bytes -= self.bytes;
        self.shared.decoded.notify_all();
    }
}

impl State {
    /// Takes an image out of the cache.
    fn remove(&mut self, view: usize) {
        if let Some(old) = self.cached.remove(&view) {
            let bytes = old.image.num_bytes();
            self.bytes -= bytes;
            self.unused_bytes -= if old.unused { bytes } else { 0 };
        }
    }

    /// Keeps an image, dropping the least recently used ones; one above the budget is not kept.
    fn insert(&mut self, view: usize, image: &Arc<TargetImage>, unused: bool, budget_bytes: u64) {
        let bytes = image.num_bytes();
        self.decodes += 1;
        self.remove(view);
        if bytes > budget_bytes {
            return;
        }
        while self.bytes + bytes > budget_bytes {
            // Photos decoded ahead go last: they are about to be used.
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

    /// Photos decoded for an earlier prefetch no longer count as waiting for their use.
    fn forget_prefetched_except(&mut self, views: &[usize]) {
        let wanted: HashSet<&usize> = views.iter().collect();
        let mut forgotten = 0;
        for (view, cached) in &mut self.cached {
            if cached.unused && !wanted.contains(view) {
                cached.unused = false;
                forgotten += cached.image.num_bytes();
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
            self.unused_bytes -= cached.image.num_bytes();
        }
        Some(Arc::clone(&cached.image))
    }
}

impl Shared {
    /// The state is consistent between any two statements, so a poisoned lock does no harm.
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
            // At most half of the budget waits unused, or photos decoded ahead would evict one another.
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

    /// Waits until there is memory for making a photo, and holds it.
    fn working(&self, view: usize) -> Working<'_> {
        let bytes = self.recipes[view].working_bytes();
        let mut state = self.lock();
        while state.decoding_bytes > 0 && state.decoding_bytes + bytes > DECODING_BYTES_MAX {
            state = self.decoded.wait(state).unwrap_or_else(PoisonError::into_inner);
        }
        state.decoding_bytes += bytes;
        Working { shared: self, bytes }
    }

    /// Makes a photo.
    fn decode(&self, view: usize) -> Result<Arc<TargetImage>> {
        let _working = self.working(view);
        self.recipes[view].decode().map(|decoded| Arc::new(decoded.image))
    }

    fn run_ahead(&self) {
        while let Some(view) = self.next_ahead() {
            let _mark = InFlight { shared: self, view };
            // An error comes up again when the view is requested.
            if let Ok(image) = self.decode(view) {
                self.lock().insert(view, &image, true, self.budget_bytes);
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

    /// How a view's target image is made.
    pub fn recipe(&self, view: usize) -> &Recipe {
        &self.shared.recipes[view]
    }

    /// Whether any photo has a pixel that is not opaque. Decodes photos that have an alpha channel until one has; those
    /// that cannot be decoded are left to [`Self::check_all`].
    pub fn has_alpha(&self) -> bool {
        let is_translucent = |view: usize| {
            let recipe = &self.shared.recipes[view];
            let _working = recipe.has_alpha.then(|| self.shared.working(view));
            recipe.is_translucent().unwrap_or(false)
        };
        (0..self.shared.recipes.len()).into_par_iter().any(is_translucent)
    }

    /// The photo of a view.
    pub fn get(&self, view: usize) -> Result<Arc<TargetImage>> {
        let shared = &*self.shared;
        let mut state = shared.lock();
        // Cancel its prefetch: it is served here.
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
        let image = shared.decode(view)?;
        shared.lock().insert(view, &image, false, shared.budget_bytes);
        Ok(image)
    }

    /// Makes a photo without keeping it.
    pub fn look(&self, view: usize) -> Result<Decoded> {
        let _working = self.shared.working(view);
        self.shared.recipes[view].decode()
    }

    /// Whether a view has a mask of its own.
    pub fn has_mask(&self, view: usize) -> bool {
        self.shared.recipes[view].mask.is_some()
    }

    /// Makes every photo once, on all threads, and keeps the first ones that the budget has room for.
    pub fn check_all(&self) -> Vec<Result<CheckedPhoto>> {
        let check = |view: usize| {
            let shared = &*self.shared;
            let recipe = &shared.recipes[view];
            let working = shared.working(view);
            let decoded = recipe.decode()?;
            drop(working);
            let image = Arc::new(decoded.image);
            let masked_share = recipe.mask.is_some().then_some(decoded.masked_share);
            let has_pixels = image.has_counted_pixels();
            let mut state = shared.lock();
            if !state.cached.contains_key(&view) && state.bytes + image.num_bytes() <= shared.budget_bytes {
                state.insert(view, &image, false, shared.budget_bytes);
            }
            drop(state);
            let mut cut_off = Vec::new();
            for path in std::iter::once(&recipe.photo).chain(&recipe.mask) {
                if jpeg_end::is_cut_off(path)? {
                    cut_off.push(path.clone());
                }
            }
            Ok(CheckedPhoto { has_pixels, masked_share, cut_off })
        };
        (0..self.shared.recipes.len()).into_par_iter().map(check).collect()
    }

    /// Decodes these views in the background, in this order; replaces an earlier prefetch.
    pub fn prefetch(&self, views: &[usize]) {
        let num_recipes = self.shared.recipes.len();
        let mut state = self.shared.lock();
        state.queue = views.iter().copied().filter(|&v| v < num_recipes).collect();
        state.forget_prefetched_except(views);
        drop(state);
        let mut threads = self.threads.lock().unwrap_or_else(PoisonError::into_inner);
        while threads.len() < PREFETCH_THREADS {
            let shared = Arc::clone(&self.shared);
            let spawned = std::thread::Builder::new()
                .name("photo-prefetch".to_owned())
                .spawn(move || shared.run_ahead());
            match spawned {
                Ok(thread) => threads.push(thread),
                // Without threads, photos are decoded on demand.
                Err(_) => break,
            }
        }
        self.shared.work.notify_all();
    }

    /// Bound of the cache.
    pub fn budget_bytes(&self) -> u64 {
        self.shared.budget_bytes
    }

    /// Most memory that making `threads` photos at once takes.
    pub fn decoding_bytes(&self, threads: usize) -> u64 {
        decoded_at_once(self.shared.recipes.iter().map(Recipe::working_bytes).collect(), threads)
    }

    /// Bytes in the cache.
    pub fn cached_bytes(&self) -> u64 {
        self.shared.lock().bytes
    }
}

/// Memory of the largest photos that may be decoded at once, given the needs of all.
fn decoded_at_once(mut needs: Vec<u64>, threads: usize) -> u64 {
    needs.sort_unstable_by(|a, b| b.cmp(a));
    let (mut count, mut bytes) = (0, 0);
    for need in needs {
        if count < threads && (count == 0 || bytes + need <= DECODING_BYTES_MAX) {
            (count, bytes) = (count + 1, bytes + need);
        }
    }
    bytes
}

impl Drop for ImageStore {
    fn drop(&mut self) {
        self.shared.lock().stopped = true;
        self.shared.work.notify_all();
        for thread in self.threads.get_mut().unwrap_or_else(PoisonError::into_inner).drain(..) {
            // A panic there did no harm: the view is decoded on demand.
            let _ = thread.join();
        }
    }
}

#[cfg(test)]
#[path = "store_tests.rs"]
mod tests;
