//! XML documents of limited size and shape. The parser resolves no entities of a document's own; what is checked here
//! before are tags and namespaces, for which its time and memory grow with the square of their number.

use crate::{Result, input_file};
use roxmltree::{Document, Node, ParsingOptions};
use std::path::Path;

/// The cameras of 20,000 photos take less.
const FILE_BYTES_MAX: u64 = 32 << 20;

/// A tag with its attributes: programs that edit photos keep masks and curves in those of sidecar files.
const TAG_BYTES_MAX: usize = 1 << 20;

/// Of a tag, which the parser compares with each other. Programs that edit photos write some 300.
const ATTRIBUTES_MAX: usize = 1000;

/// The documents of the formats that are read have up to ten.
const NAMESPACES_MAX: usize = 64;

/// Twenty for each of 20,000 photos. A node takes about 60 bytes.
const NODES_MAX: u32 = 1_000_000;

/// The text of a file, in bounds.
pub(crate) fn read(path: &Path) -> Result<String> {
    input_file::read_text(path, FILE_BYTES_MAX)
}

/// Parses a document.
///
/// # Errors
/// [`crate::Error::InvalidInput`] with line and column, [`crate::Error::Unsupported`] beyond the bounds.
pub(crate) fn parse<'a>(path: &Path, text: &'a str) -> Result<Document<'a>> {
    // Room is made for as many before any limit applies.
    for (sign, what) in [('<', "nodes"), ('=', "attributes")] {
        if text.matches(sign).nth(NODES_MAX as usize).is_some() {
            return Err(unsupported!(path, "more than {NODES_MAX} {what}, which is the limit"));
        }
    }
    for tag in text.split('<').skip(1).map(Tag::of) {
        if tag.bytes > TAG_BYTES_MAX {
            return Err(unsupported!(
                path,
                "a tag has {} bytes, expected at most {TAG_BYTES_MAX}",
                tag.bytes
            ));
        }
        if tag.attributes > ATTRIBUTES_MAX {
            let count = tag.attributes;
            return Err(unsupported!(
                path,
                "a tag has {count} attributes, expected at most {ATTRIBUTES_MAX}"
            ));
        }
    }
    if text.matches("xmlns").nth(NAMESPACES_MAX).is_some() {
        return Err(unsupported!(path, "more than {NAMESPACES_MAX} declarations of namespaces (xmlns)"));
    }
    let options = ParsingOptions { nodes_limit: NODES_MAX, ..ParsingOptions::default() };
    Document::parse_with_options(text, options)
        .map_err(|e| invalid!(path, "not a valid XML document: {e}; export it again"))
}

/// The size of a tag, to the `>` that ends it: one outside quotes.
struct Tag {
    bytes: usize,
    attributes: usize,
}

impl Tag {
    /// `tag`: the text after its `<`.
    fn of(tag: &str) -> Self {
        let (mut open_quote, mut attributes) = (None, 0);
        for (at, sign) in tag.bytes().enumerate() {
            match (open_quote, sign) {
                (None, b'>') => return Self { bytes: at, attributes },
                (None, b'=') => attributes += 1,
                (None, b'"' | b'\'') => open_quote = Some(sign),
                (Some(quote), _) if quote == sign => open_quote = None,
                _ => {}
            }
        }
        Self { bytes: tag.len(), attributes }
    }
}

/// The text inside an element, without blanks around it.
pub(crate) fn text_of<'a>(node: Node<'a, '_>) -> &'a str {
    node.text().unwrap_or_default().trim()
}

/// The first element inside with this name.
pub(crate) fn child<'a, 'input>(node: Node<'a, 'input>, name: &str) -> Option<Node<'a, 'input>> {
    node.children().find(|c| c.has_tag_name(name))
}

/// Exactly `N` finite numbers, separated by blanks.
///
/// # Errors
/// What was found.
pub(crate) fn numbers<const N: usize>(text: &str) -> Result<[f64; N], String> {
    let mut out = [0.0; N];
    let mut count = 0;
    for word in text.split_whitespace() {
        let value = word.parse().ok().filter(|v: &f64| v.is_finite());
        let value = value.ok_or_else(|| format!("{} is no number", crate::text::quoted(word)))?;
        if let Some(slot) = out.get_mut(count) {
            *slot = value;
        }
        count += 1;
    }
    if count == N { Ok(out) } else { Err(format!("{count} numbers found, expected {N}")) }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn refused(text: &str) -> String {
        parse(Path::new("a.xml"), text).unwrap_err().to_string()
    }

    #[test]
    fn documents_that_would_take_too_long_are_refused_before_they_are_parsed() {
        assert!(parse(Path::new("a.xml"), "<a b='1'><c/></a>").is_ok(), "negative control");
        let attributes: String = (0..2000).map(|i| format!(" a{i}=''")).collect();
        assert!(refused(&format!("<a{attributes}/>")).contains("a tag has 2000 attributes"));
        assert!(
            refused(&format!("<a b='>' c=\">\"{attributes}/>")).contains("a tag has 2002 attributes"),
            "behind quoted brackets"
        );
        let long = |bytes: usize| format!("<a b='{}'/>", "=x>>".repeat(bytes / 4));
        assert!(parse(Path::new("a.xml"), &long(100_000)).is_ok(), "negative control");
        assert!(refused(&long(TAG_BYTES_MAX)).contains("bytes, expected at most"));
        assert!(refused(&format!("<a>{}</a>", "=".repeat(NODES_MAX as usize + 1))).contains("attributes"));
        let nested: String = (0..100).map(|i| format!("<a xmlns:b{i}='{i}'>")).collect();
        assert!(refused(&nested).contains("namespaces"));
        assert!(refused(&format!("<a>{}</a>", "<b/>".repeat(NODES_MAX as usize))).contains("limit"));
        let entities = "<!DOCTYPE a [<!ENTITY x 'yyyy'><!ENTITY z '&x;&x;&x;'>]><a>&z;</a>";
        assert!(refused(entities).contains("DTD"), "{}", refused(entities));
    }

    #[test]
    fn numbers_are_counted() {
        assert_eq!(numbers::<2>(" 1 -2e3\n"), Ok([1.0, -2000.0]));
        for (text, what) in
            [("1", "1 numbers found"), ("1 2 3", "3 numbers"), ("1 x", "\"x\""), ("1 inf", "inf")]
        {
            assert!(numbers::<2>(text).unwrap_err().contains(what));
        }
    }
}
