//! A cache of photos on the device: one pool, filled as a ring. A photo is uploaded again only after others have
//! evicted it for want of room.

use super::device::GpuDevice;
use super::kernels::Buf;
use super::resources::Resources;
use crate::backend::TargetImage;
use crate::image::ALPHA_LEVELS;
use crate::{Error, Result};
use rayon::prelude::*;

/// Identity of a cached photo: its number and its size, since a photo may be used at several sizes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct PhotoKey {
    photo: PhotoNumber,
    size_px: [u32; 2],
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum PhotoNumber {
    /// Given by the caller.
    Known(u32),
    /// Place in its batch, of a photo that is used once.
    Once(usize),
}

impl PhotoKey {
    /// Those of a batch.
    fn all(batch: &[(Option<u32>, &TargetImage)]) -> Vec<Self> {
        let key = |(place, (photo, target)): (usize, &(Option<u32>, &TargetImage))| Self {
            photo: photo.map_or(PhotoNumber::Once(place), PhotoNumber::Known),
            size_px: [target.width_px, target.height_px],
        };
        batch.iter().enumerate().map(key).collect()
    }

    fn num_px(self) -> u64 {
        u64::from(self.size_px[0]) * u64::from(self.size_px[1])
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct ResidentPhoto {
    key: PhotoKey,
    first_px: u64,
}

impl ResidentPhoto {
    fn end_px(self) -> u64 {
        self.first_px + self.key.num_px()
    }
}

/// Position of a photo in the pool, and whether it still has to be uploaded.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct PhotoSlot {
    first_px: u64,
    is_new: bool,
}

/// The photos in the pool.
#[derive(Default)]
pub(super) struct PhotoPool {
    resident: Vec<ResidentPhoto>,
    capacity_px: u64,
    /// Once the device has refused a larger pool.
    most_px: Option<u64>,
    next_px: u64,
}

/// What a batch wants of the pool.
struct Wanted {
    /// How many of its photos, counted from the first, can be in the pool at once.
    fitting: usize,
    /// Pixels of these.
    needed_px: u64,
    /// Capacity that the pool should have.
    ample_px: u64,
}

const PIXEL_BYTES: u64 = 4;
/// Pixels that a thread packs at a time.
const PIXELS_PER_TASK: usize = 1 << 16;
/// Largest size of the pool, unless the device's limit is smaller.
const POOL_MAX_BYTES: u64 = 2 << 30;

impl PhotoPool {
    /// Forgets all photos.
    pub(super) fn forget(&mut self) {
        *self = Self { capacity_px: self.capacity_px, most_px: self.most_px, ..Self::default() };
    }

    /// Makes room for the photos of a batch to be resident at once. Returns how many of them, counted from the
    /// first, fit into the largest pool that the device allows.
    ///
    /// # Errors
    /// [`Error::DeviceFull`] if not even the first fits.
    pub(super) fn prepare(
        &mut self,
        device: &GpuDevice,
        resources: &mut Resources,
        batch: &[(Option<u32>, &TargetImage)],
    ) -> Result<usize> {
        let most = device.most_buffer_bytes().min(POOL_MAX_BYTES);
        self.forget_used();
        let keys = PhotoKey::all(batch);
        let wanted = self.wanted(&keys, self.most_px.unwrap_or(most / PIXEL_BYTES));
        if wanted.ample_px > self.capacity_px {
            self.grow(&wanted, |capacity_px, keeps_photos| {
                if !keeps_photos {
                    resources.remove(Buf::Photo);
                }
                let pool = device.buffer("photos, pixels", capacity_px, PIXEL_BYTES)?;
                if keeps_photos {
                    // They stay where they are.
                    device.copy_all(std::iter::once((resources.buffer(Buf::Photo), &pool)));
                }
                resources.set(Buf::Photo, pool);
                Ok(())
            })?;
        }
        Ok(wanted.fitting)
    }

