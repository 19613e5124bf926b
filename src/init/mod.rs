//! Initialisation: the model that training starts from, with a splat at each sparse point or at random
//! points (method section 5). Works from points and cameras; reading them from files is up to `dataset`.

mod backdrop;
#[cfg(test)]
mod backdrop_tests;
mod input;
mod knn;
mod patch;
mod points;
mod random;
mod splats;
mod sweep;
#[cfg(test)]
mod sweep_tests;
#[cfg(test)]
mod tests;

pub use input::{InitInput, InitOptions, InitPoints};

use crate::constants::SH_DEGREE_MAX;
use crate::model::Model;
use crate::{Error, Report, Result};
use points::{LocalPoint, along_a_curve, local_points, random_points, thinned, usable};
use random::{Purpose, Stream, local_from_cameras, rotation};

/// The model that training starts from, and which points were left out.
///
/// # Errors
/// [`Error::Usage`] for options out of range, [`Error::InvalidInput`] if no usable point is left; with a backdrop
/// or a sweep whatever reading a photo reports.
pub fn initial_model(input: &InitInput<'_>, options: &InitOptions) -> Result<(Model, Report)> {
    if options.sh_degree > SH_DEGREE_MAX || options.max_points == 0 {
        return Err(Error::Usage(format!(
            "initial model: SH degree {} (expected 0 to {SH_DEGREE_MAX}), at most {} points (expected 1 or more)",
            options.sh_degree, options.max_points
        )));
    }
    let mut report = Report::default();
    let mut points = match input.points {
        InitPoints::Sparse(points) => local_points(input, points),
        InitPoints::Random(count) => random_points(input, count, options.seed),
        InitPoints::Missing(_) => Vec::new(),
    };
    if let Some(background) = options.sweep_on {
        let (known, swept) = (points.len(), sweep::swept(input, &points, background, options.seed)?);
        if !swept.is_empty() {
            let message =
                format!("the capture has {known} points; {} more found by comparing photos", swept.len());
            report.warn("few-points", swept.len(), message);
        }
        points.extend(swept);
    }
    if let InitPoints::Missing(count) = input.points
        && points.is_empty()
    {
        let message = format!("the capture has no points: initialising from {count} random points");
        report.warn("random-initialisation", count, message);
        points = random_points(input, count, options.seed);
    }
    // What is drawn at random for a point must depend neither on its place in the file nor on how the
    // capture is turned.
    points.sort_by(|a, b| {
        let values = |p: &LocalPoint| p.position.into_iter().chain(p.rgb);
        let compared = values(a).zip(values(b)).map(|(a, b)| a.total_cmp(&b));
        compared.fold(a.distance.total_cmp(&b.distance), std::cmp::Ordering::then)
    });
    let mut points = usable(points, input.views, &mut report);
    if points.is_empty() {
        return Err(Error::invalid(
            input.points_file,
            "no usable points; initialise from random ones with --init random:COUNT",
        ));
    }
    let mut backdrop = Vec::new();
    if let Some(background) = options.backdrop_on {
        splats::size_by_spacing(&mut points);
        backdrop = backdrop::backdrop(input, &points, background)?;
        // The points give way to a backdrop, but most of a tight budget is theirs.
        if backdrop.len() > options.max_points / 4 {
            backdrop.clear();
        }
    }
    let mut points = thinned(points, options.max_points - backdrop.len(), options.seed, &mut report);
    let (turned, mut stream) =
        (local_from_cameras(input.views), Stream::new(options.seed, Purpose::Rotations));
    points.iter_mut().for_each(|point| point.quaternion = rotation(turned, &mut stream));
    splats::size_by_spacing(&mut points);
    points.append(&mut backdrop);
    Ok((splats::model(input, &along_a_curve(&points), options)?, report))
}
