//! How sharp a photo is: how much of its coarse structure goes on to fine detail, in the direction that has least.
//!
//! Per block of 32 pixels and direction, the energy of the gradient in the photo halved once, over that in the photo halved
//! three times. A blur leaves the coarse one and takes the fine one, in one direction if it is that of a motion. Blocks
//! without coarse structure say nothing: a smooth wall is not blurred.

use crate::capture::frame::quantile;
use crate::image::TargetImage;
use glam::DVec2;
use std::ops::Range;

/// Side of a block, pixels of the photo as it is trained.
const BLOCK_PX: usize = 32;

/// Directions that gradients are taken in, over half a turn.
pub(super) const DIRECTIONS: usize = 8;

/// Gradient energy of a block with structure, halved three times, squared 255ths per squared pixel. Noise of standard
/// deviation 10 of 255 has 0.8.
const STRUCTURE_MIN: f64 = 1.0;

/// A direction counts in blocks where it has this share of the energy of the strongest: along stripes there is nothing to
/// be sharp.
const DIRECTION_SHARE_MIN: f64 = 0.1;

/// Fewer blocks with structure say nothing about a photo or a direction.
const BLOCKS_MIN: usize = 12;

/// A photo has as many regions along each side: one with a shallow depth of field is sharp in a few.
const REGIONS: usize = 4;

/// Fewer blocks with structure say nothing about a region.
const REGION_BLOCKS_MIN: usize = 3;

/// The block that stands for a photo or a region: one of four is sharper.
const UPPER: f64 = 0.75;

/// Sharpness of a photo: fine over coarse energy. Measured: typical is 0.43 to 3.3 in photos that are sharp, 0.12 to 0.33
/// with a Gaussian blur of 4 pixels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Sharpness {
    /// Of the block at the upper quartile of the photo.
    pub typical: f64,
    /// Of the region that is sharpest in this respect.
    pub best: f64,
}

/// A photo at the sizes at which its detail is measured.
pub(super) struct Levels<'a> {
    full: Plane,
    half: Plane,
    eighth: Plane,
    /// Blocks of which nothing is masked: column, row.
    blocks: Vec<(usize, usize)>,
    kept: Option<&'a [u8]>,
    /// Energy of the noise in the photo halved.
    noise: f64,
}

/// Grey values, 0 to 255. `[height, width]`
#[derive(Clone)]
struct Plane {
    width: usize,
    height: usize,
    values: Vec<f32>,
}

/// Energy of the gradient in a block: the means of gx gx, gx gy and gy gy.
type Tensor = [f64; 3];

impl<'a> Levels<'a> {
    pub fn of(photo: &'a TargetImage) -> Self {
        let kept = photo.mask.as_deref();
        let full = Plane::of(photo);
        let half = full.halved();
        let eighth = half.halved().halved();
        let (columns, rows) = (full.width / BLOCK_PX, full.height / BLOCK_PX);
        let blocks: Vec<(usize, usize)> = (0..rows)
            .flat_map(|row| (0..columns).map(move |column| (column, row)))
            .filter(|&block| kept.is_none_or(|kept| is_whole(kept, full.width, block)))
            .collect();
        // White noise has a quarter of the energy in the photo halved.
        let mut quiet: Vec<f64> = tensors(&blocks, &full, BLOCK_PX).map(|t| 0.5 * (t[0] + t[2])).collect();
        let noise = quantile(&mut quiet, 0.05).unwrap_or(0.0) / 4.0;
        Self { full, half, eighth, blocks, kept, noise }
    }

    /// Fine over coarse energy around a place of the photo, pixels, by direction: `None` for directions without structure, and for
    /// places where less than a block is seen.
    pub fn ratios_around(&self, at: DVec2) -> Option<[Option<f64>; DIRECTIONS]> {
        let half = BLOCK_PX as f64 / 2.0;
        let corner = at - half;
        let (width, height) = (self.full.width as f64, self.full.height as f64);
        if !(corner.min_element() >= 0.0 && at.x + half <= width && at.y + half <= height) {
            return None;
        }
        let (x, y) = (corner.x as usize, corner.y as usize);
        let mut rows = y..y + BLOCK_PX;
        let is_kept = |row: usize, kept: &[u8]| {
            let start = row * self.full.width + x;
            kept[start..start + BLOCK_PX].iter().all(|&kept| kept != 0)
        };
        if self.kept.is_some_and(|kept| !rows.all(|row| is_kept(row, kept))) {
            return None;
        }
        let of = |plane: &Plane, scale: usize| {
            let side = BLOCK_PX / scale;
            plane.tensor([x / scale..x / scale + side, y / scale..y / scale + side])
        };
        let (fine, coarse) = (of(&self.half, 2), of(&self.eighth, 8));
        Some(std::array::from_fn(|direction| self.ratio(&fine, &coarse, direction)))
    }

