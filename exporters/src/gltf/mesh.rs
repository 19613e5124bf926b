//! A mesh of textured quads for viewers that know no splats: every quad shows its splat's colour and falloff, baked into
//! one atlas of 8-bit RGBA. A preview: colours do not depend on the direction, viewers blend in linear light, and few sort.

use super::buffer::{Arrays, Use};
use super::document::{Buffer, Document, Image, MIME_PNG, Mesh, Primitive, Scene, TARGET_INDICES, Texture};
use super::{UNLIT, colour, container, write};
use crate::atlas::{PAGE_SIDE, Placement, pack};
use crate::sh::SH_0;
use crate::{ColourSpace, Error, Result, SplatAsset, quaternion, yup};
use std::collections::BTreeMap;

/// Quads reach this many standard deviations at most.
const SIGMA_MAX: f64 = 3.0;

/// Samples of a quad along an axis, at least.
const SAMPLES_MIN: u16 = 8;

/// A splat shows where its alpha reaches this.
const ALPHA_MIN: f64 = 1.0 / 255.0;

/// Alpha is clamped to this.
const ALPHA_MAX: f64 = 0.99;

/// What to write.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MeshOptions {
    /// Most quads.
    pub quads_max: usize,
    /// Largest side of an atlas page, texels.
    pub page_side: u16,
}

impl Default for MeshOptions {
    fn default() -> Self {
        Self { quads_max: 50_000, page_side: PAGE_SIDE }
    }
}

/// What was written.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct MeshSummary {
    /// Size of the file.
    pub bytes: usize,
    /// Splats that became quads.
    pub quads: usize,
    /// Splats that were left out: too faint to be seen, or beyond the most quads.
    pub omitted: usize,
    /// Texels of the atlas that quads use.
    pub texels: usize,
}

/// A splat as a quad.
struct Quad {
    splat: usize,
    /// Half its sides along u and v, local units.
    half: [f64; 2],
    /// Samples along v and u: columns and rows of its place in the atlas.
    size: [u16; 2],
}

/// The bytes of a `.glb` with one unlit mesh of quads for the most visible splats, by opacity times area.
///
/// # Errors
/// [`Error::Invalid`] if the asset breaks a rule or nothing of it can be seen, [`Error::TooLarge`].
pub fn encode_mesh(asset: &SplatAsset, options: &MeshOptions) -> Result<(Vec<u8>, MeshSummary)> {
    asset.validate()?;
    let quads: Vec<Quad> =
        most_visible(asset, options.quads_max).into_iter().map(|i| quad(asset, i, options)).collect();
    if quads.is_empty() {
        return Err(Error::invalid("", "no splat that can be seen: a glTF mesh cannot be empty"));
    }
    let sizes: Vec<[u16; 2]> = quads.iter().map(|q| q.size).collect();
    let (placements, pages) = pack(&sizes, options.page_side).ok_or_else(|| {
        Error::too_large("", format!("quads on pages of {} texels a side", options.page_side))
    })?;
    let mut arrays = Arrays::default();
    let mut document = Document::default();
    for (page, size) in pages.iter().enumerate() {
        let on_page = || quads.iter().zip(&placements).filter(|(_, at)| usize::from(at.page) == page);
        let rgba = bake_page(asset, on_page(), *size);
        let png = encode_rgba(*size, &rgba)?;
        let primitive = push_quads(&mut arrays, asset, on_page(), *size, page as u32);
        push_material(&mut document, arrays.push_bytes(&png), page as u32);
        document.meshes.resize(1, Mesh::default());
        document.meshes[0].primitives.push(primitive);
    }
    finish(&mut document, asset, &arrays);
    let bytes = container::glb(write::json(&document)?, arrays.bytes)?;
    let texels = sizes.iter().map(|s| usize::from(s[0]) * usize::from(s[1])).sum();
    let omitted = asset.num_splats() - quads.len();
    let summary = MeshSummary { bytes: bytes.len(), quads: quads.len(), omitted, texels };
    Ok((bytes, summary))
}

/// Splats in their own order, without the least visible ones.
fn most_visible(asset: &SplatAsset, most: usize) -> Vec<usize> {
    let visibility = |i: usize| {
        let [u, v] = asset.scales[i].map(f64::from);
        f64::from(asset.opacities[i]) * u * v
    };
    let mut order: Vec<usize> =
        (0..asset.num_splats()).filter(|&i| f64::from(asset.opacities[i]) > ALPHA_MIN).collect();
    order.sort_by(|&a, &b| visibility(b).total_cmp(&visibility(a)).then(a.cmp(&b)));
    order.truncate(most);
    order.sort_unstable();
    order
}

