//! Parses PLY headers: which elements, which properties, where the data begins.

use super::scalar::Scalar;
use crate::{Error, Result};
use std::path::Path;

/// Longest header: the metadata's most, which ours hold in comments, and room for the rest.
const HEADER_BYTES_MAX: usize = crate::meta::META_BYTES_MAX + (1 << 20);

/// Most lines of comments; cameras have one each.
const COMMENTS_MAX: usize = 1 << 20;

/// Most properties and elements; files of splats have 62 and one.
const NAMES_MAX: usize = 1024;

/// How values are stored.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Encoding {
    /// Text.
    Ascii,
    /// Raw, least significant byte first.
    BinaryLittleEndian,
}

/// A property of an element: name and type; `None`: a list.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Property {
    pub(super) name: String,
    pub(super) scalar: Option<Scalar>,
}

/// An element of the file.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Element {
    pub(super) name: String,
    pub(super) count: usize,
    pub(super) properties: Vec<Property>,
}

impl Element {
    /// Bytes of a binary row; `None` if there is a list.
    pub(super) fn row_bytes(&self) -> Option<usize> {
        self.properties.iter().map(|p| p.scalar.map(Scalar::num_bytes)).sum()
    }
}

/// All that precedes the data.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Header {
    pub(super) encoding: Encoding,
    pub(super) elements: Vec<Element>,
    pub(super) comments: Vec<String>,
    /// Length of the header.
    pub(super) num_bytes: usize,
}

/// Splits off one line without its end.
fn next_line<'a>(rest: &mut &'a [u8]) -> Option<&'a [u8]> {
    let end = rest.iter().position(|&b| b == b'\n')?;
    let line = &rest[..end];
    *rest = &rest[end + 1..];
    Some(line.strip_suffix(b"\r").unwrap_or(line))
}

impl Header {
    /// # Errors
    /// [`Error::Invalid`] naming the line, [`Error::Unsupported`] for big-endian files.
    pub(super) fn parse(bytes: &[u8], path: &Path) -> Result<Self> {
        let mut rest = &bytes[..bytes.len().min(HEADER_BYTES_MAX)];
        let available = rest.len();
        if next_line(&mut rest) != Some(b"ply") {
            return Err(Error::invalid(path, "does not begin with the line \"ply\""));
        }
        let mut encoding = None;
        let mut header =
            Self { encoding: Encoding::Ascii, elements: Vec::new(), comments: Vec::new(), num_bytes: 0 };
        for number in 2.. {
            let Some(line) = next_line(&mut rest) else {
                let what = format!("the header ends in line {number} without \"end_header\"");
                return Err(if available < bytes.len() {
                    Error::too_large(path, format!("{what}: longer than {HEADER_BYTES_MAX} bytes"))
                } else {
                    Error::invalid(path, what)
                });
            };
            let names: usize = header.elements.iter().map(|e| e.properties.len()).sum();
            if names + header.elements.len() > NAMES_MAX || header.comments.len() > COMMENTS_MAX {
                let what = format!(
                    "more than {NAMES_MAX} elements and properties, or {COMMENTS_MAX} comments, in its header"
                );
                return Err(Error::too_large(path, what));
            }
            let line = String::from_utf8_lossy(line);
            let offence = |what: &str| {
                let shown: String = line.chars().take(80).collect();
                Error::invalid(path, format!("header line {number} {shown:?}: {what}"))
            };
            let words: Vec<&str> = line.split_ascii_whitespace().collect();
            match words.as_slice() {
                ["end_header"] => break,
                ["format", name, "1.0"] => encoding = Some(parse_encoding(name, path)?),
                ["format", ..] => return Err(offence("expected \"format NAME 1.0\"")),
                ["comment", ..] => {
                    let text = line.trim_start().strip_prefix("comment").unwrap_or_default();
                    header.comments.push(text.trim().to_owned());
                }
                ["element", name, count] => header.elements.push(Element {
                    name: (*name).to_owned(),
                    count: count.parse().map_err(|_| offence("the count is not a number"))?,
                    properties: Vec::new(),
                }),
                ["property", kind @ .., name] => {
                    let element = header.elements.last_mut();
                    let element = element.ok_or_else(|| offence("a property before any element"))?;
                    let scalar = match kind {
                        ["list", _, _] => None,
                        [kind] => {
                            Some(Scalar::parse(kind).ok_or_else(|| offence("unknown type of a property"))?)
                        }
                        _ => return Err(offence("expected \"property TYPE NAME\"")),
                    };
                    if element.properties.iter().any(|p| p.name == *name) {
                        return Err(offence("a second property of this name"));
                    }
                    element.properties.push(Property { name: (*name).to_owned(), scalar });
                }
                [] | ["obj_info", ..] => {}
                _ => return Err(offence("unknown keyword")),
            }
        }
        header.encoding =
            encoding.ok_or_else(|| Error::invalid(path, "the header has no \"format\" line"))?;
        header.num_bytes = available - rest.len();
        Ok(header)
    }
}

fn parse_encoding(name: &str, path: &Path) -> Result<Encoding> {
    match name {
        "ascii" => Ok(Encoding::Ascii),
        "binary_little_endian" => Ok(Encoding::BinaryLittleEndian),
        "binary_big_endian" => {
            Err(Error::unsupported(path, "big-endian values; supported: binary_little_endian, ascii"))
        }
        _ => Err(Error::invalid(path, format!("unknown format {name:?}"))),
    }
}
