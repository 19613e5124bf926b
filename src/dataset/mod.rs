//! Captures: posed photos and sparse points read from files and brought into the frame, size and colour
//! space of training. Nothing here knows how training or rendering works.

mod check;
mod decode;
mod exr_photo;
#[cfg(test)]
pub(crate) mod fixtures;
mod folder;
mod formats;
mod frame;
mod health;
mod jpeg_end;
mod lens;
mod load;
mod options;
mod photos;
mod plausible;
mod pose_format;
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
use crate::{Error, Report, Result};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use store::ImageStore;

/// One posed photo.
#[derive(Clone, Debug, PartialEq)]
pub struct View {
    /// Name of the photo relative to the photo folder, with forward slashes.
    pub name: String,
    /// Trained on or held out.
    pub split: Split,
    /// Camera in the local frame, at the size that is trained.
    pub camera: Camera,
}

/// A capture, ready to be trained on. Photos are decoded on demand.
pub struct Capture {
    /// Name of its folder or archive.
    pub name: String,
    /// Its folder or archive.
    pub root: PathBuf,
    /// The format of its poses.
    pub format: CaptureFormat,
    /// The file or folder that its poses were read from.
    pub poses: PathBuf,
    /// Sorted by name.
    pub views: Vec<View>,
    /// Points of the sparse reconstruction, unfiltered.
    pub points: Vec<SfmPoint>,
    /// Undoes the local frame, in which the extent of the capture is 1.
    pub capture_from_local: Similarity,
    /// Distance of the near plane, local units.
    pub near: f32,
    /// How sound the sparse reconstruction looks, where there is one.
    pub health: Option<SparseHealth>,
    /// Warnings: what was left out, chosen among several or looks wrong.
    pub report: Report,
    store: ImageStore,
    /// The files of an archive. Dropped after the store, whose threads read them.
    unpacked: Option<zipped::Unpacked>,
}

impl Capture {
    /// Reads the poses and points of a capture and checks the sizes of its photos without decoding them.
    ///
    /// `path` is the capture's folder, a ZIP archive of it, its sparse model or its `transforms.json`.
    ///
    /// # Errors
    /// [`Error::InvalidInput`], [`Error::Unsupported`] or [`Error::Io`], naming file,
    /// element, what was found, what was expected and what to do.
    pub fn load(path: &Path, options: &LoadOptions) -> Result<Self> {
        load::load(path, options)
    }

    /// Decodes every photo and mask once, so that a damaged one is found before training and not during it.
    /// What fits stays in the image cache.
    ///
    /// # Errors
    /// The first error in the order of the views, with the names of other views that have one.
    pub fn check_photos(&self) -> Result<Report> {
        let mut report =
            check::photos(&self.views, self.store.check_all()).map_err(|e| self.name_archive(e))?;
        if let Some(unpacked) = &self.unpacked {
            report.warnings.iter_mut().for_each(|w| w.message = unpacked.in_words(&w.message));
        }
        Ok(report)
    }

    /// Most memory that decoding takes if `threads` photos are asked for at once.
    pub fn decoding_bytes(&self, threads: usize) -> u64 {
        self.store.decoding_bytes(threads)
    }

    /// Errors about an unpacked file are about the archive to the user.
    fn name_archive(&self, error: Error) -> Error {
        match &self.unpacked {
            Some(unpacked) => unpacked.name_archive(error),
            None => error,
        }
    }

    /// Bytes of decoded photos in the image cache.
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
        self.store.get(view).map_err(|e| self.name_archive(e))
    }

    fn cache_limit_bytes(&self) -> u64 {
        self.store.budget_bytes()
    }

    fn prefetch(&self, views: &[usize]) {
        self.store.prefetch(views);
    }
}
