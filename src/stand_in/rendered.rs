//! Renders of a scene as the photos of a capture.

use crate::Result;
use crate::backend::{RenderedImage, TargetImage};
use crate::bake::camera;
use crate::camera::Camera;
use crate::eval::quantised;
use crate::views::{Split, ViewSource};
use litetex_exporters::AssetCamera;
use std::sync::Arc;

/// Cameras with renders in place of photos; all are training views.
pub(super) struct RenderedViews<'a> {
    cameras: &'a [AssetCamera],
    images: Vec<Arc<TargetImage>>,
}

impl<'a> RenderedViews<'a> {
    /// `images` are those of the cameras.
    pub fn new(cameras: &'a [AssetCamera], images: &[RenderedImage]) -> Self {
        let image = |image: &RenderedImage| {
            Arc::new(TargetImage::opaque(image.width_px, image.height_px, quantised(&image.rgb)))
        };
        Self { cameras, images: images.iter().map(image).collect() }
    }
}

impl ViewSource for RenderedViews<'_> {
    fn num_views(&self) -> usize {
        self.cameras.len()
    }

    fn name(&self, view: usize) -> &str {
        &self.cameras[view].name
    }

    fn split(&self, _view: usize) -> Split {
        Split::Train
    }

    fn camera(&self, view: usize) -> Camera {
        camera(&self.cameras[view])
    }

    fn target(&self, view: usize) -> Result<Arc<TargetImage>> {
        Ok(Arc::clone(&self.images[view]))
    }
}
