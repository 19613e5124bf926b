//! The vertices of a PLY file, row by row in any encoding, and the sizes of the file's parts.

use super::header::{Element, Encoding, Header};
use super::scalar::Scalar;
use crate::{Describes, Error, Result, SPLATS_MAX, Section, parse_number, quoted};
use std::path::Path;

/// A file whose header has been parsed.
pub(super) struct Rows<'a> {
    pub(super) header: Header,
    path: &'a Path,
    /// Index of the element of vertices.
    at: usize,
    scalars: Vec<Scalar>,
    /// Everything behind the header.
    data: &'a [u8],
}

impl<'a> Rows<'a> {
    /// Parses the header.
    ///
    /// # Errors
    /// As [`super::decode_ply`].
    pub(super) fn open(bytes: &'a [u8], path: &'a Path) -> Result<Self> {
        let header = Header::parse(bytes, path)?;
        if header.encoding == Encoding::BinaryBigEndian {
            let what = "big-endian values; supported: binary_little_endian, ascii";
            return Err(Error::unsupported(path, what));
        }
        let at = header.elements.iter().position(|e| e.name == "vertex");
        let at = at.ok_or_else(|| Error::invalid(path, "no element \"vertex\""))?;
        let vertex = &header.elements[at];
        let list = |name: &str| unsupported!(path, "list property {} of \"vertex\"", quoted(name));
        let scalars = vertex.properties.iter().map(|p| p.scalar().ok_or_else(|| list(&p.name)));
        let scalars = scalars.collect::<Result<_>>()?;
        if vertex.count > SPLATS_MAX {
            return Err(too_large!(path, "{} splats, at most {SPLATS_MAX}", vertex.count));
        }
        let data = bytes.get(header.num_bytes..).unwrap_or_default();
        Ok(Self { header, path, at, scalars, data })
    }

    pub(super) fn vertex(&self) -> &Element {
        &self.header.elements[self.at]
    }

    /// The most vertices that the data could hold: one byte per property, or a digit and a blank.
    pub(super) fn room(&self) -> usize {
        self.vertex().count.min(self.data.len() / self.scalars.len().max(1))
    }

    /// Calls `visit` with the numbers of every vertex.
    ///
    /// # Errors
    /// [`Error::Invalid`] if the file is cut, and what `visit` returns.
    pub(super) fn for_each(&self, visit: &mut dyn FnMut(&[f64]) -> Result<()>) -> Result<()> {
        match self.header.encoding {
            Encoding::Ascii => self.for_each_line(visit),
            _ => {
                let mut values = Vec::with_capacity(self.scalars.len());
                for row in self.binary()? {
                    let mut rest = row;
                    values.clear();
                    for scalar in &self.scalars {
                        // `binary` made the row long enough.
                        values.push(scalar.read(rest).unwrap_or(f64::NAN));
                        rest = &rest[scalar.num_bytes()..];
                    }
                    visit(&values)?;
                }
                Ok(())
            }
        }
    }

    /// Bytes of the elements before the vertices; `None` if they contain lists, or too many bytes to count.
    fn skipped_bytes(&self) -> Option<usize> {
        let mut sizes = self.header.elements[..self.at].iter().map(|e| e.row_bytes()?.checked_mul(e.count));
        sizes.try_fold(0_usize, |sum, size| sum.checked_add(size?))
    }

    /// Rows of the vertices of a binary file, after checking that the file holds them.
    fn binary(&self) -> Result<impl Iterator<Item = &'a [u8]> + use<'a>> {
        let before = &self.header.elements[..self.at];
        if let Some(element) = before.iter().find(|e| e.row_bytes().is_none()) {
            let what = format!("lists in element {} before \"vertex\"", quoted(&element.name));
            return Err(Error::unsupported(self.path, what));
        }
        let skipped = self.skipped_bytes().unwrap_or(usize::MAX);
        let (count, row) = (self.vertex().count, self.vertex().row_bytes().unwrap_or_default());
        let data = self.data.get(skipped..).unwrap_or_default();
        match row.checked_mul(count).and_then(|needed| data.get(..needed)) {
            Some(rows) if row > 0 => Ok(rows.chunks_exact(row)),
            _ => Err(invalid!(
                self.path,
                "{count} splats of {row} bytes each, but {} bytes of data: the file is truncated or damaged",
                data.len()
            )),
        }
    }

    /// The rows of a text file: one line per row.
    fn for_each_line(&self, visit: &mut dyn FnMut(&[f64]) -> Result<()>) -> Result<()> {
        let invalid = |what: String| Err(Error::invalid(self.path, what));
        let text = std::str::from_utf8(self.data).map_err(|e| invalid!(self.path, "ascii data: {e}"))?;
        let mut lines = text.lines();
        for element in &self.header.elements[..self.at] {
            if element.count > 0 && lines.nth(element.count - 1).is_none() {
                return invalid(format!("element {} is truncated", quoted(&element.name)));
            }
        }
        let expected = self.scalars.len();
        let mut values: Vec<f64> = Vec::with_capacity(expected);
        for splat in 0..self.vertex().count {
            let line = lines.next().unwrap_or_default();
            values.clear();
            values.extend(line.split_ascii_whitespace().map_while(parse_number));
            if values.len() != expected {
                return invalid(format!("splat {splat}: {} numbers, expected {expected}", values.len()));
            }
            visit(&values)?;
        }
        Ok(())
    }

    /// Bytes behind the last vertex; 0 for text files.
    pub(super) fn trailing_bytes(&self) -> usize {
        let row = self.vertex().row_bytes().unwrap_or_default();
        let needed = row.checked_mul(self.vertex().count).and_then(|v| v.checked_add(self.skipped_bytes()?));
        match self.header.encoding {
            Encoding::Ascii => 0,
            _ => self.data.len().saturating_sub(needed.unwrap_or(usize::MAX)),
        }
    }

    /// Parts of the file by property.
    pub(super) fn sections(&self) -> Vec<Section> {
        let mut sections = vec![Section {
            name: "header".to_owned(),
            bytes: self.header.num_bytes as u64,
            describes: Describes::Other,
        }];
        let mut left = self.data.len() as u64;
        let mut add = |name: &str, bytes: u64, describes: Describes| {
            let bytes = bytes.min(left);
            left -= bytes;
            Section::add(&mut sections, name, describes, bytes);
        };
        if self.header.encoding == Encoding::Ascii {
            // The text of a property has no fixed size.
            add("splats", u64::MAX, Describes::Splats);
            return sections;
        }
        let count = self.vertex().count as u64;
        for property in &self.vertex().properties {
            let bytes = property.scalar().map_or(0, Scalar::num_bytes) as u64;
            add(part_of(&property.name), bytes * count, Describes::Splats);
        }
        add("other", u64::MAX, Describes::Other);
        sections
    }
}

/// The part of the file to which a property of vertices belongs.
fn part_of(property: &str) -> &'static str {
    match property {
        "x" | "y" | "z" => "positions",
        "nx" | "ny" | "nz" => "normals",
        "opacity" => "opacities",
        name if name.starts_with("f_dc_") => "sh0",
        name if name.starts_with("f_rest_") => "sh_rest",
        name if name.starts_with("scale_") => "scales",
        name if name.starts_with("rot_") => "rotations",
        _ => "other properties",
    }
}
