//! The page that draws scenes, and what it may do: a Content-Security-Policy with the hashes of its own scripts and styles.

use super::tags::{Tag, tags};
use base64::prelude::{BASE64_STANDARD, Engine as _};
use sha2::{Digest as _, Sha256};

/// The page as it was built from `web/`.
const EMBEDDED: &str = include_str!("../../page/view.html");

/// Where a page is opened from, on which depends what it may connect to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Place {
    /// Served by the program: data come from the same server.
    Server,
    /// A file that holds its scene: no connection at all.
    File,
}

/// A page with all its scripts and styles inside.
#[derive(Clone, Debug)]
pub struct Page<'a> {
    html: &'a str,
    /// Sources of a policy, such as `'sha256-...'`.
    scripts: Vec<String>,
    styles: Vec<String>,
}

impl Page<'static> {
    /// The page that this crate brings.
    pub fn embedded() -> Self {
        Self::new(EMBEDDED)
    }
}

impl<'a> Page<'a> {
    /// Hashes the scripts and styles of a page.
    pub fn new(html: &'a str) -> Self {
        let hashes = |is_wanted: fn(&Tag<'_>) -> bool| {
            let wanted = tags(html.as_bytes()).filter(is_wanted).filter_map(|tag| tag.content);
            wanted.map(|content| source_of(&html.as_bytes()[content])).collect()
        };
        Self { html, scripts: hashes(is_run), styles: hashes(|tag| tag.is("style")) }
    }

    /// The page's text.
    pub fn html(&self) -> &'a str {
        self.html
    }

    /// The page's Content-Security-Policy: its own scripts and styles, workers that these make, images that they make, and from
    /// a server its data. Nothing else is loaded, and nothing is sent anywhere.
    pub fn policy(&self, place: Place) -> String {
        let list =
            |sources: &[String]| if sources.is_empty() { "'none'".to_owned() } else { sources.join(" ") };
        let of_place = match place {
            Place::Server => "connect-src 'self'; img-src 'self' blob: data:; frame-ancestors 'none'",
            // Browsers ignore `frame-ancestors` in a `meta` element.
            Place::File => "img-src blob: data:",
        };
        format!(
            "default-src 'none'; script-src {}; style-src {}; worker-src blob:; {of_place}; base-uri 'none'; form-action \
             'none'",
            list(&self.scripts),
            list(&self.styles)
        )
    }
}

/// Whether a tag is that of a script that browsers run. Others hold data.
fn is_run(tag: &Tag<'_>) -> bool {
    let of_type = tag.attribute("type").unwrap_or_default().to_ascii_lowercase();
    tag.is("script") && matches!(of_type.as_slice(), b"" | b"module" | b"text/javascript")
}

/// The source by which a policy allows an inline script or style.
fn source_of(content: &[u8]) -> String {
    format!("'sha256-{}'", BASE64_STANDARD.encode(Sha256::digest(content)))
}