    /// Grows the pool. `allocate` is told a capacity in pixels, and whether photos are kept. Where memory fails, photos make room for
    /// one another.
    fn grow(&mut self, wanted: &Wanted, mut allocate: impl FnMut(u64, bool) -> Result<()>) -> Result<()> {
        match allocate(wanted.ample_px, self.capacity_px > 0) {
            Ok(()) => self.capacity_px = wanted.ample_px,
            Err(Error::DeviceFull(_)) if wanted.needed_px <= self.capacity_px => {
                self.most_px = Some(self.capacity_px);
            }
            Err(Error::DeviceFull(_)) => {
                *self = Self::default();
                allocate(wanted.needed_px, false)?;
                (self.capacity_px, self.most_px) = (wanted.needed_px, Some(wanted.needed_px));
            }
            Err(error) => return Err(error),
        }
        Ok(())
    }

    /// What a batch wants of a pool of at most `most_px` pixels.
    fn wanted(&self, batch: &[PhotoKey], most_px: u64) -> Wanted {
        let (mut distinct, mut fitting): (Vec<PhotoKey>, usize) = (Vec::new(), 0);
        for &key in batch {
            if !distinct.contains(&key) {
                let needed_px = distinct.iter().map(|k| k.num_px()).sum::<u64>() + key.num_px();
                if needed_px > most_px && fitting > 0 {
                    break;
                }
                distinct.push(key);
            }
            fitting += 1;
        }
        let needed_px: u64 = distinct.iter().map(|k| k.num_px()).sum();
        // Room for every photo seen so far, and at least twice the batch, because placing it may wrap around once.
        let missing = distinct.iter().filter(|k| self.find(**k).is_none());
        let seen_px = self.resident.iter().map(|r| r.key.num_px()).sum::<u64>()
            + missing.map(|k| k.num_px()).sum::<u64>();
        let wanted_px = seen_px.max(2 * needed_px).min(most_px).max(needed_px);
        if wanted_px > self.capacity_px {
            let ample_px = (2 * self.capacity_px).clamp(wanted_px, most_px.max(wanted_px));
            return Wanted { fitting, needed_px, ample_px };
        }
        Wanted { fitting, needed_px, ample_px: wanted_px }
    }

    /// Uploads the photos of a batch that are not resident, and returns the first pixel of each in the pool. The
    /// batch must have been prepared.
    pub(super) fn place(
        &mut self,
        device: &GpuDevice,
        resources: &Resources,
        batch: &[(Option<u32>, &TargetImage)],
    ) -> Result<Vec<u32>> {
        let keys = PhotoKey::all(batch);
        let slots = self.slots(&keys).ok_or_else(|| {
            device.error("the photos of a batch do not fit into the pool that was allocated for them")
        })?;
        let pool = resources.buffer(Buf::Photo);
        for ((_, target), slot) in batch.iter().zip(&slots).filter(|(_, slot)| slot.is_new) {
            device.count(|work| &work.photos);
            let words = packed(target);
            let written = device.write(pool, slot.first_px * PIXEL_BYTES, bytemuck::cast_slice(&words));
            if let Err(error) = written {
                // Those not written yet count as resident.
                self.forget();
                return Err(error);
            }
        }
        Ok(slots.iter().map(|slot| slot.first_px as u32).collect())
    }

    /// Finds positions for all photos of a batch. If its resident photos leave only gaps that are too small, the
    /// pool is cleared and the whole batch placed contiguously.
    fn slots(&mut self, batch: &[PhotoKey]) -> Option<Vec<PhotoSlot>> {
        for _ in 0..2 {
            if let Some(slots) = batch.iter().map(|key| self.slot(*key, batch)).collect() {
                return Some(slots);
            }
            self.resident.clear();
            self.next_px = 0;
        }
        None
    }

    /// Finds the position of one photo, or makes room for it without evicting those of `kept`.
    fn slot(&mut self, key: PhotoKey, kept: &[PhotoKey]) -> Option<PhotoSlot> {
        if let Some(resident) = self.find(key) {
            return Some(PhotoSlot { first_px: resident.first_px, is_new: false });
        }
        let mut first_px = self.next_px;
        // Skips over kept photos, at most twice around the ring.
        for _ in 0..2 * self.resident.len() + 3 {
            if first_px + key.num_px() > self.capacity_px {
                first_px = 0;
            }
            let end_px = first_px + key.num_px();
            if end_px > self.capacity_px {
                return None;
            }
            let overlaps = |r: &ResidentPhoto| r.first_px < end_px && first_px < r.end_px();
            let blocked = self.resident.iter().filter(|r| overlaps(r) && kept.contains(&r.key));
            match blocked.map(|r| r.end_px()).max() {
                Some(end) => first_px = end,
                None => {
                    self.resident.retain(|r| !overlaps(r));
                    self.resident.push(ResidentPhoto { key, first_px });
                    self.next_px = end_px;
                    return Some(PhotoSlot { first_px, is_new: true });
                }
            }
        }
        None
    }

