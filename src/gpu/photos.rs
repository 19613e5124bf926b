//! Photos that stay on the device: one pool, filled in a ring. A view's photo is sent again only once another
//! has taken its place.

use super::device::GpuDevice;
use super::kernels::Buf;
use super::resources::Resources;
use crate::Result;
use crate::backend::TargetImage;

/// A photo in the pool.
struct Resident {
    photo: u32,
    size_px: [u32; 2],
    first_px: u64,
    end_px: u64,
}

/// Which photos are where.
#[derive(Default)]
pub(super) struct PhotoPool {
    resident: Vec<Resident>,
    capacity_px: u64,
    next_px: u64,
}

/// Bytes of a pixel.
const PIXEL_BYTES: u64 = 4;
/// The pool grows to at most this, or to the device's limit.
const POOL_MAX_BYTES: u64 = 2 << 30;

impl PhotoPool {
    /// Numbers may stand for other photos from now on.
    pub(super) fn forget(&mut self) {
        self.resident.clear();
    }

    /// Makes room for a batch of photos of these sizes: all of them are resident at once afterwards. Says how
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
        let limits = &device.limits;
        let most = limits.max_storage_buffer_binding_size.min(limits.max_buffer_size).min(POOL_MAX_BYTES);
        let most_px = most / PIXEL_BYTES;
        let mut fitting = 0;
        let mut needed_px = 0;
        for (_, target) in batch {
            needed_px += num_px(target);
            if needed_px > most_px && fitting > 0 {
                break;
            }
            fitting += 1;
        }
        let needed_px: u64 = batch[..fitting].iter().map(|(_, t)| num_px(t)).sum();
        // Photos met for the first time are worth a larger pool; a batch may wrap around once, hence twice.
        let missing = batch[..fitting].iter().filter(|(p, t)| self.find(*p, t).is_none());
        let wanted_px = self.resident.iter().map(|r| r.end_px - r.first_px).sum::<u64>()
            + missing.map(|(_, t)| num_px(t)).sum::<u64>();
        let wanted_px = wanted_px.max(2 * needed_px).min(most_px).max(needed_px);
        if wanted_px > self.capacity_px {
            let capacity_px = (2 * self.capacity_px).clamp(wanted_px, most_px.max(wanted_px));
            resources.set(Buf::Photo, device.buffer("photos, pixels", capacity_px, PIXEL_BYTES)?);
            *self = Self { capacity_px, ..Self::default() };
        }
        Ok(fitting)
    }

    /// First pixel of a photo in the pool, after sending it if needed. `kept` are photos that must stay.
    pub(super) fn place(
        &mut self,
        device: &GpuDevice,
        resources: &Resources,
        photo: u32,
        target: &TargetImage,
        kept: &[u32],
    ) -> Option<u32> {
        if let Some(resident) = self.find(photo, target) {
            return Some(resident.first_px as u32);
        }
        let size = num_px(target);
        let mut first_px = self.next_px;
        // Twice around at most: kept photos are jumped over.
        for _ in 0..2 * self.resident.len() + 3 {
            if first_px + size > self.capacity_px {
                first_px = 0;
            }
            let end_px = first_px + size;
            let blocked = self
                .resident
                .iter()
                .filter(|r| r.first_px < end_px && first_px < r.end_px && kept.contains(&r.photo))
                .map(|r| r.end_px)
                .max();
            match blocked {
                Some(end) => first_px = end,
                None => {
                    self.resident.retain(|r| r.end_px <= first_px || end_px <= r.first_px);
                    self.resident.retain(|r| r.photo != photo);
                    let size_px = [target.width_px, target.height_px];
                    self.resident.push(Resident { photo, size_px, first_px, end_px });
                    self.next_px = end_px;
                    let words = packed(target);
                    let (pool, at) = (resources.buffer(Buf::Photo), first_px * PIXEL_BYTES);
                    device.queue.write_buffer(pool, at, bytemuck::cast_slice(&words));
                    return Some(first_px as u32);
                }
            }
        }
        None
    }

    fn find(&self, photo: u32, target: &TargetImage) -> Option<&Resident> {
        let size_px = [target.width_px, target.height_px];
        self.resident.iter().find(|r| r.photo == photo && r.size_px == size_px)
    }
}

fn num_px(target: &TargetImage) -> u64 {
    u64::from(target.width_px) * u64::from(target.height_px)
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
