//! Writes a sparse model in COLMAP's binary and text layouts (`cameras`, `images`, `points3D`).
//! `capture::formats` reads them.

use crate::Result;
use crate::atomic_file;
use crate::camera::{Pinhole, RigidTransform};
use glam::{DQuat, DVec2, DVec3};
use std::fmt::Write as _;
use std::path::Path;

/// COLMAP's model id of `PINHOLE`.
const MODEL_PINHOLE: i32 = 1;

/// A posed image. Its COLMAP id is its index + 1.
#[derive(Clone, Debug)]
pub struct SparseImage {
    /// File name, relative to the image folder.
    pub name: String,
    /// Pose of the camera.
    pub camera_from_capture: RigidTransform,
    /// Index of its intrinsics in [`SparseModel::pinholes`].
    pub pinhole: usize,
}

/// A sparse point. Its COLMAP id is its index + 1.
#[derive(Clone, Debug)]
pub struct SparsePoint {
    /// Position in the capture's frame.
    pub position: DVec3,
    /// Colour, display space.
    pub rgb: [u8; 3],
    /// Mean reprojection error over the observations.
    pub error_px: f64,
    /// Index of each image that observes the point, with the point's pixel position in it.
    pub observations: Vec<(usize, DVec2)>,
}

/// A sparse model.
#[derive(Clone, Debug)]
pub struct SparseModel {
    /// Intrinsics; their COLMAP ids are index + 1.
    pub pinholes: Vec<Pinhole>,
    /// Posed images, in COLMAP id order.
    pub images: Vec<SparseImage>,
    /// Sparse points, in COLMAP id order.
    pub points: Vec<SparsePoint>,
}

/// Observations in one image: pixel position and point index. Tracks refer to indices into this list.
type Keypoints = Vec<(DVec2, usize)>;

impl SparseModel {
    /// Keypoints of each image, and the track of each point as pairs of image and keypoint index.
    fn keypoints_and_tracks(&self) -> (Vec<Keypoints>, Vec<Vec<(usize, usize)>>) {
        let mut keypoints = vec![Keypoints::new(); self.images.len()];
        let tracks = self
            .points
            .iter()
            .enumerate()
            .map(|(point, p)| {
                let track = p.observations.iter().map(|&(image, at)| {
                    keypoints[image].push((at, point));
                    (image, keypoints[image].len() - 1)
                });
                track.collect()
            })
            .collect();
        (keypoints, tracks)
    }

    /// Writes `cameras.bin`, `images.bin` and `points3D.bin`.
    ///
    /// # Errors
    /// [`crate::Error::Io`].
    pub fn write_binary(&self, folder: &Path) -> Result<()> {
        let (keypoints, tracks) = self.keypoints_and_tracks();
        atomic_file::write(&folder.join("cameras.bin"), &self.cameras_bin())?;
        atomic_file::write(&folder.join("images.bin"), &self.images_bin(&keypoints))?;
        Ok(atomic_file::write(&folder.join("points3D.bin"), &self.points_bin(&tracks))?)
    }

    fn cameras_bin(&self) -> Vec<u8> {
        let mut out = Vec::new();
        out.extend((self.pinholes.len() as u64).to_le_bytes());
        for (index, p) in self.pinholes.iter().enumerate() {
            out.extend((index as i32 + 1).to_le_bytes());
            out.extend(MODEL_PINHOLE.to_le_bytes());
            out.extend(u64::from(p.width_px).to_le_bytes());
            out.extend(u64::from(p.height_px).to_le_bytes());
            extend_f64(&mut out, &[p.fx_px, p.fy_px, p.cx_px, p.cy_px]);
        }
        out
    }

    fn images_bin(&self, keypoints: &[Keypoints]) -> Vec<u8> {
        let mut out = Vec::new();
        out.extend((self.images.len() as u64).to_le_bytes());
        for (index, (image, keypoints)) in self.images.iter().zip(keypoints).enumerate() {
            out.extend((index as i32 + 1).to_le_bytes());
            extend_f64(&mut out, &pose_numbers(&image.camera_from_capture));
            out.extend((image.pinhole as i32 + 1).to_le_bytes());
            out.extend(image.name.as_bytes());
            out.push(0);
            out.extend((keypoints.len() as u64).to_le_bytes());
            for &(at, point) in keypoints {
                extend_f64(&mut out, &at.to_array());
                out.extend((point as i64 + 1).to_le_bytes());
            }
        }
        out
    }

