//! What the image cache holds at a moment.

use super::pinned::Shares;
use crate::image::TargetImage;
use crate::views::WantedPhoto;
use std::collections::{HashMap, HashSet, VecDeque};
use std::sync::Arc;

pub(super) struct Cached {
    image: Arc<TargetImage>,
    /// Of photos that do not stay: when it was used last; `None`: decoded ahead and not requested yet.
    used: Option<u64>,
}

#[derive(Default)]
pub(super) struct State {
    /// Photos that stay.
    pub kept: HashMap<usize, Arc<TargetImage>>,
    pub kept_bytes: u64,
    /// The others.
    pub passing: HashMap<usize, Cached>,
    /// Photos made ahead at a smaller size, each for one use.
    reduced: HashMap<WantedPhoto, Arc<TargetImage>>,
    /// Bytes of both.
    pub passing_bytes: u64,
    /// Bytes of those of both that wait for their use, made or being made.
    pub waiting_bytes: u64,
    clock: u64,
    /// Views whose photos are being made, and at which size.
    pub in_flight: HashMap<usize, WantedPhoto>,
    /// Working memory of the decodes under way.
    pub decoding_bytes: u64,
    pub queue: VecDeque<WantedPhoto>,
    pub stopped: bool,
    pub decodes: u64,
}

impl State {
    pub fn has(&self, wanted: WantedPhoto) -> bool {
        let view = wanted.view;
        match wanted.reduced_px {
            None => self.kept.contains_key(&view) || self.passing.contains_key(&view),
            Some(_) => self.reduced.contains_key(&wanted),
        }
    }

    /// Drops a photo that does not stay.
    fn remove(&mut self, view: usize) {
        if let Some(old) = self.passing.remove(&view) {
            let bytes = old.image.num_bytes();
            self.passing_bytes -= bytes;
            self.waiting_bytes -= if old.used.is_none() { bytes } else { 0 };
        }
    }

    /// Keeps an image if it is one of those that stay. Otherwise it takes the place of others that do not stay
    /// and were used, first of those used longest ago, and is not kept without such a place.
    pub fn insert(&mut self, view: usize, image: &Arc<TargetImage>, is_ahead: bool, shares: &Shares) {
        let bytes = image.num_bytes();
        if shares.pinned[view] {
            if self.kept.insert(view, Arc::clone(image)).is_none() {
                self.kept_bytes += bytes;
            }
            return;
        }
        self.remove(view);
        if !self.make_room(bytes, shares) {
            return;
        }
        self.clock += 1;
        self.passing_bytes += bytes;
        self.waiting_bytes += if is_ahead { bytes } else { 0 };
        let used = (!is_ahead).then_some(self.clock);
        self.passing.insert(view, Cached { image: Arc::clone(image), used });
    }

    /// Drops photos that do not stay and were used, the oldest first, until there is room for another.
    fn make_room(&mut self, bytes: u64, shares: &Shares) -> bool {
        while self.passing_bytes + bytes > shares.passing_bytes {
            let used = self.passing.iter().filter_map(|(&view, cached)| Some((cached.used?, view)));
            let Some((_, oldest)) = used.min() else { return false };
            self.remove(oldest);
        }
        true
    }

    /// Holds a photo at a smaller size for its use, if there is room.
    pub fn insert_reduced(&mut self, wanted: WantedPhoto, image: Arc<TargetImage>, shares: &Shares) {
        self.take_reduced(wanted);
        let bytes = image.num_bytes();
        if self.make_room(bytes, shares) {
            self.passing_bytes += bytes;
            self.waiting_bytes += bytes;
            self.reduced.insert(wanted, image);
        }
    }

    /// A photo that was made ahead at a smaller size.
    fn take_reduced(&mut self, wanted: WantedPhoto) -> Option<Arc<TargetImage>> {
        let image = self.reduced.remove(&wanted)?;
        self.passing_bytes -= image.num_bytes();
        self.waiting_bytes -= image.num_bytes();
        Some(image)
    }

    /// Photos made for an earlier prefetch no longer count as waiting for their use.
    pub fn forget_prefetched_except(&mut self, wanted: &[WantedPhoto]) {
        let wanted: HashSet<&WantedPhoto> = wanted.iter().collect();
        self.clock += 1;
        for (&view, cached) in &mut self.passing {
            if cached.used.is_none() && !wanted.contains(&WantedPhoto { view, reduced_px: None }) {
                cached.used = Some(self.clock);
                self.waiting_bytes -= cached.image.num_bytes();
            }
        }
        let unwanted: Vec<_> = self.reduced.keys().filter(|made| !wanted.contains(made)).copied().collect();
        unwanted.into_iter().for_each(|made| drop(self.take_reduced(made)));
    }

    /// A photo of the cache; it no longer waits for its use.
    pub fn take(&mut self, wanted: WantedPhoto) -> Option<Arc<TargetImage>> {
        let view = wanted.view;
        if wanted.reduced_px.is_some() {
            return self.take_reduced(wanted);
        }
        if let Some(image) = self.kept.get(&view) {
            return Some(Arc::clone(image));
        }
        self.clock += 1;
        let cached = self.passing.get_mut(&view)?;
        if cached.used.replace(self.clock).is_none() {
            self.waiting_bytes -= cached.image.num_bytes();
        }
        Some(Arc::clone(&cached.image))
    }
}
