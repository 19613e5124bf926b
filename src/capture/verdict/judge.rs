//! The verdict, a function of the figures alone: the thresholds, and what to do about what lies beyond them.

use super::measure::Figures;
use super::{Rating, Reason, blur};
use crate::text::{counted, quoted};
use Rating::{ShootAgain, Usable};

/// Reasons that are stated at most.
const REASONS_MAX: usize = 3;

/// Names that are stated at most; the report has all.
const NAMES_MAX: usize = 8;

/// Training views: with fewer, parts of the scene stay vague. Measured: 9 instead of 35 cost 0.8 dB, 6 cost 2.3 dB
/// (lab/stress.md), 12 as little as they vary.
const TRAIN_VIEWS: [usize; 2] = [12, 8];

/// Places of cameras: with fewer, nothing says how far away things are.
const PLACES: usize = 6;

/// Median parallax, degrees. Measured: 4.5 in a capture that faces one way, 7.9 to 88 in others; 0 from one place.
const PARALLAX_DEGREES: [f64; 2] = [2.0, 1.0];

/// Views of a point, mean over the observations. Measured: 10.5 and 13 in captures that train well, 4.5 where mapping left
/// out two of three photos, 6.2 with 11 photos in all.
const VIEWS_PER_POINT: [f64; 2] = [5.0, 3.0];

/// Share of the training views that overlap with no other.
const WITHOUT_OVERLAP: [f64; 2] = [0.05, 0.5];

/// Share of the photos without a pose.
const WITHOUT_POSE: [f64; 2] = [0.3, 0.6];

/// Share of the decoded photos that are blurred, above which the rest is not enough; the first one counts.
const BLURRED_MANY: f64 = 1.0 / 3.0;

/// Range of the exposures, stops. Measured: 1.1 in a phone's video that trains well, 1.0 in photos of a facade with haze; a
/// drift of two stops up and down has 2.8.
const EXPOSURE_STOPS: f64 = 1.6;

/// Reprojection error, pixels. Measured: 0.3 to 0.9 in four real captures, 1.0 in a made one.
const REPROJECTION_ERROR_PX: f64 = 1.5;

/// Median share of the pixels that masks leave out: objects that fill a tenth of their photos are rarely masked.
const MASKED_SHARE: f64 = 0.9;

/// What is wrong with a capture of these figures: at most three reasons, the worst first.
pub(super) fn reasons(figures: &Figures) -> Vec<Reason> {
    let all =
        [photos, unusable_masks, views, place, overlap, blurred, registered, exposure, poses, far, masks];
    let mut found: Vec<Reason> = all.into_iter().filter_map(|rule| rule(figures)).collect();
    // Stable: of equal ones the first rule's comes first.
    found.sort_by_key(|reason| std::cmp::Reverse(reason.rating));
    found.truncate(REASONS_MAX);
    found
}

fn reason(code: &'static str, rating: Rating, found: String, remedy: &'static str) -> Option<Reason> {
    Some(Reason { code, rating, found, remedy })
}

/// The rating of a value that two thresholds are above, `None` where none is.
fn below<T: PartialOrd>(value: T, [usable, again]: [T; 2]) -> Option<Rating> {
    if value < again { Some(ShootAgain) } else { (value < usable).then_some(Usable) }
}

/// The same of two thresholds below it.
fn above(value: f64, [usable, again]: [f64; 2]) -> Option<Rating> {
    below(-value, [-usable, -again])
}

fn photos(figures: &Figures) -> Option<Reason> {
    let found = figures.unreadable.clone()?;
    reason("unreadable-photos", ShootAgain, found, "replace the file, or remove it and its pose")
}

fn unusable_masks(figures: &Figures) -> Option<Reason> {
    let found = figures.unreadable_mask.clone()?;
    reason("unreadable-masks", ShootAgain, found, "replace the mask, or remove it: all pixels count then")
}

fn views(figures: &Figures) -> Option<Reason> {
    let found = format!("only {}", counted(figures.train_views, "training view"));
    let rating = below(figures.train_views, TRAIN_VIEWS)?;
    reason("few-views", rating, found, "take more photos, at least 30, all around and from two heights")
}

