//! The frame header of a JPEG file: components, their sampling, and whether the file is progressive. Markers are those of
//! ITU-T T.81, table B.1.

use std::fs::File;
use std::io::{BufReader, Read};
use std::path::Path;

pub(crate) const START_OF_IMAGE: u8 = 0xd8;
pub(crate) const END_OF_IMAGE: u8 = 0xd9;
pub(crate) const START_OF_SCAN: u8 = 0xda;
const PROGRESSIVE: [u8; 2] = [0xc2, 0xca];

/// What the frame header says.
#[derive(Debug, PartialEq)]
pub(crate) struct Frame {
    pub is_progressive: bool,
    pub width_px: u16,
    pub height_px: u16,
    /// Identifier, and sampling factors along x and y.
    pub components: Vec<(u8, u8, u8)>,
}

/// Whether a marker begins a frame header. Three in the range are others: Huffman tables, extensions, arithmetic coding.
pub(crate) fn is_frame(marker: u8) -> bool {
    (0xc0..=0xcf).contains(&marker) && !matches!(marker, 0xc4 | 0xc8 | 0xcc)
}

/// Whether neither a length nor content follows a marker.
pub(crate) fn is_bare(marker: u8) -> bool {
    matches!(marker, 0x01 | 0xd0..=0xd8)
}

impl Frame {
    /// From the segment of a frame marker, without its length.
    pub fn parse(marker: u8, segment: &[u8]) -> Option<Self> {
        let [_precision, y0, y1, x0, x1, num, rest @ ..] = segment else { return None };
        let components = rest.chunks_exact(3).take(usize::from(*num)).map(|c| (c[0], c[1] >> 4, c[1] & 15));
        Some(Self {
            is_progressive: PROGRESSIVE.contains(&marker),
            width_px: u16::from_be_bytes([*x0, *x1]),
            height_px: u16::from_be_bytes([*y0, *y1]),
            components: components.collect(),
        })
    }

    /// The first frame header of a file; `None` for files that are not JPEG or have none.
    pub fn of_file(path: &Path) -> Option<Self> {
        Self::read(BufReader::new(File::open(path).ok()?))
    }

    fn read(mut file: impl Read) -> Option<Self> {
        let mut start = [0; 2];
        file.read_exact(&mut start).ok()?;
        if start != [0xff, START_OF_IMAGE] {
            return None;
        }
        loop {
            let marker = next_marker(&mut file)?;
            if is_bare(marker) {
                continue;
            }
            if matches!(marker, END_OF_IMAGE | START_OF_SCAN) {
                return None;
            }
            let mut length = [0; 2];
            file.read_exact(&mut length).ok()?;
            let length = usize::from(u16::from_be_bytes(length)).checked_sub(2)?;
            let mut segment = vec![0; length];
            file.read_exact(&mut segment).ok()?;
            if is_frame(marker) {
                return Self::parse(marker, &segment);
            }
        }
    }

    /// Memory for the coefficients, two bytes each, of all components. A progressive file is decoded from all of them,
    /// others row by row.
    pub fn coefficient_bytes(&self) -> u64 {
        const BLOCK_SIDE: u64 = 8;
        if !self.is_progressive {
            return 0;
        }
        let largest = |factor: fn(&(u8, u8, u8)) -> u8| {
            u64::from(self.components.iter().map(factor).max().unwrap_or(1).max(1))
        };
        let units = |side_px: u16, factor: u64| u64::from(side_px).div_ceil(BLOCK_SIDE * factor);
        let blocks: u64 = self.components.iter().map(|&(_, h, v)| u64::from(h) * u64::from(v)).sum();
        units(self.width_px, largest(|c| c.1))
            * units(self.height_px, largest(|c| c.2))
            * blocks
            * BLOCK_SIDE.pow(2)
            * 2
    }
}

/// The next marker, behind fill bytes.
fn next_marker(file: &mut impl Read) -> Option<u8> {
    let mut byte = [0];
    let mut is_prefixed = false;
    loop {
        file.read_exact(&mut byte).ok()?;
        match byte[0] {
            0xff => is_prefixed = true,
            0 => is_prefixed = false,
            marker if is_prefixed => return Some(marker),
            _ => {}
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use image::ExtendedColorType;
    use image::codecs::jpeg::JpegEncoder;

    /// A frame header of 8 bits with these components.
    fn header(marker: u8, (width, height): (u16, u16), components: &[[u8; 3]]) -> Vec<u8> {
        // An application segment first, with a marker in it.
        let mut bytes = vec![0xff, START_OF_IMAGE, 0xff, 0xe1, 0, 4, 0xff, 0xc0];
        bytes.extend([0xff, 0xff, marker, 0, 8 + 3 * components.len() as u8, 8]);
        bytes.extend(height.to_be_bytes());
        bytes.extend(width.to_be_bytes());
        bytes.push(components.len() as u8);
        bytes.extend(components.concat());
        bytes
    }

    #[test]
    fn coefficients_count_whole_units_of_every_component_and_only_in_progressive_files() {
        // 4:2:0: 2 x 2 blocks of luma and one of each chroma in 16 x 16 pixels.
        let components = [[1, 0x22, 0], [2, 0x11, 1], [3, 0x11, 1]];
        let progressive = Frame::read(&header(0xc2, (33, 16), &components)[..]).unwrap();
        assert_eq!(progressive.components, [(1, 2, 2), (2, 1, 1), (3, 1, 1)]);
        assert_eq!(progressive.coefficient_bytes(), 3 * 6 * 64 * 2);
        let grey = Frame::read(&header(0xc2, (33, 16), &components[1..2])[..]).unwrap();
        assert_eq!(grey.coefficient_bytes(), 5 * 2 * 64 * 2);
        let baseline = Frame::read(&header(0xc0, (33, 16), &components)[..]).unwrap();
        assert_eq!((baseline.coefficient_bytes(), baseline.width_px, baseline.height_px), (0, 33, 16));
    }

    #[test]
    fn other_and_damaged_files_have_no_frame() {
        let whole = header(0xc2, (33, 16), &[[1, 0x11, 0]]);
        for length in 0..whole.len() {
            assert_eq!(Frame::read(&whole[..length]), None, "cut at {length}");
        }
        assert_eq!(Frame::read(&b"\x89PNG\r\n\x1a\n"[..]), None);
        let mut encoded = Vec::new();
        JpegEncoder::new(&mut encoded).encode(&[9; 3 * 20 * 10], 20, 10, ExtendedColorType::Rgb8).unwrap();
        let frame = Frame::read(&encoded[..]).unwrap();
        assert_eq!((frame.width_px, frame.height_px, frame.is_progressive), (20, 10, false));
    }
}
