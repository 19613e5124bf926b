//! Parses PLY headers, also for PLY files of points: elements, properties, and where the data begin.

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
pub enum Encoding {
    /// Numbers as text.
    Ascii,
    /// Raw numbers, least significant byte first.
    BinaryLittleEndian,
    /// Raw numbers, most significant byte first.
    BinaryBigEndian,
}

/// The type of a property.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// A number.
    Scalar(Scalar),
    /// A count and as many items.
    List {
        /// Type of the count.
        count: Scalar,
        /// Type of the items.
        item: Scalar,
    },
}

/// A property of an element.
#[derive(Clone, Debug, PartialEq)]
pub struct Property {
    /// Its name.
    pub name: String,
    /// Its type.
    pub kind: Kind,
}

impl Property {
    /// The type of its number; `None` for lists.
    pub(super) fn scalar(&self) -> Option<Scalar> {
        if let Kind::Scalar(scalar) = self.kind { Some(scalar) } else { None }
    }
}

/// An element of the file: a table.
#[derive(Clone, Debug, PartialEq)]
pub struct Element {
    /// Its name.
    pub name: String,
    /// Number of rows.
    pub count: usize,
    /// Its columns.
    pub properties: Vec<Property>,
}

impl Element {
    /// Bytes of a binary row; `None` if it contains a list.
    pub(super) fn row_bytes(&self) -> Option<usize> {
        self.properties.iter().map(|p| p.scalar().map(Scalar::num_bytes)).sum()
    }

    /// Refuses splats in SuperSplat's compressed form; `path` is only for messages.
    ///
    /// # Errors
    /// [`Error::Unsupported`] with what to export instead.
    pub fn check_uncompressed(&self, path: &Path) -> Result<()> {
        match self.properties.iter().any(|p| p.name == "packed_position") {
            true => Err(unsupported!(
                path,
                "a compressed PLY (property \"packed_position\"), expected a plain one: open it in SuperSplat and export \
                 it as \"PLY\" instead of \"Compressed PLY\""
            )),
            false => Ok(()),
        }
    }
}

/// Everything before the data.
#[derive(Clone, Debug, PartialEq)]
pub struct Header {
    /// How values are stored.
    pub encoding: Encoding,
    /// The tables, in order.
    pub elements: Vec<Element>,
    /// Comments, in order.
    pub comments: Vec<String>,
    /// Length of the header, at which the data begin.
    pub num_bytes: usize,
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
    /// [`Error::Invalid`] naming the line, [`Error::TooLarge`].
    pub fn parse(bytes: &[u8], path: &Path) -> Result<Self> {
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
                    too_large!(path, "{what}: longer than {HEADER_BYTES_MAX} bytes")
                } else {
                    Error::invalid(path, what)
                });
            };
            let line = String::from_utf8_lossy(line);
            let is_end = parser
                .line(&line)
                .map_err(|what| invalid!(path, "header line {number} {}: {what}", quoted(&line)))?;
            if parser.num_names > NAMES_MAX || parser.comments.len() > COMMENTS_MAX {
                return Err(too_large!(
                    path,
                    "more than {NAMES_MAX} elements and properties, or {COMMENTS_MAX} comments, in its header"
                ));
            }
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
    fn line(&mut self, line: &str) -> Result<bool, &'static str> {
        let words: Vec<&str> = line.split_ascii_whitespace().collect();
        match words.as_slice() {
            ["end_header"] => return Ok(true),
            ["format", name, "1.0"] => {
                self.encoding = Some(match *name {
                    "ascii" => Encoding::Ascii,
                    "binary_little_endian" => Encoding::BinaryLittleEndian,
                    "binary_big_endian" => Encoding::BinaryBigEndian,
                    _ => return Err("unknown format"),
                });
            }
            ["format", ..] => return Err("expected \"format NAME 1.0\""),
            ["comment", ..] => {
                let text = line.trim_start().strip_prefix("comment").unwrap_or_default();
                self.comments.push(text.trim().to_owned());
            }
            ["element", name, count] => {
                let count = count.parse().map_err(|_| "the count is not a number")?;
                self.elements.push(Element { name: (*name).to_owned(), count, properties: Vec::new() });
                self.num_names += 1;
            }
            ["property", kind @ .., name] => self.property(kind, name)?,
            [] | ["obj_info", ..] => {}
            _ => return Err("unknown keyword"),
        }
        Ok(false)
    }

    fn property(&mut self, kind: &[&str], name: &str) -> Result<(), &'static str> {
        let element = self.elements.last_mut().ok_or("a property before any element")?;
        let scalar = |name: &str| Scalar::parse(name).ok_or("unknown type of a property");
        let kind = match kind {
            ["list", count, item] => Kind::List { count: scalar(count)?, item: scalar(item)? },
            [kind] => Kind::Scalar(scalar(kind)?),
            _ => return Err("expected \"property TYPE NAME\""),
        };
        if element.properties.iter().any(|p| p.name == name) {
            return Err("a second property of this name");
        }
        element.properties.push(Property { name: name.to_owned(), kind });
        self.num_names += 1;
        Ok(())
    }
}
