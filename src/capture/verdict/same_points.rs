//! How sharp photos are where they show the same points. Photos differ in what they show, and with that in how much of it is fine
//! detail; what surrounds a point differs little, so that a blur of a few pixels shows.

use super::sharpness::{DIRECTIONS, Levels};
use crate::capture::frame::median;
use glam::DVec2;
use std::collections::HashMap;

/// Fewer points say nothing about a photo in a direction.
const POINTS_MIN: usize = 20;

/// Of a point that fewer photos show in a direction, it is not known how it looks in a sharp one.
const PHOTOS_MIN: usize = 3;

/// The detail around a point in one photo.
pub(super) struct Seen {
    pub point: u32,
    /// Natural logarithm of fine over coarse energy by direction; `None` where there is no structure.
    pub detail: [Option<f64>; DIRECTIONS],
}

/// The detail around the points that a photo shows: indices, and places in pixels.
pub(super) fn seen(levels: &Levels, points: &[(u32, DVec2)]) -> Vec<Seen> {
    let look = |&(point, at): &(u32, DVec2)| {
        let ratios = levels.ratios_around(at)?;
        // A direction without any fine detail is as blurred as can be told.
        let detail = ratios.map(|ratio| ratio.map(|ratio| ratio.max(1e-6).ln()));
        Some(Seen { point, detail })
    };
    points.iter().filter_map(look).collect()
}

/// For each photo, how much of the detail that other photos show around its points it shows too, in the direction that has least: 1
/// is as much. `None` for photos that share too little.
pub(super) fn shares(photos: &[Vec<Seen>]) -> Vec<Option<f64>> {
    let mut by_point = HashMap::<u32, Vec<&Seen>>::new();
    for seen in photos.iter().flatten() {
        by_point.entry(seen.point).or_default().push(seen);
    }
    let usual: HashMap<u32, [Option<f64>; DIRECTIONS]> = by_point
        .into_iter()
        .map(|(point, seen)| {
            let of_direction = |direction: usize| {
                let all: Vec<f64> = seen.iter().filter_map(|seen| seen.detail[direction]).collect();
                median(all.clone()).filter(|_| all.len() >= PHOTOS_MIN)
            };
            (point, std::array::from_fn(of_direction))
        })
        .collect();
    let share = |photo: &Vec<Seen>| {
        let of_direction = |direction: usize| {
            let difference = |seen: &Seen| Some(seen.detail[direction]? - usual[&seen.point][direction]?);
            let all: Vec<f64> = photo.iter().filter_map(difference).collect();
            let is_known = all.len() >= POINTS_MIN;
            median(all).filter(|_| is_known).map(f64::exp)
        };
        (0..DIRECTIONS).filter_map(of_direction).reduce(f64::min)
    };
    photos.iter().map(share).collect()
}
