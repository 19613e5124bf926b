//! The figures that a verdict follows from.

use super::{blur, exposure, geometry, same_points, sharpness};
use crate::capture::frame::median;
use crate::capture::loaded::Capture;
use crate::views::{Split, ViewSource as _};
use rayon::prelude::*;
use serde::Serialize;

/// Of more photos, as many evenly spaced ones are decoded.
const PHOTOS_MAX: usize = 60;

/// Points of a view whose brightness is looked at.
const POINTS_MAX: usize = 1000;

/// What was measured. Names are those of photos.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Figures {
    /// Views, and photos without a pose in the folders of their photos.
    pub photos: usize,
    /// Views with a pose.
    pub views: usize,
    /// Those that are trained on.
    pub train_views: usize,
    /// Places that cameras stand in.
    pub places: usize,
    /// Training views of which no other shows a fifth.
    pub views_without_overlap: usize,
    /// Over all observations, the mean number of views that a point was triangulated from.
    pub views_per_point: Option<f64>,
    /// Median over the points of the widest angle between two views of it, degrees.
    pub parallax_degrees: Option<f64>,
    /// Mean distance between points and where the photos show them, pixels.
    pub reprojection_error_px: Option<f64>,
    /// Cameras that are far from all others.
    pub far_cameras: usize,
    /// Photos that were decoded.
    pub photos_decoded: usize,
    /// Median sharpness: fine over coarse detail in the direction that has least.
    pub sharpness: Option<f64>,
    /// Decoded photos that are less than half as sharp as the sharp ones, or show much less detail around the points that they
    /// share.
    pub blurred: Vec<String>,
    /// Range of the exposures of the decoded photos without the outer tenths, stops.
    pub exposure_stops: Option<f64>,
    /// Median share of the pixels that masks leave out.
    pub masked_share: Option<f64>,
    /// The first photo that cannot be decoded, and why.
    pub unreadable: Option<String>,
    /// The first mask that cannot be used, and why.
    pub unreadable_mask: Option<String>,
}

/// What one photo shows.
#[derive(Default)]
struct Look {
    sharpness: Option<sharpness::Sharpness>,
    seen: Vec<exposure::Seen>,
    detail: Vec<same_points::Seen>,
    masked_share: Option<f64>,
}

/// A photo or a mask that cannot be used.
struct Unreadable {
    why: String,
    is_mask: bool,
}

/// Measures a capture.
pub(super) fn of(capture: &Capture) -> Figures {
    let num_views = capture.num_views();
    let num = num_views.min(PHOTOS_MAX);
    let chosen: Vec<usize> = (0..num).map(|i| (2 * i + 1) * num_views / (2 * num)).collect();
    let looks: Vec<Result<Look, Unreadable>> = chosen.par_iter().map(|&view| look(capture, view)).collect();
    let unreadable = |is_mask: bool| {
        let mut found = looks.iter().filter_map(|look| look.as_ref().err());
        found.find(|unreadable| unreadable.is_mask == is_mask).map(|unreadable| unreadable.why.clone())
    };
    // Of a damaged photo that is not among those decoded, loading the capture warned.
    let mut warnings = capture.report.warnings.iter();
    let warned = || warnings.find(|warning| warning.code == "photos-unreadable").map(|w| w.message.clone());
    let (unreadable, unreadable_mask) = (unreadable(false).or_else(warned), unreadable(true));
    let mut looks: Vec<Look> = looks.into_iter().map(Result::unwrap_or_default).collect();
    let sharpness: Vec<_> = looks.iter().map(|look| look.sharpness).collect();
    let detail: Vec<_> = looks.iter_mut().map(|look| std::mem::take(&mut look.detail)).collect();
    let blur = blur::of(&sharpness, &same_points::shares(&detail));
    let masked_share = median(looks.iter().filter_map(|look| look.masked_share).collect());
    let seen: Vec<_> = looks.into_iter().map(|look| look.seen).collect();
    let geometry = geometry::of(capture);
    let warned = |code: &str| {
        capture.report.warnings.iter().find(|warning| warning.code == code).map_or(0, |warning| warning.count)
    };
    Figures {
        photos: num_views + capture.photos_without_pose,
        views: num_views,
        train_views: capture.indices(Split::Train).len(),
        places: geometry.places,
        views_without_overlap: warned("views-without-overlap"),
        views_per_point: geometry.views_per_point,
        parallax_degrees: geometry.parallax_degrees,
        reprojection_error_px: capture.health.as_ref().and_then(|health| health.mean_reprojection_error_px),
        far_cameras: warned("far-cameras").max(warned("cameras-far-off")),
        photos_decoded: num,
        sharpness: blur.median,
        blurred: blur.blurred.into_iter().map(|at| capture.name(chosen[at]).to_owned()).collect(),
        exposure_stops: exposure::spread_stops(&seen),
        masked_share,
        unreadable,
        unreadable_mask,
    }
}

fn look(capture: &Capture, view: usize) -> Result<Look, Unreadable> {
    let decoded = capture.store.look(view).map_err(|error| {
        let mask = capture.store.recipe(view).mask.as_deref();
        let is_mask = mask.is_some() && error.path() == mask;
        Unreadable { why: capture.name_archive(error).to_string(), is_mask }
    })?;
    let observed = &capture.observed[view];
    let local_from_capture = capture.capture_from_local.inverse();
    // The same points in all photos, so that they can be compared.
    let step = (capture.points.len().div_ceil(POINTS_MAX * 8)).max(1);
    let points =
        observed.iter().copied().filter(|&index| (index as usize).is_multiple_of(step)).map(|index| {
            (index, local_from_capture.transform_point(capture.points[index as usize].position_in_capture))
        });
    let camera = capture.camera(view);
    let project = |position| camera.pinhole.project(camera.camera_from_local.transform_point(position));
    let points: Vec<_> = points.filter_map(|(index, place)| Some((index, project(place)?))).collect();
    let levels = sharpness::Levels::of(&decoded.image);
    Ok(Look {
        sharpness: sharpness::of(&levels),
        seen: exposure::seen(&decoded.image, &points),
        detail: same_points::seen(&levels, &points),
        masked_share: capture.store.has_mask(view).then_some(decoded.masked_share),
    })
}
