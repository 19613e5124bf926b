//! How sharp a photo is: how much of its coarse structure goes on to fine detail, in the direction that has least.
//!
//! Per block of 32 pixels and direction, the energy of the gradient in the photo halved once, over that in the photo halved
//! three times. A blur leaves the coarse one and takes the fine one, in one direction if it is that of a motion. Blocks
//! without coarse structure say nothing: a smooth wall is not blurred.

use crate::capture::frame::quantile;
use crate::image::TargetImage;

/// Side of a block, pixels of the photo as it is trained.
const BLOCK_PX: usize = 32;

/// Directions that gradients are taken in, over half a turn.
const DIRECTIONS: usize = 8;

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

/// Grey values, 0 to 255. `[height, width]`
#[derive(Clone)]
struct Plane {
    width: usize,
    height: usize,
    values: Vec<f32>,
}

/// Energy of the gradient in a block: the means of gx gx, gx gy and gy gy.
type Tensor = [f64; 3];

/// The sharpness of a photo; `None` if it shows too little structure to tell.
pub(super) fn of(photo: &TargetImage) -> Option<Sharpness> {
    let kept = photo.mask.as_deref();
    let full = Plane::of(photo);
    let half = full.halved();
    let eighth = half.halved().halved();
    let (columns, rows) = (full.width / BLOCK_PX, full.height / BLOCK_PX);
    let blocks: Vec<(usize, usize)> = (0..rows)
        .flat_map(|row| (0..columns).map(move |column| (column, row)))
        .filter(|&block| kept.is_none_or(|kept| is_whole(kept, full.width, block)))
        .collect();
    let of_level = |plane: &Plane, side: usize| -> Vec<Tensor> {
        blocks.iter().map(|&block| plane.tensor(block, side)).collect()
    };
    let finest = of_level(&full, BLOCK_PX);
    let fine = of_level(&half, BLOCK_PX / 2);
    let coarse = of_level(&eighth, BLOCK_PX / 8);
    // White noise has a quarter of the energy in the photo halved.
    let mut quiet: Vec<f64> = finest.iter().map(|t| 0.5 * (t[0] + t[2])).collect();
    let noise = quantile(&mut quiet, 0.05).unwrap_or(0.0) / 4.0;
    let of_direction = |direction: usize| {
        let angle = std::f64::consts::PI * direction as f64 / DIRECTIONS as f64;
        let (mut all, mut regions) = (Vec::new(), vec![Vec::new(); REGIONS * REGIONS]);
        for ((&(column, row), fine), coarse) in blocks.iter().zip(&fine).zip(&coarse) {
            let energy = along(coarse, angle);
            if energy > STRUCTURE_MIN.max(DIRECTION_SHARE_MIN * strongest(coarse)) {
                let ratio = (along(fine, angle) - noise).max(0.0) / energy;
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

    /// Of the block of this side in a column and a row of blocks, by central differences.
    fn tensor(&self, (column, row): (usize, usize), side: usize) -> Tensor {
        let inside = |block: usize, length: usize| {
            (block * side).max(1)..((block + 1) * side).min(length.saturating_sub(1))
        };
        let (mut sums, mut count) = ([0.0_f32; 3], 0);
        for y in inside(row, self.height) {
            let at = y * self.width;
            for x in inside(column, self.width) {
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
