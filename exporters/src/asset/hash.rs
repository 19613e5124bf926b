//! A content hash: equal for assets that render identically.

use crate::{Filter, SplatAsset};
use std::hash::Hasher as _;
use twox_hash::XxHash3_64;

impl SplatAsset {
    /// xxh3-64 of everything that renders depend on, little-endian: number of splats and filter (u32 each; 0: none, 1: ewa),
    /// near plane, positions, rotations, scales, opacities; SH degrees (u8); SH up to the degree of each splat; rows, columns
    /// (u16), texel sizes and shift (i16) of each map; texels.
    pub fn hash(&self) -> u64 {
        Self::hash_of(self, std::slice::from_ref(self))
    }

    /// The hash of an asset whose splats are those of the `parts`, in order; near plane and filter are those of `whole`.
    pub(crate) fn hash_of(whole: &Self, parts: &[Self]) -> u64 {
        let mut hasher = XxHash3_64::new();
        let num_splats: usize = parts.iter().map(Self::num_splats).sum();
        hasher.write(&(num_splats as u32).to_le_bytes());
        hasher.write(&u32::from(whole.filter == Filter::Ewa).to_le_bytes());
        floats(&mut hasher, &[whole.near]);
        parts.iter().for_each(|part| floats(&mut hasher, part.positions.as_flattened()));
        parts.iter().for_each(|part| floats(&mut hasher, part.rotations.as_flattened()));
        parts.iter().for_each(|part| floats(&mut hasher, part.scales.as_flattened()));
        parts.iter().for_each(|part| floats(&mut hasher, &part.opacities));
        parts.iter().for_each(|part| hasher.write(&part.sh_degrees));
        for part in parts {
            (0..part.num_splats()).for_each(|splat| floats(&mut hasher, part.own_sh_of(splat)));
        }
        for map in parts.iter().flat_map(|part| &part.maps) {
            hasher.write(&map.rows.to_le_bytes());
            hasher.write(&map.cols.to_le_bytes());
            map.texel_sizes.iter().for_each(|k| hasher.write(&k.to_le_bytes()));
            map.shift.iter().for_each(|s| hasher.write(&s.to_le_bytes()));
        }
        parts.iter().for_each(|part| floats(&mut hasher, &part.texels));
        hasher.finish()
    }
}

/// A hash as 16 hexadecimal digits.
pub(crate) fn text_from_hash(hash: u64) -> String {
    format!("{hash:016x}")
}

/// The hash that 16 hexadecimal digits state.
pub(crate) fn hash_from_text(text: &str) -> Option<u64> {
    let is_hash = text.len() == 16 && text.bytes().all(|b| b.is_ascii_hexdigit());
    is_hash.then(|| u64::from_str_radix(text, 16).ok()).flatten()
}

/// Hashes numbers in pieces, to avoid a copy of the whole array.
fn floats(hasher: &mut XxHash3_64, values: &[f32]) {
    for piece in values.chunks(4096) {
        let bytes: Vec<u8> = piece.iter().flat_map(|v| v.to_le_bytes()).collect();
        hasher.write(&bytes);
    }
}

#[cfg(test)]
mod tests {
    use crate::asset::tests::fixture;

    #[test]
    fn the_hash_covers_rendered_values_but_not_titles() {
        let asset = fixture(9, 2);
        let mut titled = asset.clone();
        titled.provenance.title = "Another".into();
        titled.cameras.clear();
        assert_eq!(titled.hash(), asset.hash());
        type Change = fn(&mut crate::SplatAsset);
        let changes: [Change; 12] = [
            |a| a.filter = crate::Filter::Ewa,
            |a| a.positions[8][2] += 1e-6,
            |a| a.rotations[0][3] *= -1.0,
            |a| a.scales[4][1] *= 1.0 + 1e-6,
            |a| a.opacities[8] *= 0.5,
            |a| a.sh[200] += 1e-6,
            |a| a.sh_degrees[4] = 1,
            |a| (a.maps[2].rows, a.maps[2].cols) = (3, 5),
            |a| a.maps[5].texel_sizes[0] *= 1.01,
            |a| a.maps[5].texel_sizes[1] *= 1.01,
            |a| a.maps[5].shift[1] += 1,
            |a| a.texels[50] = 0.0,
        ];
        for (i, change) in changes.iter().enumerate() {
            let mut changed = asset.clone();
            change(&mut changed);
            assert_ne!(changed.hash(), asset.hash(), "change {i}");
        }
    }
}
