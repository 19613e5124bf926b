//! The interface of a capture for initialisation, training and evaluation: cameras in the local frame, names, the split, photos
//! on demand and sparse points. `capture` implements it for files, tests do so in memory.

use crate::Result;
use crate::camera::Camera;
use crate::camera::up::{self, Up};
use crate::image::TargetImage;
use glam::DVec3;
use std::sync::Arc;

/// The side of the split that a view is on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Split {
    /// Training view.
    Train,
    /// Test view, held out from training.
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

/// Sorts views by the distance of their cameras from the origin, which is the cameras' mean in the local frame;
/// ties keep their order. The views of a capture are then drawn in the same order after it was rotated or its
/// photos renamed.
pub fn by_place(views: &dyn ViewSource, mut indices: Vec<usize>) -> Vec<usize> {
    indices.sort_by(|&a, &b| {
        let distance = |view: usize| views.camera(view).centre_in_local().length_squared();
        distance(a).total_cmp(&distance(b))
    });
    indices
}

/// A photo that will be needed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct WantedPhoto {
    /// Index of the view.
    pub view: usize,
    /// Width and height that it is reduced to; `None`: its own.
    pub reduced_px: Option<(u32, u32)>,
}

impl WantedPhoto {
    /// Photos at their own size.
    pub fn full(views: &[usize]) -> Vec<Self> {
        views.iter().map(|&view| Self { view, reduced_px: None }).collect()
    }
}

/// Views with cameras and photos.
pub trait ViewSource: Sync {
    /// Number of views, both sides of the split.
    fn num_views(&self) -> usize;

    /// Name of a view's photo, relative to the folder of the photos.
    fn name(&self, view: usize) -> &str;

    /// Side of the split that a view is on.
    fn split(&self, view: usize) -> Split;

    /// Camera of a view, at the size of training and evaluation.
    fn camera(&self, view: usize) -> Camera;

    /// Which direction of the capture is up, by the cameras of all views; the local frame is not turned from the capture's.
    fn up(&self) -> Up {
        up::find((0..self.num_views()).map(|v| self.camera(v).camera_from_local.rotation), None)
    }

    /// The program by whose poses a unit of the capture is a metre, if they say so.
    fn metric(&self) -> Option<&'static str> {
        None
    }

    /// The photo, of the camera's size. May block while it is decoded.
    ///
    /// # Errors
    /// Whatever reading the file reports.
    fn target(&self, view: usize) -> Result<Arc<TargetImage>>;

    /// The photo, reduced by area to a width and height of at most its own. May block while it is decoded.
    ///
    /// # Errors
    /// As [`Self::target`].
    fn reduced_target(&self, view: usize, (width_px, height_px): (u32, u32)) -> Result<Arc<TargetImage>> {
        Ok(Arc::new(self.target(view)?.reduced(width_px, height_px)))
    }

    /// Whether any photo has a pixel that is not opaque. May decode photos.
    fn has_alpha(&self) -> bool {
        false
    }

    /// Bound on the memory for decoded photos; copies of them may take as much again.
    fn cache_limit_bytes(&self) -> u64 {
        u64::MAX
    }

    /// Whether every photo stays in memory once it is decoded: holding several then takes no more.
    fn keeps_all(&self) -> bool {
        true
    }

    /// Announces the photos that will be needed next, so that they can be made in the background. The order is that of their use.
    fn prefetch(&self, _wanted: &[WantedPhoto]) {}

    /// Indices of one side of the split, ascending.
    fn indices(&self, split: Split) -> Vec<usize> {
        (0..self.num_views()).filter(|&v| self.split(v) == split).collect()
    }
}

/// Views for tests, all on one side of the split: name, camera and photo of each.
#[cfg(test)]
pub(crate) struct TestViews(pub Split, pub Vec<(&'static str, Camera, Arc<TargetImage>)>);

#[cfg(test)]
impl ViewSource for TestViews {
    fn num_views(&self) -> usize {
        self.1.len()
    }

    fn name(&self, view: usize) -> &str {
        self.1[view].0
    }

    fn split(&self, _view: usize) -> Split {
        self.0
    }

    fn camera(&self, view: usize) -> Camera {
        self.1[view].1
    }

    fn target(&self, view: usize) -> Result<Arc<TargetImage>> {
        Ok(Arc::clone(&self.1[view].2))
    }
}
