//! The reader: takes the `.ltgs` file out of a page, and trusts nothing else in it.

use super::tags::tags;
use super::{ASSET_ID, ASSET_TYPE};
use crate::files::read::read_file;
use crate::{Contents, Describes, Issue, ReadLimits, Result, Section, Severity, ltgs};
use base64::prelude::{BASE64_STANDARD, Engine as _};
use std::path::Path;

/// Reads the scene of a page.
///
/// # Errors
/// [`crate::Error::Io`], [`crate::Error::TooLarge`], [`crate::Error::Invalid`] for a page that is no exported scene or holds
/// more than one, and those of [`ltgs::decode`].
pub fn read_html(path: &Path, limits: &ReadLimits) -> Result<Contents> {
    let html = read_file(path, limits.decoded_bytes)?;
    let page_bytes = html.len() as u64;
    let bytes = embedded(&html, path)?;
    drop(html);
    let mut contents = ltgs::decode(&bytes, path, limits)?;
    contents.format = format!("HTML with {}", contents.format);
    // Base64 included: parts add up to the file.
    Section::add(&mut contents.sections, "page", Describes::Other, page_bytes - bytes.len() as u64);
    Ok(contents)
}

/// The bytes of the `.ltgs` file in a page; `path` is only for messages.
///
/// # Errors
/// [`crate::Error::Invalid`] if there is none, more than one, or if it is not base64.
pub fn embedded(html: &[u8], path: &Path) -> Result<Vec<u8>> {
    let mut found = tags(html).filter(|tag| tag.attribute("id") == Some(ASSET_ID.as_bytes()));
    let Some(tag) = found.next() else {
        return Err(invalid!(
            path,
            "not an exported scene: no element has the id {ASSET_ID:?}; expected a page written by \"litetex export\""
        ));
    };
    let invalid = |what: &str| Err(invalid!(path, "element #{ASSET_ID}: {what}"));
    if !tag.is("script") || tag.attribute("type") != Some(ASSET_TYPE.as_bytes()) {
        return invalid(&format!("expected a script of the type {ASSET_TYPE:?}"));
    }
    let Some(content) = tag.content.clone() else {
        return invalid("its end is missing; the file is truncated");
    };
    if found.next().is_some() {
        return invalid("there are two; expected one scene in a page");
    }
    match BASE64_STANDARD.decode(html[content].trim_ascii()) {
        Ok(bytes) => Ok(bytes),
        Err(error) => invalid(&format!("not base64: {error}; the file is damaged")),
    }
}

/// Checks a page and the `.ltgs` file in it, whose issues have the codes of that format; `path` is only for messages. Of the
/// page itself:
///
/// | code | meaning |
/// |---|---|
/// | `LT5001` | not an exported scene, or the element that holds it is damaged |
pub fn validate(html: &[u8], path: &Path) -> Vec<Issue> {
    match embedded(html, path) {
        Ok(bytes) => ltgs::validate(&bytes, path),
        Err(error) => vec![Issue::new("LT5001", Severity::Error, "", &error.text())],
    }
}