    /// Forgets the photos that are used once: their numbers mean others in the next batch.
    fn forget_used(&mut self) {
        let is_once = |r: &&ResidentPhoto| matches!(r.key.photo, PhotoNumber::Once(_));
        if let Some(first) = self.resident.iter().find(is_once) {
            self.next_px = first.first_px;
        }
        self.resident.retain(|r| matches!(r.key.photo, PhotoNumber::Known(_)));
    }

    fn find(&self, key: PhotoKey) -> Option<&ResidentPhoto> {
        self.resident.iter().find(|r| r.key == key)
    }
}

/// RGB, and a byte of alpha in seven bits below the mask's, packed in an integer. `[height, width]`
fn packed(target: &TargetImage) -> Vec<u32> {
    let rgb = target.rgb.par_chunks_exact(3).with_min_len(PIXELS_PER_TASK).enumerate();
    rgb.map(|(i, p)| {
        let alpha = target.alpha.as_ref().map_or(ALPHA_LEVELS, |alpha| alpha[i]);
        u32::from_le_bytes([p[0], p[1], p[2], alpha | if target.counts(i) { 128 } else { 0 }])
    })
    .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt as _, SeedableRng as _};
    use rand_pcg::Pcg32;

    fn key(photo: u32, width_px: u32) -> PhotoKey {
        PhotoKey { photo: PhotoNumber::Known(photo), size_px: [width_px, 1] }
    }

    /// A pool that records which photo each pixel belongs to.
    struct FilledPool {
        pool: PhotoPool,
        pixels: Vec<Option<PhotoKey>>,
    }

    impl FilledPool {
        fn new(capacity_px: u64) -> Self {
            let pool = PhotoPool { capacity_px, ..PhotoPool::default() };
            Self { pool, pixels: vec![None; capacity_px as usize] }
        }

        /// Places a batch, fills in new photos, and checks that every photo of the batch is intact. Returns the
        /// number of new photos.
        fn place(&mut self, batch: &[PhotoKey]) -> usize {
            let slots = self.pool.slots(batch).unwrap_or_else(|| panic!("{batch:?} found no place"));
            let range = |key: PhotoKey, slot: &PhotoSlot| {
                slot.first_px as usize..(slot.first_px + key.num_px()) as usize
            };
            for (&key, slot) in batch.iter().zip(&slots).filter(|(_, slot)| slot.is_new) {
                self.pixels[range(key, slot)].fill(Some(key));
            }
            for (&key, slot) in batch.iter().zip(&slots) {
                assert!(self.pixels[range(key, slot)].iter().all(|p| *p == Some(key)), "{batch:?}");
            }
            slots.iter().filter(|slot| slot.is_new).count()
        }
    }

    #[test]
    fn photos_stay_until_their_space_is_needed_and_are_cached_by_size() {
        let mut pool = FilledPool::new(100);
        assert_eq!(pool.place(&[key(0, 40), key(1, 20), key(0, 40)]), 2);
        assert_eq!(pool.place(&[key(1, 20), key(0, 40)]), 0, "both are still there");
        // The same number at another size is another photo, which evicts nothing while there is room.
        assert_eq!(pool.place(&[key(0, 10), key(0, 40)]), 1);
        assert_eq!(pool.place(&[key(2, 60)]), 1);
        assert_eq!(pool.place(&[key(0, 40)]), 1, "it was evicted");
    }

    #[test]
    fn photos_that_are_used_once_are_sent_again_and_take_no_room() {
        let once = |place: usize| PhotoKey { photo: PhotoNumber::Once(place), size_px: [20, 1] };
        let mut pool = FilledPool::new(100);
        for _ in 0..3 {
            pool.pool.forget_used();
            assert_eq!(pool.pool.wanted(&[key(0, 30), once(1)], 1_000).ample_px, 100, "as at first");
            let seen = pool.place(&[key(0, 30), once(1), once(2)]);
            assert!(seen >= 2, "{seen}");
        }
        for _ in 0..5 {
            pool.pool.forget_used();
            assert_eq!(pool.place(&[once(0), once(1)]), 2);
        }
        pool.pool.forget_used();
        assert_eq!(pool.place(&[key(0, 30)]), 0, "the numbered one is still there");
    }

