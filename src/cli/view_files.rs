//! Files of evaluated and rendered views: their names, images, error maps and the table of figures.

use litetex_gs::backend::RenderedImage;
use litetex_gs::eval::{Evaluation, error_map, quantised};
use litetex_gs::image::{Channels, write_png};
use litetex_gs::views::ViewSource;
use litetex_gs::{Error, Result, atomic_file};
use std::fs;
use std::path::{Path, PathBuf};

/// Name of the table with the figures of each view.
pub const PER_VIEW: &str = "per_view.csv";

/// Writes a rendered view and its error map below `folder`, under the photo's name.
///
/// # Errors
/// [`Error::Io`], or what decoding the photo found.
pub fn write_view(folder: &Path, views: &dyn ViewSource, view: usize, image: &RenderedImage) -> Result<()> {
    let name = image_name(views, view);
    let target = views.target(view)?;
    let put = |path: PathBuf, rgb: &[u8]| {
        if let Some(parent) = path.parent() {
            fs::create_dir_all(parent).map_err(|e| Error::io(parent, e))?;
        }
        write_png(&path, image.width_px, image.height_px, Channels::Rgb, rgb)
    };
    put(folder.join(&name), &quantised(&image.rgb))?;
    put(folder.join("error").join(&name), &error_map(&image.rgb, &target))
}

/// File name for images of a view: the photo's with the extension `png`, or with `png` appended where two photos
/// differ only in their extension. Never leads out of the folder.
pub fn image_name(views: &dyn ViewSource, view: usize) -> PathBuf {
    let name = views.name(view);
    let stem = |name: &str| Path::new(name).with_extension("");
    let shared = (0..views.num_views()).any(|v| v != view && stem(views.name(v)) == stem(name));
    let name = if shared { format!("{name}.png") } else { format!("{}.png", stem(name).display()) };
    let parts = name.split(['/', '\\']).filter(|part| !matches!(*part, "" | "." | ".."));
    parts.map(|part| part.replace(':', "_")).collect()
}

/// Writes the figures of each view as a table, [`PER_VIEW`].
///
/// # Errors
/// [`Error::Io`].
pub fn write_per_view(folder: &Path, evaluation: &Evaluation) -> Result<()> {
    let mut text = String::from("name,psnr,grad_psnr,ssim_3dgs,ssim_valid,flip\n");
    for v in &evaluation.per_view {
        let name = if v.name.contains([',', '"', '\n']) {
            format!("\"{}\"", v.name.replace('"', "\"\""))
        } else {
            v.name.clone()
        };
        text.push_str(&format!(
            "{name},{},{},{},{},{}\n",
            v.psnr, v.grad_psnr, v.ssim_3dgs, v.ssim_valid, v.flip
        ));
    }
    atomic_file::write(&folder.join(PER_VIEW), text.as_bytes())
}
