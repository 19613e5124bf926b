//! A procedural capture in COLMAP's layout: ray-cast images of a small still life with exact poses,
//! sparse points and exact depths. For trying the program and for tests, without photos or licences of
//! others.

mod capture;
mod colmap_write;
mod lettering;
mod noise;
mod render;
mod scene;
mod texture;

pub use colmap_write::{SparseImage, SparseModel, SparsePoint};

use crate::atomic_file;
use crate::image::{Channels, write_exr, write_png};
use crate::{Error, Result};
use capture::Capture;
use serde::{Deserialize, Serialize};
use std::path::Path;

/// Options of [`write_sample`].
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
        }
    }
}

/// What [`write_sample`] has written.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SampleSummary {
    /// Number of views.
    pub views: usize,
    /// Number of sparse points.
    pub points: usize,
    /// Number of observations of the points, over all images.
    pub observations: usize,
    /// Mean distance between an observation and the projection of its (noisy) point.
    pub mean_reprojection_error_px: f64,
}

/// Longest image side; the ray caster is meant for small captures.
const SIDE_MAX_PX: u32 = 8192;

impl SampleOptions {
    fn check(&self) -> Result<()> {
        let usage = |what: &str| Err(Error::Usage(format!("sample: {what}")));
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
        Ok(())
    }
}

/// Writes a capture to `dir`: `images/*.png`, `sparse/0/*.bin` and, if requested, `sparse/0/*.txt`,
/// `truth/depth/*.exr` and `truth/scene.json`. Equal options give equal bytes.
///
/// # Errors
/// [`Error::Usage`] for options out of range, [`Error::Io`] if writing fails.
pub fn write_sample(dir: &Path, options: &SampleOptions) -> Result<SampleSummary> {
    options.check()?;
    let capture = Capture::new(options);
    let folder = |name: &str| {
        let path = dir.join(name);
        std::fs::create_dir_all(&path).map_err(|e| Error::io(&path, e))?;
        Ok::<_, Error>(path)
    };
    let (images, sparse) = (folder("images")?, folder("sparse/0")?);
    let (width_px, height_px) = (options.width_px, options.height_px);
    for (view, image) in capture.sparse.images.iter().enumerate() {
        let rgb = capture.image(view);
        write_png(&images.join(&image.name), width_px, height_px, Channels::Rgb, &rgb)?;
    }
    capture.sparse.write_binary(&sparse)?;
    if options.text {
        capture.sparse.write_text(&sparse)?;
    }
    if options.truth {
        let depths = folder("truth/depth")?;
        for (view, image) in capture.sparse.images.iter().enumerate() {
            let path = depths.join(&image.name).with_extension("exr");
            write_exr(&path, width_px, height_px, Channels::Grey, &capture.depth(view))?;
        }
        let json = serde_json::to_vec_pretty(&capture.description())
            .map_err(|e| Error::io(dir, std::io::Error::other(e)))?;
        atomic_file::write(&dir.join("truth/scene.json"), &json)?;
    }
    Ok(capture.summary())
}

#[cfg(test)]
mod tests;
