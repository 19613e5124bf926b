//! Texture atlases: maps at their exact sizes on pages, side by side or with a border of zeros between them. Column
//! `x + col` and row `y + row` of a page hold texel `(row, col)` of a map.

mod codes;
mod image;
mod pages;
mod skyline;

pub use codes::{TexelDecode, ZERO};
pub(crate) use image::{encode_exr, encode_png};
pub(crate) use pages::{MapRows, PageRows};
pub use skyline::{Placement, pack};

use crate::{AssetMap, Error, Result, SplatAsset};

/// Default side of a page, texels.
pub const PAGE_SIDE: u16 = 4096;

/// Largest side of a page, texels: what every graphics device supports.
pub const PAGE_SIDE_MAX: u16 = 8192;

/// Pages may have this many texels for each that maps use, and [`SPARE_TEXELS`]: decoding takes time for all of them.
/// Packed pages are mostly full; only where the largest maps meet much smaller ones is much of a page left over.
const PAPER_MAX: u64 = 64;

/// See [`PAPER_MAX`]: one large page.
const SPARE_TEXELS: u64 = 1 << 24;

/// The positions of maps on pages.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Atlas {
    /// Position of each splat's map.
    pub placements: Vec<Placement>,
    /// `[width, height]` of each page.
    pub pages: Vec<[u16; 2]>,
    /// Texels of no map around each, at least.
    pub border: u16,
}

impl Atlas {
    /// Packs the maps of an asset onto pages of at most `side` texels, side by side.
    ///
    /// # Errors
    /// [`Error::TooLarge`] if a map is larger than a page.
    pub fn of(asset: &SplatAsset, side: u16) -> Result<Self> {
        Self::packed(asset, side, 0).ok_or_else(|| {
            let most = asset.maps.iter().map(|m| m.rows.max(m.cols)).max().unwrap_or(0);
            too_large!("", "atlas: maps of up to {most} texels per side on pages of {side}")
        })
    }

    /// [`Self::of`], with a texel of no map around each map if the pages have room for that.
    ///
    /// # Errors
    /// As [`Self::of`].
    pub fn with_border(asset: &SplatAsset, side: u16) -> Result<Self> {
        Self::packed(asset, side, 1).map_or_else(|| Self::of(asset, side), Ok)
    }

    fn packed(asset: &SplatAsset, side: u16, border: u16) -> Option<Self> {
        // Neighbours share what is between them; upper and left edges have a border of their own.
        let wider = |side: u16| if side == 0 { Some(0) } else { side.checked_add(border) };
        let sizes =
            asset.maps.iter().map(|m| Some([wider(m.cols)?, wider(m.rows)?])).collect::<Option<Vec<_>>>()?;
        let (mut placements, mut pages) = pack(&sizes, side.checked_sub(border)?)?;
        pages.iter_mut().flatten().for_each(|side| *side += border);
        for (at, _) in placements.iter_mut().zip(&asset.maps).filter(|(_, map)| map.num_texels() > 0) {
            (at.x, at.y) = (at.x + border, at.y + border);
        }
        Some(Self { placements, pages, border })
    }

    /// Copies texels of 3 numbers each onto pages; what no map covers is `empty`. `[page][height, width, 3]`
    pub fn pages_from_texels<T: Copy>(&self, maps: &[AssetMap], texels: &[T], empty: T) -> Vec<Vec<T>> {
        let floats = |p: &[u16; 2]| 3 * usize::from(p[0]) * usize::from(p[1]);
        let mut pages: Vec<Vec<T>> = self.pages.iter().map(|p| vec![empty; floats(p)]).collect();
        self.for_each_row(maps, |page, on_page, of_texels| {
            pages[page][on_page].copy_from_slice(&texels[of_texels]);
        });
        pages
    }

    /// The texels of the border around all maps, as maps of an atlas of their own, four for each; `None` if a page ends before.
    pub fn borders(&self, maps: &[AssetMap]) -> Option<(Self, Vec<AssetMap>)> {
        let (mut placements, mut strips, mut offset_texels) = (Vec::new(), Vec::new(), 0_u32);
        let b = self.border;
        let textured = maps.iter().zip(&self.placements).filter(|(map, _)| b > 0 && map.num_texels() > 0);
        for (&AssetMap { rows, cols, .. }, &Placement { page, x, y }) in textured {
            let (left, top) = (x.checked_sub(b)?, y.checked_sub(b)?);
            let (right, bottom) = (x.checked_add(cols)?, y.checked_add(rows)?);
            let [width, height] = *self.pages.get(usize::from(page))?;
            if right.checked_add(b)? > width || bottom.checked_add(b)? > height {
                return None;
            }
            let wide = cols + 2 * b;
            for (x, y, rows, cols) in
                [(left, top, b, wide), (left, bottom, b, wide), (left, y, rows, b), (right, y, rows, b)]
            {
                placements.push(Placement { page, x, y });
                strips.push(AssetMap { offset_texels, rows, cols, ..AssetMap::default() });
                offset_texels = offset_texels.checked_add(u32::from(rows) * u32::from(cols))?;
            }
        }
        Some((Self { placements, pages: self.pages.clone(), border: 0 }, strips))
    }

