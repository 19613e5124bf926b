//! The squared error of the model in a backend.

use super::probe::ProbeView;
use crate::Result;
use crate::backend::{Backend, ColourMap, RenderOptions};

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
        let of_pixel = |(pixel, rgb): (usize, &[f32])| {
            if photo.mask.as_ref().is_some_and(|mask| mask[pixel] == 0) {
                return 0.0;
            }
            let shown = exposure.apply([rgb[0], rgb[1], rgb[2]]);
            let differences = shown.into_iter().zip(photo.colour(pixel, background));
            differences.map(|(a, b)| f64::from(a - b).powi(2)).sum::<f64>()
        };
        sum += image.rgb.chunks_exact(3).enumerate().map(of_pixel).sum::<f64>() / image.rgb.len() as f64;
    }
    Ok(sum / views.len().max(1) as f64)
}
