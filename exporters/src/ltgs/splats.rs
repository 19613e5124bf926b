//! The splats of a chunk of a lossy file as columns of codes.

use super::colour::{luma_chroma, rgb};
use super::contexts::{of_exponent, of_scale, of_side, of_sides, of_twist};
use super::integers::{alone, put_numbers, take_exactly, unzigzag, zigzag};
use super::math::two_to;
use super::shape::{self, EXPONENT_MAX, Shape, TexelSizeCodes};
use super::steps::Quantiser;
use super::tally::Tally;
use super::texels::Map;
use crate::files::limits::filled;
use crate::math::sh::SH_0;
use crate::{AssetMap, Error, MAP_SIDE_MAX, Result, SplatAsset, num_sh_coefficients};

/// The codes of a chunk. Colours of degree 0 contain the means of maps.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SplatCodes {
    /// Exponents x of the steps. `[n]`
    pub exponents: Vec<i32>,
    /// Sides of maps. `[n, 2]`
    pub sides: Vec<[u16; 2]>,
    /// Codes of standard deviations. `[n, 2]`
    pub scales: Vec<[i32; 2]>,
    /// Codes of texel sizes, for splats with a map only.
    pub texel_sizes: Vec<TexelSizeCodes>,
    /// Shifts of maps, half texels, for splats with a map only. `[textured, 2]`
    pub shifts: Vec<[i16; 2]>,
    /// Codes of rotations: two of the swing, one of the twist. `[n, 3]`
    pub rotations: Vec<[i32; 3]>,
    /// Positions in finest steps, ordered by the Morton numbers of their cells. `[n, 3]`
    pub positions: Vec<[u32; 3]>,
    /// Codes of opacities. `[n]`
    pub opacities: Vec<u32>,
    /// SH degrees. `[n]`
    pub degrees: Vec<u8>,
    /// Codes of colours, luma and chroma; 0 above a splat's degree. `[n, (sh_degree + 1)^2, 3]`
    pub sh: Vec<i32>,
}

/// Step of a channel of an SH coefficient of a splat.
fn colour_step(quantiser: &Quantiser, exponent: i32, coefficient: usize, channel: usize) -> f64 {
    let steps = &quantiser.steps;
    let luma = match coefficient {
        0 => steps.sh0,
        1..4 => steps.sh_rest[0],
        4..9 => steps.sh_rest[1],
        _ => steps.sh_rest[2],
    };
    let luma = luma * two_to(exponent);
    if channel == 0 { luma } else { luma * steps.chroma }
}

/// Contexts of other codes of a splat; see [`super::contexts`].
impl SplatCodes {
    /// A splat's exponent.
    pub fn exponent_context(&self, splat: usize) -> u32 {
        of_exponent(self.exponents[splat])
    }

    /// Both sides of a splat's map.
    pub fn sides_context(&self, splat: usize) -> u32 {
        of_sides(self.sides[splat])
    }

    /// A splat's exponent and the standard deviation of its longer axis.
    pub fn scale_context(&self, quantiser: &Quantiser, splat: usize) -> u32 {
        of_scale(quantiser, self.exponents[splat], self.scales[splat][0])
    }

    /// Splats with a map.
    pub fn textured(&self) -> Vec<usize> {
        (0..self.sides.len()).filter(|&splat| self.sides[splat][0] > 0).collect()
    }
}

impl SplatCodes {
    /// Appends everything but the colours of a splat; returns shape and map as readers will decode them.
    pub fn push(&mut self, quantiser: &Quantiser, asset: &SplatAsset, splat: usize, exponent: i32) -> Map {
        let map = &asset.maps[splat];
        let scales = asset.scales[splat].map(|s| shape::code_scale(quantiser, exponent, s));
        let log2_scales = scales.map(|c| shape::log2_scale(quantiser, exponent, c));
        let mut texel_sizes = [0.0; 2];
        if map.num_texels() > 0 {
            let sides = [map.rows, map.cols];
            let codes = shape::code_texel_sizes(quantiser, log2_scales, sides, map.texel_sizes);
            texel_sizes = shape::value_texel_sizes(quantiser, log2_scales, sides, codes);
            self.texel_sizes.push(codes);
            self.shifts.push(map.shift);
        }
        let shape = Shape { exponent, scales: log2_scales.map(shape::value_scale), texel_sizes };
        let rotation = shape::code_rotation(quantiser, &shape, asset.rotations[splat]);
        self.exponents.push(exponent);
        self.sides.push([map.rows, map.cols]);
        self.scales.push(scales);
        self.rotations.push(rotation);
        self.positions.push(shape::fine_position(quantiser, asset.positions[splat]));
        self.opacities.push(shape::code_opacity(quantiser, exponent, asset.opacities[splat]));
        self.degrees.push(asset.sh_degrees[splat]);
        Map { shape, rows: map.rows, cols: map.cols, shift: map.shift }
    }

