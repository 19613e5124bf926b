//! Text from anywhere, as a page may hold it.

use crate::text::{printable, shortened};
use litetex_exporters::html::escaped;

/// Characters of a text at most: names from files may have any number.
const TEXT_CHARS_MAX: usize = 400;

/// Text from anywhere as it stands in an element or a quoted attribute.
pub fn escaped_text(text: &str) -> String {
    let text = printable(text, &[]);
    escaped(&shortened(&text, TEXT_CHARS_MAX))
}
