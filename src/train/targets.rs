//! Photos at the size of the current stage: reduced by area once in each stage and kept while there is room.

use crate::Result;
use crate::camera::{Camera, Pinhole};
use crate::image::TargetImage;
use crate::views::{ViewSource, WantedPhoto};
use std::sync::Arc;

/// Memory for reduced photos, unless the user allows less for photos.
const KEPT_BYTES: u64 = 1 << 30;

/// Steps of a batch whose photos are not all kept: the batch holds them besides.
const HELD_PHOTOS: usize = 16;

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

    /// Steps of a batch, at most `preferred` and no more than there is memory for their photos.
    pub fn batch_steps(&self, views: &dyn ViewSource, preferred: usize) -> usize {
        let reduced_bytes = || (0..self.kept.len()).map(|view| self.bytes_at_most(views, view)).sum::<u64>();
        let keeps_all = views.keeps_all() && (self.scale <= 1.0 || reduced_bytes() <= self.most_bytes(views));
        preferred.clamp(1, if keeps_all { usize::MAX } else { HELD_PHOTOS })
    }

    /// The camera of a view at the stage's size.
    pub fn camera(&self, views: &dyn ViewSource, view: usize) -> Camera {
        let camera = views.camera(view);
        Camera { pinhole: reduced(&camera.pinhole, self.scale), ..camera }
    }

    /// The photos of these views at a scale, in the order of their use, without those that are kept: what is to be made ahead.
    pub fn wanted(&self, views: &dyn ViewSource, drawn: &[usize], scale: f64) -> Vec<WantedPhoto> {
        let is_kept = |view: usize| scale == self.scale && self.kept[view].is_some();
        let mut announced = vec![false; self.kept.len()];
        let mut wanted = Vec::new();
        for &view in drawn {
            if !is_kept(view) && !std::mem::replace(&mut announced[view], true) {
                let pinhole = reduced(&views.camera(view).pinhole, scale);
                let reduced_px = (scale > 1.0).then_some((pinhole.width_px, pinhole.height_px));
                wanted.push(WantedPhoto { view, reduced_px });
            }
        }
        wanted
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
        let pinhole = self.camera(views, view).pinhole;
        let image = views.reduced_target(view, (pinhole.width_px, pinhole.height_px))?;
        self.keep(views, view, &image);
        Ok(image)
    }

    fn keep(&mut self, views: &dyn ViewSource, view: usize, image: &Arc<TargetImage>) {
        let bytes = image.num_bytes();
        if self.kept_bytes + bytes <= self.most_bytes(views) {
            self.kept_bytes += bytes;
            self.kept[view] = Some(Arc::clone(image));
        }
    }

    /// Bytes of a reduced photo with a mask or transparency.
    fn bytes_at_most(&self, views: &dyn ViewSource, view: usize) -> u64 {
        4 * self.camera(views, view).pinhole.num_pixels() as u64
    }

    fn most_bytes(&self, views: &dyn ViewSource) -> u64 {
        KEPT_BYTES.min(views.cache_limit_bytes())
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
    use crate::selftest::{SceneOptions, random_scene};
    use crate::views::{Split, TestViews};

    #[test]
    fn cameras_of_reduced_photos_have_the_same_field_of_view() {
        let pinhole = Pinhole { width_px: 9, height_px: 6, fx_px: 9.0, fy_px: 9.0, cx_px: 4.5, cy_px: 3.0 };
        let small = reduced(&pinhole, 2.0);
        assert_eq!((small.width_px, small.height_px), (4, 3));
        assert!((small.fx_px / 4.0 - pinhole.fx_px / 9.0).abs() < 1e-12);
    }

    /// Views of 100 x 10 pixels in a cache.
    struct Cached {
        views: TestViews,
        keeps_all: bool,
        limit_bytes: u64,
    }

    impl ViewSource for Cached {
        fn num_views(&self) -> usize {
            self.views.num_views()
        }
        fn name(&self, view: usize) -> &str {
            self.views.name(view)
        }
        fn split(&self, view: usize) -> Split {
            self.views.split(view)
        }
        fn camera(&self, view: usize) -> Camera {
            self.views.camera(view)
        }
        fn target(&self, view: usize) -> Result<Arc<TargetImage>> {
            self.views.target(view)
        }
        fn cache_limit_bytes(&self) -> u64 {
            self.limit_bytes
        }
        fn keeps_all(&self) -> bool {
            self.keeps_all
        }
    }

    #[test]
    fn long_batches_hold_no_photos_besides_those_that_are_kept() {
        let camera = random_scene(&SceneOptions { num_splats: 1, ..SceneOptions::default() }).camera;
        let photo = Arc::new(TargetImage::opaque(100, 10, vec![0; 3000]));
        let views = vec![("a", camera.resized(100, 10), photo); 40];
        let mut views =
            Cached { views: TestViews(Split::Train, views), keeps_all: true, limit_bytes: 40_000 };
        // Reduced by 2 on each side, 40 photos take up to 40,000 bytes.
        let steps = |views: &Cached| [1.0, 2.0].map(|s| Targets::new(40, s).batch_steps(views, 64));
        assert_eq!(steps(&views), [64, 64]);
        views.limit_bytes -= 1;
        assert_eq!(steps(&views), [64, 16]);
        views.keeps_all = false;
        assert_eq!(steps(&views), [16, 16]);
        assert_eq!([0, 3].map(|preferred| Targets::new(40, 1.0).batch_steps(&views, preferred)), [1, 3]);
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
