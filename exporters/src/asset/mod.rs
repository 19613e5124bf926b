//! The neutral scene that every writer takes and every reader returns: activated values, computed once when a trained
//! model is baked. A format is lossless if it keeps these numbers. Parameters of the optimisation (logits, logarithms,
//! moments) do not belong here.

pub mod degrees;
pub mod edit;
pub mod hash;
pub mod meta;
mod meta_camera;
pub mod origin;
pub mod overview;
pub mod surface;
pub mod validate;

use crate::Transform;
use crate::math::sh::{SH_0, num_sh_coefficients};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Largest side of a texture map, texels.
pub const MAP_SIDE_MAX: u16 = 4096;

/// Most splats of an asset.
pub const SPLATS_MAX: usize = 1 << 24;

/// Low-pass filter in the image with which the splats were trained.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Filter {
    /// None.
    #[default]
    None,
    /// Elliptical weighted average, of the variance that the specification states.
    Ewa,
}

/// What the colour values mean, and with that the space in which they are blended.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum ColourSpace {
    /// sRGB code values from 0 to 1, never linearised: what photos hold and training uses.
    #[default]
    #[serde(rename = "srgb_rec709_display")]
    SrgbRec709Display,
    /// Linear light with Rec. 709 primaries.
    #[serde(rename = "lin_rec709_display")]
    LinRec709Display,
}

impl ColourSpace {
    /// The linear light that a value in [0, 1] stands for.
    pub fn linear(self, v: f64) -> f64 {
        match self {
            Self::LinRec709Display => v,
            Self::SrgbRec709Display if v <= 0.040_45 => v / 12.92,
            Self::SrgbRec709Display => ((v + 0.055) / 1.055).powf(2.4),
        }
    }

    /// The sRGB code value from 0 to 1 that a value in [0, 1] stands for.
    pub fn srgb(self, v: f64) -> f64 {
        match self {
            Self::SrgbRec709Display => v,
            Self::LinRec709Display if v <= 0.003_130_8 => 12.92 * v,
            Self::LinRec709Display => 1.055 * v.powf(1.0 / 2.4) - 0.055,
        }
    }
}

/// Position and size of a splat's texture map among the texels of an asset.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct AssetMap {
    /// Index of the first texel.
    pub offset_texels: u32,
    /// Texels along the splat's tangent u; 0 if it has no map.
    pub rows: u16,
    /// Texels along the splat's tangent v; 0 if it has no map.
    pub cols: u16,
    /// Texel sizes along u and v, local units; 0 if the splat has no map.
    pub texel_sizes: [f32; 2],
    /// The map's centre from the splat's along u and v, **half texels**; 0: centred.
    pub shift: [i16; 2],
}

impl AssetMap {
    /// Rows times columns.
    pub fn num_texels(&self) -> usize {
        usize::from(self.rows) * usize::from(self.cols)
    }

    /// Texture coordinate of the splat's centre along u (axis 0) or v (axis 1): the centres of texels are whole numbers.
    pub fn middle(&self, axis: usize) -> f64 {
        let count = [self.rows, self.cols][axis];
        0.5 * (f64::from(count) - 1.0 - f64::from(self.shift[axis]))
    }

    /// The smaller texel size, local units.
    pub fn finer_texel_size(&self) -> f64 {
        self.texel_sizes[0].min(self.texel_sizes[1]).into()
    }
}

/// A camera of the capture. Axes: x right, y down, z forward; pixel centres at integer + 0.5.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "camelCase")]
pub struct AssetCamera {
    /// Name of the photo.
    pub name: String,
    /// Whether the photo was held out from training.
    #[serde(default)]
    pub held_out: bool,
    /// Width of the photo.
    pub width_px: u32,
    /// Height of the photo.
    pub height_px: u32,
    /// Focal lengths along x and y.
    pub focal_px: [f64; 2],
    /// Principal point, from the upper left corner.
    pub principal_px: [f64; 2],
    /// Rows of the rotation of `camera_from_local`.
    pub rotation_rows: [[f64; 3]; 3],
    /// Translation of `camera_from_local`, local units.
    pub translation: [f64; 3],
}

/// How [`Provenance::scale`] begins if a unit of files is a metre.
pub const METRES: &str = "metres";

