//! Tiny captures for tests, written in every format from one description. `tests/capture_damage.rs`
//! includes this file too, so it uses the crate's dependencies only, not the crate.

use glam::{DMat3, DQuat, DVec3};
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

/// A camera: id, COLMAP's number and name of the model, size and parameters.
#[derive(Clone, Debug)]
pub struct Camera {
    pub id: u32,
    pub model: (i32, &'static str),
    pub size: (u32, u32),
    pub params: Vec<f64>,
}

/// An image with keypoints (x, y, index of the point or -1).
#[derive(Clone, Debug)]
pub struct Image {
    pub id: u32,
    pub camera_id: u32,
    pub name: String,
    pub camera_from_world: (DQuat, DVec3),
    pub keypoints: Vec<(f64, f64, i64)>,
}

/// A capture.
#[derive(Clone, Debug)]
pub struct Scene {
    pub cameras: Vec<Camera>,
    pub images: Vec<Image>,
    pub points: Vec<([f64; 3], [u8; 3])>,
}

impl Scene {
    /// `count` cameras on a ring around the origin that look at it, one PINHOLE camera of 12 x 8 pixels.
    pub fn ring(count: u32) -> Self {
        let points: Vec<([f64; 3], [u8; 3])> = (0..20)
            .map(|i| {
                let a = f64::from(i);
                ([0.5 * a.sin(), 0.5 * (2.0 * a).cos(), 0.4 * (3.0 * a).sin()], [10 * i as u8, 100, 200])
            })
            .collect();
        let images = (0..count)
            .map(|i| {
                let angle = std::f64::consts::TAU * f64::from(i) / f64::from(count);
                let centre = DVec3::new(3.0 * angle.cos(), 0.3 * f64::from(i % 3), 3.0 * angle.sin());
                let z = -centre.normalize();
                let x = DVec3::Y.cross(z).normalize();
                let rotation = DMat3::from_cols(x, z.cross(x), z).transpose();
                let keypoints = (0..points.len() as i64)
                    .flat_map(|p| [(1.5 + p as f64, 2.25, p), (3.0, 4.0, -1)])
                    .collect();
                Image {
                    id: i + 1,
                    camera_id: 7,
                    name: format!("p{:02}.png", count - i),
                    camera_from_world: (DQuat::from_mat3(&rotation), -(rotation * centre)),
                    keypoints,
                }
            })
            .collect();
        Self {
            cameras: vec![Camera {
                id: 7,
                model: (1, "PINHOLE"),
                size: (12, 8),
                params: vec![10.0, 11.0, 6.25, 3.75],
            }],
            images,
            points,
        }
    }

    /// Writes a photo of `size` for every image.
    pub fn write_photos(&self, folder: &Path, size: (u32, u32)) {
        std::fs::create_dir_all(folder).unwrap();
        for (index, image) in self.images.iter().enumerate() {
            let photo = image::RgbImage::from_fn(size.0, size.1, |x, y| {
                image::Rgb([(20 * x) as u8, (30 * y) as u8, index as u8])
            });
            photo.save(folder.join(&image.name)).unwrap();
        }
    }

    /// A whole capture: `sparse/0` in binary and `images`.
    pub fn write(&self, root: &Path) {
        self.write_binary(&root.join("sparse/0"));
        self.write_photos(&root.join("images"), self.cameras[0].size);
    }

    pub fn cameras_bin(&self) -> Vec<u8> {
        let mut out = (self.cameras.len() as u64).to_le_bytes().to_vec();
        for c in &self.cameras {
            out.extend(c.id.to_le_bytes());
            out.extend(c.model.0.to_le_bytes());
            out.extend(u64::from(c.size.0).to_le_bytes());
            out.extend(u64::from(c.size.1).to_le_bytes());
            c.params.iter().for_each(|p| out.extend(p.to_le_bytes()));
        }
        out
    }

    pub fn images_bin(&self) -> Vec<u8> {
        let mut out = (self.images.len() as u64).to_le_bytes().to_vec();
        for i in &self.images {
            let (q, t) = i.camera_from_world;
            out.extend(i.id.to_le_bytes());
            for v in [q.w, q.x, q.y, q.z, t.x, t.y, t.z] {
                out.extend(v.to_le_bytes());
            }
            out.extend(i.camera_id.to_le_bytes());
            out.extend(i.name.as_bytes());
            out.push(0);
            out.extend((i.keypoints.len() as u64).to_le_bytes());
            for &(x, y, point) in &i.keypoints {
                out.extend(x.to_le_bytes());
                out.extend(y.to_le_bytes());
                out.extend(if point < 0 { u64::MAX } else { 100 + point as u64 }.to_le_bytes());
            }
        }
        out
    }

