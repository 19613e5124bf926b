//! An AVI file (RIFF) of JPEG frames (codec MJPG), which ffmpeg and players read. It is written frame by frame: the header is
//! completed at the end.

use crate::{Error, Result};
use image::{ExtendedColorType, codecs::jpeg::JpegEncoder};
use std::fs::File;
use std::io::{BufWriter, Seek as _, SeekFrom, Write as _};
use std::path::{Path, PathBuf};

/// Quality of the frames: that of a phone's video.
const QUALITY: u8 = 92;

/// Bytes before the first frame.
const HEADER_BYTES: u32 = 224;

/// A file that is being written.
pub struct AviWriter {
    path: PathBuf,
    file: BufWriter<File>,
    size: (u32, u32),
    rate_hz: u32,
    /// Of each frame, from the list of frames on, and its bytes.
    index: Vec<(u32, u32)>,
    at: u32,
}

impl AviWriter {
    /// Begins a file of frames of this size.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub fn create(path: &Path, size: (u32, u32), rate_hz: u32) -> Result<Self> {
        let io = |e| Error::io(path, e);
        let mut file = BufWriter::new(File::create(path).map_err(io)?);
        file.write_all(&[0; HEADER_BYTES as usize]).map_err(io)?;
        Ok(Self { path: path.to_owned(), file, size, rate_hz, index: Vec::new(), at: 4 })
    }

    /// Appends a frame. `rgb`: `[height, width, 3]`
    ///
    /// # Errors
    /// [`Error::Io`].
    pub fn frame(&mut self, rgb: &[u8]) -> Result<()> {
        let io = |e| Error::io(&self.path, e);
        let mut jpeg = Vec::new();
        JpegEncoder::new_with_quality(&mut jpeg, QUALITY)
            .encode(rgb, self.size.0, self.size.1, ExtendedColorType::Rgb8)
            .map_err(|e| io(std::io::Error::other(e)))?;
        let bytes = jpeg.len() as u32;
        // Chunks begin at even bytes.
        jpeg.resize(jpeg.len().next_multiple_of(2), 0);
        let chunk = [&b"00dc"[..], &bytes.to_le_bytes(), &jpeg].concat();
        self.file.write_all(&chunk).map_err(io)?;
        self.index.push((self.at, bytes));
        self.at += chunk.len() as u32;
        Ok(())
    }

    /// Writes the index and the header.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub fn finish(mut self) -> Result<()> {
        let key_frame = 0x10_u32;
        let entries = self.index.iter().flat_map(|(at, bytes)| {
            [&b"00dc"[..], &key_frame.to_le_bytes(), &at.to_le_bytes(), &bytes.to_le_bytes()].concat()
        });
        let index = chunk(b"idx1", &entries.collect::<Vec<u8>>());
        let header = self.header(index.len() as u32);
        let path = self.path.clone();
        let mut write = || {
            self.file.write_all(&index)?;
            self.file.seek(SeekFrom::Start(0))?;
            self.file.write_all(&header)?;
            self.file.flush()
        };
        write().map_err(|e| Error::io(path, e))
    }

    fn header(&self, index_bytes: u32) -> Vec<u8> {
        let words = |words: &[u32]| words.iter().flat_map(|w| w.to_le_bytes()).collect::<Vec<u8>>();
        let (frames, (width, height)) = (self.index.len() as u32, self.size);
        let largest = self.index.iter().map(|(_, bytes)| *bytes).max().unwrap_or(0);
        let has_index = 0x10;
        let main = words(&[
            1_000_000 / self.rate_hz,
            largest * self.rate_hz,
            0,
            has_index,
            frames,
            0,
            1,
            largest,
            width,
            height,
            0,
            0,
            0,
            0,
        ]);
        let stream = [
            &b"vidsMJPG"[..],
            &words(&[0, 0, 0, 1, self.rate_hz, 0, frames, largest, u32::MAX, 0]),
            // The frame's rectangle, four numbers of 16 bits.
            &words(&[0, width | height << 16]),
        ];
        let bits = 1 | 24 << 16;
        let format =
            [&words(&[40, width, height, bits])[..], b"MJPG", &words(&[width * height * 3, 0, 0, 0, 0])];
        let streams = [chunk(b"strh", &stream.concat()), chunk(b"strf", &format.concat())].concat();
        let headers = [chunk(b"avih", &main), list(b"strl", &streams)].concat();
        let before = [&b"AVI "[..], &list(b"hdrl", &headers)].concat();
        // The file, after this word, has headers, the list of frames and the index.
        let frames_bytes = self.at;
        let riff_bytes = HEADER_BYTES - 8 - 4 + frames_bytes + index_bytes;
        let mut header =
            [&b"RIFF"[..], &riff_bytes.to_le_bytes(), &before, b"LIST", &frames_bytes.to_le_bytes(), b"movi"]
                .concat();
        debug_assert_eq!(header.len(), HEADER_BYTES as usize);
        header.truncate(HEADER_BYTES as usize);
        header
    }
}

fn chunk(kind: &[u8; 4], content: &[u8]) -> Vec<u8> {
    [&kind[..], &(content.len() as u32).to_le_bytes(), content].concat()
}

fn list(kind: &[u8; 4], content: &[u8]) -> Vec<u8> {
    chunk(b"LIST", &[&kind[..], content].concat())
}
