//! Figures of the test views that `litetex eval` reports when asked for, beside those of every evaluation.

use litetex_gs::Result;
use litetex_gs::backend::{Backend, RenderedImage};
use litetex_gs::capture::Capture;
use litetex_gs::console::Table;
use litetex_gs::run::Trained;

/// Figures that are added up view by view.
pub trait ExtraFigures {
    /// Adds a test view; `image` is its render.
    ///
    /// # Errors
    /// What decoding the photo or another file found.
    fn add(&mut self, capture: &Capture, view: usize, image: &RenderedImage) -> Result<()>;

    /// Adds what is not about test views.
    ///
    /// # Errors
    /// What rendering and decoding report.
    fn finish(&mut self, _trained: &Trained, _backend: &mut dyn Backend, _capture: &Capture) -> Result<()> {
        Ok(())
    }

    /// Key and value in the JSON.
    fn json(&self) -> (&'static str, serde_json::Value);

    /// Rows for people.
    fn rows(&self, table: &mut Table);
}
