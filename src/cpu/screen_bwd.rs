//! From the sums over a splat's pixels to the derivatives with respect to its map from pixels to the coordinates (a, b) on the
//! surfel. The pixel at (a, b) is `centre_px + (a t_a + b t_b) / p` with `p = 1 + a z_a + b z_b`, its depth over that of the centre:
//! all sums over pixels are combinations of sums of products of a and b. Sums in pixels, as the chain rule asks for, would be twice
//! as many.

use super::project::{ProjectedSplat, Spread};
use super::sums::{HEADER_FLOATS, Sum};
use super::view::ViewF32;

/// Derivatives with respect to the projected centre, the numerators of a and b, and their denominator.
pub(super) struct ScreenSums {
    pub centre_px: [f32; 2],
    pub a: [f32; 2],
    pub b: [f32; 2],
    pub g: [f32; 2],
}

/// Derivatives from `sums`, the sums over all pairs of the splat.
pub(super) fn screen_bwd(splat: &ProjectedSplat, sums: &[f32; HEADER_FLOATS], view: &ViewF32) -> ScreenSums {
    let s = |sum: Sum| sums[sum as usize];
    let [half_a, half_b] = half_axes(splat);
    let p = splat.centre_in_camera;
    let (z_a, z_b) = (half_a[2] / p[2], half_b[2] / p[2]);
    let t = |half: [f32; 3]| [0, 1].map(|k| view.focal_px[k] * (half[k] - p[k] / p[2] * half[2]) / p[2]);
    let (t_a, t_b) = (t(half_a), t(half_b));
    // Derivatives by a and b, times a and b: through the falloff and through the texture.
    let aa = s(Sum::TextureAA) - s(Sum::ExponentAA);
    let ab = s(Sum::TextureAB) - s(Sum::ExponentAB);
    let ba = s(Sum::TextureBA) - s(Sum::ExponentAB);
    let bb = s(Sum::TextureBB) - s(Sum::ExponentBB);
    let (radial_a, radial_b) = (s(Sum::RadialA), s(Sum::RadialB));
    // By the numerators and by the denominator, for each pixel times p.
    let by_a = s(Sum::A) + z_a * aa + z_b * ab;
    let by_b = s(Sum::B) + z_a * ba + z_b * bb;
    let by_denominator = s(Sum::D) - (aa + bb + z_a * radial_a + z_b * radial_b);
    let (distortion_x, distortion_y) = (s(Sum::DX), s(Sum::DY));
    ScreenSums {
        centre_px: [0, 1].map(|k| -(splat.a[k] * by_a + splat.b[k] * by_b + splat.g[k] * by_denominator)),
        a: [0, 1].map(|k| t_a[k] * aa + t_b[k] * ab),
        b: [0, 1].map(|k| t_a[k] * ba + t_b[k] * bb),
        g: [0, 1].map(|k| [distortion_x, distortion_y][k] - (t_a[k] * radial_a + t_b[k] * radial_b)),
    }
}

/// The axes of a splat in camera axes along which the coordinates grow by 1.
fn half_axes(splat: &ProjectedSplat) -> [[f32; 3]; 2] {
    let Spread { u_a, v_a, v_b } = splat.spread;
    let ([e_u, e_v, _], [su, sv]) = (splat.axes_in_camera, splat.scales);
    [[0, 1, 2].map(|k| u_a * su * e_u[k] + v_a * sv * e_v[k]), e_v.map(|v| v_b * sv * v)]
}
