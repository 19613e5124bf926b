//! Layers per pixel: what a scene costs on a screen.

use crate::bake::camera;
use crate::camera::Camera;
use crate::cpu::blended_fragments;
use crate::fragments::rasterised_fragments;
use crate::model::Model;
use crate::verify::evenly_spread;
use litetex_exporters::AssetCamera;
use serde::{Deserialize, Serialize};

/// Stored cameras that are counted at most, evenly spread.
const MOST_VIEWS: usize = 32;
/// Longer side to which their images are reduced.
const LONGER_SIDE_PX: u32 = 480;
/// Share of the splats that count as the largest.
const LARGEST: f64 = 0.05;

/// Fragments per pixel, means over views.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct LayersPerPixel {
    /// Splats whose support covers a pixel, hidden or not.
    pub rasterised: f64,
    /// Those that are blended: with alpha of at least 1/255, before the pixel stops.
    pub blended: f64,
    /// Share of the rasterised fragments that belong to the 5 % of the splats which have most.
    pub share_of_largest: f64,
    /// Number of views.
    pub views: usize,
    /// Longer side of the largest image, pixels.
    pub longer_side_px: u32,
}

impl LayersPerPixel {
    /// Counts over these views; `None` without any.
    pub fn of(model: &Model, cameras: &[Camera]) -> Option<Self> {
        let sides = cameras.iter().map(|c| c.pinhole.width_px.max(c.pinhole.height_px));
        let longer_side_px = sides.max()?;
        let mut of_splats = rasterised_fragments(model, cameras);
        of_splats.sort_unstable_by(|a, b| b.total_cmp(a));
        let rasterised = of_splats.iter().sum::<f64>();
        let largest = (LARGEST * of_splats.len() as f64).ceil() as usize;
        let of_largest = of_splats[..largest].iter().sum::<f64>();
        Some(Self {
            rasterised,
            blended: blended_fragments(model, cameras),
            share_of_largest: if rasterised > 0.0 { of_largest / rasterised } else { 0.0 },
            views: cameras.len(),
            longer_side_px,
        })
    }

    /// Counts over up to 32 of a scene's cameras, evenly spread, whose longer side is at most 480 pixels; `None` for a scene
    /// without cameras.
    pub fn of_stored(model: &Model, cameras: &[AssetCamera]) -> Option<Self> {
        let reduced = |of: &AssetCamera| {
            let longer_side_px = of.width_px.max(of.height_px).min(LONGER_SIDE_PX);
            camera(of).with_longer_side(longer_side_px)
        };
        let cameras: Vec<Camera> = evenly_spread(cameras, MOST_VIEWS).iter().map(reduced).collect();
        Self::of(model, &cameras)
    }

    /// Both in a line.
    pub fn words(&self) -> String {
        format!("{:.1} rasterised, {:.1} blended", self.rasterised, self.blended)
    }
}