/// [`Provenance::scale`] if it is not known how long a unit of files is.
pub const UNKNOWN_SCALE: &str = "unknown scale";

/// Where an asset comes from. Empty strings stand for what is not known.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "camelCase")]
pub struct Provenance {
    /// Title of the work.
    pub title: String,
    /// Who made the work.
    pub author: String,
    /// Licence of the data: an SPDX expression or free text.
    pub licence: String,
    /// What the work was made from.
    pub source: String,
    /// Version of the program that baked the asset.
    pub program_version: String,
    /// Which direction of the capture is up in files, and why; `world_from_capture` is the turn itself.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub up: String,
    /// Whether a unit of files is a metre, and how that is known: a text that begins with [`METRES`], or [`UNKNOWN_SCALE`]; empty if
    /// the file does not say.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub scale: String,
    /// Facts about the training, by name.
    pub training: BTreeMap<String, String>,
}

/// A baked scene: 2D Gaussians in the local frame, each with a texture map of its own.
#[derive(Clone, Debug, PartialEq)]
pub struct SplatAsset {
    /// SH degree of `sh`, 0 to 3: the largest of `sh_degrees`.
    pub sh_degree: u32,
    /// SH degree of each splat. `[n]`
    pub sh_degrees: Vec<u8>,
    /// Centres, local frame. `[n]`
    pub positions: Vec<[f32; 3]>,
    /// `local_from_surfel` as unit quaternions **wxyz**; a splat's normal is its z axis. `[n]`
    pub rotations: Vec<[f32; 4]>,
    /// Standard deviations along the tangents u and v, local units. `[n]`
    pub scales: Vec<[f32; 2]>,
    /// In (0, 1]. `[n]`
    pub opacities: Vec<f32>,
    /// Spherical harmonics with the signs and order of 3DGS; colour = max(0, 0.5 + sum). Those above a splat's own degree
    /// are 0. `[n, (sh_degree + 1)^2, 3]`
    pub sh: Vec<f32>,
    /// One per splat, in order and without gaps between their texels. `[n]`
    pub maps: Vec<AssetMap>,
    /// Residuals in [-1, 1], added to the colour before it is clamped; map by map, row-major.
    /// `[num_texels, 3]`
    pub texels: Vec<f32>,
    /// Near plane, local units.
    pub near: f32,
    /// Low-pass filter in the image.
    pub filter: Filter,
    /// From the local frame back to that of the capture.
    pub capture_from_local: Transform,
    /// From there to the frame of files, if that is another: another direction is up, units are others.
    pub world_from_capture: Transform,
    /// What the colour values mean.
    pub colour_space: ColourSpace,
    /// Background colour of the training.
    pub background: [f32; 3],
    /// Cameras of the capture, ordered by name.
    pub cameras: Vec<AssetCamera>,
    /// Title, author, licence and facts about the training.
    pub provenance: Provenance,
}

impl Default for SplatAsset {
    /// An asset without splats.
    fn default() -> Self {
        Self {
            sh_degree: 0,
            sh_degrees: Vec::new(),
            positions: Vec::new(),
            rotations: Vec::new(),
            scales: Vec::new(),
            opacities: Vec::new(),
            sh: Vec::new(),
            maps: Vec::new(),
            texels: Vec::new(),
            near: 0.01,
            filter: Filter::None,
            capture_from_local: Transform::IDENTITY,
            world_from_capture: Transform::IDENTITY,
            colour_space: ColourSpace::default(),
            background: [0.0; 3],
            cameras: Vec::new(),
            provenance: Provenance::default(),
        }
    }
}

impl Provenance {
    /// What is known about the scale, in words.
    pub fn scale_words(&self) -> &str {
        if self.scale.is_empty() { UNKNOWN_SCALE } else { &self.scale }
    }
}

impl SplatAsset {
    /// Splats of the asset.
    pub fn num_splats(&self) -> usize {
        self.positions.len()
    }

    /// Texels of all maps together.
    pub fn num_texels(&self) -> usize {
        self.texels.len() / 3
    }

    /// SH coefficients of a splat, 0 above its own degree. `[(sh_degree + 1)^2, 3]`
    pub fn sh_of(&self, splat: usize) -> &[f32] {
        let width = 3 * num_sh_coefficients(self.sh_degree);
        &self.sh[splat * width..(splat + 1) * width]
    }

