//! What an image loses if a map is coarsened or dropped (method 6.5).

use crate::model::{Model, texel_value};

/// Mean absolute residual of the map (mean over channels, weighted by the splat's falloff at the texels): what
/// the image loses if the map is dropped. 1 for a splat without a map.
pub fn residual(model: &Model, splat: usize) -> f64 {
    let map = &model.textures.maps[splat];
    let texels = model.textures.texels[map.floats()].chunks_exact(3);
    let values = texels.map(|t| t.iter().map(|&stored| texel_value(stored.into()).abs()).sum::<f64>() / 3.0);
    let (mut weighted, mut weights) = (0.0, 0.0);
    for (t, value) in values.enumerate() {
        let weight = falloff(model, splat, t / usize::from(map.cols), t % usize::from(map.cols));
        weighted += weight * value;
        weights += weight;
    }
    if weights > 0.0 { weighted / weights } else { 1.0 }
}

/// The splat's falloff at the centre of a texel.
fn falloff(model: &Model, splat: usize, row: usize, col: usize) -> f64 {
    let map = &model.textures.maps[splat];
    let squared = |axis: usize, at: usize, count: u16| {
        let offset = (at as f64 - (f64::from(count) - 1.0) / 2.0) * f64::from(map.texel_size);
        let sigma = f64::from(model.splats.log_scales[2 * splat + axis]).exp();
        (offset / sigma).powi(2)
    };
    (-0.5 * (squared(0, row, map.rows) + squared(1, col, map.cols))).exp()
}

/// Mean absolute change of the map's image (mean over channels, weighted by the splat's falloff at the texels)
/// if its texels are averaged in 2 x 2 and sampled bilinearly again, with zeros outside.
/// 1 for maps of less than two texels per side.
pub fn coarsening_error(model: &Model, splat: usize) -> f64 {
    let map = &model.textures.maps[splat];
    let (rows, cols) = (usize::from(map.rows), usize::from(map.cols));
    if rows < 2 || cols < 2 {
        return 1.0;
    }
    let fine: Vec<f64> = model.textures.texels[map.floats()]
        .chunks_exact(3)
        .map(|t| t.iter().map(|&stored| texel_value(stored.into())).sum::<f64>() / 3.0)
        .collect();
    let padded = |n: usize| n.next_multiple_of(4);
    let (half_rows, half_cols) = (padded(rows) / 2, padded(cols) / 2);
    // Padding is the same on both sides, so that the centre stays.
    let (pad_u, pad_v) = ((padded(rows) - rows) / 2, (padded(cols) - cols) / 2);
    let clamped = |i: usize, pad: usize, n: usize| i.saturating_sub(pad).min(n - 1);
    let mean = |i: usize, j: usize| {
        let sum: f64 = (0..4)
            .map(|k| {
                let row = clamped(2 * i + k / 2, pad_u, rows);
                let col = clamped(2 * j + k % 2, pad_v, cols);
                fine[row * cols + col]
            })
            .sum();
        sum / 4.0
    };
    let coarse: Vec<f64> = (0..half_rows * half_cols).map(|k| mean(k / half_cols, k % half_cols)).collect();
    let sample = |u: f64, v: f64| {
        let (row, col) = (u.floor(), v.floor());
        let (fu, fv) = (u - row, v - col);
        let at = |row: f64, col: f64| {
            let inside = row >= 0.0 && col >= 0.0 && row < half_rows as f64 && col < half_cols as f64;
            if inside { coarse[row as usize * half_cols + col as usize] } else { 0.0 }
        };
        (1.0 - fu) * ((1.0 - fv) * at(row, col) + fv * at(row, col + 1.0))
            + fu * ((1.0 - fv) * at(row + 1.0, col) + fv * at(row + 1.0, col + 1.0))
    };
    let (mut weighted, mut weights) = (0.0, 0.0);
    for i in 0..rows {
        let offset_u = i as f64 - (rows as f64 - 1.0) / 2.0;
        for j in 0..cols {
            let offset_v = j as f64 - (cols as f64 - 1.0) / 2.0;
            let weight = falloff(model, splat, i, j);
            let u = offset_u / 2.0 + (half_rows as f64 - 1.0) / 2.0;
            let v = offset_v / 2.0 + (half_cols as f64 - 1.0) / 2.0;
            weighted += weight * (fine[i * cols + j] - sample(u, v)).abs();
            weights += weight;
        }
    }
    weighted / weights.max(1e-300)
}
