//! `litetex eval --worst`: the render of the worst test view beside its photo.

use super::capture::Capture;
use litetex_gs::Result;
use litetex_gs::backend::{Backend, RenderOptions};
use litetex_gs::eval::{Evaluation, quantised};
use litetex_gs::image::{JPEG_QUALITY, write_jpeg};
use litetex_gs::views::{Split, ViewSource as _};
use std::path::Path;

/// Pixels between the two images.
const GAP_PX: usize = 4;

/// Writes the test view with the lowest PSNR, the render left and the photo right, as a JPEG file.
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
    write_jpeg(path, 2 * image.width_px + GAP_PX as u32, image.height_px, &rgb, JPEG_QUALITY)
}
