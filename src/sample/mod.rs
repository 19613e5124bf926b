//! A procedural capture in COLMAP's layout: ray-cast images of a small still life with exact poses,
//! sparse points and exact depths. For tests and for trying the program, without third-party photos
//! or licences.

mod capture;
mod colmap_write;
mod lettering;
mod noise;
mod options;
mod render;
mod scene;
mod texture;

pub use capture::SampleSummary;
pub use colmap_write::{SparseImage, SparseModel, SparsePoint};
pub use options::SampleOptions;

use crate::atomic_file;
use crate::image::{Channels, write_exr, write_png};
use crate::{Error, Result};
use capture::Capture;
use std::path::Path;

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
