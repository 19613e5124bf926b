//! `litetex-lab figures --regions`: figures of the parts of the images that masks mark.

use litetex_gs::backend::RenderedImage;
use litetex_gs::camera::Pinhole;
use litetex_gs::capture::{Capture, read_image};
use litetex_gs::console::{Table, path_text};
use litetex_gs::eval::{ImagePair, RegionError, psnr_from_squares, texels_in_region};
use litetex_gs::model::Model;
use litetex_gs::views::ViewSource as _;
use litetex_gs::{Error, Result};
use serde_json::{Value, json};
use std::path::{Path, PathBuf};

/// Figures of the marked parts of all views: errors in test views, texels in all.
pub struct Regions {
    folder: PathBuf,
    error: RegionError,
    /// Texels of splats that project into the regions, and into the views with a region.
    texels: (u64, u64),
    /// Pixels of the regions, and of the views with a region.
    pixels: (u64, u64),
}

impl Regions {
    /// Counts texels and pixels in the views for which the folder has a mask.
    ///
    /// # Errors
    /// [`Error::Usage`] if it has none, [`Error::InvalidInput`] if one is damaged or of another size than its view.
    pub fn of(folder: &Path, capture: &Capture, model: &Model) -> Result<Self> {
        let mut out =
            Self { folder: folder.to_owned(), error: RegionError::default(), texels: (0, 0), pixels: (0, 0) };
        for view in 0..capture.num_views() {
            let camera = capture.camera(view);
            let Some(region) = out.mask(capture.name(view), &camera.pinhole)? else { continue };
            let (inside, all) = texels_in_region(model, &camera, &region);
            out.texels = (out.texels.0 + inside, out.texels.1 + all);
            let marked = region.iter().filter(|marked| **marked).count() as u64;
            out.pixels = (out.pixels.0 + marked, out.pixels.1 + region.len() as u64);
        }
        if out.pixels.1 == 0 {
            return Err(Error::Usage(format!(
                "--regions {}: no mask of any view in the folder; masks are PNG files with the names of the photos",
                folder.display()
            )));
        }
        Ok(out)
    }

    /// The mask of a photo, white where marked; `None` if there is none.
    fn mask(&self, name: &str, pinhole: &Pinhole) -> Result<Option<Vec<bool>>> {
        let path = self.folder.join(name).with_extension("png");
        if !path.exists() {
            return Ok(None);
        }
        let (width_px, height_px, rgb) = read_image(&path)?;
        if (width_px, height_px) != (pinhole.width_px, pinhole.height_px) {
            return Err(Error::invalid(
                &path,
                format!(
                    "the mask has {width_px} x {height_px} pixels, expected {} x {} as the view has",
                    pinhole.width_px, pinhole.height_px
                ),
            ));
        }
        Ok(Some(rgb.as_chunks::<3>().0.iter().map(|c| c[0] >= 0.5).collect()))
    }

    fn psnr(&self) -> Option<f64> {
        (self.error.pixels > 0).then(|| psnr_from_squares((self.error.squares, self.error.pixels)))
    }

    fn recall(&self) -> Option<f64> {
        share(self.error.recalled, self.error.pixels)
    }

    /// Share of the texels in the regions per share of the pixels.
    fn texels_per_pixel(&self) -> Option<f64> {
        Some(share(self.texels.0, self.texels.1)? / share(self.pixels.0, self.pixels.1)?)
    }
}

fn share(part: u64, whole: u64) -> Option<f64> {
    (whole > 0).then(|| part as f64 / whole as f64)
}

impl Regions {
    /// Adds a test view; `image` is its render.
    ///
    /// # Errors
    /// What decoding the photo or its mask found.
    pub fn add(&mut self, capture: &Capture, view: usize, image: &RenderedImage) -> Result<()> {
        if let Some(region) = self.mask(capture.name(view), &capture.camera(view).pinhole)? {
            self.error.add(ImagePair::new(&image.rgb, &*capture.target(view)?), &region);
        }
        Ok(())
    }

    /// The figures as JSON.
    pub fn json(&self) -> Value {
        json!({
            "folder": path_text(&self.folder),
            "test_pixels": self.error.pixels,
            "psnr": self.psnr(),
            "recall": self.recall(),
            "pixel_share": share(self.pixels.0, self.pixels.1),
            "texel_share": share(self.texels.0, self.texels.1),
            "texels_per_pixel": self.texels_per_pixel(),
        })
    }

    /// Rows for people.
    pub fn rows(&self, table: &mut Table) {
        if let (Some(psnr), Some(recall)) = (self.psnr(), self.recall()) {
            let recall = 100.0 * recall;
            table
                .row("PSNR in the regions", format!("{psnr:.2} dB; {recall:.1} % of the pixels within 10 %"));
        }
        if let Some(ratio) = self.texels_per_pixel() {
            table.row("texels in the regions", format!("{ratio:.2} times their share of the pixels"));
        }
    }
}
