//! The squared error of the model in a backend.

use super::probe::ProbeView;
use crate::Result;
use crate::backend::{Backend, ColourMap, RenderOptions};
use rayon::prelude::*;

/// Pixels that a thread sums at a time.
const CHUNK_PIXELS: usize = 1 << 14;

/// Mean squared error over pixels and channels, mean over views with the exposures of their photos.
///
/// # Errors
/// Whatever the backend reports.
pub fn mean_squared_error(
    backend: &mut dyn Backend,
    views: &[(ProbeView<'_>, Option<ColourMap>)],
) -> Result<f64> {
    let mut sum = 0.0;
    for (view, exposure) in views {
        let ProbeView { photo, background, sh_degree, .. } = *view;
        let options = RenderOptions { background, sh_degree, geometry: false };
        let image = backend.render(&view.camera, &options)?;
        let exposure = exposure.unwrap_or(ColourMap::IDENTITY);
        let of_pixel = |pixel: usize, rgb: &[f32]| {
            if photo.mask.as_ref().is_some_and(|mask| mask[pixel] == 0) {
                return 0.0;
            }
            let shown = exposure.apply([rgb[0], rgb[1], rgb[2]]);
            let differences = shown.into_iter().zip(photo.colour(pixel, background));
            differences.map(|(a, b)| f64::from(a - b).powi(2)).sum::<f64>()
        };
        let of_chunk = |(chunk, rgb): (usize, &[f32])| -> f64 {
            let pixels = rgb.chunks_exact(3).enumerate();
            pixels.map(|(i, rgb)| of_pixel(chunk * CHUNK_PIXELS + i, rgb)).sum()
        };
        // Added in order, whatever the number of threads.
        let chunks: Vec<f64> = image.rgb.par_chunks(3 * CHUNK_PIXELS).enumerate().map(of_chunk).collect();
        sum += chunks.iter().sum::<f64>() / image.rgb.len() as f64;
    }
    Ok(sum / views.len().max(1) as f64)
}