    /// Fine over coarse energy in a direction; `None` without structure.
    fn ratio(&self, fine: &Tensor, coarse: &Tensor, direction: usize) -> Option<f64> {
        let angle = std::f64::consts::PI * direction as f64 / DIRECTIONS as f64;
        let energy = along(coarse, angle);
        let is_structure = energy > STRUCTURE_MIN.max(DIRECTION_SHARE_MIN * strongest(coarse));
        is_structure.then(|| (along(fine, angle) - self.noise).max(0.0) / energy)
    }
}

/// The energy in blocks of this side.
fn tensors<'a>(
    blocks: &'a [(usize, usize)],
    plane: &'a Plane,
    side: usize,
) -> impl Iterator<Item = Tensor> + 'a {
    let inside = move |block: usize| block * side..(block + 1) * side;
    blocks.iter().map(move |&(column, row)| plane.tensor([inside(column), inside(row)]))
}

/// The sharpness of a photo; `None` if it shows too little structure to tell.
pub(super) fn of(levels: &Levels<'_>) -> Option<Sharpness> {
    let blocks = &levels.blocks;
    let (columns, rows) = (levels.full.width / BLOCK_PX, levels.full.height / BLOCK_PX);
    let fine: Vec<Tensor> = tensors(blocks, &levels.half, BLOCK_PX / 2).collect();
    let coarse: Vec<Tensor> = tensors(blocks, &levels.eighth, BLOCK_PX / 8).collect();
    let of_direction = |direction: usize| {
        let (mut all, mut regions) = (Vec::new(), vec![Vec::new(); REGIONS * REGIONS]);
        for ((&(column, row), fine), coarse) in blocks.iter().zip(&fine).zip(&coarse) {
            if let Some(ratio) = levels.ratio(fine, coarse, direction) {
                all.push(ratio);
                regions[row * REGIONS / rows * REGIONS + column * REGIONS / columns].push(ratio);
            }
        }
        if all.len() < BLOCKS_MIN {
            return None;
        }
        let known = regions.iter_mut().filter(|region| region.len() >= REGION_BLOCKS_MIN);
        let best = known.filter_map(|region| quantile(region, UPPER)).reduce(f64::max);
        let typical = quantile(&mut all, UPPER)?;
        Some(Sharpness { typical, best: best.unwrap_or(typical) })
    };
    let found: Vec<Sharpness> = (0..DIRECTIONS).filter_map(of_direction).collect();
    let least = |of: fn(&Sharpness) -> f64| found.iter().map(of).reduce(f64::min);
    Some(Sharpness { typical: least(|s| s.typical)?, best: least(|s| s.best)? })
}

/// Mean squared derivative in a direction.
fn along(tensor: &Tensor, angle: f64) -> f64 {
    let (sin, cos) = angle.sin_cos();
    tensor[0] * cos * cos + 2.0 * tensor[1] * sin * cos + tensor[2] * sin * sin
}

/// The most in any direction.
fn strongest([xx, xy, yy]: &Tensor) -> f64 {
    0.5 * (xx + yy) + (0.25 * (xx - yy) * (xx - yy) + xy * xy).sqrt()
}

/// Whether no pixel of a block is masked.
fn is_whole(kept: &[u8], width: usize, (column, row): (usize, usize)) -> bool {
    (row * BLOCK_PX..(row + 1) * BLOCK_PX).all(|y| {
        let start = y * width + column * BLOCK_PX;
        kept[start..start + BLOCK_PX].iter().all(|&kept| kept != 0)
    })
}

impl Plane {
    fn of(photo: &TargetImage) -> Self {
        let grey = |p: &[u8]| p.iter().map(|&v| f32::from(v)).sum::<f32>() / 3.0;
        Self {
            width: photo.width_px as usize,
            height: photo.height_px as usize,
            values: photo.rgb.chunks_exact(3).map(grey).collect(),
        }
    }

    /// Means of 2 x 2 pixels; an odd last row or column is left out.
    fn halved(&self) -> Self {
        let (width, height) = (self.width / 2, self.height / 2);
        let mut values = Vec::with_capacity(width * height);
        for y in 0..height {
            let (upper, lower) =
                (&self.values[2 * y * self.width..], &self.values[(2 * y + 1) * self.width..]);
            for x in 0..width {
                values.push(0.25 * (upper[2 * x] + upper[2 * x + 1] + lower[2 * x] + lower[2 * x + 1]));
            }
        }
        Self { width, height, values }
    }

    /// Of a window, by central differences.
    fn tensor(&self, [columns, rows]: [Range<usize>; 2]) -> Tensor {
        let inside =
            |range: Range<usize>, length: usize| range.start.max(1)..range.end.min(length.saturating_sub(1));
        let (mut sums, mut count) = ([0.0_f32; 3], 0);
        for y in inside(rows, self.height) {
            let at = y * self.width;
            for x in inside(columns.clone(), self.width) {
                let gx = 0.5 * (self.values[at + x + 1] - self.values[at + x - 1]);
                let gy = 0.5 * (self.values[at + self.width + x] - self.values[at - self.width + x]);
                sums[0] += gx * gx;
                sums[1] += gx * gy;
                sums[2] += gy * gy;
                count += 1;
            }
        }
        sums.map(|sum| f64::from(sum) / f64::from(count.max(1)))
    }
}
