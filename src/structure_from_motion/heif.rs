//! The header of HEIC and AVIF files (ISO/IEC 14496-12 and 23008-12): the size of the photo, upright, and its EXIF data. The
//! pixels are decoded by other programs.

use std::ops::Range;

/// What the header says.
#[derive(Clone, Debug, PartialEq)]
pub struct HeifHeader {
    /// Width and height of the photo after its crop and its turn.
    pub size: (u32, u32),
    /// The TIFF structure of its EXIF data; empty if there is none.
    pub exif: Vec<u8>,
}

/// Reads a header; `None` if it is broken or has no photo.
pub fn read(file: &[u8]) -> Option<HeifHeader> {
    let all = File(file);
    let meta = all.find(0..file.len(), b"meta")?;
    // A full box: version and flags come first.
    let meta = meta.start + 4..meta.end;
    let pitm = all.find(meta.clone(), b"pitm")?;
    let primary = match all.uint(pitm.start, 1)? {
        0 => all.uint(pitm.start + 4, 2)?,
        _ => all.uint(pitm.start + 4, 4)?,
    };
    let properties = all.find(meta.clone(), b"iprp")?;
    let known = all.boxes(all.find(properties.clone(), b"ipco")?);
    let own = all.associations(all.find(properties, b"ipma")?, primary)?;
    let own = own.into_iter().filter_map(|index| known.get(index.checked_sub(1)?));
    let number = |at| u32::try_from(all.uint(at, 4)?).ok();
    let stored = own.clone().rfind(|(kind, _)| *kind == b"ispe");
    let mut size = stored.and_then(|(_, at)| Some((number(at.start + 4)?, number(at.start + 8)?)));
    // Crops and turns apply in the order in which they are listed.
    for (kind, at) in own {
        match *kind {
            b"clap" => {
                let side = |at| {
                    let [above, below] = [all.uint(at, 4)?, all.uint(at + 4, 4)?];
                    u32::try_from((above + below / 2).checked_div(below)?).ok()
                };
                size = Some((side(at.start)?, side(at.start + 8)?));
            }
            b"irot" if all.uint(at.start, 1)? % 2 == 1 => size = size.map(|(w, h)| (h, w)),
            _ => {}
        }
    }
    let size = size.filter(|(width, height)| *width > 0 && *height > 0)?;
    Some(HeifHeader { size, exif: all.exif(meta).unwrap_or_default().to_vec() })
}

struct File<'a>(&'a [u8]);

type Box4<'a> = (&'a [u8; 4], Range<usize>);

impl<'a> File<'a> {
    /// A number of 0 to 8 bytes, big-endian.
    fn uint(&self, at: usize, bytes: usize) -> Option<u64> {
        let bytes = self.0.get(at..at.checked_add(bytes)?)?;
        Some(bytes.iter().fold(0, |number, byte| number << 8 | u64::from(*byte)))
    }

    /// The boxes within a range: their kinds, and where their contents are.
    fn boxes(&self, within: Range<usize>) -> Vec<Box4<'a>> {
        let mut found = Vec::new();
        let mut at = within.start;
        while let Some((kind, content)) = self.box_at(at, within.end) {
            at = content.end;
            found.push((kind, content));
        }
        found
    }

    fn box_at(&self, at: usize, end: usize) -> Option<Box4<'a>> {
        let kind = self.0.get(at.checked_add(4)?..at.checked_add(8)?)?.try_into().ok()?;
        let (size, header) = match self.uint(at, 4)? {
            0 => (end.checked_sub(at)?, 8),
            1 => (usize::try_from(self.uint(at + 8, 8)?).ok()?, 16),
            size => (size as usize, 8),
        };
        let stop = at.checked_add(size)?;
        (size >= header && stop <= end).then(|| (kind, at + header..stop))
    }

    fn find(&self, within: Range<usize>, kind: &[u8; 4]) -> Option<Range<usize>> {
        self.boxes(within).into_iter().find(|(own, _)| *own == kind).map(|(_, content)| content)
    }

    /// The numbers of an item's properties, from 1.
    fn associations(&self, content: Range<usize>, item: u64) -> Option<Vec<usize>> {
        let (version, flags) = (self.uint(content.start, 1)?, self.uint(content.start + 1, 3)?);
        let id_bytes = if version == 0 { 2 } else { 4 };
        let index_bytes = if flags & 1 == 1 { 2 } else { 1 };
        let mut at = content.start + 8;
        for _ in 0..self.uint(content.start + 4, 4)? {
            let id = self.uint(at, id_bytes)?;
            let count = self.uint(at + id_bytes, 1)? as usize;
            at += id_bytes + 1;
            if id == item {
                // The highest bit says whether a reader must know the property.
                let mask = (1_u64 << (8 * index_bytes - 1)) - 1;
                let index = |k| Some((self.uint(at + k * index_bytes, index_bytes)? & mask) as usize);
                return (0..count).map(index).collect();
            }
            at += count * index_bytes;
        }
        None
    }

    /// The TIFF structure of the item of the kind "Exif".
    fn exif(&self, meta: Range<usize>) -> Option<&'a [u8]> {
        let infos = self.find(meta.clone(), b"iinf")?;
        let first = infos.start + if self.uint(infos.start, 1)? == 0 { 6 } else { 8 };
        let item = self.boxes(first..infos.end).into_iter().find_map(|(_, info)| {
            let id_bytes = if self.uint(info.start, 1)? < 3 { 2 } else { 4 };
            let kind = info.start + 4 + id_bytes + 2;
            (self.0.get(kind..kind + 4)? == b"Exif").then(|| self.uint(info.start + 4, id_bytes))?
        })?;
        let content = self.extent(self.find(meta, b"iloc")?, item)?;
        let bytes = self.0.get(content)?;
        // Four bytes say how many follow before the structure.
        let skipped = u32::from_be_bytes(bytes.get(..4)?.try_into().ok()?) as usize;
        bytes.get(skipped.checked_add(4)?..)
    }

    /// Where the first extent of an item is in the file.
    fn extent(&self, content: Range<usize>, item: u64) -> Option<Range<usize>> {
        let version = self.uint(content.start, 1)?;
        let sizes = self.uint(content.start + 4, 2)?;
        let [offset, length, base, index] = [12, 8, 4, 0].map(|shift| (sizes >> shift & 15) as usize);
        let index = if version == 0 { 0 } else { index };
        let id_bytes = if version < 2 { 2 } else { 4 };
        let mut at = content.start + 6 + id_bytes;
        for _ in 0..self.uint(content.start + 6, id_bytes)? {
            let id = self.uint(at, id_bytes)?;
            at += id_bytes;
            let method = if version == 0 { 0 } else { self.uint(at, 2)? & 15 };
            at += if version == 0 { 2 } else { 4 };
            let base_offset = self.uint(at, base)?;
            let extents = self.uint(at + base, 2)? as usize;
            at += base + 2;
            if id == item {
                let start = usize::try_from(base_offset.checked_add(self.uint(at + index, offset)?)?).ok()?;
                let count = usize::try_from(self.uint(at + index + offset, length)?).ok()?;
                return (method == 0).then_some(start..start.checked_add(count)?);
            }
            at += extents * (index + offset + length);
        }
        None
    }
}

