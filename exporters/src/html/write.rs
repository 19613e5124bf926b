//! The writer: puts a `.ltgs` file and facts about it into the page.

use super::tags::{Tag, tags};
use super::{ASSET_ID, ASSET_TYPE, Page, Place, SESSION_ID, Session, SessionAsset};
use crate::ltgs::{self, LtgsOptions};
use crate::{Error, Provenance, Result, SplatAsset};
use base64::prelude::{BASE64_STANDARD, Engine as _};

/// Encodes a scene as a page.
///
/// # Errors
/// As [`ltgs::encode`].
pub fn encode_html(asset: &SplatAsset, options: &LtgsOptions<'_>) -> Result<Vec<u8>> {
    wrapped(&Page::embedded(), &ltgs::encode(asset, options)?, &asset.provenance)
}

/// Puts the bytes of a `.ltgs` file into a page.
///
/// # Errors
/// [`Error::Invalid`] if the page lacks its charset, title or body.
pub fn wrapped(page: &Page<'_>, ltgs: &[u8], facts: &Provenance) -> Result<Vec<u8>> {
    let html = page.html();
    let find = |name: &str| -> Result<Tag<'_>> {
        let found = tags(html.as_bytes()).find(|tag| tag.is(name));
        found.ok_or_else(|| invalid!("", "the page has no <{name}>"))
    };
    // The policy must stand before what it governs, and the encoding in the first 1024 bytes.
    let [charset, title, body] = [find("meta")?, find("title")?, find("body")?];
    let title = title.content.ok_or_else(|| Error::invalid("", "the page's title does not end"))?;
    let is_first = charset.attribute("charset").is_some() && charset.place.end <= title.start;
    if !is_first || title.end > body.place.start {
        return Err(Error::invalid(
            "",
            "the page must begin with its charset, title and body, in this order",
        ));
    }
    let asset =
        SessionAsset { bytes: ltgs.len() as u64, format: "ltgs".to_owned(), ..SessionAsset::default() };
    let session = Session { asset: Some(asset), ..Session::new(&facts.title) };
    let mut out = String::with_capacity(html.len() + ltgs.len().div_ceil(3) * 4 + 4096);
    out.push_str(&html[..charset.place.end]);
    out.push_str(&meta("http-equiv", "Content-Security-Policy", &page.policy(Place::File)));
    out.push_str(&meta("name", "generator", &session.program));
    for (name, text) in
        [("author", &facts.author), ("dcterms.license", &facts.licence), ("dcterms.source", &facts.source)]
    {
        if !text.is_empty() {
            out.push_str(&meta("name", name, text));
        }
    }
    out.push_str(&html[charset.place.end..title.start]);
    match facts.title.as_str() {
        "" => out.push_str(&html[title.clone()]),
        text => out.push_str(&escaped(text)),
    }
    out.push_str(&html[title.end..body.place.end]);
    out.push_str(&format!("<script type=\"application/json\" id=\"{SESSION_ID}\">"));
    out.push_str(&session.to_inline_json());
    out.push_str(&format!("</script><script type=\"{ASSET_TYPE}\" id=\"{ASSET_ID}\">"));
    BASE64_STANDARD.encode_string(ltgs, &mut out);
    out.push_str("</script>");
    out.push_str(&html[body.place.end..]);
    Ok(out.into_bytes())
}

fn meta(key: &str, name: &str, content: &str) -> String {
    format!("<meta {key}=\"{name}\" content=\"{}\">", escaped(content))
}

/// Text as it stands in an element or a quoted attribute. Control characters, which may not stand there at all, become spaces.
pub fn escaped(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' => out.push_str("&amp;"),
            '<' => out.push_str("&lt;"),
            '>' => out.push_str("&gt;"),
            '"' => out.push_str("&quot;"),
            c if c.is_control() => out.push(' '),
            c => out.push(c),
        }
    }
    out
}