    #[test]
    fn a_batch_that_fits_is_placed_despite_gaps_between_kept_photos() {
        let mut pool = FilledPool::new(100);
        pool.place(&[key(0, 30)]);
        pool.place(&[key(1, 30)]);
        // Photo 1 is in the middle, with 30 px before it and 40 px after.
        assert_eq!(pool.pool.resident.iter().map(|r| r.first_px).collect::<Vec<_>>(), [0, 30]);
        assert_eq!(pool.place(&[key(1, 30), key(2, 60)]), 2, "both are placed again");
        // Negative control: a batch that does not fit is refused.
        assert!(pool.pool.slots(&[key(1, 30), key(3, 71)]).is_none());
    }

    #[test]
    fn any_batch_that_fits_is_placed() {
        let mut random = Pcg32::seed_from_u64(3);
        let mut pool = FilledPool::new(64);
        let mut sent = 0;
        for _ in 0..2_000 {
            let (mut batch, mut left) = (Vec::new(), 64_u32);
            while batch.len() < 6 && left > 0 {
                let photo: u32 = random.random_range(0..12);
                let next = key(photo, (3 + 5 * photo) % 31 + 1 + random.random_range(0..2));
                if !batch.contains(&next) && next.size_px[0] <= left {
                    left -= next.size_px[0];
                } else if !batch.contains(&next) {
                    break;
                }
                batch.push(next);
            }
            sent += pool.place(&batch);
        }
        assert!(sent > 1_000, "photos were evicted: {sent}");
    }

    #[test]
    fn the_pool_holds_a_whole_batch_or_what_the_device_allows() {
        let wanted = |batch: &[PhotoKey], most_px| {
            let wanted = PhotoPool::default().wanted(batch, most_px);
            (wanted.fitting, wanted.needed_px, wanted.ample_px)
        };
        assert_eq!(wanted(&[key(0, 10), key(1, 20), key(0, 10)], 1_000), (3, 30, 60));
        assert_eq!(wanted(&[key(0, 10), key(1, 20), key(2, 10)], 35), (2, 30, 35));
        // Too large for the device, which reports its size when the pool is allocated.
        assert_eq!(wanted(&[key(0, 10)], 5), (1, 10, 10));
    }

    #[test]
    fn a_device_without_room_for_a_larger_pool_keeps_the_photos_that_fit() {
        // Bytes for 100 pixels, in the old pool and the new one together.
        let allocate = |held_px: u64| {
            move |px: u64, keeps_photos: bool| match px + if keeps_photos { held_px } else { 0 } {
                0..=100 => Ok(()),
                _ => Err(Error::DeviceFull(String::from("full").into())),
            }
        };
        let mut filled = FilledPool::new(40);
        filled.place(&[key(0, 20)]);
        // A larger pool would hold both photos twice; this one holds both.
        let wanted = filled.pool.wanted(&[key(0, 20), key(1, 20)], 1_000);
        assert!((wanted.needed_px, wanted.ample_px) == (40, 80));
        filled.pool.grow(&wanted, allocate(40)).unwrap();
        assert_eq!((filled.pool.capacity_px, filled.pool.most_px), (40, Some(40)));
        assert_eq!(filled.place(&[key(0, 20), key(1, 20)]), 1, "one was there");
        // A batch that the pool does not hold takes the place of all photos.
        let wanted = filled.pool.wanted(&[key(2, 70)], 40);
        filled.pool.grow(&wanted, allocate(40)).unwrap();
        assert_eq!((filled.pool.capacity_px, filled.pool.resident.len()), (70, 0));
        // Negative control: more than the device holds.
        let wanted = filled.pool.wanted(&[key(3, 101)], 1_000);
        assert!(matches!(filled.pool.grow(&wanted, allocate(70)), Err(Error::DeviceFull(_))));
        assert_eq!(filled.pool.capacity_px, 0, "the next batch begins anew");
    }
}
