//! Bounds-checked reading of binary files, and whole-file reading.

use crate::{Error, Result, input_file};
use std::path::{Path, PathBuf};

/// Larger files are not poses or points; the COLMAP model of 10,000 photos takes about 3 GB.
const FILE_BYTES_MAX: u64 = 8 << 30;

/// The whole file.
pub(crate) fn read_file(path: &Path) -> Result<Vec<u8>> {
    input_file::read(path, FILE_BYTES_MAX)
}

/// The whole file, which must be text.
pub(crate) fn read_text(path: &Path) -> Result<String> {
    input_file::read_text(path, FILE_BYTES_MAX)
}

/// A cursor over a file's bytes that never reads past their end.
pub(crate) struct Bytes<'a> {
    path: PathBuf,
    data: &'a [u8],
    at: usize,
}

impl<'a> Bytes<'a> {
    pub fn new(path: &Path, data: &'a [u8]) -> Self {
        Self { path: path.to_owned(), data, at: 0 }
    }

    /// An error that names the file.
    pub fn invalid(&self, what: impl Into<String>) -> Error {
        Error::invalid(&self.path, what)
    }

    /// Number of bytes that follow.
    pub fn remaining(&self) -> usize {
        self.data.len() - self.at
    }

    pub fn take(&mut self, count: usize, element: &dyn Fn() -> String) -> Result<&'a [u8]> {
        if count > self.remaining() {
            return Err(self.invalid(format!(
                "the file ends inside {}: {count} bytes needed at byte {}, {} left; copy the file again",
                element(),
                self.at,
                self.remaining()
            )));
        }
        let taken = &self.data[self.at..self.at + count];
        self.at += count;
        Ok(taken)
    }

    pub fn array<const N: usize>(&mut self, element: &dyn Fn() -> String) -> Result<[u8; N]> {
        let mut out = [0; N];
        out.copy_from_slice(self.take(N, element)?);
        Ok(out)
    }

    pub fn u32(&mut self, element: &dyn Fn() -> String) -> Result<u32> {
        self.array(element).map(u32::from_le_bytes)
    }

    pub fn i32(&mut self, element: &dyn Fn() -> String) -> Result<i32> {
        self.array(element).map(i32::from_le_bytes)
    }

    pub fn u64(&mut self, element: &dyn Fn() -> String) -> Result<u64> {
        self.array(element).map(u64::from_le_bytes)
    }

    pub fn f64s<const N: usize>(&mut self, element: &dyn Fn() -> String) -> Result<[f64; N]> {
        let mut out = [0.0; N];
        for value in &mut out {
            *value = self.array(element).map(f64::from_le_bytes)?;
        }
        Ok(out)
    }

    /// A count of elements of at least `min_bytes` each, which must fit the rest of the file.
    pub fn count(&mut self, min_bytes: usize, element: &dyn Fn() -> String) -> Result<usize> {
        let stated = self.u64(element)?;
        let room = (self.remaining() / min_bytes) as u64;
        if stated > room {
            return Err(self.invalid(format!(
                "{} is {stated}, but the rest of the file has room for {room} at most: it is damaged or truncated; copy it again",
                element()
            )));
        }
        Ok(stated as usize)
    }

    /// The bytes of a text up to a zero byte.
    pub fn text(&mut self, element: &dyn Fn() -> String) -> Result<&'a [u8]> {
        let rest = &self.data[self.at..];
        let Some(length) = rest.iter().position(|&b| b == 0) else {
            return Err(self.invalid(format!("the file ends inside {}; copy the file again", element())));
        };
        self.at += length + 1;
        Ok(&rest[..length])
    }

    /// Fails unless the file ends here.
    pub fn finish(&self) -> Result<()> {
        match self.remaining() {
            0 => Ok(()),
            n => Err(self.invalid(format!(
                "{n} bytes follow the last element: the file is damaged or of another format"
            ))),
        }
    }
}
