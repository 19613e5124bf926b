//! What a viewer sees of an image: its colours, as blurred as the eye sees them, its edges and its points.

use super::colour::{ColourSpaces, OPPONENT_Y_PER_LUMINANCE};
use super::filters::Filters;
use glam::Vec3;
use std::f32::consts::FRAC_1_SQRT_2;
use std::ops::Range;

/// What is seen at a pixel.
pub(super) struct Percept {
    /// See [`ColourSpaces::lab`].
    colour: Vec3,
    /// Strength of an edge, 0 to the root of 2.
    edge: f32,
    /// Strength of a point or line, 0 to the root of 2.
    point: f32,
}

impl Percept {
    /// The FLIP error between two images at a pixel, 0 to 1: the difference of the colours, increased where edges or points
    /// differ (paper, 4.2.2 and 4.3).
    pub fn difference(&self, other: &Self, spaces: &ColourSpaces) -> f32 {
        let features = (self.edge - other.edge).abs().max((self.point - other.point).abs());
        let colours = spaces.difference(self.colour, other.colour);
        colours.powf(1.0 - (FRAC_1_SQRT_2 * features).sqrt())
    }
}

/// What is seen of some rows of an image with these code values of sRGB. `codes`: `[height, width, 3]`, the result:
/// `[rows, width]`
pub(super) fn percepts(
    codes: &[u8],
    width_px: usize,
    rows: Range<usize>,
    spaces: &ColourSpaces,
    filters: &Filters,
) -> Vec<Percept> {
    let height_px = codes.len() / (3 * width_px);
    let radius_px = filters.radius_px();
    let reached = rows.start.saturating_sub(radius_px)..(rows.end + radius_px).min(height_px);
    let codes = &codes[3 * width_px * reached.start..3 * width_px * reached.end];
    let planes = filtered_along_rows(codes, width_px, spaces, filters);
    let mut out = Vec::with_capacity(rows.len() * width_px);
    for y in rows {
        // Row `offset` rows below y, or the outermost one.
        let row_at = |plane: usize, offset: isize| {
            let row = y.saturating_add_signed(offset).min(height_px - 1) - reached.start;
            &planes[plane][row * width_px..(row + 1) * width_px]
        };
        let mut blurred = [0; 3].map(|_| vec![0.0; width_px]);
        for (plane, blur) in filters.blurs.iter().enumerate() {
            blur.along_columns.add_along_columns(&mut blurred[blur.channel], |offset| row_at(plane, offset));
        }
        // Filters along the rows and along the columns.
        let [edge_x, edge_y, point_x, point_y] =
            [(1, 0), (0, 1), (2, 0), (0, 2)].map(|(along_row, along_columns)| {
                let mut row = vec![0.0; width_px];
                let plane = filters.blurs.len() + along_row;
                filters.features[along_columns].add_along_columns(&mut row, |offset| row_at(plane, offset));
                row
            });
        let strength = |x: f32, y: f32| x.hypot(y) / OPPONENT_Y_PER_LUMINANCE;
        out.extend((0..width_px).map(|x| Percept {
            colour: spaces.lab(Vec3::from(blurred.each_ref().map(|row: &Vec<f32>| row[x]))),
            edge: strength(edge_x[x], edge_y[x]),
            point: strength(point_x[x], point_y[x]),
        }));
    }
    out
}

/// The image filtered along its rows, by the parts of the blurs and then the features. `[rows, width]` each
fn filtered_along_rows(
    codes: &[u8],
    width_px: usize,
    spaces: &ColourSpaces,
    filters: &Filters,
) -> [Vec<f32>; 7] {
    let mut planes = [0; 7].map(|_| vec![0.0; codes.len() / 3]);
    let pad_px = filters.radius_px();
    let mut padded = [0; 3].map(|_| vec![0.0_f32; width_px + 2 * pad_px]);
    for (row, codes) in codes.as_chunks::<3>().0.chunks_exact(width_px).enumerate() {
        for x in 0..width_px + 2 * pad_px {
            let nearest = x.saturating_sub(pad_px).min(width_px - 1);
            let opponent = spaces.opponent_of_codes(codes[nearest]);
            (0..3).for_each(|c| padded[c][x] = opponent[c]);
        }
        let parts = filters.blurs.iter().map(|blur| (&blur.along_row, blur.channel));
        let features = filters.features.iter().map(|feature| (feature, 0));
        for (plane, (filter, channel)) in planes.iter_mut().zip(parts.chain(features)) {
            let out = &mut plane[row * width_px..(row + 1) * width_px];
            filter.add_along_row(out, &padded[channel], pad_px);
        }
    }
    planes
}
