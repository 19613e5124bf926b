//! Evaluation: renders views and compares them with their photos.

use super::events::Control;
use crate::Result;
use crate::backend::{Backend, RenderOptions, RenderedImage};
use crate::eval::{Evaluation, ViewQuality, quality_of, uncovered_share};
use crate::views::{ViewSource, WantedPhoto};
use rayon::prelude::*;

/// Views whose renders are held in memory at once.
const EVAL_BATCH: usize = 4;

/// Outcome of [`evaluate`].
pub enum Evaluated {
    /// Quality figures of the views that have unmasked pixels.
    Figures(Evaluation),
    /// No view has an unmasked pixel.
    Nothing,
    /// The consumer stopped the evaluation.
    Stopped,
}

/// Renders views and compares them with their photos; `on_view` receives each render. Wholly masked views are
/// rendered but have no figures.
///
/// # Errors
/// Whatever the backend, the views or `on_view` report.
pub fn evaluate(
    backend: &mut dyn Backend,
    views: &dyn ViewSource,
    indices: &[usize],
    options: &RenderOptions,
    on_view: &mut dyn FnMut(usize, &RenderedImage) -> Result<Control>,
) -> Result<Evaluated> {
    let mut per_view: Vec<ViewQuality> = Vec::new();
    for batch in indices.chunks(EVAL_BATCH) {
        views.prefetch(&WantedPhoto::full(batch));
        let mut images = Vec::new();
        for &view in batch {
            let image = backend.render(&views.camera(view), options)?;
            if on_view(view, &image)? == Control::Stop {
                return Ok(Evaluated::Stopped);
            }
            images.push((view, image));
        }
        let figures = images.par_iter().map(|(view, image)| {
            let target = views.target(*view)?;
            let quality = || ViewQuality {
                uncovered: Some(uncovered_share(&image.alpha, &target, options.background)),
                ..quality_of(views.name(*view), &image.rgb, &target)
            };
            Ok(target.has_counted_pixels().then(quality))
        });
        per_view.extend(figures.collect::<Result<Vec<_>>>()?.into_iter().flatten());
    }
    Ok(Evaluation::from_views(per_view).map_or(Evaluated::Nothing, Evaluated::Figures))
}
