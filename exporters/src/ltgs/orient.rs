//! The orientation in which lossy files hold splats. A splat looks the same turned by half around its axes u, v and n, and turned
//! by a quarter around n with its axes swapped, if its map turns with it. Of these eight orientations, files hold the one whose u
//! is the longer axis, whose normal has z >= 0, and which is turned around its normal by at most a quarter: three bits less to
//! store for each splat.

use crate::math::quaternion::{conjugate, norm, product};
use crate::{AssetMap, SplatAsset};
use std::f64::consts::FRAC_1_SQRT_2;

/// Turns by which a splat's axes change.
const QUARTER_N: [f64; 4] = [FRAC_1_SQRT_2, 0.0, 0.0, FRAC_1_SQRT_2];
const HALF_U: [f64; 4] = [0.0, 1.0, 0.0, 0.0];
const HALF_N: [f64; 4] = [0.0, 0.0, 0.0, 1.0];

/// A rotation as the shortest one that turns z to the normal, its *swing*, after one around z, its *twist*.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SwingTwist {
    /// x and y of the swing's unit quaternion; its z is 0, its w is not negative.
    pub swing: [f64; 2],
    /// Sine of half the angle of the twist; its cosine is not negative.
    pub twist: f64,
}

impl SwingTwist {
    /// The parts of a rotation wxyz.
    pub fn of(q: [f64; 4]) -> Self {
        let [w, _, _, z] = q;
        let length = w.hypot(z);
        if length == 0.0 {
            // The normal is -z: any twist will do.
            return Self { swing: [q[1], q[2]], twist: 0.0 };
        }
        let sign = if w < 0.0 { -1.0 } else { 1.0 };
        let twist = [w / length, 0.0, 0.0, z / length];
        let [_, x, y, _] = product(q, conjugate(twist));
        Self { swing: [x, y], twist: sign * twist[3] }
    }

    /// The rotation wxyz.
    pub fn quaternion(&self) -> [f64; 4] {
        let ([x, y], s) = (self.swing, self.twist);
        let w = (1.0 - (x * x + y * y)).max(0.0).sqrt();
        let c = (1.0 - s * s).max(0.0).sqrt();
        [w * c, x * c + y * s, y * c - x * s, w * s]
    }
}

/// How a map turns with its splat: first by a quarter, then mirrored along its rows and columns.
#[derive(Clone, Copy, Default)]
struct Turn {
    quarter: bool,
    mirror: [bool; 2],
}

impl Turn {
    fn half_around_u(&mut self) {
        self.mirror[1] ^= true;
    }

    fn half_around_n(&mut self) {
        self.mirror = self.mirror.map(|mirror| !mirror);
    }

    /// The map after the turn, of an old one; the offset stays.
    fn map(self, old: &AssetMap) -> AssetMap {
        let mut map = *old;
        if self.quarter {
            (map.rows, map.cols) = (old.cols, old.rows);
            map.texel_sizes = [old.texel_sizes[1], old.texel_sizes[0]];
            map.shift = [old.shift[1], old.shift[0].saturating_neg()];
        }
        for (shift, mirror) in map.shift.iter_mut().zip(self.mirror) {
            if mirror {
                *shift = shift.saturating_neg();
            }
        }
        map
    }

    /// Indices within the old map of the texels of the new one, row by row.
    fn sources(self, old: &AssetMap) -> impl Iterator<Item = usize> {
        let (rows, cols) = if self.quarter { (old.cols, old.rows) } else { (old.rows, old.cols) };
        let old = *old;
        (0..rows.into())
            .flat_map(move |row| (0..cols.into()).map(move |col| (row, col)))
            .map(move |(row, col)| self.source(&old, row, col))
    }

    /// Index within the old map of a texel of the new one.
    fn source(self, old: &AssetMap, row: usize, col: usize) -> usize {
        let new = self.map(old);
        let [rows, cols] = [new.rows, new.cols].map(usize::from);
        let row = if self.mirror[0] { rows - 1 - row } else { row };
        let col = if self.mirror[1] { cols - 1 - col } else { col };
        if self.quarter { (cols - 1 - col) * rows + row } else { row * cols + col }
    }
}

/// How a splat gets into the orientation of lossy files.
struct Orientation {
    turn: Turn,
    /// The unit quaternion wxyz, and what it was multiplied with from the right.
    rotation: [f64; 4],
    change: [f64; 4],
}

