//! Splats as textured rectangles for programs that show only meshes: a preview. Each rectangle shows its splat without
//! dependence on the view: base colour plus map, clamped, with the Gaussian as alpha.

use crate::atlas::{self, Placement};
use crate::math::sh::SH_0;
use crate::math::{quaternion, yup};
use crate::{AssetMap, Result, SplatAsset};

/// Most rectangles by default: programs that sort them take time for each.
pub(crate) const QUADS_MAX: usize = 50_000;

/// Standard deviations that rectangles reach at most.
const SIGMA_MAX: f64 = 3.0;

/// Smallest side of a rectangle's map, texels.
const SIDE_MIN: u16 = 8;

/// Alpha below which samples are not drawn (method, section 1.4).
const ALPHA_MIN: f64 = 1.0 / 255.0;

/// Largest alpha of a sample.
const ALPHA_MAX: f64 = 0.99;

/// A rectangle that shows a splat.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Quad {
    /// Index of its splat.
    pub(crate) splat: u32,
    /// Index of the page that holds its map.
    pub(crate) page: u16,
    /// Corners, counter-clockwise as seen against the normal; y up.
    pub(crate) corners: [[f32; 3]; 4],
    /// Texture coordinates of the corners, from the upper left of the page; half a texel inside the map.
    pub(crate) uvs: [[f32; 2]; 4],
}

/// An image of rectangles' maps.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct QuadPage {
    /// Width and height, texels.
    pub(crate) size: [u16; 2],
    /// sRGB and unassociated alpha, row by row. `[height, width, 4]`
    pub(crate) rgba: Vec<u8>,
}

/// Rectangles in the order of their splats, and their pages.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Quads {
    pub(crate) quads: Vec<Quad>,
    pub(crate) pages: Vec<QuadPage>,
    /// Texels of all rectangles together.
    pub(crate) num_texels: usize,
}

/// How far a splat's rectangle reaches, and how fine its map is.
struct Rectangle {
    splat: usize,
    /// Half sides along u and v, local units.
    half: [f64; 2],
    /// Texels along v (columns) and u (rows).
    size: [u16; 2],
}

impl Quads {
    /// Makes rectangles of the splats with the largest opacity times area, at most `most`, on pages of at most `side`
    /// texels per side.
    ///
    /// # Errors
    /// [`crate::Error::TooLarge`] if pages are too small for any map.
    pub(crate) fn of(asset: &SplatAsset, most: usize, side: u16) -> Result<Self> {
        let rectangles: Vec<Rectangle> =
            chosen(asset, most).into_iter().map(|i| extent(asset, i, side)).collect();
        let sizes: Vec<[u16; 2]> = rectangles.iter().map(|r| r.size).collect();
        let num_texels = sizes.iter().map(|s| usize::from(s[0]) * usize::from(s[1])).sum();
        let (placements, pages) = atlas::pack(&sizes, side).ok_or_else(|| {
            too_large!("", "rectangles: {SIDE_MIN} texels per side and more, on pages of {side}")
        })?;
        let blank = |size: [u16; 2]| vec![0; 4 * usize::from(size[0]) * usize::from(size[1])];
        let pages = pages.into_iter().map(|size| QuadPage { size, rgba: blank(size) }).collect();
        let mut quads = Self { quads: Vec::with_capacity(rectangles.len()), pages, num_texels };
        for (rectangle, at) in rectangles.iter().zip(&placements) {
            let page = &mut quads.pages[usize::from(at.page)];
            draw(asset, rectangle, at, page);
            quads.quads.push(quad(asset, rectangle, at, page.size));
        }
        Ok(quads)
    }
}

/// Indices of the visible splats with the largest opacity times area, ascending.
fn chosen(asset: &SplatAsset, most: usize) -> Vec<usize> {
    let weight = |splat: usize| {
        let [u, v] = asset.scales[splat].map(f64::from);
        f64::from(asset.opacities[splat]) * u * v
    };
    let shows = |&splat: &usize| f64::from(asset.opacities[splat]) > ALPHA_MIN;
    let mut order: Vec<usize> = (0..asset.num_splats()).filter(shows).collect();
    order.sort_by(|&a, &b| weight(b).total_cmp(&weight(a)).then(a.cmp(&b)));
    order.truncate(most);
    order.sort_unstable();
    order
}

