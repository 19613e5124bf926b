//! `litetex eval --training`: how well the training views are met.

use super::extra_figures::ExtraFigures;
use litetex_gs::Result;
use litetex_gs::backend::{Backend, RenderedImage};
use litetex_gs::capture::Capture;
use litetex_gs::console::Table;
use litetex_gs::eval::{ImagePair, psnr};
use litetex_gs::run::Trained;
use litetex_gs::views::{Split, ViewSource as _};

/// Mean PSNR of the training views, dB.
#[derive(Default)]
pub struct TrainingViews {
    psnr: Option<f64>,
}

impl ExtraFigures for TrainingViews {
    fn add(&mut self, _capture: &Capture, _view: usize, _image: &RenderedImage) -> Result<()> {
        Ok(())
    }

    fn finish(&mut self, trained: &Trained, backend: &mut dyn Backend, capture: &Capture) -> Result<()> {
        let options = trained.render_options();
        let views = capture.indices(Split::Train);
        let mut sum = 0.0;
        for &view in &views {
            let image = backend.render(&capture.camera(view), &options)?;
            sum += psnr(&ImagePair::new(&image.rgb, &*capture.target(view)?));
        }
        self.psnr = (!views.is_empty()).then(|| sum / views.len() as f64);
        Ok(())
    }

    fn json(&self) -> (&'static str, serde_json::Value) {
        ("training", serde_json::json!({ "psnr": self.psnr }))
    }

    fn rows(&self, table: &mut Table) {
        if let Some(psnr) = self.psnr {
            table.row("PSNR of the training views", format!("{psnr:.2} dB"));
        }
    }
}
