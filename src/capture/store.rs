//! The image cache: photos decoded on demand, or shortly before by background threads. When not all fit, a fixed set of photos
//! stays, and the others only from when they are decoded ahead to when they are used (`pinned`).

use super::decode::{Decoded, Recipe};
use super::jpeg_end;
use super::pinned::Shares;
use super::stored::State;
use crate::Result;
use crate::image::TargetImage;
use crate::views::WantedPhoto;
use rayon::prelude::*;
use std::collections::hash_map::Entry;
use std::path::PathBuf;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;

/// Background threads that decode ahead, at least and at most; training needs the other cores.
const PREFETCH_THREADS: [usize; 2] = [2, 8];

/// Memory for decoding several photos at once; a single one may need more.
const DECODING_BYTES_MAX: u64 = 512 << 20;

struct Shared {
    recipes: Vec<Recipe>,
    budget_bytes: u64,
    shares: Shares,
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

/// Ends a decode even if it panics, so that no thread waits for it or for its room forever.
struct InFlight<'a> {
    shared: &'a Shared,
    view: usize,
    /// Room among the photos that do not stay that is held for it.
    held_bytes: u64,
}

impl Drop for InFlight<'_> {
    fn drop(&mut self) {
        let mut state = self.shared.lock();
        state.in_flight.remove(&self.view);
        state.waiting_bytes -= self.held_bytes;
        drop(state);
        self.shared.decoded.notify_all();
        self.shared.work.notify_all();
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

impl Shared {
    /// The state is consistent between any two statements, so a poisoned lock does no harm.
    fn lock(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Next photo for a background thread; `None` at the end.
    fn next_ahead(&self) -> Option<WantedPhoto> {
        let mut state = self.lock();
        loop {
            if state.stopped {
                return None;
            }
            let mut at = 0;
            while let Some(&wanted) = state.queue.get(at) {
                match state.in_flight.get(&wanted.view) {
                    // It is made after another size of itself.
                    Some(&made) if made != wanted => at += 1,
                    None if !state.has(wanted) => {
                        // Photos made ahead must not take each other's place.
                        let bytes = self.waiting_bytes(wanted);
                        if bytes > 0 && state.waiting_bytes + bytes > self.shares.passing_bytes {
                            break;
                        }
                        state.queue.remove(at);
                        state.waiting_bytes += bytes;
                        state.in_flight.insert(wanted.view, wanted);
                        return Some(wanted);
                    }
                    _ => drop(state.queue.remove(at)),
                }
            }
            state = self.work.wait(state).unwrap_or_else(PoisonError::into_inner);
        }
    }

    /// Bytes that a photo takes up while it is made and waits for its use, besides those that stay.
    fn waiting_bytes(&self, wanted: WantedPhoto) -> u64 {
        let recipe = &self.recipes[wanted.view];
        match wanted.reduced_px {
            _ if !self.shares.pinned[wanted.view] => recipe.num_bytes(),
            None => 0,
            Some((width_px, height_px)) => {
                let pixels = |(width, height): (u32, u32)| u64::from(width) * u64::from(height);
                recipe.num_bytes() / pixels(recipe.size) * pixels((width_px, height_px))
            }
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
        let image = Arc::new(self.recipes[view].decode()?.image);
        self.lock().decodes += 1;
        Ok(image)
    }

    /// Makes a photo that is wanted smaller, from that of the cache if it is there.
    fn reduce(&self, view: usize, (width_px, height_px): (u32, u32)) -> Result<Arc<TargetImage>> {
        let cached = self.lock().take(WantedPhoto { view, reduced_px: None });
        let image = match cached {
            Some(image) => image,
            None => {
                let image = self.decode(view)?;
                if self.shares.pinned[view] {
                    self.lock().insert(view, &image, false, &self.shares);
                }
                image
            }
        };
        Ok(Arc::new(image.reduced(width_px, height_px)))
    }

    fn run_ahead(&self) {
        while let Some(wanted) = self.next_ahead() {
            let view = wanted.view;
            let _mark = InFlight { shared: self, view, held_bytes: self.waiting_bytes(wanted) };
            let made = match wanted.reduced_px {
                None => self.decode(view),
                Some(size_px) => self.reduce(view, size_px),
            };
            // An error comes up again when the photo is requested.
            let Ok(image) = made else { continue };
            let mut state = self.lock();
            match wanted.reduced_px {
                None => state.insert(view, &image, true, &self.shares),
                Some(_) => state.insert_reduced(wanted, image, &self.shares),
            }
        }
    }
}

impl ImageStore {
    /// A cache of `budget_bytes`, in which the photos that are `first` stay before others.
    pub fn new(recipes: Vec<Recipe>, first: impl Fn(usize) -> bool, budget_bytes: u64) -> Self {
        let sizes_bytes: Vec<u64> = recipes.iter().map(Recipe::num_bytes).collect();
        Self {
            shared: Arc::new(Shared {
                recipes,
                budget_bytes,
                shares: Shares::new(&sizes_bytes, first, budget_bytes),
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
        let (_mark, shared) = match self.made_ahead(WantedPhoto { view, reduced_px: None }) {
            Ok(image) => return Ok(image),
            Err(mark) => (mark, &*self.shared),
        };
        let image = shared.decode(view)?;
        shared.lock().insert(view, &image, false, &shared.shares);
        Ok(image)
    }

    /// The photo of a view, reduced to a width and height.
    pub fn get_reduced(&self, view: usize, size_px: (u32, u32)) -> Result<Arc<TargetImage>> {
        match self.made_ahead(WantedPhoto { view, reduced_px: Some(size_px) }) {
            Ok(image) => Ok(image),
            Err(_mark) => self.shared.reduce(view, size_px),
        }
    }

    /// A photo of the cache, after a decode of its view that is under way; or the mark of one to be made here.
    fn made_ahead(&self, wanted: WantedPhoto) -> std::result::Result<Arc<TargetImage>, InFlight<'_>> {
        let (shared, view) = (&*self.shared, wanted.view);
        let mut state = shared.lock();
        // Cancel its prefetch: it is served here.
        if let Some(at) = state.queue.iter().position(|&queued| queued == wanted) {
            state.queue.remove(at);
        }
        loop {
            if let Some(image) = state.take(wanted) {
                // Room for the background threads.
                shared.work.notify_all();
                return Ok(image);
            }
            if let Entry::Vacant(entry) = state.in_flight.entry(view) {
                entry.insert(wanted);
                return Err(InFlight { shared, view, held_bytes: 0 });
            }
            state = shared.decoded.wait(state).unwrap_or_else(PoisonError::into_inner);
        }
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

    /// Makes every photo once, on all threads, and keeps those that stay.
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
            if shared.shares.pinned[view] && !state.kept.contains_key(&view) {
                state.insert(view, &image, false, &shared.shares);
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

    /// Makes these photos in the background, in this order; replaces an earlier prefetch.
    pub fn prefetch(&self, wanted: &[WantedPhoto]) {
        let num_recipes = self.shared.recipes.len();
        let mut state = self.shared.lock();
        state.queue = wanted.iter().copied().filter(|wanted| wanted.view < num_recipes).collect();
        state.forget_prefetched_except(wanted);
        drop(state);
        let mut threads = self.threads.lock().unwrap_or_else(PoisonError::into_inner);
        while threads.len() < prefetch_threads() {
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

    /// Whether all photos fit in the cache.
    pub fn keeps_all(&self) -> bool {
        self.shared.shares.pinned.iter().all(|&pinned| pinned)
    }

    /// Most memory that making `threads` photos at once takes.
    pub fn decoding_bytes(&self, threads: usize) -> u64 {
        decoded_at_once(self.shared.recipes.iter().map(Recipe::working_bytes).collect(), threads)
    }

    /// Bytes in the cache.
    pub fn cached_bytes(&self) -> u64 {
        let state = self.shared.lock();
        state.kept_bytes + state.passing_bytes
    }
}

/// Half of the cores decode ahead, within bounds.
fn prefetch_threads() -> usize {
    let [least, most] = PREFETCH_THREADS;
    std::thread::available_parallelism().map_or(least, |cores| (cores.get() / 2).clamp(least, most))
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