impl Orientation {
    fn of(asset: &SplatAsset, splat: usize) -> Self {
        let q = asset.rotations[splat].map(f64::from);
        let length = norm(q);
        let q = q.map(|c| c / length);
        let mut found = Self { turn: Turn::default(), rotation: q, change: [1.0, 0.0, 0.0, 0.0] };
        if asset.scales[splat][0] < asset.scales[splat][1] {
            found.turn.quarter = true;
            found.change_by(QUARTER_N);
        }
        let [w, _, _, z] = found.rotation;
        if w * w + z * z < 0.5 {
            found.turn.half_around_u();
            found.change_by(HALF_U);
        }
        if found.rotation[3].abs() > found.rotation[0].abs() {
            found.turn.half_around_n();
            found.change_by(HALF_N);
        }
        if found.rotation[0] < 0.0 {
            found.change_by([-1.0, 0.0, 0.0, 0.0]);
        }
        found
    }

    fn change_by(&mut self, by: [f64; 4]) {
        self.rotation = product(self.rotation, by);
        self.change = product(self.change, by);
    }

    /// Standard deviations or texel sizes after the change, or before it.
    fn swapped(&self, [u, v]: [f32; 2]) -> [f32; 2] {
        if self.turn.quarter { [v, u] } else { [u, v] }
    }
}

/// The asset with its splats in the orientation of lossy files; it looks the same, to the rounding of quaternions.
pub fn oriented(asset: &SplatAsset) -> SplatAsset {
    let mut out = asset.clone();
    for splat in 0..asset.num_splats() {
        let found = Orientation::of(asset, splat);
        out.scales[splat] = found.swapped(asset.scales[splat]);
        out.rotations[splat] = found.rotation.map(|c| c as f32);
        let old = &asset.maps[splat];
        out.maps[splat] = found.turn.map(old);
        let texels = asset.texels_of(splat).as_chunks::<3>().0;
        let to = out.texels[3 * old.offset_texels as usize..].as_chunks_mut::<3>().0;
        for (to, source) in to.iter_mut().zip(found.turn.sources(old)) {
            *to = texels[source];
        }
    }
    out
}

