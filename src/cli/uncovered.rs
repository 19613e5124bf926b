//! The pixels of the test views that another run leaves uncovered, and the error of a run there.

use super::capture::Capture;
use super::log::Log;
use super::sources::{Trained, render_options};
use super::table::path_text;
use litetex_gs::Result;
use litetex_gs::backend::RenderedImage;
use litetex_gs::eval::{psnr_from_mse, quantised, uncovered_pixels};
use litetex_gs::verify::CaptureIdentity;
use litetex_gs::views::{Split, ViewSource as _};
use std::collections::BTreeMap;
use std::path::PathBuf;

/// Uncovered pixels of another run, and sums over them.
pub struct UncoveredArea {
    /// The other run's checkpoint.
    path: PathBuf,
    /// For each test view, which pixels are uncovered. `[height, width]`
    masks: BTreeMap<usize, Vec<bool>>,
    pixels: u64,
    /// Sum of the squared differences of 8-bit values.
    squares: u64,
}

impl UncoveredArea {
    /// Renders the test views of another run.
    ///
    /// # Errors
    /// If that run has another frame, and whatever device and photos report.
    pub fn of(other: &Trained, capture: &Capture, device: &str, log: &Log) -> Result<Self> {
        other.identity.check_frame(&CaptureIdentity::new(capture, capture.capture_from_local))?;
        let mut backend = other.on_device(device, log)?;
        let options = render_options(&other.model, other.config.train.background, false);
        let mut masks = BTreeMap::new();
        for view in capture.indices(Split::Test) {
            let image = backend.render(&capture.camera(view), &options)?;
            masks.insert(view, uncovered_pixels(&image.alpha, &*capture.target(view)?));
        }
        Ok(Self { path: other.path.clone(), masks, pixels: 0, squares: 0 })
    }

    /// Adds the error of a view.
    ///
    /// # Errors
    /// What decoding the photo found.
    pub fn add(&mut self, capture: &Capture, view: usize, image: &RenderedImage) -> Result<()> {
        let target = capture.target(view)?;
        let rendered = quantised(&image.rgb);
        let pairs = rendered.as_chunks::<3>().0.iter().zip(target.rgb.as_chunks::<3>().0);
        for ((a, b), _) in pairs.zip(&self.masks[&view]).filter(|(_, uncovered)| **uncovered) {
            self.pixels += 1;
            self.squares += (0..3).map(|c| u64::from(a[c].abs_diff(b[c])).pow(2)).sum::<u64>();
        }
        Ok(())
    }

    /// PSNR over all these pixels, dB; `None` if there are none.
    fn psnr(&self) -> Option<f64> {
        let mse = self.squares as f64 / (3.0 * 255.0 * 255.0 * self.pixels as f64);
        (self.pixels > 0).then(|| psnr_from_mse(mse))
    }

    /// The figures as JSON.
    pub fn json(&self) -> serde_json::Value {
        serde_json::json!({ "checkpoint": path_text(&self.path), "pixels": self.pixels, "psnr": self.psnr() })
    }

    /// The figures as text.
    pub fn text(&self) -> String {
        match self.psnr() {
            Some(psnr) => format!("{psnr:.2} dB over {} pixels", self.pixels),
            None => "every pixel is covered".to_owned(),
        }
    }
}
