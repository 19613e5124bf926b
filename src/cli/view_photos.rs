//! The photos of a capture as pages get them: as training sees them, in PNG.

use crate::viewer::{Photos, Shown};
use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::{ExtendedColorType, ImageEncoder as _};
use litetex_exporters::html::SessionPhoto;
use litetex_gs::Error;
use litetex_gs::capture::Capture;
use litetex_gs::console::Log;
use litetex_gs::views::ViewSource as _;
use std::io;
use std::sync::Arc;

/// The photos of a capture by the numbers of its views.
pub struct CapturePhotos(pub Arc<Capture>);

/// All photos of a capture, in the order of its views; their addresses are left out.
pub fn list(capture: &Capture) -> Vec<SessionPhoto> {
    let of_view = |view| {
        let size = capture.camera(view).pinhole;
        let (width_px, height_px) = (size.width_px, size.height_px);
        SessionPhoto { view: capture.name(view).to_owned(), url: String::new(), width_px, height_px }
    };
    (0..capture.num_views()).map(of_view).collect()
}

impl Photos for CapturePhotos {
    fn png(&self, index: usize) -> Option<io::Result<Vec<u8>>> {
        (index < self.0.num_views()).then(|| {
            let photo = self.0.target(index).map_err(io::Error::other)?;
            let mut png = Vec::new();
            // The fastest: the reader is on the same machine.
            PngEncoder::new_with_quality(&mut png, CompressionType::Fast, FilterType::Sub)
                .write_image(&photo.rgb, photo.width_px, photo.height_px, ExtendedColorType::Rgb8)
                .map_err(io::Error::other)?;
            Ok(png)
        })
    }
}

/// Says why the page does not follow a change.
pub fn not_shown(error: &Error, log: &Log) {
    log.warn("scene-not-shown", &format!("the page keeps the scene before: {error}"), 1);
}

/// Offers the photos of a capture, if there is one.
pub fn offer_photos(capture: Option<Arc<Capture>>, shown: &Shown) {
    if let Some(capture) = capture {
        shown.set_photos(list(&capture), Arc::new(CapturePhotos(capture)));
    }
}

/// Says why there are no photos.
pub fn no_photos(error: &Error, log: &Log) {
    log.warn("no-photos", &format!("photos are not shown: {error}"), 1);
}
