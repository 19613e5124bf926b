//! Detects truncated JPEG files, whose missing part the decoder silently fills with grey. Some programs close a file that
//! was cut off with an end-of-image marker. Such a progressive file is detected if whole scans are missing. Where data is
//! missing within the last scan only, or the file is not progressive, nothing short of decoding tells, and the decoder
//! does not report it.

use super::jpeg_frame::{END_OF_IMAGE, Frame, START_OF_IMAGE, START_OF_SCAN, is_bare, is_frame};
use super::photos::FILE_BYTES_MAX;
use crate::{Error, Result, input_file};
use std::fs::File;
use std::io::Read as _;
use std::path::Path;

/// Coefficients of a block.
const COEFFICIENTS: usize = 64;

/// Whether a file is a JPEG that ends before its end-of-image marker, or a progressive one that lacks scans.
pub(crate) fn is_cut_off(path: &Path) -> Result<bool> {
    let mut start = Vec::new();
    // Files of other kinds are not read whole.
    let read = File::open(path).and_then(|file| file.take(2).read_to_end(&mut start));
    read.map_err(|e| Error::io(path, e))?;
    Ok(start == [0xff, START_OF_IMAGE] && is_incomplete(&input_file::read(path, FILE_BYTES_MAX)?))
}

/// What the scans of a progressive file have delivered: for each component its identifier and, for each coefficient, how
/// many low bits are missing.
struct Delivered(Vec<(u8, [u8; COEFFICIENTS])>);

impl Delivered {
    /// Nothing yet.
    fn nothing(frame: &Frame) -> Self {
        Self(frame.components.iter().map(|&(id, ..)| (id, [u8::MAX; COEFFICIENTS])).collect())
    }

    /// Takes note of a scan, from the segment of its header without the length (T.81, B.2.3).
    fn add(&mut self, scan: &[u8]) {
        let Some((&num, rest)) = scan.split_first() else { return };
        let Some((selectors, &[first, last, bits])) = rest.split_at_checked(2 * usize::from(num)) else {
            return;
        };
        let (first, last) = (usize::from(first), usize::from(last).min(COEFFICIENTS - 1));
        for (id, missing_bits) in &mut self.0 {
            if selectors.chunks_exact(2).any(|selector| selector[0] == *id)
                && let Some(band) = missing_bits.get_mut(first..=last)
            {
                band.fill(bits & 15);
            }
        }
    }

    fn is_all(&self) -> bool {
        self.0.iter().all(|(_, missing_bits)| missing_bits.iter().all(|&bits| bits == 0))
    }
}

/// Walks over segments and scans; other bytes than those of a JPEG file lack nothing.
fn is_incomplete(bytes: &[u8]) -> bool {
    if !bytes.starts_with(&[0xff, START_OF_IMAGE]) {
        return false;
    }
    let mut delivered = None;
    let mut at = 2;
    loop {
        // To the next marker: entropy-coded bytes lie between scans, fill bytes before markers.
        let Some(found) = bytes[at..].iter().position(|&b| b == 0xff) else { return true };
        at += found + 1;
        match bytes.get(at) {
            None => return true,
            Some(&END_OF_IMAGE) => return delivered.is_some_and(|delivered: Delivered| !delivered.is_all()),
            // A fill byte.
            Some(0xff) => {}
            // A stuffed byte, or a marker without a length.
            Some(&marker) if marker == 0 || is_bare(marker) => at += 1,
            Some(&marker) => {
                let Some(length) = bytes.get(at + 1..at + 3) else { return true };
                let end = at + 1 + usize::from(u16::from_be_bytes([length[0], length[1]]));
                if end >= bytes.len() {
                    return true;
                }
                let segment = bytes.get(at + 3..end).unwrap_or_default();
                if is_frame(marker) {
                    let frame = Frame::parse(marker, segment).filter(|frame| frame.is_progressive);
                    delivered = frame.as_ref().map(Delivered::nothing);
                } else if marker == START_OF_SCAN
                    && let Some(delivered) = &mut delivered
                {
                    delivered.add(segment);
                }
                at = end;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use image::ExtendedColorType;
    use image::codecs::jpeg::JpegEncoder;

    fn jpeg() -> Vec<u8> {
        let mut bytes = Vec::new();
        let rgb: Vec<u8> = (0..3 * 64 * 48_u32).map(|i| (i * i % 251) as u8).collect();
        JpegEncoder::new_with_quality(&mut bytes, 95).encode(&rgb, 64, 48, ExtendedColorType::Rgb8).unwrap();
        bytes
    }

    #[test]
    fn truncated_jpegs_are_detected_and_complete_ones_pass() {
        let whole = jpeg();
        assert!(!is_incomplete(&whole));
        for length in 2..whole.len() {
            assert!(is_incomplete(&whole[..length]), "cut at {length} of {}", whole.len());
        }
        let mut trailing = whole.clone();
        trailing.extend(b"a trailer, as some cameras write");
        assert!(!is_incomplete(&trailing));
    }

    #[test]
    fn the_end_marker_of_an_embedded_preview_is_ignored() {
        let whole = jpeg();
        // An application segment that holds a whole small JPEG.
        let preview = [0xff, 0xd8, 0xff, 0xd9];
        let mut bytes = vec![0xff, 0xd8, 0xff, 0xe1, 0, 2 + preview.len() as u8];
        bytes.extend(preview);
        bytes.extend(&whole[2..]);
        assert!(!is_incomplete(&bytes));
        assert!(is_incomplete(&bytes[..bytes.len() / 2]));
    }

    /// A progressive file of two components without entropy-coded data: the headers of its scans, as (components, first
    /// and last coefficient, missing bits).
    fn progressive(scans: &[(&[u8], u8, u8, u8)]) -> Vec<u8> {
        let mut bytes =
            vec![0xff, START_OF_IMAGE, 0xff, 0xc2, 0, 14, 8, 0, 16, 0, 16, 2, 1, 0x22, 0, 2, 0x11, 0];
        for &(components, first, last, bits) in scans {
            bytes.extend([0xff, START_OF_SCAN, 0, 6 + 2 * components.len() as u8, components.len() as u8]);
            components.iter().for_each(|&id| bytes.extend([id, 0]));
            bytes.extend([first, last, bits, 0x12, 0xff, 0, 0x34]);
        }
        bytes.extend([0xff, END_OF_IMAGE]);
        bytes
    }

    #[test]
    fn progressive_files_that_lack_scans_are_detected_despite_their_end_marker() {
        let scans: [(&[u8], u8, u8, u8); 5] =
            [(&[1, 2], 0, 0, 1), (&[2], 1, 63, 0), (&[1], 1, 5, 0), (&[1], 6, 63, 0), (&[1, 2], 0, 0, 0x10)];
        assert!(!is_incomplete(&progressive(&scans)));
        for count in 0..scans.len() {
            assert!(is_incomplete(&progressive(&scans[..count])), "{count} of {} scans", scans.len());
        }
        let damaged: [(&[u8], u8, u8, u8); 1] = [(&[1, 2], 70, 3, 0)];
        assert!(is_incomplete(&progressive(&damaged)));
    }

    #[test]
    fn files_that_are_not_jpeg_pass() {
        assert!(!is_incomplete(b"\x89PNG\r\n\x1a\n") && !is_incomplete(b""));
    }
}
