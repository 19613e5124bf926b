//! A loaded capture: its views and points, and its photos on demand.

use super::health::SparseHealth;
use super::options::CaptureFormat;
use super::store::ImageStore;
use super::undistortion::Undistortion;
use super::zipped::Unpacked;
use crate::camera::up::Up;
use crate::camera::{Camera, Similarity};
use crate::image::TargetImage;
use crate::views::{SfmPoint, Split, ViewSource, WantedPhoto};
use crate::{Error, Report, Result};
use std::path::PathBuf;
use std::sync::Arc;

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
    /// Which direction is up.
    pub up: Up,
    /// The program whose poses are in metres, if they are.
    pub metric: Option<&'static str>,
    /// Distance of the near plane, local units.
    pub near: f32,
    /// How plausible the sparse reconstruction looks, where there is one.
    pub health: Option<SparseHealth>,
    /// Photos without a pose in the folders of its photos.
    pub photos_without_pose: usize,
    /// What decided the split, for people: a list, files of the capture or `--test-every`.
    pub split_by: String,
    /// What undistortion keeps of the photos; `None` if no lens is distorted.
    pub undistortion: Option<Undistortion>,
    /// Warnings: what was left out, chosen among several or looks wrong.
    pub report: Report,
    /// For each view, the points that were triangulated from it, where the poses say so.
    pub(super) observed: Vec<Vec<u32>>,
    pub(super) store: ImageStore,
    /// The files of an archive. Dropped after the store, whose threads read them.
    pub(super) unpacked: Option<Unpacked>,
}

impl Capture {
    /// How many views are held out, and why.
    pub fn held_out(&self) -> String {
        let test = self.indices(Split::Test).len();
        format!("{test} of {} views are held out: {}", self.views.len(), self.split_by)
    }

    /// Most memory that decoding takes if `threads` photos are requested at once.
    pub fn decoding_bytes(&self, threads: usize) -> u64 {
        self.store.decoding_bytes(threads)
    }

    /// Errors about an unpacked file are about the archive to the user.
    pub(super) fn name_archive(&self, error: Error) -> Error {
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

    fn up(&self) -> Up {
        self.up
    }

    fn metric(&self) -> Option<&'static str> {
        self.metric
    }

    fn target(&self, view: usize) -> Result<Arc<TargetImage>> {
        self.store.get(view).map_err(|e| self.name_archive(e))
    }

    fn reduced_target(&self, view: usize, size_px: (u32, u32)) -> Result<Arc<TargetImage>> {
        self.store.get_reduced(view, size_px).map_err(|e| self.name_archive(e))
    }

    fn has_alpha(&self) -> bool {
        self.store.has_alpha()
    }

    fn cache_limit_bytes(&self) -> u64 {
        self.store.budget_bytes()
    }

    fn keeps_all(&self) -> bool {
        self.store.keeps_all()
    }

    fn prefetch(&self, wanted: &[WantedPhoto]) {
        self.store.prefetch(wanted);
    }
}
