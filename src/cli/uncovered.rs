//! The pixels of the test views that another run leaves uncovered, and the error of a run there.

use super::sources::on_device;
use litetex_gs::Result;
use litetex_gs::backend::RenderedImage;
use litetex_gs::capture::Capture;
use litetex_gs::console::{Log, Table, path_text};
use litetex_gs::eval::{ImagePair, psnr_from_squares, squared_error, uncovered_pixels};
use litetex_gs::run::Trained;
use litetex_gs::verify::CaptureIdentity;
use litetex_gs::views::{Split, ViewSource as _};
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::path::PathBuf;

/// Uncovered pixels of another run, and sums over them.
pub struct UncoveredArea {
    /// The other run's checkpoint.
    path: PathBuf,
    /// For each test view, which pixels are uncovered. `[height, width]`
    masks: BTreeMap<usize, Vec<bool>>,
    /// As [`squared_error`] over all views.
    squares: u64,
    pixels: u64,
}

impl UncoveredArea {
    /// Renders the test views of another run; `background` is that of the capture's photos.
    ///
    /// # Errors
    /// If that run has another frame, and whatever device and photos report.
    pub fn of(
        other: &Trained,
        capture: &Capture,
        background: [f32; 3],
        device: &str,
        log: &Log,
    ) -> Result<Self> {
        other.identity.check_frame(&CaptureIdentity::new(capture, capture.capture_from_local))?;
        let mut backend = on_device(other, device, log)?;
        let options = other.render_options();
        let mut masks = BTreeMap::new();
        for view in capture.indices(Split::Test) {
            let image = backend.render(&capture.camera(view), &options)?;
            let mask = uncovered_pixels(&image.alpha, &*capture.target(view)?, background);
            masks.insert(view, mask);
        }
        Ok(Self { path: other.path.clone(), masks, squares: 0, pixels: 0 })
    }

    /// PSNR over all these pixels, dB; `None` if there are none.
    fn psnr(&self) -> Option<f64> {
        (self.pixels > 0).then(|| psnr_from_squares((self.squares, self.pixels)))
    }

    /// Adds a test view; `image` is its render.
    ///
    /// # Errors
    /// What decoding the photo found.
    pub fn add(&mut self, capture: &Capture, view: usize, image: &RenderedImage) -> Result<()> {
        let mut pair = ImagePair::new(&image.rgb, &*capture.target(view)?);
        pair.unmasked = Some(self.masks[&view].clone());
        let (squares, pixels) = squared_error(&pair);
        self.squares += squares;
        self.pixels += pixels;
        Ok(())
    }

    /// The figures as JSON.
    pub fn json(&self) -> Value {
        let (checkpoint, psnr) = (path_text(&self.path), self.psnr());
        json!({ "checkpoint": checkpoint, "pixels": self.pixels, "psnr": psnr })
    }

    /// A row for people.
    pub fn row(&self, table: &mut Table) {
        let text = match self.psnr() {
            Some(psnr) => format!("{psnr:.2} dB over {} pixels", self.pixels),
            None => "every pixel is covered".to_owned(),
        };
        table.row("PSNR where uncovered", text);
    }
}
