//! The sample capture: a scene, its views and its sparse model.

use super::colmap_write::{SparseImage, SparseModel};
use super::frame::Frame;
use super::options::SampleOptions;
use super::patch::Patch;
use super::planted::Planted;
use super::points::{points, points_on_patch};
use super::render;
use super::scene::Scene;
use super::scenes::SceneKind;
use super::views::{View, views};
use crate::camera::Pinhole;
use glam::DMat3;
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

/// What was made.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SampleSummary {
    /// Images.
    pub views: usize,
    /// Those listed in `test.txt`.
    pub test_views: usize,
    /// Sparse points.
    pub points: usize,
    /// Observations of the points over all images.
    pub observations: usize,
    /// Mean distance between an observation and the projection of its (noisy) point.
    pub mean_reprojection_error_px: f64,
}

/// Intrinsics of the photos.
pub fn pinhole_of(options: &SampleOptions) -> Pinhole {
    let (width, height) = (f64::from(options.width_px), f64::from(options.height_px));
    let focal_px = 0.95 * width.max(height);
    Pinhole {
        width_px: options.width_px,
        height_px: options.height_px,
        fx_px: focal_px,
        fy_px: focal_px,
        cx_px: 0.5 * width,
        cy_px: 0.5 * height,
    }
}

/// What a capture shows.
enum Content {
    /// The still life.
    Room(Box<Scene>),
    /// Another scene.
    Patch(Patch),
    Planted(Box<Planted>),
}

/// The scene with its cameras and points.
pub struct Capture {
    options: SampleOptions,
    content: Content,
    /// Photos, in the order of the sparse model.
    pub views: Vec<View>,
    /// Cameras and points, as written to `sparse/0`.
    pub sparse: SparseModel,
}

/// 8-bit values of an image file. `[height, width, channels]`
pub struct Pixels {
    pub width_px: u32,
    pub height_px: u32,
    pub values: Vec<u8>,
}

impl Capture {
    /// Places cameras and points. Images are rendered on demand.
    pub fn new(options: &SampleOptions) -> Self {
        let pinhole = pinhole_of(options);
        let views = views(options, &pinhole);
        let (content, mut points) = match options.scene {
            None => {
                let scene = Scene::new(options, pinhole.fx_px);
                let points = points(options, &scene, &views);
                (Content::Room(Box::new(scene)), points)
            }
            Some(scene) => {
                let patch = Patch::new(scene, options.seed);
                let planted = (scene.kind == SceneKind::Planted).then(|| Planted::new(options.seed));
                let points = points_on_patch(options, &patch, planted.as_ref(), &views);
                (planted.map_or(Content::Patch(patch), |p| Content::Planted(Box::new(p))), points)
            }
        };
        let frame = Frame::new(options);
        for point in &mut points {
            point.position = frame.point(point.position);
        }
        let mut pinholes: Vec<Pinhole> = Vec::new();
        let images = views.iter().map(|view| {
            let own = view.file_pinhole();
            let pinhole = pinholes.iter().position(|p| *p == own).unwrap_or_else(|| {
                pinholes.push(own);
                pinholes.len() - 1
            });
            SparseImage { name: view.name.clone(), camera_from_capture: frame.pose(&view.written), pinhole }
        });
        let images = images.collect();
        Self { options: options.clone(), content, views, sparse: SparseModel { pinholes, images, points } }
    }

    /// The scene as it is when a photo is taken.
    fn scene_of(scene: &Scene, view: &View) -> Scene {
        let mut scene = scene.clone();
        scene.extras.walker = view.walker;
        scene
    }

    /// The photo of a view, 8 bits, display space, 3 channels.
    pub fn photo(&self, index: usize) -> Pixels {
        let view = &self.views[index];
        let (rays, seed) = (self.options.supersampling, self.options.seed);
        let mut rgb = match &self.content {
            Content::Room(scene) => render::photo(&Self::scene_of(scene, view), view, rays),
            Content::Patch(patch) => {
                render::dithered(&render::patch(patch, view, rays), patch.dither, seed, index)
            }
            Content::Planted(planted) => {
                let colours = planted.photo(&view.pinhole, &view.camera_from_capture, rays);
                render::dithered(&colours, 0.0, seed, index)
            }
        };
        if view.noise > 0.0 {
            render::add_noise(&mut rgb, view.noise, seed, index);
        }
        padded(view, &rgb, 3)
    }

    /// The mask of a padded photo, 1 channel: white where the photo is.
    pub fn mask(&self, index: usize) -> Option<Pixels> {
        let view = &self.views[index];
        view.padded.map(|_| padded(view, &vec![255; view.pinhole.num_pixels()], 1))
    }