    /// Appends the colours of the splat that was pushed last; `mean` is the mean residual of its decoded map.
    pub fn push_colours(&mut self, quantiser: &Quantiser, sh: &[f32], exponent: i32, mean: [f64; 3]) {
        for (coefficient, colour) in sh.as_chunks::<3>().0.iter().enumerate() {
            let mut colour = colour.map(f64::from);
            if coefficient == 0 {
                colour = std::array::from_fn(|c| colour[c] + mean[c] / SH_0);
            }
            let code = |(channel, value): (usize, f64)| {
                let off = value / colour_step(quantiser, exponent, coefficient, channel);
                // Small coefficients of higher degrees are mostly noise: rounding them to 0 saves more than it costs.
                if coefficient == 0 {
                    shape::rounded(off)
                } else {
                    let size = (off.abs() + 0.4).floor() as i32;
                    if off < 0.0 { -size } else { size }
                }
            };
            let values = luma_chroma(colour);
            self.sh.extend(values.into_iter().enumerate().map(code));
        }
    }

    /// Decodes the splats without texels: colours contain the means of maps, which have sides but no texels yet.
    ///
    /// # Errors
    /// [`Error::TooLarge`] if there are more texels than 32 bits can number.
    pub fn values(&self, quantiser: &Quantiser, sh_degree: u32) -> Result<SplatAsset> {
        let mut asset = SplatAsset { sh_degree, sh_degrees: self.degrees.clone(), ..SplatAsset::default() };
        let width = 3 * num_sh_coefficients(sh_degree);
        let mut offset_texels = 0_u32;
        let mut shifts = self.shifts.iter();
        for (splat, (shape, &exponent)) in self.shapes(quantiser)?.iter().zip(&self.exponents).enumerate() {
            let mut map = AssetMap { offset_texels, ..AssetMap::default() };
            let [rows, cols] = self.sides[splat];
            if rows > 0 {
                let shift = shifts.next().copied().unwrap_or_default();
                map = AssetMap { offset_texels, rows, cols, texel_sizes: shape.texel_sizes, shift };
            }
            offset_texels = offset_texels
                .checked_add(map.num_texels() as u32)
                .ok_or_else(|| Error::too_large("", "more than 2^32 texels in a chunk"))?;
            asset.maps.push(map);
            asset.scales.push(shape.scales);
            asset.rotations.push(shape::value_rotation(quantiser, shape, self.rotations[splat]));
            let bits = shape.position_exponent(quantiser);
            let corner = self.positions[splat].map(|c| c >> bits << bits);
            asset.positions.push(shape::value_position(quantiser, corner, bits));
            asset.opacities.push(shape::value_opacity(quantiser, exponent, self.opacities[splat]));
            for (coefficient, codes) in
                self.sh[splat * width..(splat + 1) * width].as_chunks::<3>().0.iter().enumerate()
            {
                let step = |channel| colour_step(quantiser, exponent, coefficient, channel);
                let values = std::array::from_fn(|c| f64::from(codes[c]) * step(c));
                asset.sh.extend(rgb(values).map(|v| v as f32));
            }
        }
        Ok(asset)
    }

    /// Encodes the block of geometry.
    ///
    /// # Errors
    /// None for codes made by the writer.
    pub fn encode_geometry(&self, quantiser: &Quantiser, sh_degree: u32) -> Result<Vec<u8>> {
        let mut block = Vec::new();
        let with_exponent = |splat: usize, _: &[u32]| [self.exponent_context(splat)];
        let column = |of: &dyn Fn(usize) -> u32| (0..self.exponents.len()).map(of).collect::<Vec<_>>();
        put_numbers(&mut block, &column(&|s| zigzag(self.exponents[s])), alone);
        put_numbers(&mut block, &column(&|s| self.sides[s][0].into()), with_exponent);
        // Both axes of a splat are alike: the second is stored as its difference from the first. u is the longer one.
        let textured = self.textured();
        let more = |&s: &usize| zigzag(i32::from(self.sides[s][1]) - i32::from(self.sides[s][0]));
        let more: Vec<u32> = textured.iter().map(more).collect();
        put_numbers(&mut block, &more, |map, _| [of_side(self.sides[textured[map]][0])]);
        let off = |s: usize| self.scales[s][0].wrapping_sub(self.predicted_scale(quantiser, s));
        put_numbers(&mut block, &column(&|s| zigzag(off(s))), with_exponent);
        let less = |s: usize| self.scales[s][0].wrapping_sub(self.scales[s][1]) as u32;
        put_numbers(&mut block, &column(&less), |s, _| [self.exponent_context(s), self.sides_context(s)]);
        self.put_texel_sizes(&mut block);
        let shapes = self.shapes(quantiser)?;
        for axis in 0..2 {
            put_numbers(&mut block, &column(&|s| zigzag(self.rotations[s][axis])), with_exponent);
        }
        let twists = column(&|s| zigzag(self.rotations[s][2]));
        put_numbers(&mut block, &twists, |s, _| [of_twist(quantiser, &shapes[s])]);
        let corners = self.put_positions(&mut block, quantiser)?;
        put_numbers(&mut block, &self.opacities, |s, _| [self.scale_context(quantiser, s)]);
        self.put_colours(&mut block, &corners, sh_degree);
        Ok(block)
    }

