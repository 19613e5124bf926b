//! Depths and normals of an image, from the sums that the forward pass writes.

use crate::backend::RenderedImage;

/// Sets depths and normals from the sums of each pixel. The first vector has the sums of normal and depth, weighted
/// by the blending weight; the second is for the loss. `[height, width, 2]`
pub(super) fn fill_in(image: &mut RenderedImage, sums: &[[[f32; 4]; 2]]) {
    image.depth = sums
        .iter()
        .zip(&image.alpha)
        .map(|([[.., depth], _], &alpha)| if alpha > 0.0 { depth / alpha } else { 0.0 })
        .collect();
    image.normal = sums
        .iter()
        .flat_map(|[[x, y, z, _], _]| {
            let length = (x * x + y * y + z * z).sqrt();
            [x, y, z].map(|v| if length > 0.0 { v / length } else { 0.0 })
        })
        .collect();
}