fn extent(asset: &SplatAsset, splat: usize, page_side: u16) -> Rectangle {
    let (map, opacity) = (&asset.maps[splat], f64::from(asset.opacities[splat]));
    let reach = (2.0 * (opacity / ALPHA_MIN).ln()).sqrt().min(SIGMA_MAX);
    let half = asset.scales[splat].map(|s| f64::from(s) * reach);
    // As fine as the map, but not many more texels where a splat has outgrown its map.
    let texels = |axis: usize| {
        let of_map = [map.rows, map.cols][axis];
        let most = of_map.saturating_mul(2).clamp(SIDE_MIN, page_side.max(SIDE_MIN));
        let wanted = (2.0 * half[axis] / f64::from(map.texel_sizes[axis])).ceil() + 1.0;
        if of_map == 0 { SIDE_MIN } else { wanted.clamp(SIDE_MIN.into(), most.into()) as u16 }
    };
    Rectangle { splat, half, size: [texels(1), texels(0)] }
}

/// Coordinate of a texel, one of `count` from `-half` to `half`.
fn coordinate(index: u16, count: u16, half: f64) -> f64 {
    (2.0 * f64::from(index) / f64::from(count - 1) - 1.0) * half
}

fn draw(asset: &SplatAsset, rectangle: &Rectangle, at: &Placement, page: &mut QuadPage) {
    let splat = rectangle.splat;
    let [cols, rows] = rectangle.size;
    let [scale_u, scale_v] = asset.scales[splat].map(f64::from);
    let sh = asset.sh_of(splat);
    let base: [f64; 3] = std::array::from_fn(|c| (0.5 + SH_0 * f64::from(sh[c])).max(0.0));
    let falloff = |d: f64, scale: f64| (-0.5 * (d / scale).powi(2)).exp();
    // The Gaussian is a product: one exponential for each row and each column.
    let along_v: Vec<(f64, f64)> = (0..cols)
        .map(|col| coordinate(col, cols, rectangle.half[1]))
        .map(|b| (b, falloff(b, scale_v)))
        .collect();
    for row in 0..rows {
        let a = coordinate(row, rows, rectangle.half[0]);
        let opacity = f64::from(asset.opacities[splat]) * falloff(a, scale_u);
        for (col, &(b, falloff)) in along_v.iter().enumerate() {
            let residual = sample(&asset.maps[splat], asset.texels_of(splat), a, b);
            let alpha = (opacity * falloff).min(ALPHA_MAX);
            let pixel =
                (usize::from(at.y) + usize::from(row)) * usize::from(page.size[0]) + usize::from(at.x) + col;
            for c in 0..3 {
                let shown = (base[c] + residual[c]).clamp(0.0, 1.0);
                page.rgba[4 * pixel + c] = code(asset.colour_space.srgb(shown));
            }
            page.rgba[4 * pixel + 3] = code(alpha);
        }
    }
}

fn code(value: f64) -> u8 {
    (255.0 * value.clamp(0.0, 1.0)).round() as u8
}

/// Residual at a position on the splat: bilinear, zero outside the map (method, section 1.3).
fn sample(map: &AssetMap, texels: &[f32], a: f64, b: f64) -> [f64; 3] {
    let mut sum = [0.0; 3];
    if map.num_texels() == 0 {
        return sum;
    }
    let u = a / f64::from(map.texel_sizes[0]) + map.middle(0);
    let v = b / f64::from(map.texel_sizes[1]) + map.middle(1);
    for row in [u.floor(), u.floor() + 1.0] {
        for col in [v.floor(), v.floor() + 1.0] {
            if row < 0.0 || col < 0.0 || row >= f64::from(map.rows) || col >= f64::from(map.cols) {
                continue;
            }
            let weight = (1.0 - (u - row).abs()) * (1.0 - (v - col).abs());
            let texel = row as usize * usize::from(map.cols) + col as usize;
            for (s, &t) in sum.iter_mut().zip(&texels[3 * texel..]) {
                *s += weight * f64::from(t);
            }
        }
    }
    sum
}

fn quad(asset: &SplatAsset, rectangle: &Rectangle, at: &Placement, page: [u16; 2]) -> Quad {
    let splat = rectangle.splat;
    let centre = yup::position(asset.positions[splat]).map(f64::from);
    let q = yup::rotation(asset.rotations[splat]).map(f64::from);
    let [half_u, half_v] = rectangle.half;
    let [cols, rows] = rectangle.size.map(f64::from);
    let corner = |u: f64, v: f64| {
        let offset = quaternion::turned(q, [u * half_u, v * half_v, 0.0]);
        std::array::from_fn(|i| (centre[i] + offset[i]) as f32)
    };
    // From the centre of the first texel to that of the last; columns run along v, rows along u.
    let uv = |u: f64, v: f64| {
        let x = f64::from(at.x) + 0.5 + 0.5 * (v + 1.0) * (cols - 1.0);
        let y = f64::from(at.y) + 0.5 + 0.5 * (u + 1.0) * (rows - 1.0);
        [(x / f64::from(page[0])) as f32, (y / f64::from(page[1])) as f32]
    };
    let signs = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)];
    Quad {
        splat: splat as u32,
        page: at.page,
        corners: signs.map(|(u, v)| corner(u, v)),
        uvs: signs.map(|(u, v)| uv(u, v)),
    }
}

