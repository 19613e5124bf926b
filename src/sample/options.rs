//! Options of the sample capture, and their bounds.

use super::scenes::NamedScene;
use super::stress::Stress;
use crate::Result;
use serde::{Deserialize, Serialize};

/// Longest image side; the ray caster is meant for small captures.
const SIDE_MAX_PX: u32 = 8192;

/// Options of [`write_sample`](super::write_sample).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SampleOptions {
    /// Number of views, at least 2.
    pub views: usize,
    /// Width of the images.
    pub width_px: u32,
    /// Height of the images.
    pub height_px: u32,
    /// Seed of the patterns, the placement of objects, the camera jitter and the points.
    pub seed: u64,
    /// Rays per pixel along each axis.
    pub supersampling: u32,
    /// Number of sparse points.
    pub points: usize,
    /// Standard deviation of the noise on point positions, per axis, metres.
    pub point_noise_m: f64,
    /// Also write the sparse model as text.
    pub text: bool,
    /// Write `truth/`: depths and a description of the scene.
    pub truth: bool,
    /// What makes the capture hard. With any, every eighth view is a test view, and `test.txt` lists these.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub stress: Option<Stress>,
    /// What is shown instead of the still life; excludes a stress. Every eighth view is a test view here too.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub scene: Option<NamedScene>,
}

/// A capture that trains in about a minute; the values are not measured.
impl Default for SampleOptions {
    fn default() -> Self {
        Self {
            views: 32,
            width_px: 320,
            height_px: 240,
            seed: 0,
            supersampling: 3,
            points: 4000,
            point_noise_m: 0.002,
            text: false,
            truth: true,
            stress: None,
            scene: None,
        }
    }
}

impl SampleOptions {
    /// Checks the bounds.
    ///
    /// # Errors
    /// [`crate::Error::Usage`] naming the first value out of range.
    pub(super) fn check(&self) -> Result<()> {
        let usage = |what: &str| Err(usage!("sample: {what}"));
        if !(2..=10_000).contains(&self.views) {
            return usage("the number of views must be 2 to 10000");
        }
        if !(1..=SIDE_MAX_PX).contains(&self.width_px) || !(1..=SIDE_MAX_PX).contains(&self.height_px) {
            return usage("width and height must be 1 to 8192 pixels");
        }
        if !(1..=16).contains(&self.supersampling) {
            return usage("supersampling must be 1 to 16");
        }
        if self.points > 1_000_000 {
            return usage("there may be at most 1000000 points");
        }
        if !(0.0..=0.1).contains(&self.point_noise_m) {
            return usage("the points' noise must be 0 to 0.1 m");
        }
        if let (Some(scene), Some(stress)) = (self.scene, self.stress) {
            return usage(&format!("found the scene {scene} and the stress {stress}, expected one of them"));
        }
        Ok(())
    }
}