#[cfg(test)]
pub mod tests {
    use super::*;
    use crate::structure_from_motion::exif::tests::exif_of;

    fn boxed(kind: &[u8; 4], content: &[u8]) -> Vec<u8> {
        [&(content.len() as u32 + 8).to_be_bytes()[..], kind, content].concat()
    }

    /// A file of a photo of this stored size, turned by a quarter `turns` times, with EXIF data and no pixels.
    pub fn heif(size: (u32, u32), turns: u8) -> Vec<u8> {
        heif_with(size, &boxed(b"irot", &[turns]))
    }

    /// The same with any third property.
    fn heif_with(size: (u32, u32), property: &[u8]) -> Vec<u8> {
        let exif = exif_of("Phone 15", 6, 26);
        let brand = boxed(b"ftyp", b"heic\0\0\0\0heicmif1");
        let tile = [&[0; 4][..], &512_u32.to_be_bytes(), &512_u32.to_be_bytes()].concat();
        let whole = [&[0; 4][..], &size.0.to_be_bytes(), &size.1.to_be_bytes()].concat();
        let known = [boxed(b"ispe", &tile), boxed(b"ispe", &whole), property.to_vec()].concat();
        // Two items: a tile with property 1, the photo with 3 and 2, as some programs order them.
        let links = [&[0, 0, 0, 0, 0, 0, 0, 2][..], &[0, 1, 1, 1], &[0, 2, 2, 0x83, 2]].concat();
        let properties = boxed(b"iprp", &[boxed(b"ipco", &known), boxed(b"ipma", &links)].concat());
        let info =
            |id: u8, kind: &[u8; 4]| boxed(b"infe", &[&[2, 0, 0, 0, 0, id, 0, 0][..], kind, &[0]].concat());
        let infos = [&[0, 0, 0, 0, 0, 2][..], &info(2, b"grid"), &info(3, b"Exif")].concat();
        let meta = |start: u32| {
            let length = exif.len() as u32 + 10;
            let place = [&start.to_be_bytes()[..], &length.to_be_bytes()].concat();
            let locations = [&[0, 0, 0, 0, 0x44, 0, 0, 1, 0, 3, 0, 0, 0, 1][..], &place].concat();
            let content = [
                &[0; 4][..],
                &boxed(b"pitm", &[0, 0, 0, 0, 0, 2]),
                &boxed(b"iinf", &infos),
                &properties,
                &boxed(b"iloc", &locations),
            ];
            boxed(b"meta", &content.concat())
        };
        let start = brand.len() + meta(0).len() + 8;
        let data = boxed(b"mdat", &[&6_u32.to_be_bytes()[..], b"Exif\0\0", &exif].concat());
        [brand, meta(start as u32), data].concat()
    }

    #[test]
    fn the_size_is_that_of_the_whole_photo_upright() {
        let found = read(&heif((4032, 3024), 0)).unwrap();
        assert_eq!((found.size, found.exif), ((4032, 3024), exif_of("Phone 15", 6, 26)));
        assert_eq!(read(&heif((4032, 3024), 3)).unwrap().size, (3024, 4032));
        assert_eq!(read(&heif((0, 3024), 0)), None);
        let crop = |numbers: [u32; 4]| {
            boxed(b"clap", &[numbers.map(u32::to_be_bytes).concat(), vec![0; 16]].concat())
        };
        assert_eq!(read(&heif_with((4032, 3024), &crop([770, 2, 330, 1]))).unwrap().size, (385, 330));
        assert_eq!(read(&heif_with((4032, 3024), &crop([770, 0, 330, 1]))), None);
    }

    #[test]
    fn broken_headers_are_none() {
        let whole = heif((4032, 3024), 1);
        for at in 0..whole.len() {
            let _ = read(&whole[..at]);
            let mut broken = whole.clone();
            broken[at] ^= 0xff;
            let _ = read(&broken);
        }
        assert_eq!(read(&whole[..100]), None);
    }
}
