//! Texture atlases: every map at its exact size, side by side on pages, without gutter. Column `x + col` and row
//! `y + row` of a page hold texel `(row, col)` of a map.

mod codes;
mod image;
mod skyline;

pub use codes::TexelDecode;
pub use image::{decode_exr, decode_png, encode_exr, encode_png};
pub use skyline::{Placement, pack};

use crate::{AssetMap, Error, Result, SplatAsset};

/// Side of a page unless something else is asked for.
pub const PAGE_SIDE: u16 = 4096;

/// Largest side of a page: what graphics devices offer at least.
pub const PAGE_SIDE_MAX: u16 = 8192;

/// Where each map lies.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Atlas {
    /// By splat.
    pub placements: Vec<Placement>,
    /// `[width, height]` of each page.
    pub pages: Vec<[u16; 2]>,
}

impl Atlas {
    /// Packs the maps of an asset onto pages of at most `side` texels.
    ///
    /// # Errors
    /// [`Error::TooLarge`] if a map is larger than a page.
    pub fn of(asset: &SplatAsset, side: u16) -> Result<Self> {
        let sizes: Vec<[u16; 2]> = asset.maps.iter().map(|m| [m.cols, m.rows]).collect();
        let (placements, pages) = pack(&sizes, side).ok_or_else(|| {
            let most = asset.maps.iter().map(|m| m.rows.max(m.cols)).max().unwrap_or(0);
            Error::too_large("", format!("atlas: maps of up to {most} texels a side on pages of {side}"))
        })?;
        Ok(Self { placements, pages })
    }

    /// Lays texels of 3 numbers each, map by map, onto pages. What no map covers is `T::default()`.
    /// `[page][height, width, 3]`
    pub fn pages_from_texels<T: Copy + Default>(&self, maps: &[AssetMap], texels: &[T]) -> Vec<Vec<T>> {
        let floats = |p: &[u16; 2]| 3 * usize::from(p[0]) * usize::from(p[1]);
        let mut pages: Vec<Vec<T>> = self.pages.iter().map(|p| vec![T::default(); floats(p)]).collect();
        self.for_each_row(maps, |page, on_page, of_texels| {
            pages[page][on_page].copy_from_slice(&texels[of_texels]);
        });
        pages
    }

    /// Collects the texels of the maps again. The atlas must have passed [`Atlas::check`].
    pub fn texels_from_pages<T: Copy + Default>(&self, maps: &[AssetMap], pages: &[Vec<T>]) -> Vec<T> {
        let count: usize = maps.iter().map(AssetMap::num_texels).sum();
        let mut texels = vec![T::default(); 3 * count];
        self.for_each_row(maps, |page, on_page, of_texels| {
            texels[of_texels].copy_from_slice(&pages[page][on_page]);
        });
        texels
    }

    /// Calls with page, its range of numbers, and the texels' range, for every row of every map.
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

    /// Checks that every map lies on a page. Overlaps are not looked for.
    ///
    /// # Errors
    /// [`Error::Invalid`] naming the splat; the path is empty.
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
        Ok(())
    }

    /// Share of the pages that maps cover.
    pub fn occupancy(&self, maps: &[AssetMap]) -> f64 {
        let paper: u64 = self.pages.iter().map(|p| u64::from(p[0]) * u64::from(p[1])).sum();
        maps.iter().map(|m| m.num_texels() as u64).sum::<u64>() as f64 / paper.max(1) as f64
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::asset::tests::fixture;

    #[test]
    fn texels_go_onto_pages_and_come_back() {
        let asset = fixture(200, 0);
        for side in [8, 64] {
            let atlas = Atlas::of(&asset, side).unwrap();
            assert!(side > 8 || atlas.pages.len() > 2);
            atlas.check(&asset.maps).unwrap();
            let pages = atlas.pages_from_texels(&asset.maps, &asset.texels);
            assert_eq!(atlas.texels_from_pages(&asset.maps, &pages), asset.texels);
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
}
