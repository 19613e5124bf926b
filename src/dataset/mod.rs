//! Captures: posed photos and sparse points from files, brought into the frame, size and colour in
//! which they are trained on. Nothing here knows how training or rendering works.

mod decode;
mod exr_photo;
#[cfg(test)]
pub(crate) mod fixtures;
mod formats;
mod frame;
mod health;
mod lens;
mod load;
mod options;
mod photos;
mod source;
mod split;
mod store;
#[cfg(test)]
mod tests;
mod warp;
#[cfg(test)]
mod warp_tests;
mod zipped;

pub use decode::read_image;
pub use formats::ply::read_points as read_ply_points;
pub use health::SparseHealth;
pub use options::{CaptureFormat, LoadOptions};

use crate::camera::{Camera, Similarity};
use crate::image::TargetImage;
use crate::views::{SfmPoint, Split, ViewSource};
use crate::{Report, Result};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use store::ImageStore;

/// One posed photo.
#[derive(Clone, Debug, PartialEq)]
pub struct View {
    /// Name of the image relative to the image folder, with forward slashes.
    pub name: String,
    /// Side of the split.
    pub split: Split,
    /// Camera in the local frame, at the size that is trained.
    pub camera: Camera,
    /// The image file.
    pub image: PathBuf,
    /// Width and height of the image file.
    pub image_size_px: (u32, u32),
    /// The mask file.
    pub mask: Option<PathBuf>,
}

/// A capture, ready to be trained on. Photos are decoded on demand.
pub struct Capture {
    /// Name of its folder.
    pub name: String,
    /// Its folder.
    pub root: PathBuf,
    /// What its poses were read from.
    pub format: CaptureFormat,
    /// The file or folder that its poses were read from.
    pub poses: PathBuf,
    /// Sorted by name.
    pub views: Vec<View>,
    /// Points of the sparse reconstruction, unfiltered.
    pub points: Vec<SfmPoint>,
    /// Way back from the local frame, in which the cameras' extent is 1.
    pub capture_from_local: Similarity,
    /// Near plane, local units.
    pub near: f32,
    /// State of the sparse reconstruction, where there is one.
    pub health: Option<SparseHealth>,
    /// What was left out, chosen or looks wrong.
    pub report: Report,
    store: ImageStore,
    /// Dropped after the store, whose threads read from it.
    _unpacked: Option<zipped::Unpacked>,
}

impl Capture {
    /// Reads the poses and points of a capture and checks its images' sizes; decodes no image.
    ///
    /// `path` is the capture's folder, a ZIP archive of it, its sparse model or its `transforms.json`.
    ///
    /// # Errors
    /// [`crate::Error::InvalidInput`], [`crate::Error::Unsupported`] or [`crate::Error::Io`], naming file,
    /// element, what was found, what was expected and what to do.
    pub fn load(path: &Path, options: &LoadOptions) -> Result<Self> {
        load::load(path, options)
    }

    /// Bytes of decoded photos held now.
    pub fn cached_bytes(&self) -> u64 {
        self.store.cached_bytes()
    }
}

impl ViewSource for Capture {
    fn num_views(&self) -> usize {
        self.views.len()
    }

    fn name(&self, view: usize) -> &str {
        &self.views[view].name
    }

    fn split(&self, view: usize) -> Split {
        self.views[view].split
    }

    fn camera(&self, view: usize) -> Camera {
        self.views[view].camera
    }

    fn target(&self, view: usize) -> Result<Arc<TargetImage>> {
        self.store.get(view)
    }

    fn prefetch(&self, views: &[usize]) {
        self.store.prefetch(views);
    }
}
