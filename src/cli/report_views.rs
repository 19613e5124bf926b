//! What `litetex report` renders: the worst views beside their photos, and what the training views show.

use litetex_gs::backend::{Backend, RenderOptions};
use litetex_gs::capture::Capture;
use litetex_gs::console::Interrupt;
use litetex_gs::eval::{error_map, quantised, uncovered_share};
use litetex_gs::report_page::{COVERAGE_VIEWS_MAX, Coverage, Picture, SeenCounter, WorstView, WorstViews};
use litetex_gs::run::Trained;
use litetex_gs::train::{Control, Evaluated, evaluate};
use litetex_gs::verify::{CaptureIdentity, evenly_spread};
use litetex_gs::views::{Split, ViewSource as _};
use litetex_gs::{Error, Result};

/// Views that are shown beside their photos.
const WORST_VIEWS: usize = 3;

/// The test views with the lowest PSNR or, where there are none, training views; `None` if the masks exclude every pixel.
///
/// # Errors
/// What rendering and decoding report; [`Error::Usage`] if other views are held out than in training.
pub fn worst_views(
    trained: &Trained,
    backend: &mut dyn Backend,
    capture: &Capture,
    interrupt: &Interrupt,
) -> Result<Option<WorstViews>> {
    let tests = capture.indices(Split::Test);
    let are_training = tests.is_empty();
    if !are_training {
        trained.identity.check_held_out(&CaptureIdentity::new(capture, capture.capture_from_local))?;
    }
    let views =
        if are_training { evenly_spread(&capture.indices(Split::Train), COVERAGE_VIEWS_MAX) } else { tests };
    let options = trained.render_options();
    let mut go_on =
        |_: usize, _: &_| Ok(if interrupt.is_requested() { Control::Stop } else { Control::Continue });
    let evaluation = match evaluate(backend, capture, &views, &options, &mut go_on)? {
        Evaluated::Figures(evaluation) => evaluation,
        Evaluated::Nothing => return Ok(None),
        Evaluated::Stopped => return Err(Error::Interrupted),
    };
    let mut worst: Vec<_> = evaluation.per_view.iter().collect();
    worst.sort_by(|a, b| a.psnr.total_cmp(&b.psnr));
    let mut shown = Vec::new();
    for quality in worst.into_iter().take(WORST_VIEWS) {
        let Some(&view) = views.iter().find(|&&view| capture.name(view) == quality.name) else { continue };
        let image = backend.render(&capture.camera(view), &options)?;
        let photo = capture.target(view)?;
        let picture = |rgb: Vec<u8>| {
            let made = Picture::new(image.width_px, image.height_px, rgb);
            made.map_err(|e| Error::io(&capture.root, e))
        };
        shown.push(WorstView {
            name: quality.name.clone(),
            psnr: quality.psnr,
            grad_psnr: quality.grad_psnr,
            photo: picture(photo.rgb.clone())?,
            render: picture(quantised(&image.rgb))?,
            error_map: picture(error_map(&image.rgb, &photo))?,
        });
    }
    let (psnr, grad_psnr) = (evaluation.psnr, evaluation.grad_psnr);
    Ok(Some(WorstViews { are_training, of_views: evaluation.per_view.len(), psnr, grad_psnr, views: shown }))
}

/// How many training views show each splat, and what the splats leave uncovered.
///
/// # Errors
/// What rendering and decoding report.
pub fn measure_coverage(
    trained: &Trained,
    backend: &mut dyn Backend,
    capture: &Capture,
    interrupt: &Interrupt,
) -> Result<Option<Coverage>> {
    let all = capture.indices(Split::Train);
    let views = evenly_spread(&all, COVERAGE_VIEWS_MAX);
    let options = RenderOptions { geometry: true, ..trained.render_options() };
    // Pending updates of the optimiser do not move splats.
    let mut seen = SeenCounter::new(&trained.model.splats.positions);
    let (mut sum, mut most) = (0.0, None::<(String, f64)>);
    for &view in &views {
        interrupt.check()?;
        let camera = capture.camera(view);
        let image = backend.render(&camera, &options)?;
        seen.add(&camera, &image);
        let share = uncovered_share(&image.alpha, &*capture.target(view)?, options.background);
        sum += share;
        if most.as_ref().is_none_or(|(_, largest)| share > *largest) {
            most = Some((capture.name(view).to_owned(), share));
        }
    }
    Ok((!views.is_empty()).then(|| Coverage {
        views: views.len(),
        of_views: all.len(),
        splats_by_views: seen.shares(),
        uncovered: sum / views.len() as f64,
        most_uncovered: most,
    }))
}
