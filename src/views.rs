//! What initialisation, training and evaluation need to know of a capture: cameras in the local frame,
//! names, the split, photos on demand and sparse points. `dataset` reads it from files, tests make it in memory.

use crate::Result;
use crate::camera::Camera;
use crate::image::TargetImage;
use glam::DVec3;
use std::sync::Arc;

/// Which side of the split a view is on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Split {
    /// Optimised on.
    Train,
    /// Held out.
    Test,
}

/// A point of a capture's sparse reconstruction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SfmPoint {
    /// Position in the frame of the capture.
    pub position_in_capture: DVec3,
    /// Colour in display space.
    pub rgb: [u8; 3],
}

/// Views in an order that follows from where their cameras stand and not from their names: by distance from
/// the origin, which is the cameras' mean in the local frame; at equal distances as given. A capture that
/// was turned, or whose images were renamed, is then drawn from in the same order.
pub fn by_place(views: &dyn ViewSource, mut indices: Vec<usize>) -> Vec<usize> {
    indices.sort_by(|&a, &b| {
        let distance = |view: usize| views.camera(view).centre_in_local().length_squared();
        distance(a).total_cmp(&distance(b))
    });
    indices
}

/// A set of posed photos.
pub trait ViewSource: Sync {
    /// Number of views, both sides of the split.
    fn num_views(&self) -> usize;

    /// Original image name of a view, relative to the image folder.
    fn name(&self, view: usize) -> &str;

    /// Side of the split.
    fn split(&self, view: usize) -> Split;

    /// Camera at the size that is trained and evaluated.
    fn camera(&self, view: usize) -> Camera;

    /// The photo, of the camera's size. May decode it now.
    ///
    /// # Errors
    /// What reading the file found.
    fn target(&self, view: usize) -> Result<Arc<TargetImage>>;

    /// Bound of the memory for decoded photos; copies of them may take as much again.
    fn cache_limit_bytes(&self) -> u64 {
        u64::MAX
    }

    /// Says which views will be asked for next, so that they can be decoded meanwhile.
    fn prefetch(&self, _views: &[usize]) {}

    /// Indices of one side of the split, ascending.
    fn indices(&self, split: Split) -> Vec<usize> {
        (0..self.num_views()).filter(|&v| self.split(v) == split).collect()
    }
}
