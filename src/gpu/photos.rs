//! Photos that stay on the device: one pool, filled in a ring. A view's photo is sent again only once another
//! has taken its place.

use super::device::GpuDevice;
use super::kernels::Buf;
use super::resources::Resources;
use crate::Result;
use crate::backend::TargetImage;

/// Identity of a photo: its number, and its size, since one number may come in several.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct PhotoKey {
    photo: u32,
    size_px: [u32; 2],
}

impl PhotoKey {
    fn of((photo, target): &(u32, &TargetImage)) -> Self {
        Self { photo: *photo, size_px: [target.width_px, target.height_px] }
    }

    fn num_px(self) -> u64 {
        u64::from(self.size_px[0]) * u64::from(self.size_px[1])
    }
}

/// A photo in the pool.
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

/// Where a photo stands, and whether it has yet to be sent.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct PhotoSlot {
    first_px: u64,
    is_new: bool,
}

/// Which photos are where.
#[derive(Default)]
pub(super) struct PhotoPool {
    resident: Vec<ResidentPhoto>,
    capacity_px: u64,
    next_px: u64,
}

/// Bytes of a pixel.
const PIXEL_BYTES: u64 = 4;
/// The pool grows to at most this, or to the device's limit.
const POOL_MAX_BYTES: u64 = 2 << 30;

impl PhotoPool {
    /// Numbers may stand for other photos from now on; the memory goes back.
    pub(super) fn release(&mut self, resources: &mut Resources) {
        resources.remove(Buf::Photo);
        *self = Self::default();
    }

    /// Makes room for a batch of photos of these sizes: all of them can be resident at once afterwards. Says how
    /// many of them, from the first on, fit the largest pool that the device allows.
    ///
    /// # Errors
    /// If not even the first fits.
    pub(super) fn prepare(
        &mut self,
        device: &GpuDevice,
        resources: &mut Resources,
        batch: &[(u32, &TargetImage)],
    ) -> Result<usize> {
        let most = device.most_buffer_bytes().min(POOL_MAX_BYTES);
        let keys: Vec<PhotoKey> = batch.iter().map(PhotoKey::of).collect();
        let (fitting, wanted_px) = self.wanted(&keys, most / PIXEL_BYTES);
        if wanted_px > self.capacity_px {
            resources.set(Buf::Photo, device.buffer("photos, pixels", wanted_px, PIXEL_BYTES)?);
            *self = Self { capacity_px: wanted_px, ..Self::default() };
        }
        Ok(fitting)
    }

    /// Photos of a batch, from the first on, that a pool of `most_px` holds at once, and the pool to have for
    /// them.
    fn wanted(&self, batch: &[PhotoKey], most_px: u64) -> (usize, u64) {
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
        // Photos met for the first time are worth a larger pool; a batch may wrap around once, hence twice.
        let missing = distinct.iter().filter(|k| self.find(**k).is_none());
        let seen_px = self.resident.iter().map(|r| r.key.num_px()).sum::<u64>()
            + missing.map(|k| k.num_px()).sum::<u64>();
        let wanted_px = seen_px.max(2 * needed_px).min(most_px).max(needed_px);
        if wanted_px > self.capacity_px {
            return (fitting, (2 * self.capacity_px).clamp(wanted_px, most_px.max(wanted_px)));
        }
        (fitting, wanted_px)
    }

    /// First pixels of a batch's photos in the pool, after sending those that are not there. The batch must
    /// have been prepared.
    pub(super) fn place(
        &mut self,
        device: &GpuDevice,
        resources: &Resources,
        batch: &[(u32, &TargetImage)],
    ) -> Result<Vec<u32>> {
        let keys: Vec<PhotoKey> = batch.iter().map(PhotoKey::of).collect();
        let slots = self.slots(&keys).ok_or_else(|| {
            device.error("the photos of a batch do not fit the pool that was made for them")
        })?;
        let pool = resources.buffer(Buf::Photo);
        for ((_, target), slot) in batch.iter().zip(&slots).filter(|(_, slot)| slot.is_new) {
            let words = packed(target);
            device.queue.write_buffer(pool, slot.first_px * PIXEL_BYTES, bytemuck::cast_slice(&words));
        }
        Ok(slots.iter().map(|slot| slot.first_px as u32).collect())
    }

