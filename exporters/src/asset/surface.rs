//! The surface that a ray meets, for measuring. `web/src/three/pick.ts` finds the same one.

use crate::SplatAsset;

/// Transmittance below which a ray has met something.
const HALF: f64 = 0.5;
/// Least and largest alpha of a hit, as in rendering.
const ALPHA_MIN: f64 = 1.0 / 255.0;
const ALPHA_MAX: f64 = 0.99;

impl SplatAsset {
    /// Distance along a ray in the local frame, in lengths of `direction`, at which its transmittance falls below one half, with
    /// hits in the order of their distance: the median depth. `None` where all splats together let more than half of the
    /// light pass, as the background does. Hits nearer than `near` do not count. The low-pass filter is left out: it depends
    /// on a camera.
    pub fn surface_along(&self, origin: [f64; 3], direction: [f64; 3], near: f64) -> Option<f64> {
        let hit = |splat| self.hit(splat, origin, direction).filter(|(distance, _)| *distance >= near);
        let mut hits: Vec<(f64, f64)> = (0..self.num_splats()).filter_map(hit).collect();
        hits.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mut transmittance = 1.0;
        let surface = hits.iter().find(|(_, alpha)| {
            transmittance *= 1.0 - alpha;
            transmittance < HALF
        });
        surface.map(|(distance, _)| *distance)
    }

    /// Distance and alpha where a ray meets a splat; `None` outside its support.
    fn hit(&self, splat: usize, origin: [f64; 3], direction: [f64; 3]) -> Option<(f64, f64)> {
        let [w, x, y, z] = self.rotations[splat].map(f64::from);
        let normal = [2.0 * (x * z + w * y), 2.0 * (y * z - w * x), 1.0 - 2.0 * (x * x + y * y)];
        let dot = |a: [f64; 3], b: [f64; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
        let to_splat: [f64; 3] = std::array::from_fn(|i| f64::from(self.positions[splat][i]) - origin[i]);
        let distance = dot(normal, to_splat) / dot(normal, direction);
        let offset: [f64; 3] = std::array::from_fn(|i| distance * direction[i] - to_splat[i]);
        let u = [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y + w * z), 2.0 * (x * z - w * y)];
        let v = [2.0 * (x * y - w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z + w * x)];
        let [su, sv] = self.scales[splat].map(f64::from);
        let falloff = (-0.5 * ((dot(offset, u) / su).powi(2) + (dot(offset, v) / sv).powi(2))).exp();
        let alpha = f64::from(self.opacities[splat]) * falloff;
        // Also not a number, of rays along the surfel.
        (alpha >= ALPHA_MIN).then_some((distance, alpha.min(ALPHA_MAX)))
    }
}

#[cfg(test)]
mod tests {
    use crate::{AssetMap, SplatAsset};

    /// Discs of standard deviation 0.1 that face the ray along z, at these depths and opacities.
    fn discs(all: &[(f32, f32)]) -> SplatAsset {
        let n = all.len();
        SplatAsset {
            sh_degrees: vec![0; n],
            positions: all.iter().map(|(z, _)| [0.0, 0.0, *z]).collect(),
            rotations: vec![[1.0, 0.0, 0.0, 0.0]; n],
            scales: vec![[0.1; 2]; n],
            opacities: all.iter().map(|(_, opacity)| *opacity).collect(),
            sh: vec![0.0; 3 * n],
            maps: vec![AssetMap::default(); n],
            ..SplatAsset::default()
        }
    }

    #[test]
    fn the_surface_is_where_half_of_the_light_is_gone() {
        let along = |asset: &SplatAsset, x: f64| asset.surface_along([x, 0.0, 0.0], [0.0, 0.0, 1.0], 0.01);
        let haze = discs(&[(2.0, 0.9), (1.0, 0.3), (3.0, 0.9), (-1.0, 0.9)]);
        let depth = along(&haze, 0.0).unwrap();
        assert!((depth - 2.0).abs() < 1e-12, "behind the haze, in front of the rest: {depth}");
        // Negative controls: beside the discs, through haze alone, and behind the surface.
        assert_eq!(along(&haze, 0.5), None);
        assert_eq!(along(&discs(&[(1.0, 0.3)]), 0.0), None);
        let behind = haze.surface_along([0.0; 3], [0.0, 0.0, 1.0], 2.5).unwrap();
        assert!((behind - 3.0).abs() < 1e-12);
        // A slanted ray, and distances in lengths of the direction.
        let slanted = haze.surface_along([-0.2, 0.0, 0.0], [0.2, 0.0, 2.0], 0.01).unwrap();
        assert!((slanted - 1.0).abs() < 1e-7, "{slanted}");
    }
}