    /// Calls `visit` with page, range of numbers on it and range among the texels, for every row of every map.
    fn for_each_row(
        &self,
        maps: &[AssetMap],
        mut visit: impl FnMut(usize, std::ops::Range<usize>, std::ops::Range<usize>),
    ) {
        for (map, at) in maps.iter().zip(&self.placements).filter(|(m, _)| m.num_texels() > 0) {
            let (page, cols) = (usize::from(at.page), usize::from(map.cols));
            for row in 0..usize::from(map.rows) {
                let width = usize::from(self.pages[page][0]);
                let first = 3 * ((usize::from(at.y) + row) * width + usize::from(at.x));
                let texel = 3 * (map.offset_texels as usize + row * cols);
                visit(page, first..first + 3 * cols, texel..texel + 3 * cols);
            }
        }
    }

    /// Checks that every map lies on a page, that maps are no larger than the pages, and pages not much larger than the
    /// maps. Overlaps are not looked for.
    ///
    /// # Errors
    /// [`Error::Invalid`] naming the splat, [`Error::TooLarge`] for pages that nothing uses; the path is empty.
    pub fn check(&self, maps: &[AssetMap]) -> Result<()> {
        for (splat, (map, at)) in maps.iter().zip(&self.placements).enumerate() {
            if map.num_texels() == 0 {
                continue;
            }
            let page = self.pages.get(usize::from(at.page)).copied().unwrap_or_default();
            let [right, bottom] =
                [(at.x, map.cols), (at.y, map.rows)].map(|(a, b)| u32::from(a) + u32::from(b));
            if right > page[0].into() || bottom > page[1].into() {
                let what = format!(
                    "map of splat {splat}: {} x {} texels at column {}, row {} of page {}, which has {} x {} (columns x rows)",
                    map.cols, map.rows, at.x, at.y, at.page, page[0], page[1]
                );
                return Err(Error::invalid("", what));
            }
        }
        let used: u64 = maps.iter().map(|m| m.num_texels() as u64).sum();
        let paper: u64 = self.pages.iter().map(|p| u64::from(p[0]) * u64::from(p[1])).sum();
        if used > paper {
            return Err(invalid!("", "maps of {used} texels on pages of {paper}: they overlap"));
        }
        let most = used * PAPER_MAX + SPARE_TEXELS;
        if paper > most {
            return Err(too_large!("", "pages of {paper} texels for maps of {used}, at most {most}"));
        }
        Ok(())
    }

