//! The page: the one that draws scenes, with a style and sections added before its policy is made.

use super::figures::ReportFigures;
use super::sections::sections;
use crate::{Error, Result};
use litetex_exporters::Provenance;
use litetex_exporters::html::{Page, wrapped};

/// Makes the report: `ltgs` is the scene as a `.ltgs` file, `facts` its metadata.
///
/// # Errors
/// [`Error::InvalidInput`] if the page that draws scenes has no place for them.
pub fn report_html(figures: &ReportFigures, ltgs: &[u8], facts: &Provenance) -> Result<Vec<u8>> {
    let page = Page::embedded();
    let style = format!("<style>{}</style></head>", include_str!("style.css"));
    let html = page.html().replacen("</head>", &style, 1);
    // The keys that move the camera are for the scene: with the focus in it, the report scrolls.
    let report = format!(
        "<main id=\"report\" tabindex=\"-1\" aria-label=\"Report\"><div>{}</div></main></body>",
        sections(figures)
    );
    let end = html.rfind("</body>").ok_or_else(|| usage!("the page has no </body>"))?;
    let html = format!("{}{report}{}", &html[..end], &html[end + "</body>".len()..]);
    wrapped(&Page::new(&html), ltgs, facts).map_err(Error::from)
}