    /// The pixels of a view that show what the stress is about, 1 channel; `None` if there are none.
    pub fn region(&self, index: usize) -> Option<Pixels> {
        let view = &self.views[index];
        let (pinhole, pose) = (&view.pinhole, &view.camera_from_capture);
        let values = match &self.content {
            Content::Room(scene) => {
                let scene = Self::scene_of(scene, view);
                render::region(|ray| scene.extras.is_region(&scene.cast(ray)), pinhole, pose)
            }
            Content::Patch(patch) => render::region(|ray| patch.is_region(ray), pinhole, pose),
            Content::Planted(_) => return None,
        };
        values.iter().any(|v| *v > 0).then(|| padded(view, &values, 1))
    }

    /// Whether [`Self::depth`] has one: the grey around a patch is at no distance.
    pub fn has_depths(&self) -> bool {
        matches!(self.content, Content::Room(_))
    }

    /// Exact depth of a photo along the optical axis, metres. `[height, width]`
    pub fn depth(&self, index: usize) -> Option<(Pinhole, Vec<f32>)> {
        let Content::Room(scene) = &self.content else { return None };
        let view = &self.views[index];
        let depth = render::depth(&Self::scene_of(scene, view), &view.pinhole, &view.camera_from_capture);
        Some((view.pinhole, depth))
    }

    /// Counts and the mean reprojection error.
    pub fn summary(&self) -> SampleSummary {
        let points = &self.sparse.points;
        let observations: usize = points.iter().map(|p| p.observations.len()).sum();
        // Not sum(), which is -0 for an empty iterator.
        let error = points.iter().fold(0.0, |sum, p| sum + p.error_px * p.observations.len() as f64);
        SampleSummary {
            views: self.views.len(),
            test_views: self.views.iter().filter(|v| v.is_test).count(),
            points: points.len(),
            observations,
            mean_reprojection_error_px: error / observations.max(1) as f64,
        }
    }

    /// Contents of `truth/scene.json`: frame, options, geometry and cameras.
    pub fn description(&self) -> Value {
        let matrix_rows = |m: DMat3| m.transpose().to_cols_array_2d();
        let cameras: Vec<Value> = self
            .views
            .iter()
            .map(|view| {
                let pose = &view.camera_from_capture;
                json!({
                    "name": view.name,
                    "camera_from_capture_rows": matrix_rows(pose.rotation),
                    "translation": pose.translation.to_array(),
                    "pinhole": view.pinhole,
                })
            })
            .collect();
        let mut description = json!({
            "frame": "x right, y down, z away from the cameras; metres",
            "program_version": env!("CARGO_PKG_VERSION"),
            "options": self.options,
            "cameras": cameras,
        });
        match &self.content {
            Content::Room(scene) => describe_room(scene, &mut description),
            Content::Patch(patch) => description["patch"] = json!(patch),
            Content::Planted(planted) => description["splats"] = planted.description(),
        }
        description
    }
}

fn describe_room(scene: &Scene, description: &mut Value) {
    let boxes = ["crate", "carton", "books"].iter().zip(&scene.boxes);
    let boxes: Vec<Value> = boxes
        .map(|(name, b)| {
            json!({
                "name": name,
                "centre": b.centre.to_array(),
                "half_edges": b.half.to_array(),
                "capture_from_box_rows": b.rotation.transpose().to_cols_array_2d(),
            })
        })
        .collect();
    description["frame"] = json!("x right, y down (the floor is y = 0), z away from the cameras; metres");
    description["depth"] = json!("along the optical axis at pixel centres, metres; channel Y");
    description["room"] = json!(scene.room.map(|corner| corner.to_array()));
    description["boxes"] = json!(boxes);
    description["globe"] = json!({ "centre": scene.globe.0.to_array(), "radius": scene.globe.1 });
}

/// Values of a photo in its file: black around it if it is padded.
fn padded(view: &View, values: &[u8], channels: usize) -> Pixels {
    let p = view.pinhole;
    let Some(([width_px, height_px], [left, top])) = view.padded else {
        return Pixels { width_px: p.width_px, height_px: p.height_px, values: values.to_vec() };
    };
    let mut out = vec![0; (width_px * height_px) as usize * channels];
    for (y, row) in values.chunks_exact(p.width_px as usize * channels).enumerate() {
        let from = ((top as usize + y) * width_px as usize + left as usize) * channels;
        out[from..from + row.len()].copy_from_slice(row);
    }
    Pixels { width_px, height_px, values: out }
}
