//! A procedural capture in COLMAP's layout: ray-cast images of a small still life with exact poses,
//! sparse points and exact depths. For tests and for trying the program, without third-party photos
//! or licences. With a [`Stress`] it is hard in one respect; a [`NamedScene`] is shown instead.

mod avi;
mod capture;
mod colmap_write;
mod extras;
mod frame;
mod lettering;
mod levels;
mod noise;
mod options;
mod patch;
mod planted;
mod points;
mod poses;
mod poster;
mod random;
mod ray;
mod render;
mod scene;
mod scenes;
mod stress;
mod texture;
mod video;
mod views;

pub use capture::SampleSummary;
pub use colmap_write::{SparseImage, SparseModel, SparsePoint};
pub use options::SampleOptions;
pub use planted::planted_model;
pub use scenes::{NamedScene, SceneKind};
pub use stress::{Stress, StressKind};
pub use video::write_video;

use crate::atomic_file;
use crate::image::{Channels, write_exr, write_png};
use crate::{Error, Result};
use capture::{Capture, Pixels};
use std::path::{Path, PathBuf};

/// Writes a capture to `dir`: `images/*.png`, `sparse/0/*.bin` and, if requested, `sparse/0/*.txt`,
/// `truth/depth/*.exr` and `truth/scene.json`. A stress adds `test.txt`, which lists the test photos, `masks/*.png` of
/// padded photos, and `regions/*.png`, white where a photo shows what the stress is about. So does a [`NamedScene`], which
/// has no depths. Equal options give equal bytes.
///
/// # Errors
/// [`Error::Usage`] for options out of range, [`Error::Io`] if writing fails.
pub fn write_sample(dir: &Path, options: &SampleOptions) -> Result<SampleSummary> {
    options.check()?;
    let capture = Capture::new(options);
    let (images, sparse) = (folder(dir, "images")?, folder(dir, "sparse/0")?);
    for (index, view) in capture.views.iter().enumerate() {
        write(&images.join(&view.name), Channels::Rgb, &capture.photo(index))?;
        if let Some(mask) = capture.mask(index) {
            write(&folder(dir, "masks")?.join(&view.name), Channels::Grey, &mask)?;
        }
    }
    capture.sparse.write_binary(&sparse)?;
    if options.text {
        capture.sparse.write_text(&sparse)?;
    }
    if options.stress.is_some() || options.scene.is_some() {
        write_split_and_regions(dir, &capture)?;
    }
    if options.truth {
        write_truth(dir, &capture)?;
    }
    Ok(capture.summary())
}

fn folder(dir: &Path, name: &str) -> Result<PathBuf> {
    let path = dir.join(name);
    std::fs::create_dir_all(&path).map_err(|e| Error::io(&path, e))?;
    Ok(path)
}

fn write(path: &Path, channels: Channels, pixels: &Pixels) -> Result<()> {
    write_png(path, pixels.width_px, pixels.height_px, channels, &pixels.values)
}

fn write_split_and_regions(dir: &Path, capture: &Capture) -> Result<()> {
    let test: String = capture.views.iter().filter(|v| v.is_test).map(|v| format!("{}\n", v.name)).collect();
    atomic_file::write(&dir.join("test.txt"), test.as_bytes())?;
    for (index, view) in capture.views.iter().enumerate() {
        if let Some(region) = capture.region(index) {
            write(&folder(dir, "regions")?.join(&view.name), Channels::Grey, &region)?;
        }
    }
    Ok(())
}

fn write_truth(dir: &Path, capture: &Capture) -> Result<()> {
    let depths = folder(dir, if capture.has_depths() { "truth/depth" } else { "truth" })?;
    for (index, view) in capture.views.iter().enumerate() {
        let path = depths.join(&view.name).with_extension("exr");
        if let Some((pinhole, depth)) = capture.depth(index) {
            write_exr(&path, pinhole.width_px, pinhole.height_px, Channels::Grey, &depth)?;
        }
    }
    let json = serde_json::to_vec_pretty(&capture.description())
        .map_err(|e| Error::io(dir, std::io::Error::other(e)))?;
    Ok(atomic_file::write(&dir.join("truth/scene.json"), &json)?)
}

#[cfg(test)]
mod scenes_tests;
#[cfg(test)]
mod stress_tests;
#[cfg(test)]
mod tests;
