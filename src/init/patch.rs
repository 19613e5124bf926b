//! Patches of reduced photos, and how well other photos show them at a depth.

use crate::camera::Camera;
use crate::image::TargetImage;
use glam::{DMat3, DVec2, DVec3};

/// Pixels along the side of a patch.
const SIDE: usize = 5;
const PIXELS: usize = SIDE * SIDE;

/// Least standard deviation of the grey values of a patch that can be recognised.
const CONTRAST_MIN: f32 = 3.0 / 255.0;

/// A photo at a small size.
pub(super) struct ReducedPhoto {
    /// Of this size.
    pub camera: Camera,
    image: TargetImage,
    /// Mean of the channels, 0 to 1. `[height, width]`
    grey: Vec<f32>,
}

impl ReducedPhoto {
    /// Reduced to the longer side, or as it is if it is smaller.
    pub fn new(photo: &TargetImage, camera: &Camera, side_px: u32) -> Self {
        let longer = photo.width_px.max(photo.height_px);
        let side = |px: u32| if longer <= side_px { px } else { (px * side_px / longer).max(1) };
        let (width_px, height_px) = (side(photo.width_px), side(photo.height_px));
        let image = photo.reduced(width_px, height_px);
        let mean = |rgb: &[u8; 3]| rgb.iter().map(|&c| f32::from(c)).sum::<f32>() / (3.0 * 255.0);
        let grey = image.rgb.as_chunks::<3>().0.iter().map(mean).collect();
        Self { camera: camera.resized(width_px, height_px), image, grey }
    }

    /// Whether a position lies in the image.
    pub fn contains(&self, at_px: DVec2) -> bool {
        let size = DVec2::new(self.image.width_px.into(), self.image.height_px.into());
        at_px.cmpge(DVec2::ZERO).all() && at_px.cmplt(size).all()
    }

    fn pixel(&self, at_px: DVec2) -> usize {
        at_px.y as usize * self.image.width_px as usize + at_px.x as usize
    }

    /// Whether the pixel at a position in the image counts.
    pub fn counts(&self, at_px: DVec2) -> bool {
        self.image.counts(self.pixel(at_px))
    }

    /// Whether the pixel at a position in the image shows the background.
    pub fn shows_background(&self, at_px: DVec2, background: [f32; 3]) -> bool {
        self.image.shows_background(self.pixel(at_px), background)
    }

    /// Colour of the pixel at a position in the image, 0 to 1.
    pub fn rgb(&self, at_px: DVec2) -> [f64; 3] {
        let rgb = &self.image.rgb[3 * self.pixel(at_px)..];
        [0, 1, 2].map(|c| f64::from(rgb[c]) / 255.0)
    }

    /// Grey value by bilinear interpolation; `None` outside and where masked.
    fn grey(&self, at_px: DVec2) -> Option<f32> {
        if !self.contains(at_px) || !self.counts(at_px) {
            return None;
        }
        let last = DVec2::new(f64::from(self.image.width_px - 1), f64::from(self.image.height_px - 1));
        let at = (at_px - 0.5).clamp(DVec2::ZERO, last);
        let (x, y) = (at.x as usize, at.y as usize);
        let (right, below) = (usize::from(at.x < last.x), usize::from(at.y < last.y));
        let (u, v) = ((at.x - x as f64) as f32, (at.y - y as f64) as f32);
        let value = |dx: usize, dy: usize| self.grey[(y + dy) * self.image.width_px as usize + x + dx];
        let upper = value(0, 0) + u * (value(right, 0) - value(0, 0));
        let lower = value(0, below) + u * (value(right, below) - value(0, below));
        Some(upper + v * (lower - upper))
    }
}

/// A patch to be found in other photos.
pub(super) struct Patch {
    camera: Camera,
    /// Rays of the pixels, z = 1.
    directions: [DVec3; PIXELS],
    /// Grey values less their mean, of unit length.
    values: [f32; PIXELS],
}

impl Patch {
    /// The patch around a position; `None` at the border and where the photo is plain.
    pub fn new(photo: &ReducedPhoto, centre_px: DVec2) -> Option<Self> {
        let mut directions = [DVec3::ZERO; PIXELS];
        let mut values = [0.0; PIXELS];
        for i in 0..PIXELS {
            let offset = DVec2::new((i % SIDE) as f64, (i / SIDE) as f64) - (SIDE / 2) as f64;
            directions[i] = photo.camera.pinhole.direction_in_camera(centre_px + offset);
            values[i] = photo.grey(centre_px + offset)?;
        }
        normalise(&mut values).then_some(Self { camera: photo.camera, directions, values })
    }

    /// How another photo sees the rays of the patch.
    pub fn seen_by<'a>(&self, photo: &'a ReducedPhoto) -> PatchRays<'a> {
        let (own, other) = (&self.camera.camera_from_local, &photo.camera.camera_from_local);
        let turn: DMat3 = other.rotation * own.rotation.transpose();
        PatchRays {
            photo,
            directions: self.directions.map(|direction| turn * direction),
            origin: other.transform_point(self.camera.centre_in_local()),
        }
    }

    /// Normalised cross-correlation with the other photo, -1 to 1, the patch facing its camera at an inverse depth;
    /// -1 where the photo does not show all of it.
    pub fn correlation(&self, rays: &PatchRays<'_>, inverse_depth: f64) -> f32 {
        let mut found = [0.0; PIXELS];
        for (value, direction) in found.iter_mut().zip(&rays.directions) {
            let Some(grey) = rays.at(*direction, inverse_depth).and_then(|at| rays.photo.grey(at)) else {
                return -1.0;
            };
            *value = grey;
        }
        if !normalise(&mut found) {
            return -1.0;
        }
        found.iter().zip(&self.values).map(|(a, b)| a * b).sum()
    }
}

/// The rays of a patch in the frame of another camera.
pub(super) struct PatchRays<'a> {
    photo: &'a ReducedPhoto,
    directions: [DVec3; PIXELS],
    /// Where the rays start.
    origin: DVec3,
}

impl PatchRays<'_> {
    fn at(&self, direction: DVec3, inverse_depth: f64) -> Option<DVec2> {
        // Scaled by the inverse depth, which does not move the projection.
        self.photo.camera.pinhole.project(direction + self.origin * inverse_depth)
    }

    /// Distance between the images of the patch's centre at two inverse depths, pixels; 0 where one is behind the camera.
    pub fn path_px(&self, least: f64, most: f64) -> f64 {
        let centre = self.directions[PIXELS / 2];
        match (self.at(centre, least), self.at(centre, most)) {
            (Some(a), Some(b)) => a.distance(b),
            _ => 0.0,
        }
    }
}

/// Subtracts the mean and scales to unit length; whether there is enough contrast.
fn normalise(values: &mut [f32; PIXELS]) -> bool {
    let mean = values.iter().sum::<f32>() / PIXELS as f32;
    values.iter_mut().for_each(|v| *v -= mean);
    let length = values.iter().map(|v| v * v).sum::<f32>().sqrt();
    values.iter_mut().for_each(|v| *v /= length.max(1e-9));
    length >= CONTRAST_MIN * (PIXELS as f32).sqrt()
}
