//! Photos at the size of the current stage: reduced by area once in each stage and kept while there is room.

use crate::Result;
use crate::camera::{Camera, Pinhole};
use crate::image::TargetImage;
use crate::views::ViewSource;
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
        let full = views.target(view)?;
        let pinhole = self.camera(views, view).pinhole;
        let image = Arc::new(full.reduced(pinhole.width_px, pinhole.height_px));
        let bytes = image.num_bytes();
        if self.kept_bytes + bytes <= KEPT_BYTES.min(views.cache_limit_bytes()) {
            self.kept_bytes += bytes;
            self.kept[view] = Some(Arc::clone(&image));
        }
        Ok(image)
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
