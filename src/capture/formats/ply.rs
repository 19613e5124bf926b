//! Point clouds in PLY files: positions and colours of the element `vertex`; everything else is skipped.
//! PLY files of splats are read by `exporters`.

use super::bytes::read_file;
use crate::text::quoted;
use crate::views::SfmPoint;
use crate::{Error, Result};
use glam::DVec3;
use litetex_exporters::parse_number;
use litetex_exporters::ply::{Element, Encoding, Header, Kind, Property, Scalar};
use std::path::Path;

/// A cursor over the values, in any encoding.
struct Values<'a> {
    encoding: Encoding,
    data: &'a [u8],
    at: usize,
}

impl<'a> Values<'a> {
    fn word(&mut self) -> Option<&'a str> {
        let rest = &self.data[self.at..];
        let start = rest.iter().position(|b| !b.is_ascii_whitespace())?;
        let length = rest[start..].iter().position(u8::is_ascii_whitespace);
        let end = length.map_or(rest.len(), |l| start + l);
        self.at += end;
        std::str::from_utf8(&rest[start..end]).ok()
    }

    /// The next number; `None` at the end of the file or if there is none.
    fn next(&mut self, scalar: Scalar) -> Option<f64> {
        if self.encoding == Encoding::Ascii {
            return parse_number(self.word()?);
        }
        let size = scalar.num_bytes();
        let stored = self.data.get(self.at..self.at + size)?;
        self.at += size;
        let mut bytes = [0; 8];
        bytes[..size].copy_from_slice(stored);
        if self.encoding == Encoding::BinaryBigEndian {
            bytes[..size].reverse();
        }
        scalar.read(&bytes)
    }

    /// The value of a scalar property; a list is skipped and gives 0.
    fn property(&mut self, property: &Property) -> Option<f64> {
        match property.kind {
            Kind::Scalar(scalar) => self.next(scalar),
            Kind::List { count, item } => {
                let count = self.next(count)?;
                // Whatever a damaged count says, the loop ends with the file.
                for _ in 0..count.max(0.0) as u64 {
                    self.next(item)?;
                }
                Some(0.0)
            }
        }
    }
}

/// Reads the points of a PLY file, in the file's frame. Points without colour are mid-grey.
///
/// # Errors
/// [`Error::InvalidInput`] naming the line of the header or the vertex, [`Error::Unsupported`] for compressed splats,
/// [`Error::Io`].
pub fn read_points(path: &Path) -> Result<Vec<SfmPoint>> {
    let data = read_file(path)?;
    let header = Header::parse(&data, path)?;
    let mut values = Values { encoding: header.encoding, data: &data[header.num_bytes..], at: 0 };
    for element in &header.elements {
        if element.name == "vertex" {
            return read_vertices(path, element, &mut values);
        }
        // An element without properties has no bytes to skip, whatever its count.
        let count = if element.properties.is_empty() { 0 } else { element.count };
        for index in 0..count {
            for property in &element.properties {
                values.property(property).ok_or_else(|| damaged(path, element, index))?;
            }
        }
    }
    Err(Error::invalid(path, "no element \"vertex\"; expected one with x, y and z"))
}

fn damaged(path: &Path, element: &Element, index: usize) -> Error {
    invalid!(
        path,
        "{} {} of {}: the file ends here or has no number where one was expected; copy it again",
        quoted(&element.name),
        index + 1,
        element.count
    )
}

fn read_vertices(path: &Path, element: &Element, values: &mut Values<'_>) -> Result<Vec<SfmPoint>> {
    let column = |name: &str| element.properties.iter().position(|p| p.name == name);
    let position = ["x", "y", "z"].map(column);
    element.check_uncompressed(path)?;
    let [Some(x), Some(y), Some(z)] = position else {
        return Err(Error::invalid(path, "element \"vertex\" lacks x, y or z"));
    };
    let colour = [["red", "green", "blue"], ["r", "g", "b"]]
        .into_iter()
        .map(|names| names.map(column))
        .find(|c| c.iter().all(Option::is_some))
        .map(|c| c.map(Option::unwrap_or_default));
    let mut row = vec![0.0; element.properties.len()];
    // A vertex takes at least three bytes, which bounds the memory for a damaged count.
    let mut points = Vec::with_capacity(element.count.min(values.data.len() / 3));
    for index in 0..element.count {
        for (value, property) in row.iter_mut().zip(&element.properties) {
            *value = values.property(property).ok_or_else(|| damaged(path, element, index))?;
        }
        points.push(SfmPoint {
            position_in_capture: DVec3::new(row[x], row[y], row[z]),
            rgb: colour.map_or([128; 3], |c| c.map(|i| channel(row[i], &element.properties[i].kind))),
        });
    }
    Ok(points)
}

