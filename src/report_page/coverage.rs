//! How many training views show each splat.

use crate::backend::RenderedImage;
use crate::camera::Camera;
use glam::Vec3;
use serde::Serialize;

/// Training views that are rendered for the coverage, at most.
pub const COVERAGE_VIEWS_MAX: usize = 60;

/// How far behind the rendered depth a splat may lie and still count as shown, as a share of the depth: splats have an extent, and
/// the depth is a mean over several.
const BEHIND_MAX: f64 = 0.05;

/// Classes of numbers of views: the smallest of each, and its name.
const CLASSES: [(u32, &str); 6] =
    [(0, "no view"), (1, "1 view"), (2, "2 views"), (3, "3 or 4"), (5, "5 to 9"), (10, "10 or more")];

/// What the training views show.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Coverage {
    /// Views that were looked at.
    pub views: usize,
    /// All training views.
    pub of_views: usize,
    /// Share of the splats by the number of these views that show them, 0 to 1.
    pub splats_by_views: Vec<(&'static str, f64)>,
    /// Mean share of uncovered pixels, 0 to 1.
    pub uncovered: f64,
    /// The view with the largest share, and that.
    pub most_uncovered: Option<(String, f64)>,
}

/// Counts for each splat the views that show it.
pub struct SeenCounter {
    positions: Vec<Vec3>,
    views: Vec<u32>,
}

impl SeenCounter {
    /// A counter for splats with these centres, `[splats, 3]`, local frame.
    pub fn new(positions: &[f32]) -> Self {
        let positions: Vec<Vec3> = positions.as_chunks::<3>().0.iter().map(|p| Vec3::from(*p)).collect();
        Self { views: vec![0; positions.len()], positions }
    }

    /// Takes in a view, rendered with its depth: it shows a splat whose centre lies within the image and not behind what is drawn
    /// there.
    pub fn add(&mut self, camera: &Camera, image: &RenderedImage) {
        for (position, views) in self.positions.iter().zip(&mut self.views) {
            let in_camera = camera.camera_from_local.transform_point(position.as_dvec3());
            let Some(at) = camera.pinhole.project(in_camera) else { continue };
            let is_inside = at.x >= 0.0
                && at.y >= 0.0
                && at.x < f64::from(image.width_px)
                && at.y < f64::from(image.height_px);
            if is_inside {
                let pixel = at.y as usize * image.width_px as usize + at.x as usize;
                let depth = image.depth.get(pixel).copied().map_or(0.0, f64::from);
                *views += u32::from(depth <= 0.0 || in_camera.z <= depth * (1.0 + BEHIND_MAX));
            }
        }
    }

    /// Share of the splats in each class, 0 to 1, from few views to many.
    pub fn shares(&self) -> Vec<(&'static str, f64)> {
        let next = |class: usize| CLASSES.get(class + 1).map_or(u32::MAX, |(from, _)| *from);
        let share = |(class, (from, name)): (usize, (u32, &'static str))| {
            let count = self.views.iter().filter(|v| (from..next(class)).contains(v)).count();
            (name, count as f64 / self.views.len().max(1) as f64)
        };
        CLASSES.into_iter().enumerate().map(share).collect()
    }
}
