//! Reads the texels of maps from pages, row by row. Memory goes to the texels that maps use, never to whole pages: a few
//! bytes of a compressed page may claim many texels that nothing uses.

use super::Atlas;
use crate::files::limits::with_room;
use crate::{AssetMap, Error, Result};
use std::io::Cursor;
use std::path::Path;

/// A row of a map on its page.
#[derive(Clone, Copy)]
struct MapRow {
    page: u16,
    y: u16,
    x: u16,
    cols: u16,
    /// Index of its first texel in the asset.
    texel: u32,
}

/// The rows of all maps of an asset, ordered by page and from top to bottom.
pub(crate) struct MapRows {
    rows: Vec<MapRow>,
}

/// The texels of an asset that are being read. `[num_texels, 3]`
type Texels<'a> = &'a mut [f32];

impl MapRows {
    /// Bytes of memory that the rows of maps take.
    pub(crate) fn num_bytes(maps: &[AssetMap]) -> u64 {
        maps.iter().map(|m| u64::from(m.rows)).sum::<u64>() * size_of::<MapRow>() as u64
    }

    /// The rows of maps on an atlas that passed [`Atlas::check`].
    ///
    /// # Errors
    /// [`Error::TooLarge`] if allocation fails.
    pub(crate) fn new(atlas: &Atlas, maps: &[AssetMap]) -> Result<Self> {
        let mut rows = with_room(maps.iter().map(|m| usize::from(m.rows)).sum())?;
        for (map, at) in maps.iter().zip(&atlas.placements).filter(|(m, _)| m.num_texels() > 0) {
            rows.extend((0..map.rows).map(|row| MapRow {
                page: at.page,
                y: at.y + row,
                x: at.x,
                cols: map.cols,
                texel: map.offset_texels + u32::from(row) * u32::from(map.cols),
            }));
        }
        rows.sort_unstable_by_key(|r: &MapRow| (r.page, r.y, r.x));
        Ok(Self { rows })
    }

    /// The rows on one page; none: nothing uses it.
    pub(crate) fn on_page(&self, page: usize) -> PageRows<'_> {
        let [first, end] = [page, page + 1].map(|p| self.rows.partition_point(|r| usize::from(r.page) < p));
        PageRows(&self.rows[first..end])
    }
}

/// The rows of maps on one page, from top to bottom.
#[derive(Clone, Copy)]
pub(crate) struct PageRows<'a>(&'a [MapRow]);

impl PageRows<'_> {
    pub(crate) fn is_empty(self) -> bool {
        self.0.is_empty()
    }

    /// The rows of maps that lie on a row of the page.
    fn at(self, y: usize) -> impl Iterator<Item = (std::ops::Range<usize>, usize)> {
        let [first, end] = [y, y + 1].map(|y| self.0.partition_point(|r| usize::from(r.y) < y));
        self.0[first..end]
            .iter()
            .map(|r| (usize::from(r.x)..usize::from(r.x) + usize::from(r.cols), r.texel as usize))
    }

    /// Copies from a page of raw f32 RGB, little-endian, which must be long enough.
    pub(crate) fn copy_raw(self, bytes: &[u8], width: u16, texels: Texels<'_>) {
        let page = bytes.as_chunks::<4>().0;
        for row in self.0 {
            let first = 3 * (usize::from(row.y) * usize::from(width) + usize::from(row.x));
            let (count, to) = (3 * usize::from(row.cols), 3 * row.texel as usize);
            for (texel, bytes) in texels[to..to + count].iter_mut().zip(&page[first..first + count]) {
                *texel = f32::from_le_bytes(*bytes);
            }
        }
    }

    /// Copies from a PNG of 8-bit RGB, decoding codes by a table. `path` is only for messages.
    ///
    /// # Errors
    /// [`Error::Invalid`] if it is damaged, interlaced or of another size or kind.
    pub(crate) fn copy_png(
        self,
        bytes: &[u8],
        size: [u16; 2],
        decode: &[f32; 256],
        texels: Texels<'_>,
        path: &Path,
    ) -> Result<()> {
        let failed = |e: png::DecodingError| invalid!(path, "PNG: {e}");
        let mut decoder = png::Decoder::new(Cursor::new(bytes));
        decoder.set_transformations(png::Transformations::IDENTITY);
        decoder.set_limits(png::Limits { bytes: 1 << 20 });
        let mut reader = decoder.read_info().map_err(failed)?;
        let info = reader.info();
        let found = ([info.width, info.height], info.color_type, info.bit_depth, info.interlaced);
        if found != (size.map(u32::from), png::ColorType::Rgb, png::BitDepth::Eight, false) {
            let what =
                format!("PNG: {found:?} (interlaced), expected {size:?} RGB of 8 bits, not interlaced");
            return Err(Error::invalid(path, what));
        }
        for y in 0..usize::from(size[1]) {
            let row = reader.next_row().map_err(failed)?;
            let row = row.ok_or_else(|| invalid!(path, "PNG: row {y} is missing"))?;
            for (columns, texel) in self.at(y) {
                let codes = &row.data()[3 * columns.start..3 * columns.end];
                for (texel, code) in texels[3 * texel..].iter_mut().zip(codes) {
                    *texel = decode[usize::from(*code)];
                }
            }
        }
        reader.finish().map_err(failed)
    }

    /// Copies from an OpenEXR image of one layer in scan lines, with channels R, G and B of f32. `path` is only for messages.
    ///
    /// # Errors
    /// [`Error::Invalid`] if it is damaged or of another size or kind.
    pub(crate) fn copy_exr(
        self,
        bytes: &[u8],
        size: [u16; 2],
        texels: Texels<'_>,
        path: &Path,
    ) -> Result<()> {
        use exr::block::UncompressedBlock;
        use exr::block::reader::ChunksReader as _;
        let failed = |e: exr::error::Error| invalid!(path, "EXR: {e}");
        let reader = exr::block::read(Cursor::new(bytes), false).map_err(failed)?;
        check_exr(reader.headers(), size.map(usize::from)).map_err(|what| Error::invalid(path, what))?;
        let channels = reader.headers()[0].channels.clone();
        // Channels are sorted by name: B, G, R.
        let mut copy = |block: UncompressedBlock| {
            for line in block.lines(&channels) {
                let samples = line.value.as_chunks::<4>().0;
                for (columns, texel) in self.at(line.location.position.1) {
                    for (i, bytes) in samples.get(columns).unwrap_or_default().iter().enumerate() {
                        texels[3 * (texel + i) + 2 - line.location.channel] = f32::from_ne_bytes(*bytes);
                    }
                }
            }
            Ok(())
        };
        let chunks = reader.all_chunks(false).map_err(failed)?;
        chunks.decompress_sequential(false, |_, block| copy(block)).map_err(failed)
    }
}

