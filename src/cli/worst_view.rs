//! `litetex eval --worst`: the render of the worst test view beside its photo.

use litetex_gs::backend::{Backend, RenderOptions};
use litetex_gs::capture::Capture;
use litetex_gs::eval::{Evaluation, quantised};
use litetex_gs::image::{Channels, JPEG_QUALITY, write_jpeg, write_png};
use litetex_gs::views::{Split, ViewSource as _};
use litetex_gs::{Result, usage};
use std::path::Path;

/// Pixels between the two images.
const GAP_PX: usize = 4;

/// Checks the extension of the file.
///
/// # Errors
/// [`litetex_gs::Error::Usage`].
pub fn check(path: &Path) -> Result<()> {
    let extension = path.extension().and_then(|e| e.to_str()).unwrap_or_default().to_lowercase();
    match extension.as_str() {
        "jpg" | "jpeg" | "png" => Ok(()),
        _ => Err(usage!("--worst {}: expected a .jpg or .png file", path.display())),
    }
}

/// Writes the test view with the lowest PSNR, the render left and the photo right, as the extension says.
///
/// # Errors
/// What rendering, decoding or writing reports.
pub fn write(
    path: &Path,
    backend: &mut dyn Backend,
    capture: &Capture,
    evaluation: &Evaluation,
    options: &RenderOptions,
) -> Result<()> {
    let views = capture.indices(Split::Test);
    let worst = evaluation.per_view.iter().min_by(|a, b| a.psnr.total_cmp(&b.psnr));
    let Some(view) = worst.and_then(|w| views.into_iter().find(|&v| capture.name(v) == w.name)) else {
        return Ok(());
    };
    let image = backend.render(&capture.camera(view), options)?;
    let photo = capture.target(view)?;
    let row_bytes = 3 * image.width_px as usize;
    let mut rgb = Vec::new();
    for (left, right) in quantised(&image.rgb).chunks_exact(row_bytes).zip(photo.rgb.chunks_exact(row_bytes))
    {
        rgb.extend_from_slice(left);
        rgb.extend([255; 3 * GAP_PX]);
        rgb.extend_from_slice(right);
    }
    let (width_px, height_px) = (2 * image.width_px + GAP_PX as u32, image.height_px);
    if path.extension().is_some_and(|e| e.eq_ignore_ascii_case("png")) {
        return write_png(path, width_px, height_px, Channels::Rgb, &rgb);
    }
    write_jpeg(path, width_px, height_px, &rgb, JPEG_QUALITY)
}