    pub fn points_bin(&self) -> Vec<u8> {
        let mut out = (self.points.len() as u64).to_le_bytes().to_vec();
        for (index, (position, rgb)) in self.points.iter().enumerate() {
            out.extend((100 + index as u64).to_le_bytes());
            position.iter().for_each(|v| out.extend(v.to_le_bytes()));
            out.extend(rgb);
            out.extend(0.5_f64.to_le_bytes());
            out.extend(2_u64.to_le_bytes());
            for v in [1_u32, 0, 2, 0] {
                out.extend(v.to_le_bytes());
            }
        }
        out
    }

    /// The three binary files.
    pub fn write_binary(&self, folder: &Path) {
        std::fs::create_dir_all(folder).unwrap();
        std::fs::write(folder.join("cameras.bin"), self.cameras_bin()).unwrap();
        std::fs::write(folder.join("images.bin"), self.images_bin()).unwrap();
        std::fs::write(folder.join("points3D.bin"), self.points_bin()).unwrap();
    }

    /// The three text files, with comments; images without keypoints get a blank second line.
    pub fn write_text(&self, folder: &Path) {
        std::fs::create_dir_all(folder).unwrap();
        let mut cameras = "# Camera list\n\n".to_owned();
        for c in &self.cameras {
            write!(cameras, "{} {} {} {}", c.id, c.model.1, c.size.0, c.size.1).unwrap();
            c.params.iter().for_each(|p| write!(cameras, " {p:?}").unwrap());
            cameras.push('\n');
        }
        let mut images = "# Image list\n# two lines each\n".to_owned();
        for i in &self.images {
            let (q, t) = i.camera_from_world;
            write!(images, "{}", i.id).unwrap();
            for v in [q.w, q.x, q.y, q.z, t.x, t.y, t.z] {
                write!(images, " {v:?}").unwrap();
            }
            writeln!(images, " {} {}", i.camera_id, i.name).unwrap();
            let keypoints: Vec<String> = i
                .keypoints
                .iter()
                .map(|&(x, y, p)| format!("{x:?} {y:?} {}", if p < 0 { -1 } else { 100 + p }))
                .collect();
            images.push_str(&keypoints.join(" "));
            images.push('\n');
        }
        let mut points = "# 3D point list\n".to_owned();
        for (index, ([x, y, z], [r, g, b])) in self.points.iter().enumerate() {
            writeln!(points, "{} {x:?} {y:?} {z:?} {r} {g} {b} 0.5 1 0 2 0", 100 + index).unwrap();
        }
        std::fs::write(folder.join("cameras.txt"), cameras).unwrap();
        std::fs::write(folder.join("images.txt"), images).unwrap();
        std::fs::write(folder.join("points3D.txt"), points).unwrap();
    }

    /// `transforms.json` as a JSON value: OpenGL camera-to-world, intrinsics for the whole file.
    pub fn transforms(&self, photo_folder: &str) -> serde_json::Value {
        let c = &self.cameras[0];
        let frames: Vec<serde_json::Value> = self
            .images
            .iter()
            .map(|i| {
                let rotation = DMat3::from_quat(i.camera_from_world.0).transpose();
                let centre = -(rotation * i.camera_from_world.1);
                let (x, y, z) = (rotation.x_axis, -rotation.y_axis, -rotation.z_axis);
                serde_json::json!({
                    "file_path": format!("{photo_folder}{}", i.name),
                    "transform_matrix": [
                        [x.x, y.x, z.x, centre.x],
                        [x.y, y.y, z.y, centre.y],
                        [x.z, y.z, z.z, centre.z],
                        [0.0, 0.0, 0.0, 1.0]
                    ]
                })
            })
            .collect();
        serde_json::json!({
            "fl_x": c.params[0], "fl_y": c.params[1], "cx": c.params[2], "cy": c.params[3],
            "w": c.size.0, "h": c.size.1, "frames": frames
        })
    }
}

/// Writes a JSON file.
pub fn write_json(path: PathBuf, value: &serde_json::Value) {
    std::fs::write(path, value.to_string()).unwrap();
}