    /// The inverse of [`Self::encode_geometry`] for `n` splats, and of [`Self::encode_sh`].
    ///
    /// # Errors
    /// [`Error::Invalid`] or [`Error::Unsupported`].
    pub fn decode(
        [mut block, sh]: [&[u8]; 2],
        n: usize,
        quantiser: &Quantiser,
        sh_degree: u32,
        tally: &mut Tally,
    ) -> Result<Self> {
        let mut codes = Self::default();
        let before = block.len();
        for x in take_exactly(&mut block, n, alone)? {
            let x = unzigzag(x);
            if x.abs() > EXPONENT_MAX {
                return Err(invalid!("", "exponent {x} of a splat, at most {EXPONENT_MAX}"));
            }
            codes.exponents.push(x);
        }
        let before = tally.add("exponents", before, block.len());
        codes.take_sides(&mut block)?;
        let before = tally.add("maps", before, block.len());
        let offs = take_exactly(&mut block, n, |splat, _| [codes.exponent_context(splat)])?;
        let less = take_exactly(&mut block, n, |s, _| [codes.exponent_context(s), codes.sides_context(s)])?;
        for (splat, (off, less)) in offs.into_iter().zip(less).enumerate() {
            let u = unzigzag(off).wrapping_add(codes.predicted_scale(quantiser, splat));
            codes.scales.push([u, u.wrapping_sub_unsigned(less)]);
        }
        let before = tally.add("scales", before, block.len());
        codes.take_texel_sizes(&mut block)?;
        let before = tally.add("maps", before, block.len());
        codes.take_rotations(&mut block, quantiser)?;
        let before = tally.add("rotations", before, block.len());
        codes.take_positions(&mut block, quantiser)?;
        let before = tally.add("positions", before, block.len());
        codes.opacities = take_exactly(&mut block, n, |splat, _| [codes.scale_context(quantiser, splat)])?;
        let before = tally.add("opacities", before, block.len());
        codes.degrees = filled(n, 0)?;
        codes.sh = filled(3 * n * num_sh_coefficients(sh_degree), 0)?;
        codes.take_colours(&mut block, sh_degree)?;
        tally.add("sh0", before, block.len());
        if !block.is_empty() {
            return Err(invalid!("", "geometry: {} bytes too many", block.len()));
        }
        codes.take_sh(sh, sh_degree, tally)?;
        Ok(codes)
    }

    fn take_sides(&mut self, block: &mut &[u8]) -> Result<()> {
        let side = |found: i64| {
            let within = u16::try_from(found).ok().filter(|&side| side <= MAP_SIDE_MAX);
            within.ok_or_else(|| invalid!("", "side {found} of a map, at most {MAP_SIDE_MAX}"))
        };
        for rows in take_exactly(block, self.exponents.len(), |splat, _| [self.exponent_context(splat)])? {
            self.sides.push([side(rows.into())?, 0]);
        }
        let textured = self.textured();
        let contexts = |map: usize, _: &[u32]| [of_side(self.sides[textured[map]][0])];
        let more = take_exactly(block, textured.len(), contexts)?;
        for (&splat, more) in textured.iter().zip(more) {
            let rows = self.sides[splat][0];
            let cols = side(i64::from(rows) + i64::from(unzigzag(more)))?;
            if cols == 0 {
                return Err(invalid!("", "a map of {rows} x 0 texels"));
            }
            self.sides[splat][1] = cols;
        }
        Ok(())
    }

    fn take_rotations(&mut self, block: &mut &[u8], quantiser: &Quantiser) -> Result<()> {
        let shapes = self.shapes(quantiser)?;
        let n = shapes.len();
        let with_exponent = |splat: usize, _: &[u32]| [self.exponent_context(splat)];
        let swing = [take_exactly(block, n, with_exponent)?, take_exactly(block, n, with_exponent)?];
        let twist = take_exactly(block, n, |splat, _| [of_twist(quantiser, &shapes[splat])])?;
        let codes = |splat: usize| [swing[0][splat], swing[1][splat], twist[splat]].map(unzigzag);
        self.rotations = (0..n).map(codes).collect();
        Ok(())
    }

    /// Shapes of the splats, from the codes that precede positions.
    ///
    /// # Errors
    /// [`Error::Invalid`] if there are fewer codes of texel sizes than maps.
    pub fn shapes(&self, quantiser: &Quantiser) -> Result<Vec<Shape>> {
        let mut texel_sizes = self.texel_sizes.iter();
        let mut of_splat = |splat: usize| {
            let (exponent, [rows, cols]) = (self.exponents[splat], self.sides[splat]);
            let log2_scales = self.scales[splat].map(|c| shape::log2_scale(quantiser, exponent, c));
            let mut sizes = [0.0; 2];
            if rows > 0 && cols > 0 {
                let codes = *texel_sizes.next().ok_or_else(|| Error::invalid("", "texel sizes: too few"))?;
                sizes = shape::value_texel_sizes(quantiser, log2_scales, [rows, cols], codes);
            }
            Ok(Shape { exponent, scales: log2_scales.map(shape::value_scale), texel_sizes: sizes })
        };
        (0..self.exponents.len()).map(&mut of_splat).collect()
    }
}
