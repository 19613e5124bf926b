//! Photos at the size of the current stage: reduced by area once in each stage and kept while there is room.

use crate::Result;
use crate::camera::{Camera, Pinhole};
use crate::image::TargetImage;
use crate::views::ViewSource;
use rayon::prelude::*;
use std::sync::Arc;

/// Memory for reduced photos, unless the user allows less for photos.
const KEPT_BYTES: u64 = 1 << 30;

/// The photos of one stage.
pub(super) struct Targets {
    /// Render scale of the stage.
    scale: f64,
    /// Number of stages begun; stage and view together identify a photo at a size.
    stage: u32,
    kept: Vec<Option<Arc<TargetImage>>>,
    kept_bytes: u64,
}

impl Targets {
    /// Photos at a scale.
    pub fn new(num_views: usize, scale: f64) -> Self {
        Self { scale, stage: 0, kept: vec![None; num_views], kept_bytes: 0 }
    }

    /// Changes the scale and drops the photos at the old one.
    pub fn set_scale(&mut self, scale: f64) {
        if scale != self.scale {
            let num_views = self.kept.len();
            *self = Self { stage: self.stage + 1, ..Self::new(num_views, scale) };
        }
    }

    /// A number that only the same photo at the same size has.
    pub fn photo(&self, view: usize) -> u32 {
        self.stage * self.kept.len() as u32 + view as u32
    }

    /// The camera of a view at the stage's size.
    pub fn camera(&self, views: &dyn ViewSource, view: usize) -> Camera {
        let camera = views.camera(view);
        Camera { pinhole: reduced(&camera.pinhole, self.scale), ..camera }
    }

    /// Reduces those photos of these views that are not kept yet, on all cores, as far as there is room for them. Those that
    /// cannot be read are left for [`Self::get`] to report.
    pub fn prepare(&mut self, views: &dyn ViewSource, wanted: &[usize]) {
        let mut missing: Vec<usize> =
            wanted.iter().copied().filter(|&view| self.scale > 1.0 && self.kept[view].is_none()).collect();
        missing.sort_unstable();
        missing.dedup();
        let mut room = self.most_bytes(views).saturating_sub(self.kept_bytes);
        missing.retain(|&view| {
            // Colours and a mask.
            let bytes = 4 * self.camera(views, view).pinhole.num_pixels() as u64;
            let fits = bytes <= room;
            room -= if fits { bytes } else { 0 };
            fits
        });
        if missing.len() > 1 {
            let reduce = |&view: &usize| Some((view, self.reduced(views, view).ok()?));
            let images: Vec<_> = missing.par_iter().filter_map(reduce).collect();
            images.into_iter().for_each(|(view, image)| self.keep(views, view, &image));
        }
    }

    /// The photo of a view at the stage's size.
    ///
    /// # Errors
    /// Whatever the view reports.
    pub fn get(&mut self, views: &dyn ViewSource, view: usize) -> Result<Arc<TargetImage>> {
        if self.scale <= 1.0 {
            return views.target(view);
        }
        if let Some(image) = &self.kept[view] {
            return Ok(Arc::clone(image));
        }
        let image = self.reduced(views, view)?;
        self.keep(views, view, &image);
        Ok(image)
    }

    fn reduced(&self, views: &dyn ViewSource, view: usize) -> Result<Arc<TargetImage>> {
        let pinhole = self.camera(views, view).pinhole;
        Ok(Arc::new(views.target(view)?.reduced(pinhole.width_px, pinhole.height_px)))
    }

    fn keep(&mut self, views: &dyn ViewSource, view: usize, image: &Arc<TargetImage>) {
        let bytes = image.num_bytes();
        if self.kept_bytes + bytes <= self.most_bytes(views) {
            self.kept_bytes += bytes;
            self.kept[view] = Some(Arc::clone(image));
        }
    }

    fn most_bytes(&self, views: &dyn ViewSource) -> u64 {
        KEPT_BYTES.min(views.cache_limit_bytes())
    }

    /// Whether the full photo will be read for a view.
    pub fn needs_full(&self, view: usize) -> bool {
        self.scale <= 1.0 || self.kept[view].is_none()
    }
}

/// The camera for images reduced by a factor of at least 1; sizes are rounded down.
fn reduced(pinhole: &Pinhole, scale: f64) -> Pinhole {
    let side = |px: u32| ((f64::from(px) / scale) as u32).max(1);
    pinhole.resized(side(pinhole.width_px), side(pinhole.height_px))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cameras_of_reduced_photos_have_the_same_field_of_view() {
        let pinhole = Pinhole { width_px: 9, height_px: 6, fx_px: 9.0, fy_px: 9.0, cx_px: 4.5, cy_px: 3.0 };
        let small = reduced(&pinhole, 2.0);
        assert_eq!((small.width_px, small.height_px), (4, 3));
        assert!((small.fx_px / 4.0 - pinhole.fx_px / 9.0).abs() < 1e-12);
    }

    #[test]
    fn numbers_of_photos_differ_between_sizes() {
        let mut targets = Targets::new(5, 4.0);
        let coarse = targets.photo(3);
        targets.set_scale(4.0);
        assert_eq!(targets.photo(3), coarse);
        targets.set_scale(2.0);
        assert!(targets.photo(3) != coarse && targets.photo(0) > coarse);
    }
}
