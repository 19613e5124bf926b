//! From pixels of the photos as they are stored to positions in the images of training.

use super::decode::Recipe;
use super::loaded::Capture;
use crate::Result;
use crate::text::quoted;
use crate::views::ViewSource as _;
use glam::DVec2;
use image::metadata::Orientation;

impl Capture {
    /// Where a pixel of a view's photo lies in its image of training, pixels. `pixel` counts from 0 at the upper left of the stored
    /// photo, before the turn that its EXIF data may ask for; the centre of the pixel is meant.
    ///
    /// # Errors
    /// [`crate::Error::Usage`] for a pixel outside the photo, or one that the undistorted image does not show.
    pub fn image_px(&self, view: usize, pixel: [f64; 2]) -> Result<DVec2> {
        let recipe = self.store.recipe(view);
        let name = quoted(self.name(view));
        let (width, height) = stored_size(recipe);
        let at = DVec2::from(pixel) + 0.5;
        let is_inside = (0.0..=f64::from(width)).contains(&at.x) && (0.0..=f64::from(height)).contains(&at.y);
        if !is_inside {
            let [x, y] = pixel;
            return Err(usage!(
                "{name} has {width} x {height} pixels, {x},{y} lies outside; count from 0 at the upper left"
            ));
        }
        recipe.image_px(at).ok_or_else(|| {
            let [x, y] = pixel;
            usage!("{name}: pixel {x},{y} lies outside the undistorted image; choose a point nearer to the middle")
        })
    }
}

/// Size of a photo as it is stored.
fn stored_size(recipe: &Recipe) -> (u32, u32) {
    let (width, height) = recipe.photo_size;
    if super::photos::swaps_sides(recipe.turn) { (height, width) } else { (width, height) }
}

impl Recipe {
    /// Where a position in the stored photo lies in the target image; `None` outside of it.
    fn image_px(&self, stored_px: DVec2) -> Option<DVec2> {
        let (width, height) = self.photo_size;
        let size = DVec2::new(width.into(), height.into());
        let turned = turned(stored_px, self.turn, size);
        let undistorted = match self.warp(self.photo_size) {
            Some(warp) => warp.undistorted_px(turned)?,
            None => turned,
        };
        let is_inside = undistorted.cmpge(DVec2::ZERO).all() && undistorted.cmple(size).all();
        is_inside.then(|| undistorted * DVec2::new(self.size.0.into(), self.size.1.into()) / size)
    }
}

/// A position in a photo, once turned to this size.
fn turned(p: DVec2, turn: Orientation, size: DVec2) -> DVec2 {
    let (w, h) = (size.x, size.y);
    match turn {
        Orientation::NoTransforms => p,
        Orientation::Rotate90 => DVec2::new(w - p.y, p.x),
        Orientation::Rotate180 => DVec2::new(w - p.x, h - p.y),
        Orientation::Rotate270 => DVec2::new(p.y, h - p.x),
        Orientation::FlipHorizontal => DVec2::new(w - p.x, p.y),
        Orientation::FlipVertical => DVec2::new(p.x, h - p.y),
        Orientation::Rotate90FlipH => DVec2::new(p.y, p.x),
        Orientation::Rotate270FlipH => DVec2::new(w - p.y, h - p.x),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use image::{DynamicImage, GrayImage, Luma};

    #[test]
    fn positions_turn_as_pixels_do() {
        for turn in (1..=8).filter_map(Orientation::from_exif) {
            let mut image = GrayImage::new(5, 3);
            image.put_pixel(3, 2, Luma([255]));
            let mut image = DynamicImage::ImageLuma8(image);
            image.apply_orientation(turn);
            let image = image.into_luma8();
            let size = DVec2::new(image.width().into(), image.height().into());
            let found = turned(DVec2::new(3.5, 2.5), turn, size);
            assert_eq!(image.get_pixel(found.x as u32, found.y as u32).0, [255], "{turn:?}: {found}");
        }
    }
}
