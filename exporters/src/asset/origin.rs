//! Where the origin of files lies in the capture: at its own origin, or, for captures with coordinates that f32 cannot hold,
//! elsewhere.

use crate::math::quaternion;
use crate::{SplatAsset, Transform};

/// How users of the command line move the origin of files to the scene.
pub const ORIGIN_OPTION: &str = "--origin auto";

impl SplatAsset {
    /// Chooses which point of the capture lies at the origin of files of all formats.
    pub fn set_origin(&mut self, in_capture: [f64; 3]) {
        let world = &mut self.world_from_capture;
        let turned = quaternion::turned(world.rotation, in_capture);
        // No negative zeros, so that equal transforms make equal files.
        world.translation = turned.map(|v| 0.0 - world.scale * v);
    }

    /// The point of the capture that lies at the origin of files; `None` if it is the capture's own.
    pub fn origin_in_capture(&self) -> Option<[f64; 3]> {
        let Transform { scale, rotation, translation } = self.world_from_capture;
        if translation == [0.0; 3] {
            return None;
        }
        let origin =
            quaternion::turned(quaternion::conjugate(rotation), translation).map(|v| 0.0 - v / scale);
        // Round numbers come back as such: the digits behind the twelfth are those of the arithmetic.
        let largest = origin.iter().fold(0.0_f64, |largest, v| largest.max(v.abs()));
        Some(origin.map(|v| rounded(v, largest.log10().floor() - 12.0)))
    }

    /// A point of the capture in the middle of the splats, for [`SplatAsset::set_origin`]: rounded to the power of ten below the
    /// size of the scene, so that people can read it and name it again.
    pub fn middle_in_capture(&self) -> [f64; 3] {
        let n = self.num_splats();
        let mut along: [Vec<f64>; 3] = Default::default();
        for position in &self.positions {
            let p = self.capture_from_local.transform_point(*position);
            along.iter_mut().zip(p).for_each(|(along, v)| along.push(v));
        }
        if n == 0 {
            return [0.0; 3];
        }
        let median = |values: &mut Vec<f64>| *values.select_nth_unstable_by(n / 2, f64::total_cmp).1;
        let middle: [f64; 3] = std::array::from_fn(|axis| median(&mut along[axis]));
        // Half of the coordinates lie within this of the middle.
        let size = (0..3).map(|axis| {
            let mut from_middle: Vec<f64> = along[axis].iter().map(|v| (v - middle[axis]).abs()).collect();
            median(&mut from_middle)
        });
        let size = size.fold(0.0, f64::max);
        if size == 0.0 {
            return middle;
        }
        middle.map(|v| rounded(v, size.log10().floor()))
    }
}

/// The number rounded to a power of ten.
fn rounded(v: f64, exponent: f64) -> f64 {
    let step = 10.0_f64.powf(exponent);
    let digits = (0.0 - exponent).clamp(0.0, 300.0) as usize;
    // Through text, so that no digits appear behind the last.
    format!("{:.digits$}", (v / step).round() * step).parse().map_or(v, |v: f64| v + 0.0)
}

#[cfg(test)]
mod tests {
    use crate::asset::tests::fixture;

    #[test]
    fn another_origin_moves_the_files_and_nothing_else() {
        let whole = fixture(40, 1);
        let mut asset = whole.clone();
        asset.set_up([0.3, -0.2, 1.0]);
        asset.set_scale(0.01);
        assert_eq!(asset.origin_in_capture(), None);
        let before: Vec<[f64; 3]> =
            asset.positions.iter().map(|p| asset.world_from_local().transform_point(*p)).collect();
        let origin = [512_345.0, 4_512_345.0, -123.5];
        asset.set_origin(origin);
        assert_eq!(asset.origin_in_capture(), Some(origin));
        asset.validate().unwrap();
        // All points move by the same, and the chosen one lies at zero.
        let shift = asset.world_from_capture.translation;
        for (p, before) in asset.positions.iter().zip(before) {
            let after = asset.world_from_local().transform_point(*p);
            assert!((0..3).all(|i| (after[i] - before[i] - shift[i]).abs() < 1e-9)); // needed 3e-11
        }
        let at = asset.world_from_capture.transform_point(origin.map(|v| v as f32));
        assert!(at.iter().all(|v| v.abs() < 1e-8), "{at:?}"); // needed 1e-10
        // Turning and scaling later keeps it; the capture's own origin undoes it.
        asset.set_up([0.0, -1.0, 0.0]);
        asset.set_scale(1.0);
        let found = asset.origin_in_capture().unwrap();
        assert!((0..3).all(|i| (found[i] - origin[i]).abs() < 1e-6), "{found:?}"); // needed 1e-9
        asset.set_origin([0.0; 3]);
        assert_eq!(asset, whole);
    }

    #[test]
    fn the_middle_is_a_round_point_among_the_splats() {
        let mut asset = fixture(200, 0);
        // 3.7 units of the capture are one of the asset's; a floater does not count.
        asset.capture_from_local.translation = [512_345.678, 4_512_345.678, -7.0];
        asset.positions[0] = [1e4; 3];
        let middle = asset.middle_in_capture();
        assert!(
            (0..2).all(|i| (middle[i] - asset.capture_from_local.translation[i]).abs() < 1.0),
            "{middle:?}"
        );
        assert!(middle.iter().all(|v| (v * 10.0 - (v * 10.0).round()).abs() < 1e-6), "{middle:?}");
        asset.retain(&[false; 200]);
        assert_eq!(asset.middle_in_capture(), [0.0; 3]);
    }
}
