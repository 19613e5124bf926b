//! Views that the pose files describe more than once. What is repeated counts once; where the poses of one photo differ by more
//! than digits that a program wrote or left out, nobody knows which is right.

use super::frame::median;
use super::left_out::is_too_many;
use super::lens::Lens;
use super::source::{Source, SourceView, UnusedView, Why, first_names};
use crate::text::{counted, path};
use crate::views::Split;
use crate::{Report, Result};
use glam::{DVec2, DVec3};
use std::collections::HashMap;

/// Poses and lenses that differ by less are the same: in radians, in median distances of the cameras from their median, as a
/// share of a focal length, and on the plane z = 1. Formats hold six digits or more, and this moves the image by 0.06 px at a
/// focal length of 3,000 px.
const SAME: f64 = 1e-5;

/// Leaves out views that occur again on the same side of the split, and all of a name whose poses or lenses differ. The others
/// keep their order.
///
/// # Errors
/// [`crate::Error::InvalidInput`] if the photos with different poses are more than a tenth of all.
pub(super) fn leave_out(source: &mut Source, report: &mut Report) -> Result<()> {
    let mut by_name = HashMap::<(&str, _), Vec<usize>>::new();
    for (index, view) in source.views.iter().enumerate() {
        by_name.entry((&view.name, view.split.map(|side| side == Split::Test))).or_default().push(index);
    }
    let num_names = by_name.len();
    let mut repeated: Vec<Vec<usize>> = by_name.into_values().filter(|of_name| of_name.len() > 1).collect();
    if repeated.is_empty() {
        return Ok(());
    }
    repeated.sort();
    let views = &source.views;
    let size = spread(views);
    let is_same =
        |of_name: &Vec<usize>| of_name.iter().all(|&i| are_same(&views[of_name[0]], &views[i], size));
    let (same, different): (Vec<_>, Vec<_>) = repeated.into_iter().partition(is_same);
    let names = |groups: &[Vec<usize>]| first_names(groups.iter().map(|group| views[group[0]].name.as_str()));
    if is_too_many(different.len(), num_names) {
        return Err(invalid!(
            &source.path,
            "{} of {num_names} photos occur with different poses or lenses, and no more than one in 10 may be left out: {}; \
             expected one pose for each photo: export them again",
            different.len(),
            names(&different)
        ));
    }
    if !same.is_empty() {
        let what = format!(
            "{}: {} more than once, always with the same pose; used once: {}",
            path(&source.path),
            occur(same.len()),
            names(&same)
        );
        report.warn("views-repeated", same.len(), what);
    }
    if !different.is_empty() {
        let what = format!(
            "{}: {} with different poses or lenses, of which nobody knows the right one; left out: {}",
            path(&source.path),
            occur(different.len()),
            names(&different)
        );
        report.warn("views-with-several-poses", different.len(), what);
    }
    let mut is_kept = vec![true; views.len()];
    same.iter().flat_map(|group| &group[1..]).for_each(|&index| is_kept[index] = false);
    for group in &different {
        group.iter().for_each(|&index| is_kept[index] = false);
        let SourceView { name, split, .. } = &views[group[0]];
        source.unused.push(UnusedView { name: name.clone(), why: Why::Broken, split: *split });
    }
    let mut kept = is_kept.into_iter();
    source.views.retain(|_| kept.next() == Some(true));
    Ok(())
}

fn occur(count: usize) -> String {
    format!("{} {}", counted(count, "photo"), if count == 1 { "occurs" } else { "occur" })
}

/// Median distance of the cameras from their median centre.
fn spread(views: &[SourceView]) -> f64 {
    let centres: Vec<DVec3> = views.iter().map(|v| v.camera_from_capture.origin_of_a_in_b()).collect();
    let along = |axis: usize| median(centres.iter().map(|c| c[axis]).collect()).unwrap_or(0.0);
    let middle = DVec3::new(along(0), along(1), along(2));
    median(centres.iter().map(|c| c.distance(middle)).collect()).unwrap_or(0.0)
}

fn are_same(a: &SourceView, b: &SourceView, spread: f64) -> bool {
    let [pose_a, pose_b] = [a, b].map(|view| view.camera_from_capture);
    let turn = (pose_a.rotation - pose_b.rotation)
        .to_cols_array()
        .into_iter()
        .fold(0.0, |max: f64, v| max.max(v.abs()));
    let shift = pose_a.origin_of_a_in_b().distance(pose_b.origin_of_a_in_b());
    turn <= SAME && shift <= SAME * spread && are_same_lenses(&a.lens, &b.lens)
}

/// Lenses are compared by where they image the corners and what lies half-way to them.
fn are_same_lenses(a: &Lens, b: &Lens) -> bool {
    if a == b {
        return true;
    }
    let (p, q) = (&a.pinhole, &b.pinhole);
    let is_near = |a: f64, b: f64| (a - b).abs() <= SAME * p.fx_px.abs();
    let (x, y) = (f64::from(p.width_px) / p.fx_px, f64::from(p.height_px) / p.fy_px);
    let mut places = [(x, y), (x, -y), (-x, y), (-x, -y)].into_iter().flat_map(|(x, y)| {
        let corner = DVec2::new(x, y) / 2.0;
        [corner, corner / 2.0]
    });
    (p.width_px, p.height_px) == (q.width_px, q.height_px)
        && [(p.fx_px, q.fx_px), (p.fy_px, q.fy_px), (p.cx_px, q.cx_px), (p.cy_px, q.cy_px)]
            .into_iter()
            .all(|(a, b)| is_near(a, b))
        && places.all(|place| a.distortion.distort(place).distance(b.distortion.distort(place)) <= SAME)
}
