//! Edits of an asset before it is written: cropping, pruning, up direction, scale.

use crate::math::quaternion;
use crate::math::sh::Turn;
use crate::{AssetCamera, AssetMap, SplatAsset, Transform, num_sh_coefficients};

impl SplatAsset {
    /// Keeps the splats whose entry in `keep` is true, in their order, and returns how many were removed. `keep`: `[n]`
    pub fn retain(&mut self, keep: &[bool]) -> usize {
        let before = self.num_splats();
        let kept = |i: &usize| keep.get(*i).copied().unwrap_or(true);
        let indices: Vec<usize> = (0..before).filter(kept).collect();
        if indices.len() == before {
            return 0;
        }
        let (mut maps, mut texels, mut sh) = (Vec::new(), Vec::new(), Vec::new());
        for &i in &indices {
            let offset_texels = (texels.len() / 3) as u32;
            maps.push(AssetMap { offset_texels, ..self.maps[i] });
            texels.extend_from_slice(self.texels_of(i));
            sh.extend_from_slice(self.sh_of(i));
        }
        self.positions = indices.iter().map(|&i| self.positions[i]).collect();
        self.rotations = indices.iter().map(|&i| self.rotations[i]).collect();
        self.scales = indices.iter().map(|&i| self.scales[i]).collect();
        self.opacities = indices.iter().map(|&i| self.opacities[i]).collect();
        self.sh_degrees = indices.iter().map(|&i| self.sh_degrees[i]).collect();
        (self.maps, self.texels, self.sh) = (maps, texels, sh);
        self.fit_sh_degree();
        before - indices.len()
    }

    /// Keeps the splats whose centres lie in a box in the capture's frame, faces included, and returns how many were
    /// removed.
    pub fn crop(&mut self, low: [f64; 3], high: [f64; 3]) -> usize {
        let frame = self.capture_from_local;
        let inside = |p: &[f32; 3]| {
            let p = frame.transform_point(*p);
            (0..3).all(|i| (low[i]..=high[i]).contains(&p[i]))
        };
        let keep: Vec<bool> = self.positions.iter().map(inside).collect();
        self.retain(&keep)
    }

    /// Chooses which direction of the capture is up in files of all formats. An asset that was not told takes -y.
    pub fn set_up(&mut self, up_in_capture: [f64; 3]) {
        let world = &mut self.world_from_capture;
        let turn = quaternion::between(up_in_capture, [0.0, -1.0, 0.0]).map(|v| v + 0.0);
        let change = quaternion::product(turn, quaternion::conjugate(world.rotation));
        world.translation = quaternion::turned(change, world.translation).map(|v| v + 0.0);
        world.rotation = turn;
    }

    /// Up in the local frame, a unit vector.
    pub fn up_in_local(&self) -> [f64; 3] {
        quaternion::turned(quaternion::conjugate(self.world_from_local().rotation), [0.0, -1.0, 0.0])
    }

    /// Chooses the length of the capture's unit in files: 0.01 turns a capture in centimetres into metres.
    pub fn set_scale(&mut self, factor: f64) {
        let world = &mut self.world_from_capture;
        world.translation = world.translation.map(|t| t * factor / world.scale);
        world.scale = factor;
    }

    /// The same scene in another local frame of the same capture. Values are rounded again unless the frames are equal.
    pub fn in_frame(&self, capture_from_new: &Transform) -> Self {
        let old = &self.capture_from_local;
        if old == capture_from_new {
            return self.clone();
        }
        let mut out = Self { capture_from_local: *capture_from_new, ..self.clone() };
        let new_from_capture = quaternion::conjugate(capture_from_new.rotation);
        let turn = quaternion::product(new_from_capture, old.rotation);
        let factor = old.scale / capture_from_new.scale;
        let sh_turn = Turn::new(turn);
        let width = 3 * num_sh_coefficients(self.sh_degree);
        for i in 0..self.num_splats() {
            let in_capture = old.transform_point(self.positions[i]);
            let moved = std::array::from_fn(|c| in_capture[c] - capture_from_new.translation[c]);
            out.positions[i] =
                quaternion::turned(new_from_capture, moved).map(|v| (v / capture_from_new.scale) as f32);
            let q = quaternion::product(turn, self.rotations[i].map(f64::from));
            let norm = quaternion::norm(q);
            out.rotations[i] = q.map(|v| (v / norm) as f32);
            out.scales[i] = self.scales[i].map(|s| (f64::from(s) * factor) as f32);
            out.maps[i].texel_sizes = self.maps[i].texel_sizes.map(|k| (f64::from(k) * factor) as f32);
            let sh = &mut out.sh[i * width..(i + 1) * width];
            sh.iter_mut().zip(sh_turn.apply(self.own_sh_of(i))).for_each(|(new, v)| *new = v as f32);
        }
        out.near = (f64::from(self.near) * factor) as f32;
        let new_from_old = capture_from_new.inverse().after(old);
        out.cameras = self.cameras.iter().map(|camera| camera.in_frame(&new_from_old)).collect();
        out
    }
}

impl AssetCamera {
    /// The same camera in another frame.
    pub fn in_frame(&self, new_from_old: &Transform) -> Self {
        // camera = R old + t, in the old unit; old = Q^T (new - T) / s; in the new unit everything is s times as long.
        let back = quaternion::conjugate(new_from_old.rotation);
        let rows = self.rotation_rows;
        let rotation_rows = rows.map(|row| quaternion::turned(new_from_old.rotation, row));
        let moved = quaternion::turned(back, new_from_old.translation);
        let translation = std::array::from_fn(|i| {
            let along: f64 = (0..3).map(|k| rows[i][k] * moved[k]).sum();
            new_from_old.scale * self.translation[i] - along
        });
        Self { rotation_rows, translation, ..self.clone() }
    }
}