fn check_exr(headers: &[exr::meta::header::Header], [width, height]: [usize; 2]) -> Result<(), String> {
    use exr::meta::BlockDescription;
    use exr::meta::attribute::SampleType;
    let [header] = headers else { return Err(format!("EXR: {} layers, expected one", headers.len())) };
    let exr::math::Vec2(found_width, found_height) = header.layer_size;
    if (found_width, found_height) != (width, height) {
        return Err(format!("EXR: {found_width} x {found_height} texels, expected {width} x {height}"));
    }
    let channels = &header.channels.list;
    let is_plain = |c: &exr::meta::attribute::ChannelDescription| {
        c.sample_type == SampleType::F32 && c.sampling == exr::math::Vec2(1, 1)
    };
    let is_rgb = channels.len() == 3 && channels.iter().zip(["B", "G", "R"]).all(|(c, name)| c.name == *name);
    if header.deep
        || header.blocks != BlockDescription::ScanLines
        || !is_rgb
        || !channels.iter().all(is_plain)
    {
        return Err("EXR: expected scan lines with channels R, G and B of f32".to_owned());
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::super::{Placement, encode_exr, encode_png};
    use super::*;

    /// Two maps on a page of 40 x 17, of 3 rows x 5 columns and 17 x 1.
    fn two_maps() -> (Atlas, Vec<AssetMap>) {
        let map = |offset_texels, rows, cols| AssetMap {
            offset_texels,
            rows,
            cols,
            texel_sizes: [1.0; 2],
            ..AssetMap::default()
        };
        let at = |x, y| Placement { page: 0, x, y };
        let atlas = Atlas { placements: vec![at(7, 2), at(39, 0)], pages: vec![[40, 17]], border: 0 };
        (atlas, vec![map(0, 3, 5), map(15, 17, 1)])
    }

    /// What the maps should hold, taken from a whole page.
    fn expected(page: &[f32]) -> Vec<u32> {
        let small = (2..5).flat_map(|y| (7..12).map(move |x| (x, y)));
        let places = small.chain((0..17).map(|y| (39, y)));
        let texel = |(x, y): (usize, usize)| page[3 * (40 * y + x)..][..3].iter().map(|v| v.to_bits());
        places.flat_map(texel).collect()
    }

    #[test]
    fn maps_are_read_bit_for_bit_and_damaged_pages_are_errors() {
        let path = Path::new("page");
        let (atlas, maps) = two_maps();
        let rows = MapRows::new(&atlas, &maps).unwrap();
        let page = rows.on_page(0);
        assert!(rows.on_page(1).is_empty() && !page.is_empty());
        let codes: Vec<u8> = (0..3 * 40 * 17).map(|i| (i * 37 % 251) as u8).collect();
        let table: [f32; 256] = std::array::from_fn(|code| code as f32 / 127.0 - 1.0);
        let mut floats: Vec<f32> = codes.iter().map(|&b| table[usize::from(b)]).collect();
        floats[3 * (40 * 2 + 7)..][..3].copy_from_slice(&[-0.0, f32::MIN_POSITIVE, 1e-42]);
        let decoded: Vec<f32> = codes.iter().map(|&b| table[usize::from(b)]).collect();

        let png = encode_png([40, 17], &codes).unwrap();
        let exr = encode_exr([40, 17], &floats).unwrap();
        let raw: Vec<u8> = floats.iter().flat_map(|v| v.to_le_bytes()).collect();
        let bits = |texels: &[f32]| texels.iter().map(|v| v.to_bits()).collect::<Vec<_>>();
        let mut texels = vec![9.0; 3 * 32];
        page.copy_png(&png, [40, 17], &table, &mut texels, path).unwrap();
        assert_eq!(bits(&texels), expected(&decoded));
        texels.fill(9.0);
        page.copy_exr(&exr, [40, 17], &mut texels, path).unwrap();
        assert_eq!(bits(&texels), expected(&floats));
        texels.fill(9.0);
        page.copy_raw(&raw, 40, &mut texels);
        assert_eq!(bits(&texels), expected(&floats));

        assert!(page.copy_png(&png, [17, 40], &table, &mut texels, path).is_err(), "another size");
        assert!(page.copy_exr(&exr, [17, 40], &mut texels, path).is_err(), "another size");
        for share in 0..50 {
            let cut = |file: &[u8]| file[..file.len() * share / 50].to_vec();
            assert!(page.copy_png(&cut(&png), [40, 17], &table, &mut texels, path).is_err(), "{share} of 50");
            assert!(page.copy_exr(&cut(&exr), [40, 17], &mut texels, path).is_err(), "{share} of 50");
        }
    }
}
