//! Parses PLY headers: elements, properties, and where the data begin.

use super::scalar::Scalar;
use crate::{Error, Result, quoted};
use std::path::Path;

/// Longest header: as many bytes as metadata may have, which ours hold in comments, and room for the rest.
const HEADER_BYTES_MAX: usize = crate::asset::meta::META_BYTES_MAX + (1 << 20);

/// Most comments; each camera has one.
const COMMENTS_MAX: usize = 1 << 20;

/// Most properties and elements together; files of splats have 62 and one.
const NAMES_MAX: usize = 1024;

/// How values are stored.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Encoding {
    /// Numbers as text.
    Ascii,
    /// Raw numbers, least significant byte first.
    BinaryLittleEndian,
}

/// A property of an element; its type is `None` for lists.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Property {
    pub(super) name: String,
    pub(super) scalar: Option<Scalar>,
}

/// An element of the file: a table.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Element {
    pub(super) name: String,
    pub(super) count: usize,
    pub(super) properties: Vec<Property>,
}

impl Element {
    /// Bytes of a binary row; `None` if it contains a list.
    pub(super) fn row_bytes(&self) -> Option<usize> {
        self.properties.iter().map(|p| p.scalar.map(Scalar::num_bytes)).sum()
    }
}

/// Everything before the data.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Header {
    pub(super) encoding: Encoding,
    pub(super) elements: Vec<Element>,
    pub(super) comments: Vec<String>,
    /// Length of the header, at which the data begin.
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
    /// Parses the header at the front of a file; takes time in proportion to its length.
    ///
    /// # Errors
    /// [`Error::Invalid`] naming the line, [`Error::Unsupported`] for big-endian files, [`Error::TooLarge`].
    pub(super) fn parse(bytes: &[u8], path: &Path) -> Result<Self> {
        let mut rest = &bytes[..bytes.len().min(HEADER_BYTES_MAX)];
        let available = rest.len();
        if next_line(&mut rest) != Some(b"ply") {
            return Err(Error::invalid(path, "does not begin with the line \"ply\""));
        }
        let mut parser = Parser::default();
        for number in 2.. {
            let Some(line) = next_line(&mut rest) else {
                let what = format!("the header ends in line {number} without \"end_header\"");
                return Err(if available < bytes.len() {
                    Error::too_large(path, format!("{what}: longer than {HEADER_BYTES_MAX} bytes"))
                } else {
                    Error::invalid(path, what)
                });
            };
            let line = String::from_utf8_lossy(line);
            let is_end = parser.line(&line).map_err(|offence| match offence {
                Offence::Invalid(what) => {
                    Error::invalid(path, format!("header line {number} {}: {what}", quoted(&line)))
                }
                Offence::Unsupported(what) => Error::unsupported(path, what),
                Offence::TooLarge(what) => Error::too_large(path, what),
            })?;
            if is_end {
                break;
            }
        }
        let encoding =
            parser.encoding.ok_or_else(|| Error::invalid(path, "the header has no \"format\" line"))?;
        let Parser { elements, comments, .. } = parser;
        Ok(Self { encoding, elements, comments, num_bytes: available - rest.len() })
    }
}

/// What is wrong with a line.
enum Offence {
    Invalid(&'static str),
    Unsupported(&'static str),
    TooLarge(String),
}

/// What the lines so far say.
#[derive(Default)]
struct Parser {
    encoding: Option<Encoding>,
    elements: Vec<Element>,
    comments: Vec<String>,
    /// Elements and properties so far.
    num_names: usize,
}

impl Parser {
    /// Takes a line; returns whether it is the last.
    fn line(&mut self, line: &str) -> Result<bool, Offence> {
        let words: Vec<&str> = line.split_ascii_whitespace().collect();
        match words.as_slice() {
            ["end_header"] => return Ok(true),
            ["format", name, "1.0"] => self.encoding = Some(parse_encoding(name)?),
            ["format", ..] => return Err(Offence::Invalid("expected \"format NAME 1.0\"")),
            ["comment", ..] => {
                let text = line.trim_start().strip_prefix("comment").unwrap_or_default();
                self.comments.push(text.trim().to_owned());
            }
            ["element", name, count] => {
                let count = count.parse().map_err(|_| Offence::Invalid("the count is not a number"))?;
                self.elements.push(Element { name: (*name).to_owned(), count, properties: Vec::new() });
                self.num_names += 1;
            }
            ["property", kind @ .., name] => self.property(kind, name)?,
            [] | ["obj_info", ..] => {}
            _ => return Err(Offence::Invalid("unknown keyword")),
        }
        if self.num_names > NAMES_MAX || self.comments.len() > COMMENTS_MAX {
            let what = format!(
                "more than {NAMES_MAX} elements and properties, or {COMMENTS_MAX} comments, in its header"
            );
            return Err(Offence::TooLarge(what));
        }
        Ok(false)
    }

    fn property(&mut self, kind: &[&str], name: &str) -> Result<(), Offence> {
        let element = self.elements.last_mut().ok_or(Offence::Invalid("a property before any element"))?;
        let scalar = match kind {
            ["list", _, _] => None,
            [kind] => Some(Scalar::parse(kind).ok_or(Offence::Invalid("unknown type of a property"))?),
            _ => return Err(Offence::Invalid("expected \"property TYPE NAME\"")),
        };
        if element.properties.iter().any(|p| p.name == name) {
            return Err(Offence::Invalid("a second property of this name"));
        }
        element.properties.push(Property { name: name.to_owned(), scalar });
        self.num_names += 1;
        Ok(())
    }
}

fn parse_encoding(name: &str) -> Result<Encoding, Offence> {
    match name {
        "ascii" => Ok(Encoding::Ascii),
        "binary_little_endian" => Ok(Encoding::BinaryLittleEndian),
        "binary_big_endian" => {
            Err(Offence::Unsupported("big-endian values; supported: binary_little_endian, ascii"))
        }
        _ => Err(Offence::Invalid("unknown format")),
    }
}