    /// Places all of a batch. Where photos that must stay leave only holes that are too small, everything is
    /// forgotten and the batch placed anew, side by side.
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

    /// Finds or makes a place for one photo; those of `kept` must stay.
    fn slot(&mut self, key: PhotoKey, kept: &[PhotoKey]) -> Option<PhotoSlot> {
        if let Some(resident) = self.find(key) {
            return Some(PhotoSlot { first_px: resident.first_px, is_new: false });
        }
        let mut first_px = self.next_px;
        // Twice around at most: kept photos are jumped over.
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

    fn find(&self, key: PhotoKey) -> Option<&ResidentPhoto> {
        self.resident.iter().find(|r| r.key == key)
    }
}

/// RGB and the mask as the bytes of words. `[height, width]`
fn packed(target: &TargetImage) -> Vec<u32> {
    let rgb = target.rgb.chunks_exact(3).enumerate();
    rgb.map(|(i, p)| {
        let counts = target.mask.as_ref().is_none_or(|m| m[i] != 0);
        u32::from_le_bytes([p[0], p[1], p[2], if counts { 255 } else { 0 }])
    })
    .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt as _, SeedableRng as _};
    use rand_pcg::Pcg32;

    fn key(photo: u32, width_px: u32) -> PhotoKey {
        PhotoKey { photo, size_px: [width_px, 1] }
    }

    /// What the photos of the pool show: `(number, width)` of each pixel.
    struct FilledPool {
        pool: PhotoPool,
        pixels: Vec<Option<PhotoKey>>,
    }

    impl FilledPool {
        fn new(capacity_px: u64) -> Self {
            let pool = PhotoPool { capacity_px, ..PhotoPool::default() };
            Self { pool, pixels: vec![None; capacity_px as usize] }
        }

        /// Places a batch, sends what is new, and checks that every photo of the batch is whole.
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
    fn a_photo_stays_until_its_place_is_needed_and_sizes_are_told_apart() {
        let mut pool = FilledPool::new(100);
        assert_eq!(pool.place(&[key(0, 40), key(1, 20), key(0, 40)]), 2);
        assert_eq!(pool.place(&[key(1, 20), key(0, 40)]), 0, "both are still there");
        // The same number at another size is another photo, and drives nobody out while there is room.
        assert_eq!(pool.place(&[key(0, 10), key(0, 40)]), 1);
        assert_eq!(pool.place(&[key(2, 60)]), 1);
        assert_eq!(pool.place(&[key(0, 40)]), 1, "it had to go");
    }

    #[test]
    fn holes_between_kept_photos_do_not_fail_a_batch_that_fits() {
        let mut pool = FilledPool::new(100);
        pool.place(&[key(0, 30)]);
        pool.place(&[key(1, 30)]);
        // Photo 1 stands in the middle: 30 px before it, 40 behind.
        assert_eq!(pool.pool.resident.iter().map(|r| r.first_px).collect::<Vec<_>>(), [0, 30]);
        assert_eq!(pool.place(&[key(1, 30), key(2, 60)]), 2, "both are placed anew");
        // Negative control: what does not fit is refused.
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
        assert!(sent > 1_000, "photos had to go: {sent}");
    }

    #[test]
    fn a_pool_holds_all_photos_of_a_batch_or_as_many_as_the_device_allows() {
        let pool = PhotoPool::default();
        assert_eq!(pool.wanted(&[key(0, 10), key(1, 20), key(0, 10)], 1_000), (3, 60));
        assert_eq!(pool.wanted(&[key(0, 10), key(1, 20), key(2, 10)], 35), (2, 35));
        // The first is refused by the device, with its size in the message.
        assert_eq!(pool.wanted(&[key(0, 10)], 5), (1, 10));
    }
}
