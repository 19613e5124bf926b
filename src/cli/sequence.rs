//! `litetex eval --sequence`: the error over time of test views that are a video.

use super::capture::Capture;
use super::extra_figures::ExtraFigures;
use super::table::Table;
use litetex_gs::Result;
use litetex_gs::backend::RenderedImage;
use litetex_gs::eval::{ImagePair, SequenceError};
use litetex_gs::views::ViewSource as _;

/// The test views as frames, in name order.
#[derive(Default)]
pub struct Sequence(SequenceError);

impl ExtraFigures for Sequence {
    fn add(&mut self, capture: &Capture, view: usize, image: &RenderedImage) -> Result<()> {
        self.0.add(ImagePair::new(&image.rgb, &*capture.target(view)?));
        Ok(())
    }

    fn json(&self) -> (&'static str, serde_json::Value) {
        ("sequence", serde_json::json!({ "mean_error_of_changes": self.0.mean() }))
    }

    fn rows(&self, table: &mut Table) {
        if let Some(mean) = self.0.mean() {
            table.row("error of changes between frames", format!("{mean:.5}"));
        }
    }
}
