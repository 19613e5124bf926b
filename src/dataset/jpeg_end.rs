//! Detects truncated JPEG files, whose missing part the decoder silently fills with grey.

use super::photos::FILE_BYTES_MAX;
use crate::{Result, input_file};
use std::path::Path;

/// Markers, as the second byte after 0xff (ITU-T T.81, table B.1).
const START_OF_IMAGE: u8 = 0xd8;
const END_OF_IMAGE: u8 = 0xd9;
const TEMPORARY: u8 = 0x01;

/// Whether a file is a JPEG that ends before its end-of-image marker.
pub(crate) fn is_cut_off(path: &Path) -> Result<bool> {
    Ok(lacks_its_end(&input_file::read(path, FILE_BYTES_MAX)?))
}

fn is_restart(marker: u8) -> bool {
    (0xd0..=0xd7).contains(&marker)
}

/// Walks over segments and scans; other bytes than those of a JPEG file lack nothing.
fn lacks_its_end(bytes: &[u8]) -> bool {
    if !bytes.starts_with(&[0xff, START_OF_IMAGE]) {
        return false;
    }
    let mut at = 2;
    loop {
        // To the next marker: entropy-coded bytes lie between scans, fill bytes before markers.
        let Some(found) = bytes[at..].iter().position(|&b| b == 0xff) else { return true };
        at += found + 1;
        match bytes.get(at) {
            None => return true,
            Some(&END_OF_IMAGE) => return false,
            // A stuffed byte, a fill byte, or a marker without a length.
            Some(&(0 | TEMPORARY)) => at += 1,
            Some(0xff) => {}
            Some(&marker) if is_restart(marker) => at += 1,
            Some(_) => {
                let Some(length) = bytes.get(at + 1..at + 3) else { return true };
                at += 1 + usize::from(u16::from_be_bytes([length[0], length[1]]));
                if at >= bytes.len() {
                    return true;
                }
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
        assert!(!lacks_its_end(&whole));
        for length in 2..whole.len() {
            assert!(lacks_its_end(&whole[..length]), "cut at {length} of {}", whole.len());
        }
        let mut trailing = whole.clone();
        trailing.extend(b"a trailer, as some cameras write");
        assert!(!lacks_its_end(&trailing));
    }

    #[test]
    fn the_end_marker_of_an_embedded_preview_is_ignored() {
        let whole = jpeg();
        // An application segment that holds a whole small JPEG.
        let preview = [0xff, 0xd8, 0xff, 0xd9];
        let mut bytes = vec![0xff, 0xd8, 0xff, 0xe1, 0, 2 + preview.len() as u8];
        bytes.extend(preview);
        bytes.extend(&whole[2..]);
        assert!(!lacks_its_end(&bytes));
        assert!(lacks_its_end(&bytes[..bytes.len() / 2]));
    }

    #[test]
    fn files_that_are_not_jpeg_pass() {
        assert!(!lacks_its_end(b"\x89PNG\r\n\x1a\n") && !lacks_its_end(b""));
    }
}