    fn points_bin(&self, tracks: &[Vec<(usize, usize)>]) -> Vec<u8> {
        let mut out = Vec::new();
        out.extend((self.points.len() as u64).to_le_bytes());
        for (index, (point, track)) in self.points.iter().zip(tracks).enumerate() {
            out.extend((index as u64 + 1).to_le_bytes());
            extend_f64(&mut out, &point.position.to_array());
            out.extend(point.rgb);
            extend_f64(&mut out, &[point.error_px]);
            out.extend((track.len() as u64).to_le_bytes());
            for &(image, keypoint) in track {
                out.extend((image as i32 + 1).to_le_bytes());
                out.extend((keypoint as i32).to_le_bytes());
            }
        }
        out
    }

    /// Writes `cameras.txt`, `images.txt` and `points3D.txt`. Numbers read back exactly.
    ///
    /// # Errors
    /// [`crate::Error::Io`].
    pub fn write_text(&self, folder: &Path) -> Result<()> {
        let (keypoints, tracks) = self.keypoints_and_tracks();
        // Writing to a string cannot fail.
        let mut cameras = String::from("# CAMERA_ID, MODEL, WIDTH, HEIGHT, PARAMS[]\n");
        for (index, p) in self.pinholes.iter().enumerate() {
            let (size, focal) =
                (format!("{} {}", p.width_px, p.height_px), format!("{} {}", p.fx_px, p.fy_px));
            let _ = writeln!(cameras, "{} PINHOLE {size} {focal} {} {}", index + 1, p.cx_px, p.cy_px);
        }
        let mut images = String::from(
            "# IMAGE_ID, QW, QX, QY, QZ, TX, TY, TZ, CAMERA_ID, NAME\n# POINTS2D[] as (X, Y, POINT3D_ID)\n",
        );
        for (index, (image, keypoints)) in self.images.iter().zip(&keypoints).enumerate() {
            let pose = pose_numbers(&image.camera_from_capture).map(|v| v.to_string());
            let _ = writeln!(images, "{} {} {} {}", index + 1, pose.join(" "), image.pinhole + 1, image.name);
            let points2d = keypoints.iter().map(|(at, point)| format!("{} {} {}", at.x, at.y, point + 1));
            let _ = writeln!(images, "{}", points2d.collect::<Vec<_>>().join(" "));
        }
        let mut points =
            String::from("# POINT3D_ID, X, Y, Z, R, G, B, ERROR, TRACK[] as (IMAGE_ID, POINT2D_IDX)\n");
        for (index, (point, track)) in self.points.iter().zip(&tracks).enumerate() {
            let ([x, y, z], [r, g, b]) = (point.position.to_array(), point.rgb);
            let _ = write!(points, "{} {x} {y} {z} {r} {g} {b} {}", index + 1, point.error_px);
            for (image, keypoint) in track {
                let _ = write!(points, " {} {keypoint}", image + 1);
            }
            points.push('\n');
        }
        atomic_file::write(&folder.join("cameras.txt"), cameras.as_bytes())?;
        atomic_file::write(&folder.join("images.txt"), images.as_bytes())?;
        Ok(atomic_file::write(&folder.join("points3D.txt"), points.as_bytes())?)
    }
}

/// Quaternion wxyz (w >= 0) and translation of camera_from_capture.
fn pose_numbers(pose: &RigidTransform) -> [f64; 7] {
    let q = DQuat::from_mat3(&pose.rotation).normalize();
    let q = if q.w < 0.0 { -q } else { q };
    let t = pose.translation;
    [q.w, q.x, q.y, q.z, t.x, t.y, t.z]
}

fn extend_f64(out: &mut Vec<u8>, values: &[f64]) {
    out.extend(values.iter().flat_map(|v| v.to_le_bytes()));
}