/// A page as PNG with alpha, colours as sRGB.
///
/// # Errors
/// [`crate::Error::Invalid`] if the sizes do not fit each other.
pub(crate) fn encode_page(page: &QuadPage) -> Result<Vec<u8>> {
    let failed = |e: png::EncodingError| invalid!("", "PNG page: {e}");
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, page.size[0].into(), page.size[1].into());
    encoder.set_color(png::ColorType::Rgba);
    encoder.set_depth(png::BitDepth::Eight);
    encoder.set_compression(png::Compression::Balanced);
    encoder.set_source_srgb(png::SrgbRenderingIntent::RelativeColorimetric);
    let mut writer = encoder.write_header().map_err(failed)?;
    writer.write_image_data(&page.rgba).map_err(failed)?;
    writer.finish().map_err(failed)?;
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::asset::tests::fixture;

    #[test]
    fn rectangles_show_base_colour_map_and_falloff() {
        let mut asset = fixture(2, 0);
        asset.positions[0] = [1.0, 2.0, 3.0];
        asset.rotations[0] = [1.0, 0.0, 0.0, 0.0];
        asset.scales[0] = [0.1, 0.2];
        asset.opacities[0] = 0.8;
        asset.sh[..3].copy_from_slice(&[0.5, -0.5, 0.0]);
        asset.maps[0].texel_sizes = [10.0; 2];
        asset.texels[..3].copy_from_slice(&[0.25, 0.0, -1.0]);
        let baked = Quads::of(&asset, 10, 64).unwrap();
        let quad = &baked.quads[0];
        // y up: u = x, v = -y, normal = -z. Half sides are three standard deviations.
        let near = |a: [f32; 3], b: [f32; 3]| (0..3).all(|i| (a[i] - b[i]).abs() < 1e-6); // needed 3e-7
        assert!(near(quad.corners[0], [0.7, -1.4, -3.0]), "{:?}", quad.corners);
        assert!(near(quad.corners[2], [1.3, -2.6, -3.0]), "{:?}", quad.corners);
        let size = baked.pages[0].size;
        let texel = |uv: [f32; 2]| {
            let [x, y]: [f32; 2] = std::array::from_fn(|i| uv[i] * f32::from(size[i]) - 0.5);
            assert!((x - x.round()).abs() < 1e-4 && (y - y.round()).abs() < 1e-4, "centres of texels");
            4 * (y.round() as usize * usize::from(size[0]) + x.round() as usize)
        };
        let corner = texel(quad.uvs[0]);
        // exp(-9) of the opacity is nothing; the alpha near the centre is not.
        assert_eq!(baked.pages[0].rgba[corner + 3], 0);
        let centre = corner + 4 * (3 * usize::from(size[0]) + 3);
        let [r, g, b, a] = std::array::from_fn(|i| baked.pages[0].rgba[centre + i]);
        // Texel 3 of 8 lies at -3/7 standard deviations along both axes; texels of 10 units show (nearly) the mean of
        // the map's four.
        let alpha = 0.8 * (-9.0_f64 / 49.0).exp();
        assert_eq!(f64::from(a), (255.0 * alpha).round());
        let mean = |c: usize| (0..4).map(|t| f64::from(asset.texels[3 * t + c])).sum::<f64>() / 4.0;
        for (c, (found, dc)) in [(r, 0.5), (g, -0.5), (b, 0.0)].into_iter().enumerate() {
            let expected = 255.0 * (0.5 + SH_0 * dc + mean(c)).clamp(0.0, 1.0);
            assert!((f64::from(found) - expected).abs() < 8.0, "{c}: {found} {expected}"); // needed 4
        }
    }

    #[test]
    fn the_top_contributors_are_kept_in_order() {
        let asset = fixture(30, 1);
        let weight = |i: usize| asset.opacities[i] * asset.scales[i][0] * asset.scales[i][1];
        let baked = Quads::of(&asset, 10, 128).unwrap();
        let kept: Vec<usize> = baked.quads.iter().map(|q| q.splat as usize).collect();
        assert_eq!(kept.len(), 10);
        assert!(kept.is_sorted());
        let least = kept.iter().map(|&i| weight(i)).fold(f32::INFINITY, f32::min);
        assert!((0..30).filter(|i| !kept.contains(i)).all(|i| weight(i) <= least));
        assert!(encode_page(&baked.pages[0]).unwrap().starts_with(b"\x89PNG"));
        // A splat that is never drawn has no rectangle.
        let mut faint = fixture(1, 0);
        faint.opacities[0] = 0.003;
        assert!(Quads::of(&faint, 10, 128).unwrap().quads.is_empty());
    }
}