fn quad(asset: &SplatAsset, splat: usize, options: &MeshOptions) -> Quad {
    let (map, opacity) = (&asset.maps[splat], f64::from(asset.opacities[splat]));
    let sigmas = (2.0 * (opacity / ALPHA_MIN).ln()).max(0.0).sqrt().min(SIGMA_MAX);
    let half = asset.scales[splat].map(|s| f64::from(s) * sigmas);
    // As fine as the map, but not much more of them where a splat has outgrown its map.
    let samples = |half: f64, texels: u16| {
        let most = texels.saturating_mul(2).clamp(SAMPLES_MIN, options.page_side.max(SAMPLES_MIN));
        let wanted = (2.0 * half / f64::from(map.texel_size)).ceil() + 1.0;
        if map.num_texels() == 0 {
            return SAMPLES_MIN;
        }
        wanted.clamp(f64::from(SAMPLES_MIN), f64::from(most)) as u16
    };
    Quad { splat, half, size: [samples(half[1], map.cols), samples(half[0], map.rows)] }
}

/// Residual at a place on a splat: bilinear, zero outside of the map.
fn residual(asset: &SplatAsset, splat: usize, [a, b]: [f64; 2]) -> [f64; 3] {
    let map = &asset.maps[splat];
    let mut sum = [0.0; 3];
    if map.num_texels() == 0 {
        return sum;
    }
    let (texels, size) = (asset.texels_of(splat), f64::from(map.texel_size));
    let coordinate = |x: f64, count: u16| x / size + 0.5 * (f64::from(count) - 1.0);
    let (u, v) = (coordinate(a, map.rows), coordinate(b, map.cols));
    for (row, in_u) in [(u.floor(), 1.0 - u + u.floor()), (u.floor() + 1.0, u - u.floor())] {
        for (col, in_v) in [(v.floor(), 1.0 - v + v.floor()), (v.floor() + 1.0, v - v.floor())] {
            let inside =
                (0.0..f64::from(map.rows)).contains(&row) && (0.0..f64::from(map.cols)).contains(&col);
            if inside {
                let first = 3 * (row as usize * usize::from(map.cols) + col as usize);
                (0..3).for_each(|c| sum[c] += in_u * in_v * f64::from(texels[first + c]));
            }
        }
    }
    sum
}

/// sRGB code values and alpha at a place on a splat.
fn baked_colour(asset: &SplatAsset, splat: usize, place: [f64; 2]) -> [u8; 4] {
    let dc = asset.sh_of(splat);
    let residual = residual(asset, splat, place);
    let code = |v: f64| (255.0 * v.clamp(0.0, 1.0)).round() as u8;
    let [r, g, b] = std::array::from_fn(|c| {
        let base = (0.5 + SH_0 * f64::from(dc[c])).max(0.0);
        let v = (base + residual[c]).clamp(0.0, 1.0);
        code(match asset.colour_space {
            ColourSpace::SrgbRec709Display => v,
            ColourSpace::LinRec709Display => colour::srgb_from_linear(v),
        })
    });
    let square = |k: usize| (place[k] / f64::from(asset.scales[splat][k])).powi(2);
    let falloff = (-0.5 * (square(0) + square(1))).exp();
    [r, g, b, code((f64::from(asset.opacities[splat]) * falloff).min(ALPHA_MAX))]
}

/// Pixels of a page. `[height, width, 4]`
fn bake_page<'a>(
    asset: &SplatAsset,
    quads: impl Iterator<Item = (&'a Quad, &'a Placement)>,
    [width, height]: [u16; 2],
) -> Vec<u8> {
    let mut rgba = vec![0; 4 * usize::from(width) * usize::from(height)];
    for (quad, at) in quads {
        let place = |index: u16, count: u16, half: f64| {
            // Samples lie from edge to edge.
            half * (2.0 * f64::from(index) / (f64::from(count) - 1.0) - 1.0)
        };
        for row in 0..quad.size[1] {
            for col in 0..quad.size[0] {
                let a = place(row, quad.size[1], quad.half[0]);
                let b = place(col, quad.size[0], quad.half[1]);
                let pixel = usize::from(at.y + row) * usize::from(width) + usize::from(at.x + col);
                rgba[4 * pixel..4 * pixel + 4].copy_from_slice(&baked_colour(asset, quad.splat, [a, b]));
            }
        }
    }
    rgba
}