    /// The first splat whose map overlaps that of an earlier one; the atlas must have passed [`Atlas::check`].
    pub fn first_overlap(&self, maps: &[AssetMap]) -> Option<usize> {
        // A bit a texel; `check` bounds the pages.
        let mut taken: Vec<Vec<u64>> = vec![Vec::new(); self.pages.len()];
        for (splat, (map, at)) in maps.iter().zip(&self.placements).enumerate() {
            if map.num_texels() == 0 {
                continue;
            }
            let page = self.pages.get(usize::from(at.page))?.map(usize::from);
            let bits = taken.get_mut(usize::from(at.page))?;
            bits.resize((page[0] * page[1]).div_ceil(64), 0);
            for row in 0..usize::from(map.rows) {
                let first = (usize::from(at.y) + row) * page[0] + usize::from(at.x);
                for texel in first..first + usize::from(map.cols) {
                    let (word, bit) = (bits.get_mut(texel / 64)?, 1 << (texel % 64));
                    if *word & bit != 0 {
                        return Some(splat);
                    }
                    *word |= bit;
                }
            }
        }
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::asset::tests::fixture;

    #[test]
    fn texels_round_trip_through_pages() {
        let asset = fixture(200, 0);
        for side in [8, 64] {
            let atlas = Atlas::of(&asset, side).unwrap();
            assert!(side > 8 || atlas.pages.len() > 2);
            atlas.check(&asset.maps).unwrap();
            assert_eq!(atlas.first_overlap(&asset.maps), None);
            let pages = atlas.pages_from_texels(&asset.maps, &asset.texels, 0.0);
            let (rows, mut texels) =
                (MapRows::new(&atlas, &asset.maps).unwrap(), vec![0.0; asset.texels.len()]);
            for (i, page) in pages.iter().enumerate() {
                let bytes: Vec<u8> = page.iter().flat_map(|v| v.to_le_bytes()).collect();
                rows.on_page(i).copy_raw(&bytes, atlas.pages[i][0], &mut texels);
            }
            assert_eq!(texels, asset.texels);
            // Row 2, column 1 of a map of 5 x 3.
            let (map, at) = (&asset.maps[2], atlas.placements[2]);
            assert_eq!((map.rows, map.cols), (5, 3));
            let width = usize::from(atlas.pages[usize::from(at.page)][0]);
            let found =
                pages[usize::from(at.page)][3 * ((usize::from(at.y) + 2) * width + usize::from(at.x) + 1)];
            assert_eq!(found, asset.texels_of(2)[3 * (2 * 3 + 1)]);
        }
        let mut atlas = Atlas::of(&asset, 64).unwrap();
        atlas.placements[2].x = atlas.pages[0][0] - 2;
        assert!(atlas.check(&asset.maps).unwrap_err().to_string().contains("splat 2"));
        atlas.placements[2] = Placement { page: 9, x: 0, y: 0 };
        assert!(atlas.check(&asset.maps).is_err());
        assert!(matches!(Atlas::of(&asset, 4), Err(Error::TooLarge { .. })));
    }

    #[test]
    fn borders_around_maps_are_zero() {
        let asset = fixture(200, 0);
        let are_zero = |atlas: &Atlas| {
            let (strips, maps) = atlas.borders(&asset.maps)?;
            let pages = atlas.pages_from_texels(&asset.maps, &asset.texels, 0.0);
            let mut sum = 0.0;
            strips.for_each_row(&maps, |page, on_page, _| {
                sum += pages[page][on_page].iter().map(|t| t.abs()).sum::<f32>()
            });
            Some(sum == 0.0)
        };
        let atlas = Atlas::with_border(&asset, 64).unwrap();
        atlas.check(&asset.maps).unwrap();
        assert_eq!((atlas.border, atlas.first_overlap(&asset.maps), are_zero(&atlas)), (1, None, Some(true)));
        // Negative controls: a wider border, which pages do not have; another map within it; maps side by side.
        let moved = |at: Placement| Placement { x: at.x + 1, ..at };
        let mut near = atlas.clone();
        let first = (0..200)
            .find(|&i| asset.maps[i].num_texels() > 0 && atlas.placements[i].x + 9 < atlas.pages[0][0])
            .unwrap();
        near.placements[first] = moved(near.placements[first]);
        assert_eq!(are_zero(&near), Some(false));
        assert_eq!(are_zero(&Atlas { border: 2, ..atlas }), None);
        let close = Atlas::of(&asset, 64).unwrap();
        assert_eq!((close.border, are_zero(&Atlas { border: 1, ..close })), (0, None));
        // A map as large as a page leaves no room.
        let map = AssetMap { rows: 64, cols: 64, texel_sizes: [1.0; 2], ..AssetMap::default() };
        let full = SplatAsset { maps: vec![map], texels: vec![0.5; 3 * 64 * 64], ..SplatAsset::default() };
        assert_eq!(Atlas::with_border(&full, 64).unwrap(), Atlas::of(&full, 64).unwrap());
    }

    #[test]
    fn overlapping_maps_and_unused_pages_are_detected() {
        let asset = fixture(200, 0);
        let valid = Atlas::of(&asset, 64).unwrap();
        let mut overlapping = valid.clone();
        overlapping.placements[3] = overlapping.placements[0];
        overlapping.check(&asset.maps).unwrap();
        assert_eq!(overlapping.first_overlap(&asset.maps), Some(3));
        let mut small = valid.clone();
        small.pages.truncate(1);
        small.placements.fill(Placement::default());
        small.pages[0] = [5, 5];
        assert!(small.check(&asset.maps).unwrap_err().to_string().contains("overlap"));
        for (pages, is_sound) in [(1, true), (60, false)] {
            let mut roomy = valid.clone();
            roomy.pages.extend(vec![[4000, 4000]; pages]);
            assert_eq!(roomy.check(&asset.maps).is_ok(), is_sound, "{pages}");
        }
    }

    #[test]
    fn atlases_of_extreme_maps_pass_the_check() {
        let map = |rows, cols| AssetMap { rows, cols, texel_sizes: [1.0; 2], ..AssetMap::default() };
        for side in [PAGE_SIDE, PAGE_SIDE_MAX] {
            let maps = [map(4096, 1), map(1, 4096), map(4096, 1), map(4095, 3), map(2, 4096)];
            let mut asset = crate::SplatAsset { maps: maps.to_vec(), ..Default::default() };
            Atlas::of(&asset, side).unwrap().check(&asset.maps).unwrap();
            asset.maps.truncate(2);
            Atlas::of(&asset, side).unwrap().check(&asset.maps).unwrap();
        }
    }
}
