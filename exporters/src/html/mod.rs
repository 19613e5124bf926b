//! A scene as a web page in one file: the page that draws scenes, with a `.ltgs` file inside. `schema/html.md` specifies the
//! container; the page itself is built from the sources in `web/`.
//!
//! | element | content |
//! |---|---|
//! | `#litetex-asset` | a `.ltgs` file in base64; a data block, which browsers do not run |
//! | `#litetex-session` | a [`Session`] as JSON |
//! | `meta http-equiv` | a policy that allows the page's own scripts and styles, and no connection at all |

mod page;
mod read;
mod session;
mod tags;
#[cfg(test)]
mod tests;
mod write;

pub use page::{Page, Place};
pub use read::{embedded, read_html, validate};
pub use session::{Session, SessionAsset, SessionPhoto, SessionTraining, TrainingState};
pub use write::{encode_html, escaped, wrapped};

/// `id` of the element that holds the asset.
const ASSET_ID: &str = "litetex-asset";
/// `id` of the element that holds the session.
const SESSION_ID: &str = "litetex-session";
/// `type` of the element that holds the asset.
const ASSET_TYPE: &str = "application/vnd.litetex.ltgs;base64";