fn encode_rgba([width, height]: [u16; 2], rgba: &[u8]) -> Result<Vec<u8>> {
    let failed = |e: png::EncodingError| Error::invalid("", format!("PNG page: {e}"));
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, width.into(), height.into());
    encoder.set_color(png::ColorType::Rgba);
    encoder.set_depth(png::BitDepth::Eight);
    encoder.set_compression(png::Compression::Balanced);
    encoder.set_source_srgb(png::SrgbRenderingIntent::Perceptual);
    let mut writer = encoder.write_header().map_err(failed)?;
    writer.write_image_data(rgba).map_err(failed)?;
    writer.finish().map_err(failed)?;
    Ok(bytes)
}

/// Adds the quads of a page as a primitive.
fn push_quads<'a>(
    arrays: &mut Arrays,
    asset: &SplatAsset,
    quads: impl Iterator<Item = (&'a Quad, &'a Placement)> + Clone,
    page: [u16; 2],
    material: u32,
) -> Primitive {
    // Corners in the order of the surfel's plane, counter-clockwise seen from its normal.
    const CORNERS: [[f64; 2]; 4] = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]];
    let points: Vec<[f32; 3]> = quads
        .clone()
        .flat_map(|(quad, _)| {
            let centre = asset.positions[quad.splat].map(f64::from);
            let q = asset.rotations[quad.splat].map(f64::from);
            CORNERS.map(|[u, v]| {
                let on_surfel = quaternion::turned(q, [u * quad.half[0], v * quad.half[1], 0.0]);
                yup::position(std::array::from_fn(|i| (centre[i] + on_surfel[i]) as f32))
            })
        })
        .collect();
    // At the centres of the outermost texels: half a texel inside of the rectangle. Columns run along v, rows along u.
    let coordinates = quads.clone().flat_map(|(quad, at)| {
        let [cols, rows] = quad.size.map(f64::from);
        CORNERS.map(|[u, v]| {
            let x = f64::from(at.x) + 0.5 + 0.5 * (v + 1.0) * (cols - 1.0);
            let y = f64::from(at.y) + 0.5 + 0.5 * (u + 1.0) * (rows - 1.0);
            [(x / f64::from(page[0])) as f32, (y / f64::from(page[1])) as f32]
        })
    });
    let indices = (0..quads.count() as u32).flat_map(|i| [0, 1, 2, 0, 2, 3].map(|k| [4 * i + k]));
    let mut attributes = BTreeMap::new();
    attributes.insert("POSITION".to_owned(), arrays.push_positions(points.iter().copied()));
    attributes.insert("TEXCOORD_0".to_owned(), arrays.push(coordinates, Use::Attribute));
    let indices = arrays.push(indices, Use::Other(Some(TARGET_INDICES)));
    Primitive { attributes, indices: Some(indices), material: Some(material), ..Primitive::default() }
}

fn push_material(document: &mut Document, view: u32, page: u32) {
    document.images.push(Image {
        name: Some(format!("baked {page}")),
        buffer_view: Some(view),
        mime_type: Some(MIME_PNG.to_owned()),
        uri: None,
    });
    document.textures.push(Texture { sampler: Some(0), source: Some(page) });
    document.materials.push(serde_json::json!({
        "name": format!("page {page}"),
        "pbrMetallicRoughness": {
            "baseColorTexture": { "index": page },
            "metallicFactor": 0.0,
            "roughnessFactor": 1.0
        },
        "alphaMode": "BLEND",
        "doubleSided": true,
        "extensions": { UNLIT: {} }
    }));
}

fn finish(document: &mut Document, asset: &SplatAsset, arrays: &Arrays) {
    document.asset = write::asset_info(asset);
    document.extensions_used = vec![UNLIT.to_owned()];
    document.scene = Some(0);
    document.scenes = vec![Scene { name: None, nodes: vec![0] }];
    document.nodes = vec![write::node(asset)];
    // Bilinear, no smaller pictures: they would mix neighbours.
    document.samplers = vec![serde_json::json!({
        "magFilter": 9729, "minFilter": 9729, "wrapS": 33_071, "wrapT": 33_071
    })];
    document.accessors.clone_from(&arrays.accessors);
    document.buffer_views.clone_from(&arrays.views);
    document.buffers = vec![Buffer { byte_length: arrays.bytes.len() as u64, uri: None }];
}
