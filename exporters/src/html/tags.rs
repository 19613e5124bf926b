//! A scanner of HTML that knows just enough to find elements: tags, attributes, comments, and elements whose content is text.
//! Linear in the length of the text, whatever that holds.

use std::ops::Range;

/// Elements whose content is text up to their end tag.
const TEXT_ELEMENTS: [&[u8]; 4] = [b"script", b"style", b"title", b"textarea"];

/// A start tag.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Tag<'a> {
    /// Name, as it is written.
    pub name: &'a [u8],
    /// What stands between the name and `>`.
    attributes: &'a [u8],
    /// The tag itself, in bytes of the document.
    pub place: Range<usize>,
    /// Content of an element whose content is text; `None` for other elements, and where the end tag is missing.
    pub content: Option<Range<usize>>,
}

impl Tag<'_> {
    /// Whether this is the tag of such an element.
    pub fn is(&self, name: &str) -> bool {
        self.name.eq_ignore_ascii_case(name.as_bytes())
    }

    /// Value of an attribute, as it is written; empty if it has none.
    pub fn attribute(&self, wanted: &str) -> Option<&[u8]> {
        let mut rest = self.attributes;
        loop {
            rest = trimmed_start(rest);
            let end = rest.iter().position(|b| b.is_ascii_whitespace() || *b == b'=' || *b == b'/');
            let (name, after) = rest.split_at(end.unwrap_or(rest.len()));
            let (value, after) = value_of(after);
            if name.eq_ignore_ascii_case(wanted.as_bytes()) {
                return Some(value);
            }
            if after.is_empty() {
                return None;
            }
            rest = after;
        }
    }
}

/// The value at the beginning, and what follows it.
fn value_of(text: &[u8]) -> (&[u8], &[u8]) {
    let Some(text) = trimmed_start(text).strip_prefix(b"=") else {
        return (b"", text.strip_prefix(b"/").unwrap_or(text));
    };
    let text = trimmed_start(text);
    match text.first() {
        Some(&quote @ (b'"' | b'\'')) => {
            let end = text[1..].iter().position(|b| *b == quote).map_or(text.len(), |at| at + 1);
            (&text[1..end], text.get(end + 1..).unwrap_or_default())
        }
        _ => {
            let end = text.iter().position(u8::is_ascii_whitespace).unwrap_or(text.len());
            text.split_at(end)
        }
    }
}

fn trimmed_start(text: &[u8]) -> &[u8] {
    let start = text.iter().position(|b| !b.is_ascii_whitespace()).unwrap_or(text.len());
    &text[start..]
}

/// The start tags of a document, in order.
pub struct Tags<'a> {
    html: &'a [u8],
    at: usize,
}

/// Scans a document.
pub fn tags(html: &[u8]) -> Tags<'_> {
    Tags { html, at: 0 }
}

impl<'a> Iterator for Tags<'a> {
    type Item = Tag<'a>;

    fn next(&mut self) -> Option<Tag<'a>> {
        loop {
            let start = self.at + self.html.get(self.at..)?.iter().position(|b| *b == b'<')?;
            let rest = &self.html[start + 1..];
            if rest.starts_with(b"!--") {
                // A comment that does not end hides the rest.
                self.at = start + 4 + find(&self.html[start + 4..], b"-->")? + 3;
                continue;
            }
            if !rest.first().is_some_and(u8::is_ascii_alphabetic) {
                self.at = start + 1;
                continue;
            }
            let end = start + 1 + end_of_tag(rest)?;
            let inside = &self.html[start + 1..end];
            let name_end = inside.iter().position(|b| b.is_ascii_whitespace() || *b == b'/');
            let (name, attributes) = inside.split_at(name_end.unwrap_or(inside.len()));
            self.at = end + 1;
            let mut tag = Tag { name, attributes, place: start..end + 1, content: None };
            if TEXT_ELEMENTS.iter().any(|text| name.eq_ignore_ascii_case(text)) {
                tag.content = end_of_text(&self.html[end + 1..], name).map(|n| end + 1..end + 1 + n);
                self.at = tag.content.as_ref().map_or(self.html.len(), |content| content.end);
            }
            return Some(tag);
        }
    }
}

/// Bytes before the `>` that ends a tag; it does not count in quotation marks.
fn end_of_tag(text: &[u8]) -> Option<usize> {
    let mut quote = None;
    text.iter().position(|&b| {
        match (quote, b) {
            (None, b'>') => return true,
            (None, b'"' | b'\'') => quote = Some(b),
            (Some(open), b) if open == b => quote = None,
            _ => {}
        }
        false
    })
}

/// Bytes before the end tag of an element whose content is text.
fn end_of_text(text: &[u8], name: &[u8]) -> Option<usize> {
    let mut at = 0;
    loop {
        at += text[at..].iter().position(|b| *b == b'<')?;
        let is_end = text[at + 1..].strip_prefix(b"/").is_some_and(|rest| {
            rest.get(..name.len()).is_some_and(|found| found.eq_ignore_ascii_case(name))
                && rest.get(name.len()).is_some_and(|b| matches!(b, b'>' | b'/') || b.is_ascii_whitespace())
        });
        if is_end {
            return Some(at);
        }
        at += 1;
    }
}

fn find(text: &[u8], wanted: &[u8]) -> Option<usize> {
    text.windows(wanted.len()).position(|window| window == wanted)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(html: &str) -> Vec<String> {
        tags(html.as_bytes()).map(|tag| String::from_utf8_lossy(tag.name).into_owned()).collect()
    }

    #[test]
    fn tags_in_text_and_comments_are_none() {
        let html = "<!doctype html><!-- <a> --><B x='>'><script>'<c>' + \"</scripty>\"</SCRIPT ><d/><style><e></style>";
        assert_eq!(names(html), ["B", "script", "d", "style"]);
        let script = tags(html.as_bytes()).nth(1).unwrap();
        assert_eq!(&html[script.content.unwrap()], "'<c>' + \"</scripty>\"");
        assert_eq!(names("a < b <c <!-- <d>"), ["c <!-- <d".split(' ').next().unwrap()]);
        assert_eq!(names("<a><!-- <b> "), ["a"]);
        assert_eq!(names("<script><a></script"), ["script"]);
        assert!(tags(b"<script>x").next().unwrap().content.is_none());
        assert!(names("<").is_empty() && names("<a").is_empty() && names("").is_empty());
    }

    #[test]
    fn attributes_are_found_however_they_are_written() {
        let html = b"<script async id = 'a b' TYPE=module data-x=\"1>2\" src>";
        let tag = tags(html).next().unwrap();
        assert_eq!(tag.place, 0..html.len());
        let of = |name| tag.attribute(name).map(|v| String::from_utf8_lossy(v).into_owned());
        assert_eq!(of("id").as_deref(), Some("a b"));
        assert_eq!(of("type").as_deref(), Some("module"));
        assert_eq!(of("data-x").as_deref(), Some("1>2"));
        assert_eq!([of("src").as_deref(), of("async").as_deref()], [Some(""); 2]);
        assert_eq!([of("x"), of("module"), of("")], [None, None, None]);
        let odd = tags(b"<a =x / b/ c='>").next();
        assert_eq!(odd, None, "an open quotation has no end");
        assert_eq!(tags(b"<a/b=1/>").next().unwrap().attribute("b"), Some(b"1/".as_slice()));
    }
}