/// `asset` with the numbers of `from`, which was made of its [`oriented`] form and holds its splats in this order.
pub fn as_given(asset: &SplatAsset, (from, order): (&SplatAsset, &[u32])) -> SplatAsset {
    let mut out = asset.clone();
    for (place, &splat) in order.iter().enumerate() {
        let splat = splat as usize;
        let found = Orientation::of(asset, splat);
        out.positions[splat] = from.positions[place];
        out.scales[splat] = found.swapped(from.scales[place]);
        out.opacities[splat] = from.opacities[place];
        let rotation = product(from.rotations[place].map(f64::from), conjugate(found.change));
        out.rotations[splat] = rotation.map(|c| c as f32);
        let width = from.sh_of(place).len();
        out.sh[splat * width..][..width].copy_from_slice(from.sh_of(place));
        let map = &mut out.maps[splat];
        map.texel_sizes = found.swapped(from.maps[place].texel_sizes);
        let texels = from.texels_of(place).as_chunks::<3>().0;
        let to = out.texels[3 * map.offset_texels as usize..].as_chunks_mut::<3>().0;
        for (texel, source) in texels.iter().zip(found.turn.sources(map)) {
            to[source] = *texel;
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::asset::tests::fixture;
    use crate::math::quaternion::turned;

    /// Colours of a splat's texels with their places in the local frame; without a map, the ends of its axes with the
    /// standard deviations. Sorted.
    fn surface(asset: &SplatAsset, splat: usize) -> Vec<[f64; 6]> {
        let q = asset.rotations[splat].map(f64::from);
        let map = &asset.maps[splat];
        let mut all: Vec<[f64; 6]> = Vec::new();
        for (axis, sign) in [(0, -1.0), (0, 1.0), (1, -1.0), (1, 1.0)] {
            let mut end = [0.0; 3];
            end[axis] = sign * f64::from(asset.scales[splat][axis]);
            let [x, y, z] = turned(q, end);
            all.push([x, y, z, 0.0, 0.0, 0.0]);
        }
        for (i, texel) in asset.texels_of(splat).as_chunks::<3>().0.iter().enumerate() {
            let place = [i / usize::from(map.cols), i % usize::from(map.cols)];
            let along =
                |axis: usize| (place[axis] as f64 - map.middle(axis)) * f64::from(map.texel_sizes[axis]);
            let [x, y, z] = turned(q, [along(0), along(1), 0.0]);
            let [r, g, b] = texel.map(f64::from);
            all.push([x, y, z, r, g, b]);
        }
        let key = |p: &[f64; 6]| p.map(|c| (c * 1e4).round() as i64);
        all.sort_by_key(key);
        all
    }

    /// The splats of an asset in another order.
    fn shuffled(asset: &SplatAsset, order: &[u32]) -> SplatAsset {
        let mut out = SplatAsset { texels: Vec::new(), sh: Vec::new(), ..asset.clone() };
        for (place, splat) in order.iter().map(|&splat| splat as usize).enumerate() {
            out.positions[place] = asset.positions[splat];
            out.rotations[place] = asset.rotations[splat];
            out.scales[place] = asset.scales[splat];
            out.opacities[place] = asset.opacities[splat];
            out.maps[place] = AssetMap { offset_texels: out.num_texels() as u32, ..asset.maps[splat] };
            out.texels.extend(asset.texels_of(splat));
            out.sh.extend(asset.sh_of(splat));
        }
        out
    }

    #[test]
    fn splats_look_the_same_in_their_new_orientation_and_turn_back() {
        let mut asset = fixture(60, 1);
        for (splat, map) in asset.maps.iter_mut().enumerate() {
            if map.num_texels() > 0 {
                map.shift = [splat as i16 % 5 - 2, splat as i16 % 3];
            }
        }
        let out = oriented(&asset);
        let (mut changed, mut controls) = (0, 0);
        for splat in 0..asset.num_splats() {
            let (before, after) = (surface(&asset, splat), surface(&out, splat));
            let worst = before.iter().zip(&after).flat_map(|(a, b)| (0..6).map(|c| (a[c] - b[c]).abs()));
            // Needed 2e-7.
            assert!(worst.fold(0.0, f64::max) < 1e-6, "splat {splat}: {before:?} {after:?}");
            let [w, x, y, z] = out.rotations[splat].map(f64::from);
            assert!(out.scales[splat][0] >= out.scales[splat][1]);
            assert!(w >= z.abs() - 1e-7 && w * w + z * z >= x * x + y * y - 1e-6);
            changed += usize::from(asset.rotations[splat] != out.rotations[splat]);
            // Negative control: the splat with its map as it was.
            if asset.maps[splat].num_texels() > 1 && asset.scales[splat][0] < asset.scales[splat][1] {
                let mut other = out.clone();
                other.maps[splat] = asset.maps[splat];
                assert_ne!(surface(&other, splat), after);
                controls += 1;
            }
        }
        assert!(changed > 20 && controls > 5, "{changed} {controls}");
        // And back, from another order.
        let order: Vec<u32> = (0..60).map(|place| (7 * place + 3) % 60).collect();
        let shuffled = shuffled(&out, &order);
        let back = as_given(&asset, (&shuffled, &order));
        for splat in 0..asset.num_splats() {
            let (q, r) = (asset.rotations[splat], back.rotations[splat]);
            let length = norm(q.map(f64::from)) as f32;
            // Needed 2e-7.
            assert!((0..4).all(|c| (q[c] / length - r[c]).abs() < 1e-6), "splat {splat}: {q:?} {r:?}");
        }
        let given = |asset: SplatAsset| {
            (asset.positions, asset.scales, asset.opacities, asset.sh, asset.maps, asset.texels)
        };
        assert_eq!(given(back), given(asset.clone()));
        // Negative control: in the order of the asset.
        assert_ne!(given(as_given(&asset, (&out, &order))), given(asset));
        // Nothing is left to turn.
        let again = oriented(&out);
        assert_eq!((again.maps, again.texels, again.scales), (out.maps, out.texels, out.scales));
    }

    #[test]
    fn a_rotation_is_its_swing_after_its_twist() {
        for q in [[0.5, -0.5, 0.5, 0.5], [0.0, 0.6, 0.8, 0.0], [-0.1, 0.7, 0.1, 0.7]] {
            let length = norm(q);
            let q = q.map(|c| c / length);
            let found = SwingTwist::of(q).quaternion();
            let dot: f64 = (0..4).map(|c| q[c] * found[c]).sum();
            assert!((dot.abs() - 1.0).abs() < 1e-15, "{q:?} {found:?}");
        }
    }
}