    /// Texels of a splat's map. `[rows, cols, 3]`
    pub fn texels_of(&self, splat: usize) -> &[f32] {
        let map = &self.maps[splat];
        let first = 3 * map.offset_texels as usize;
        &self.texels[first..first + 3 * map.num_texels()]
    }

    /// The asset as formats without textures hold it: maps averaged into the base colour.
    pub fn untextured(&self) -> Self {
        let mut out =
            Self { maps: vec![AssetMap::default(); self.num_splats()], texels: Vec::new(), ..self.clone() };
        let width = 3 * num_sh_coefficients(self.sh_degree);
        for (splat, sh) in out.sh.chunks_exact_mut(width).enumerate() {
            sh[..3].copy_from_slice(&self.untextured_dc(splat));
        }
        out
    }

    /// From the local frame to that of files.
    pub fn world_from_local(&self) -> Transform {
        self.world_from_capture.after(&self.capture_from_local)
    }

    /// SH coefficient of degree 0 with the mean of the splat's map added; without a map it is exact.
    pub fn untextured_dc(&self, splat: usize) -> [f32; 3] {
        let (dc, mean) = (self.sh_of(splat), self.mean_residual(splat));
        std::array::from_fn(|c| match mean[c] {
            0.0 => dc[c],
            mean => (f64::from(dc[c]) + mean / SH_0).clamp(f32::MIN.into(), f32::MAX.into()) as f32,
        })
    }

    /// Mean residual of a splat's map, as viewers without texture support should show it: weighted by the Gaussian at the
    /// centres of texels, and zero where the Gaussian lies outside the map.
    pub fn mean_residual(&self, splat: usize) -> [f64; 3] {
        let (map, texels) = (&self.maps[splat], self.texels_of(splat));
        let (scales, texel_sizes) = (self.scales[splat].map(f64::from), map.texel_sizes.map(f64::from));
        let falloff = |index: usize, axis: usize| {
            let d = (index as f64 - map.middle(axis)) * texel_sizes[axis] / scales[axis];
            (-0.5 * d * d).exp()
        };
        let (mut sum, mut weights) = ([0.0; 3], 0.0);
        for (i, texel) in texels.chunks_exact(3).enumerate() {
            let (row, col) = (i / usize::from(map.cols), i % usize::from(map.cols));
            let weight = falloff(row, 0) * falloff(col, 1);
            weights += weight;
            for (s, &t) in sum.iter_mut().zip(texel) {
                *s += weight * f64::from(t);
            }
        }
        // What the weights would sum to if the map covered all of the Gaussian.
        let whole = std::f64::consts::TAU * scales[0] * scales[1] / (texel_sizes[0] * texel_sizes[1]);
        let total = f64::max(weights, whole);
        if total.is_finite() && total > 0.0 { sum.map(|s| s / total) } else { [0.0; 3] }
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;

    /// A camera of the test views whose numbers are easily lost on the way.
    pub(crate) fn camera() -> AssetCamera {
        AssetCamera {
            name: "frame 1.png".into(),
            held_out: true,
            width_px: 640,
            height_px: 480,
            focal_px: [500.5, 501.25],
            principal_px: [320.0, 240.5],
            rotation_rows: [[1.0, 0.0, 0.0], [0.0, 0.6, -0.8], [0.0, 0.8, 0.6]],
            translation: [0.1, 0.2, 1.0 / 3.0],
        }
    }

    /// A camera of 100 x 100 pixels at the origin that looks along z.
    pub(crate) fn front(focal_px: f64) -> AssetCamera {
        AssetCamera {
            width_px: 100,
            height_px: 100,
            focal_px: [focal_px; 2],
            principal_px: [50.0; 2],
            rotation_rows: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
            ..AssetCamera::default()
        }
    }

    /// Pseudo-random numbers below those given, which are at most 2^24.
    pub(crate) fn random(seed: u32) -> impl FnMut(usize) -> usize {
        let mut state = seed;
        move |below| {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 8) as usize % below
        }
    }

    /// The bytes, of which one to four in the range are now random.
    pub(crate) fn damaged(
        bytes: &[u8],
        range: std::ops::Range<usize>,
        random: &mut impl FnMut(usize) -> usize,
    ) -> Vec<u8> {
        let mut damaged = bytes.to_vec();
        for _ in 0..=random(4) {
            damaged[range.start + random(range.len())] = random(256) as u8;
        }
        damaged
    }

