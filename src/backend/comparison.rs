//! Squared differences between images and photos.

use super::{Backend, ColourMap, RenderOptions, TargetImage};
use crate::Result;
use crate::camera::Camera;
use rayon::prelude::*;

/// Pixels that a thread sums at a time.
const CHUNK_PIXELS: usize = 1 << 14;

/// A view to be compared with its photo.
pub struct ComparedView<'a> {
    /// Camera of the view.
    pub camera: Camera,
    /// Identity of the photo, as in a [`super::StepRequest`].
    pub photo: Option<u32>,
    /// The photo, of the camera's size.
    pub target: &'a TargetImage,
    /// Display-space colour behind all splats.
    pub background: [f32; 3],
    /// SH degree in use.
    pub sh_degree: u32,
    /// The exposure of the photo, by which the image is corrected before the comparison; `None`: not at all.
    pub exposure: Option<ColourMap>,
}

/// Mean squared difference over pixels and channels, from a rendered image; pixels that the mask leaves out differ by 0.
pub(super) fn squared_error<B: Backend + ?Sized>(backend: &mut B, view: &ComparedView<'_>) -> Result<f64> {
    let ComparedView { target, background, sh_degree, .. } = *view;
    let image = backend.render(&view.camera, &RenderOptions { background, sh_degree, geometry: false })?;
    let exposure = view.exposure.unwrap_or(ColourMap::IDENTITY);
    let of_pixel = |pixel: usize, rgb: &[f32]| {
        if target.mask.as_ref().is_some_and(|mask| mask[pixel] == 0) {
            return 0.0;
        }
        let shown = exposure.apply([rgb[0], rgb[1], rgb[2]]);
        let differences = shown.into_iter().zip(target.colour(pixel, background));
        differences.map(|(a, b)| f64::from(a - b).powi(2)).sum::<f64>()
    };
    let of_chunk = |(chunk, rgb): (usize, &[f32])| -> f64 {
        let pixels = rgb.chunks_exact(3).enumerate();
        pixels.map(|(i, rgb)| of_pixel(chunk * CHUNK_PIXELS + i, rgb)).sum()
    };
    // Added in order, whatever the number of threads.
    let chunks: Vec<f64> = image.rgb.par_chunks(3 * CHUNK_PIXELS).enumerate().map(of_chunk).collect();
    Ok(chunks.iter().sum::<f64>() / image.rgb.len() as f64)
}
