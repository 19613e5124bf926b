//! Input and options of initialisation.

use crate::camera::Similarity;
use crate::model::Filter;
use crate::train::Policy;
use crate::views::{SfmPoint, Split, ViewSource, by_place};
use std::path::Path;

/// Where the initial splats are placed.
#[derive(Clone, Copy, Debug)]
pub enum InitPoints<'a> {
    /// At these points.
    Sparse(&'a [SfmPoint]),
    /// At this many random points in the views.
    Random(usize),
    /// The capture has none: finds them in the photos, or else draws this many at random.
    Missing(usize),
}

/// What a capture contributes to the initial model.
#[derive(Clone, Copy)]
pub struct InitInput<'a> {
    /// The cameras and their split.
    pub views: &'a dyn ViewSource,
    /// Where the splats stand.
    pub points: InitPoints<'a>,
    /// The file that the points were read from, for messages.
    pub points_file: &'a Path,
    /// Way back from the local frame.
    pub capture_from_local: Similarity,
    /// Near plane, local units.
    pub near: f32,
}

/// Training views whose photos initialisation reads; of more, as many spread evenly.
const PHOTOS_MAX: usize = 64;

impl InitInput<'_> {
    /// The training views whose photos initialisation reads, in the order of [`by_place`].
    pub(super) fn photo_views(&self) -> Vec<usize> {
        let order = by_place(self.views, self.views.indices(Split::Train));
        let count = order.len().min(PHOTOS_MAX);
        (0..count).map(|k| order[k * order.len() / count]).collect()
    }
}

#[cfg(test)]
impl<'a> InitInput<'a> {
    /// That of views whose local frame is the capture's.
    pub(super) fn for_test(views: &'a dyn ViewSource, points: InitPoints<'a>) -> Self {
        let (points_file, capture_from_local) = (Path::new("points"), Similarity::IDENTITY);
        Self { views, points, points_file, capture_from_local, near: 0.01 }
    }
}

/// How the initial model is made.
#[derive(Clone, Debug, PartialEq)]
pub struct InitOptions {
    /// More points than this are thinned at random.
    pub max_points: usize,
    /// SH degree stored, 0 to 3.
    pub sh_degree: u32,
    /// Decides the size of the first texture maps.
    pub policy: Policy,
    /// Low-pass filter of the model.
    pub filter: Filter,
    /// Seed of everything random.
    pub seed: u64,
    /// Adds a backdrop where training rays meet no points, which takes reading photos; on photos that were
    /// composited on this background. `None`: no backdrop.
    pub backdrop_on: Option<[f32; 3]>,
    /// Adds points found in the photos where there are few; photos were composited on this background. `None`: only those
    /// given.
    pub sweep_on: Option<[f32; 3]>,
}

impl Default for InitOptions {
    fn default() -> Self {
        Self {
            max_points: 1_000_000,
            sh_degree: 3,
            policy: Policy::Litetex,
            filter: Filter::None,
            seed: 42,
            backdrop_on: None,
            sweep_on: None,
        }
    }
}
