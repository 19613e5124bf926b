//! Initialisation: the model that training starts from, with a splat at each sparse point, at points found in the photos
//! or at random ones (method section 5). Works from points, cameras and photos; reading them is up to `capture`.

mod backdrop;
#[cfg(test)]
mod backdrop_tests;
mod cells;
mod input;
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
use crate::text::counted;
use crate::{Error, Report, Result};
use points::{LocalPoint, along_a_curve, local_points, random_points, thinned, usable};
use random::{Purpose, Stream, local_from_cameras, rotation};

/// If the photos give a smaller share of the wanted points, a capture that has none starts from random ones. Lego at 200
/// pixels, 13 % found, 600 steps: 21.9 dB from these, 28.1 dB from 20,000 random ones.
const FOUND_SHARE_MIN: f64 = 0.25;

/// The model that training starts from.
pub struct InitialModel {
    /// The model.
    pub model: Model,
    /// Which points were left out, and where others come from.
    pub report: Report,
}

/// The model that training starts from, and which points were left out.
///
/// # Errors
/// [`Error::Usage`] for options out of range, [`Error::InvalidInput`] if no usable point is left; with a backdrop
/// or a sweep whatever reading a photo reports.
pub fn initial_model(input: &InitInput<'_>, options: &InitOptions) -> Result<InitialModel> {
    if options.sh_degree > SH_DEGREE_MAX || options.max_points == 0 {
        return Err(usage!(
            "initial model: SH degree {} (expected 0 to {SH_DEGREE_MAX}), at most {} points (expected 1 or more)",
            options.sh_degree,
            options.max_points
        ));
    }
    let mut report = Report::default();
    let mut points = first_points(input, options, &mut report)?;
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
    let model = splats::model(input, &along_a_curve(&points), options)?;
    Ok(InitialModel { model, report })
}

/// All usable points: those given, and those that the photos or chance add.
fn first_points(
    input: &InitInput<'_>,
    options: &InitOptions,
    report: &mut Report,
) -> Result<Vec<LocalPoint>> {
    let random = |count, report: &mut Report| {
        usable(sorted(random_points(input, count, options.seed)), input.views, report)
    };
    let mut points = match input.points {
        InitPoints::Sparse(points) => usable(sorted(local_points(input, points)), input.views, report),
        InitPoints::Random(count) => return Ok(random(count, report)),
        InitPoints::Missing(_) => Vec::new(),
    };
    if let Some(background) = options.sweep_on {
        let (wanted, most) = (sweep::wanted_points(input), options.max_points);
        let found = sweep::swept(input, &points, wanted, most, background, options.seed)?;
        let mut found = usable(found, input.views, &mut Report::default());
        if matches!(input.points, InitPoints::Missing(_))
            && (found.len() as f64) < FOUND_SHARE_MIN * wanted.min(most) as f64
        {
            found.clear();
        }
        if !found.is_empty() {
            let message = format!(
                "{} found by comparing photos, besides {} of the capture",
                counted(found.len(), "point"),
                points.len()
            );
            report.warn("few-points", found.len(), message);
        }
        points.extend(found);
        points = sorted(points);
    }
    match input.points {
        InitPoints::Missing(count) if points.is_empty() => {
            let message = format!("the capture has no points: initialising from {count} random points");
            report.warn("random-initialisation", count, message);
            Ok(random(count, report))
        }
        _ => Ok(points),
    }
}

/// In an order that depends neither on their places in the file nor on how the capture is turned, as must what is drawn
/// at random for them.
fn sorted(mut points: Vec<LocalPoint>) -> Vec<LocalPoint> {
    points.sort_by(|a, b| {
        let values = |p: &LocalPoint| p.position.into_iter().chain(p.rgb);
        let compared = values(a).zip(values(b)).map(|(a, b)| a.total_cmp(&b));
        compared.fold(a.distance.total_cmp(&b.distance), std::cmp::Ordering::then)
    });
    points
}