/// A colour channel as a byte: integers are 0 to 255 (16 bits: 0 to 65535), floating-point numbers 0 to 1.
fn channel(value: f64, kind: &Kind) -> u8 {
    let scaled = match kind {
        Kind::Scalar(Scalar::F32 | Scalar::F64) => value * 255.0,
        Kind::Scalar(Scalar::U16) => value / 257.0,
        _ => value,
    };
    scaled.round().clamp(0.0, 255.0) as u8
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(bytes: &[u8]) -> Result<Vec<SfmPoint>> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("points.ply");
        std::fs::write(&path, bytes).unwrap();
        read_points(&path)
    }

    fn binary(big: bool) -> Vec<u8> {
        let name = if big { "binary_big_endian" } else { "binary_little_endian" };
        let mut out = format!(
            "ply\nformat {name} 1.0\ncomment x\nelement face 1\nproperty list uchar int vertex_indices\n\
             element vertex 2\nproperty double x\nproperty float y\nproperty list uchar short tags\n\
             property float z\nproperty uchar red\nproperty uchar green\nproperty uchar blue\nend_header\n"
        )
        .into_bytes();
        let mut put = |little: &[u8]| {
            let mut bytes = little.to_vec();
            if big {
                bytes.reverse();
            }
            out.extend(bytes);
        };
        put(&[2]);
        put(&7_i32.to_le_bytes());
        put(&8_i32.to_le_bytes());
        for v in [1.0_f32, -2.5] {
            put(&f64::from(v).to_le_bytes());
            put(&(v + 1.0).to_le_bytes());
            put(&[1]);
            put(&9_i16.to_le_bytes());
            put(&(v + 2.0).to_le_bytes());
            put(&[10]);
            put(&[20]);
            put(&[30]);
        }
        out
    }

    #[test]
    fn compressed_splats_are_told_what_to_export() {
        let header = |property: &str| {
            let names = format!("property uint {property}\nproperty uint packed_rotation\nend_header\n");
            format!("ply\nformat binary_little_endian 1.0\nelement vertex 1\n{names}").into_bytes()
        };
        let error = read(&header("packed_position")).unwrap_err();
        let text = error.to_string();
        assert!(error.exit_code() == 4 && text.contains("instead of \"Compressed PLY\""), "{text}");
        let text = read(&header("id")).unwrap_err().to_string();
        assert!(text.contains("lacks x, y or z"), "negative control: {text}");
    }

    #[test]
    fn all_encodings_give_the_same_points_and_lists_are_skipped() {
        let expected = [1.0, -2.5].map(|v: f64| SfmPoint {
            position_in_capture: DVec3::new(v, v + 1.0, v + 2.0),
            rgb: [10, 20, 30],
        });
        assert_eq!(read(&binary(false)).unwrap(), expected);
        assert_eq!(read(&binary(true)).unwrap(), expected);
        let ascii = "ply\nformat ascii 1.0\nelement vertex 2\nproperty float x\nproperty float y\n\
                     property float z\nproperty float red\nproperty float green\nproperty float blue\n\
                     end_header\n1 2 3 0.0392 0.0784 0.1176\n-2.5 -1.5 -0.5 0.0392 0.0784 0.1176\n";
        assert_eq!(read(ascii.as_bytes()).unwrap(), expected);
    }

    #[test]
    fn a_ply_truncated_anywhere_is_an_error() {
        let whole = binary(false);
        for length in 0..whole.len() {
            assert!(read(&whole[..length]).is_err(), "cut at {length}");
        }
    }

    #[test]
    fn a_huge_count_allocates_nothing() {
        let text = "ply\nformat ascii 1.0\nelement vertex 99999999999999\nproperty float x\n\
                    property float y\nproperty float z\nend_header\n1 2 3\n";
        assert!(read(text.as_bytes()).unwrap_err().to_string().contains("\"vertex\" 2 of"));
    }
}