fn place(figures: &Figures) -> Option<Reason> {
    const REMEDY: &str = "walk around the scene while you take photos; turning on the spot shows no depth";
    // That few views stand in few places goes without saying.
    if figures.places < PLACES && figures.places < figures.views.div_ceil(2) {
        let places = if figures.places == 1 { "one place" } else { "a few places" };
        let found = format!("the cameras of all {} views stand in {places}", figures.views);
        return reason("one-place", ShootAgain, found, REMEDY);
    }
    let degrees = figures.parallax_degrees?;
    let found = format!("half of the points are seen under an angle of {degrees:.1} degrees at most");
    reason("one-place", below(degrees, PARALLAX_DEGREES)?, found, REMEDY)
}

fn overlap(figures: &Figures) -> Option<Reason> {
    const REMEDY: &str = "take more photos between the others: each should share two thirds with the next";
    let alone = figures.views_without_overlap as f64 / figures.train_views.max(1) as f64;
    if let Some(rating) = above(alone, WITHOUT_OVERLAP) {
        let found = format!(
            "{} of {} training views share less than a fifth of what they show with each other one",
            figures.views_without_overlap, figures.train_views
        );
        return reason("little-overlap", rating, found, REMEDY);
    }
    let views = figures.views_per_point.filter(|_| figures.train_views >= TRAIN_VIEWS[0])?;
    let found = format!("a point is seen by {views:.1} of {} views on average", figures.views);
    reason("little-overlap", below(views, VIEWS_PER_POINT)?, found, REMEDY)
}

fn blurred(figures: &Figures) -> Option<Reason> {
    if figures.sharpness.is_some_and(blur::is_everywhere) {
        let found = format!("the photos have no fine detail ({} looked at)", figures.photos_decoded);
        let remedy = "hold still, focus and use more light; photos that were enlarged need not be";
        return reason("blurred-photos", ShootAgain, found, remedy);
    }
    let count = figures.blurred.len();
    let shown: Vec<String> = figures.blurred.iter().take(NAMES_MAX).map(|name| quoted(name)).collect();
    let more = if count > NAMES_MAX { format!(" and {} more", count - NAMES_MAX) } else { String::new() };
    let blurred = if count == 1 { "is blurred" } else { "are blurred" };
    let found = format!("{count} of {} photos {blurred}: {}{more}", figures.photos_decoded, shown.join(", "));
    let rating = match count as f64 > BLURRED_MANY * figures.photos_decoded as f64 {
        true => ShootAgain,
        false => Usable,
    };
    let remedy = "remove them with their poses where others show the same, or take them again";
    (count > 0).then_some(()).and_then(|()| reason("blurred-photos", rating, found, remedy))
}

fn registered(figures: &Figures) -> Option<Reason> {
    let photos = figures.photos;
    let missing = photos.saturating_sub(figures.views);
    let found = format!("{missing} of {photos} photos have no pose");
    let rating = above(missing as f64 / photos.max(1) as f64, WITHOUT_POSE)?;
    reason(
        "photos-without-pose",
        rating,
        found,
        "take more photos between the others, and find the poses again",
    )
}

fn exposure(figures: &Figures) -> Option<Reason> {
    let stops = figures.exposure_stops.filter(|stops| *stops > EXPOSURE_STOPS)?;
    let found = format!("the exposure differs by {stops:.1} stops between photos");
    let remedy = "lock exposure and white balance, or train with --set exposure=affine";
    reason("drifting-exposure", Usable, found, remedy)
}

fn poses(figures: &Figures) -> Option<Reason> {
    let error = figures.reprojection_error_px.filter(|error| *error > REPROJECTION_ERROR_PX)?;
    let found = format!("the points lie {error:.1} px beside where the photos show them");
    reason("inexact-poses", Usable, found, "find the poses again, with the lens model of the camera")
}

fn far(figures: &Figures) -> Option<Reason> {
    let count = figures.far_cameras;
    let stand = if count == 1 { "stands" } else { "stand" };
    let found = format!("{} {stand} far from all others", counted(count, "camera"));
    let remedy = "look at the poses of these photos (see the warning), or find them again";
    (count > 0).then_some(()).and_then(|()| reason("far-cameras", Usable, found, remedy))
}

fn masks(figures: &Figures) -> Option<Reason> {
    let share = figures.masked_share.filter(|share| *share > MASKED_SHARE)?;
    let found = format!("masks leave out {:.0} % of the photos", 100.0 * share);
    reason(
        "masks",
        Usable,
        found,
        "white pixels count; if black ones should, add --mask-invert here and --set capture.mask-invert=true to train",
    )
}
