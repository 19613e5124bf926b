//! Changes of a map on its own texel grid or on one twice as fine or as coarse: texels keep their place on the surfel.

use crate::backend::{Grid, MapChange};
use crate::model::TextureMap;

/// The change to a map of these rows and columns on grids of the map, with this shift on its splat. `moved` is how far the
/// splat itself moves, in whole texels of the map.
pub fn window(
    map: &TextureMap,
    grids: [Grid; 2],
    texels: [u32; 2],
    shift: [i16; 2],
    moved: [i32; 2],
    moment_scale: [f32; 2],
) -> MapChange {
    let old = [map.rows, map.cols];
    if grids == [Grid::Same; 2] && texels == old.map(u32::from) && shift == map.shift && moved == [0; 2] {
        return MapChange::Keep;
    }
    let first = [0, 1].map(|axis| {
        // The first edges of the old and of the new map from the old splat's centre, in half texels of the old map.
        let old_edge = i32::from(map.shift[axis]) - i32::from(old[axis]);
        let new_edge = i32::from(shift[axis]) - texels[axis] as i32;
        match grids[axis] {
            Grid::Same => (new_edge + 2 * moved[axis] - old_edge).div_euclid(2),
            Grid::Finer => (new_edge + 4 * moved[axis] - 2 * old_edge).div_euclid(2),
            Grid::Coarser => (2 * new_edge + 2 * moved[axis] - old_edge).div_euclid(2),
        }
    });
    MapChange::Regrid {
        grids,
        rows: texels[0] as u16,
        cols: texels[1] as u16,
        first_row: first[0],
        first_col: first[1],
        shift,
        moment_scale,
    }
}

/// The change to a map of these rows and columns on grids of the map, centred on its splat.
pub fn centred(map: &TextureMap, grids: [Grid; 2], texels: [u32; 2], moment_scale: [f32; 2]) -> MapChange {
    window(map, grids, texels, [0; 2], [0; 2], moment_scale)
}

/// The change that takes rows and columns off a map, along each axis at the first and at the last texel.
pub fn cropped(map: &TextureMap, off: [[usize; 2]; 2]) -> MapChange {
    let held = [map.rows, map.cols];
    let texels = [0, 1].map(|axis| u32::from(held[axis]) - off[axis].iter().sum::<usize>() as u32);
    // Half texels, as the shift is.
    let shift = [0, 1].map(|axis| map.shift[axis] + off[axis][0] as i16 - off[axis][1] as i16);
    window(map, [Grid::Same; 2], texels, shift, [0; 2], [1.0; 2])
}

/// The rows and columns of a map outside of a centred one of `needed` texels, as [`cropped`] takes them off; all but one, if
/// none is inside.
pub fn surplus(map: &TextureMap, needed: [u32; 2]) -> [[usize; 2]; 2] {
    [0, 1].map(|axis| {
        let [held, needed] = [u32::from([map.rows, map.cols][axis]), needed[axis]].map(|n| n as i32);
        let shift = i32::from(map.shift[axis]);
        let beyond = [held - needed - shift, held - needed + shift];
        let off = beyond.map(|half_texels| half_texels.div_euclid(2).clamp(0, held - 1));
        [off[0], off[1].min(held - 1 - off[0])].map(|texels| texels as usize)
    })
}

/// Factors of the moments where texels become one, whose gradient is the sum of theirs.
pub fn merged_moments(grids: [Grid; 2]) -> [f32; 2] {
    let texels: f32 = grids.iter().map(|&grid| if grid == Grid::Coarser { 2.0 } else { 1.0 }).product();
    [texels, texels * texels]
}
