//! Georeferenced files of other programs may hold coordinates that an asset, whose numbers are f32, does not.

use super::columns::Columns;
use super::header::Encoding;
use super::rows::Rows;
use super::scalar::Scalar;
use crate::Result;
use crate::fallback::spacing::{COARSE, of_f32};

/// Splats that are looked at: every k-th.
const SPLATS_MAX: usize = 4096;

/// Where the origin of the local frame should lie in a file whose coordinates f32 is too coarse for: among the splats. The
/// file's own origin where coordinates are f32 already, or f32 will do.
///
/// # Errors
/// As [`Rows::for_each`].
pub(super) fn local_origin(rows: &Rows<'_>, columns: &Columns) -> Result<[f64; 3]> {
    let is_f32 = |&c: &usize| rows.vertex().properties[c].scalar() == Some(Scalar::F32);
    if rows.header.encoding != Encoding::Ascii && columns.position.iter().all(is_f32) {
        return Ok([0.0; 3]);
    }
    let stride = rows.vertex().count.div_ceil(SPLATS_MAX).max(1);
    let (mut along, mut sizes): ([Vec<f64>; 3], _) = (Default::default(), Vec::new());
    let mut number = 0_usize;
    rows.for_each(&mut |values| {
        let position = columns.position.map(|c| values[c]);
        if number.is_multiple_of(stride) && position.iter().all(|v| v.is_finite()) {
            along.iter_mut().zip(position).for_each(|(along, v)| along.push(v));
            sizes.push(values[columns.scales[0]].min(values[columns.scales[1]]).exp());
        }
        number += 1;
        Ok(())
    })?;
    let middle: [f64; 3] = std::array::from_fn(|axis| median(&mut along[axis]));
    let farthest = middle.iter().fold(0.0_f64, |farthest, v| farthest.max(v.abs()));
    Ok(if of_f32(farthest) > COARSE * median(&mut sizes) { middle.map(f64::round) } else { [0.0; 3] })
}

fn median(values: &mut [f64]) -> f64 {
    let middle = values.len() / 2;
    if values.is_empty() { 0.0 } else { *values.select_nth_unstable_by(middle, f64::total_cmp).1 }
}