    /// A small pseudo-random asset with maps of several shapes, some splats without, and SH of several degrees.
    pub(crate) fn fixture(num_splats: usize, sh_degree: u32) -> SplatAsset {
        let mut below = random(7);
        let mut random = move || below(1 << 24) as f32 / 16_777_216.0;
        let mut asset = SplatAsset {
            sh_degree,
            capture_from_local: Transform::scaled_and_moved(3.7, [10.0, -4.0, 0.5]),
            ..SplatAsset::default()
        };
        let mut offset_texels = 0;
        for i in 0..num_splats {
            asset.positions.push([random() - 0.5, random() - 0.5, random()]);
            let q: [f64; 4] = std::array::from_fn(|_| f64::from(random()) - 0.5);
            let norm = q.iter().map(|v| v * v).sum::<f64>().sqrt();
            asset.rotations.push(q.map(|v| (v / norm) as f32));
            asset.scales.push([0.01 + 0.1 * random(), 0.01 + 0.1 * random()]);
            asset.opacities.push(0.02 + 0.97 * random());
            let width = 3 * num_sh_coefficients(sh_degree);
            let degree = [sh_degree, sh_degree, sh_degree.min(1), sh_degree, 0][i % 5];
            asset.sh_degrees.push(degree as u8);
            let own = 3 * num_sh_coefficients(degree);
            asset.sh.extend((0..width).map(|k| if k < own { random() - 0.5 } else { 0.0 }));
            let (rows, cols) = [(2, 2), (0, 0), (5, 3)][i % 3];
            let mut map = AssetMap { offset_texels, rows, cols, ..AssetMap::default() };
            if rows > 0 {
                map.texel_sizes = [[0.02; 2], [0.02, 0.04], [0.03, 0.02]][i / 3 % 3];
                map.shift = [[0, 0], [1, 0], [0, 0], [-3, 2]][i / 3 % 4];
            }
            asset.maps.push(map);
            offset_texels += map.num_texels() as u32;
            asset.texels.extend((0..3 * map.num_texels()).map(|_| 1.6 * (random() - 0.5)));
        }
        asset.provenance.title = "Fixture".to_owned();
        asset.validate().unwrap();
        asset
    }

    #[test]
    fn mean_residual_of_a_full_map_is_its_constant() {
        let mut asset = fixture(1, 0);
        asset.scales[0] = [0.05, 0.03];
        let texel_sizes = [0.005; 2];
        asset.maps[0] = AssetMap { rows: 62, cols: 40, texel_sizes, ..AssetMap::default() };
        asset.texels = [0.25, -0.5, 1.0].repeat(62 * 40);
        let mean = asset.mean_residual(0);
        // The map ends at 3.1 and 3.3 sigma: 0.3 % of the Gaussian lie outside (needed 2.8e-3).
        for (found, expected) in mean.iter().zip([0.25, -0.5, 1.0]) {
            assert!((found / expected - 1.0).abs() < 4e-3, "{mean:?}");
        }
        // A map over the central quarter of the area counts by its share of the Gaussian: the
        // integral of a unit Gaussian over +-1 sigma is 0.683 per axis.
        asset.maps[0].rows = 20;
        asset.maps[0].cols = 12;
        asset.texels = [0.25, -0.5, 1.0].repeat(20 * 12);
        let share = asset.mean_residual(0)[2];
        // Needed 5.2e-4 (midpoint rule).
        assert!((share - 0.682_69_f64.powi(2)).abs() < 2e-3, "{share}");
        // Half as many texels of twice the length, and moved outwards along u by its half side: the integral over 0 to
        // 2 sigma is 0.477.
        asset.maps[0] = AssetMap {
            rows: 10,
            cols: 12,
            texel_sizes: [0.01, 0.005],
            shift: [10, 0],
            ..AssetMap::default()
        };
        asset.texels = [0.25, -0.5, 1.0].repeat(10 * 12);
        let share = asset.mean_residual(0)[2];
        // Needed 9.7e-4.
        assert!((share - 0.477_25 * 0.682_69).abs() < 2e-3, "{share}");
        // No map, no residual.
        assert_eq!(fixture(2, 0).mean_residual(1), [0.0; 3]);
    }
}