#[cfg(test)]
mod tests {
    use crate::Transform;
    use crate::asset::tests::{camera, fixture};

    #[test]
    fn kept_splats_keep_their_maps_and_coefficients() {
        let whole = fixture(20, 2);
        let mut asset = whole.clone();
        assert_eq!(asset.retain(&[true; 20]), 0);
        assert_eq!(asset, whole);
        let frame = whole.capture_from_local;
        let kept: Vec<usize> = (0..20)
            .filter(|&i| frame.transform_point(whole.positions[i])[0] <= frame.translation[0])
            .collect();
        assert!(kept.len() > 3 && kept.len() < 17);
        let high = [frame.translation[0], f64::INFINITY, f64::INFINITY];
        assert_eq!(asset.crop([f64::NEG_INFINITY; 3], high), 20 - kept.len());
        asset.validate().unwrap();
        for (new, &old) in kept.iter().enumerate() {
            assert_eq!(asset.positions[new], whole.positions[old]);
            assert_eq!(asset.sh_of(new), whole.sh_of(old));
            assert_eq!(asset.texels_of(new), whole.texels_of(old));
            assert_eq!((asset.rotations[new], asset.scales[new]), (whole.rotations[old], whole.scales[old]));
        }
    }

    #[test]
    fn changing_the_frame_keeps_positions_in_the_capture() {
        let mut turned = fixture(12, 3);
        turned.set_up([1.0, 2.0, -0.5]);
        turned.set_scale(3.0);
        // The same capture from both sides: local frames that differ by the turn.
        let other = Transform { scale: 0.7, rotation: [0.5, 0.5, -0.5, 0.5], translation: [1.0, 2.0, 3.0] };
        let moved = turned.in_frame(&other);
        moved.validate().unwrap();
        let mut worst = 0.0_f64;
        for i in 0..12 {
            let before = turned.capture_from_local.transform_point(turned.positions[i]);
            let after = moved.capture_from_local.transform_point(moved.positions[i]);
            worst = (0..3).map(|c| (before[c] - after[c]).abs()).fold(worst, f64::max);
        }
        assert!(worst < 1e-5, "{worst}"); // needed 4e-7: f32
        assert!((moved.scales[3][0] / turned.scales[3][0] - (3.7 / 0.7)).abs() < 1e-4);
        let back = moved.in_frame(&turned.capture_from_local);
        for (a, b) in back.sh.iter().zip(&turned.sh) {
            assert!((a - b).abs() < 1e-6, "{a} {b}"); // needed 3e-8
        }
        assert_eq!(turned.in_frame(&turned.capture_from_local), turned);
    }

    #[test]
    fn changing_the_frame_keeps_camera_projections() {
        let mut asset = fixture(8, 0);
        asset.set_up([0.3, -1.0, 0.2]);
        asset.cameras.push(crate::AssetCamera { translation: [0.1, 0.2, 4.0], ..camera() });
        let pixels = |asset: &crate::SplatAsset| -> Vec<f64> {
            let camera = &asset.cameras[0];
            let seen = |p: &[f32; 3]| -> [f64; 2] {
                let at: [f64; 3] = std::array::from_fn(|i| {
                    let row = camera.rotation_rows[i];
                    (0..3).map(|c| row[c] * f64::from(p[c])).sum::<f64>() + camera.translation[i]
                });
                std::array::from_fn(|i| camera.focal_px[i] * at[i] / at[2] + camera.principal_px[i])
            };
            asset.positions.iter().flat_map(seen).collect()
        };
        let other = Transform { scale: 0.7, rotation: [0.5, 0.5, -0.5, 0.5], translation: [1.0, 2.0, 3.0] };
        let moved = asset.in_frame(&other);
        let worst = |found: Vec<f64>| {
            found.iter().zip(pixels(&asset)).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
        };
        let found = worst(pixels(&moved));
        assert!(found < 1e-4, "{found}"); // needed 7.2e-7: f32 of places
        let mut wrong = moved.clone();
        wrong.cameras[0].translation[2] *= 1.01;
        assert!(worst(pixels(&wrong)) > 1e-2, "negative control");
    }

    #[test]
    fn up_and_scale_change_only_the_world_transform() {
        let whole = fixture(5, 1);
        let mut asset = whole.clone();
        asset.set_up([0.0, -1.0, 0.0]);
        assert_eq!(asset, whole, "already so");
        // z up: what lay at z lies at -y now. Twice is once.
        for _ in 0..2 {
            asset.set_up([0.0, 0.0, 2.0]);
            asset.set_scale(0.01);
        }
        asset.validate().unwrap();
        let world = std::mem::take(&mut asset.world_from_capture);
        assert_eq!(asset, whole);
        asset.world_from_capture = world;
        for p in &whole.positions {
            let before = whole.world_from_local().transform_point(*p);
            let after = asset.world_from_local().transform_point(*p);
            assert!((after[1] + 0.01 * before[2]).abs() < 1e-14, "{before:?} {after:?}"); // needed 4e-18
            assert!((after[0] - 0.01 * before[0]).abs() < 1e-14);
        }
        assert_eq!(asset.crop([f64::NEG_INFINITY; 3], [f64::INFINITY; 3]), 0);
        // A file that was moved by hand keeps its place.
        asset.world_from_capture.translation = [0.0, 1.0, 0.0];
        asset.set_up([0.0, 0.0, -1.0]);
        assert!((asset.world_from_capture.translation[1] + 1.0).abs() < 1e-14);
    }
}
