//! The sample capture shifted, rotated and scaled, with its points and images reordered and its images renamed.

use glam::{DMat3, DQuat, DVec3};
use litetex_gs::camera::{Pinhole, RigidTransform};
use litetex_gs::sample::{SampleOptions, SparseImage, SparseModel, SparsePoint, write_sample};
use std::path::Path;

/// A change to the capture.
#[derive(Clone, Copy, Debug)]
pub struct Change {
    pub rotation: DMat3,
    pub scale: f64,
    pub shift: DVec3,
    /// Scales only the points; 1 for changes that must not matter.
    pub points_scale: f64,
    /// Reorders points and images in their files and renames the images; the test views stay the same.
    pub disorder: bool,
}

impl Change {
    pub const NONE: Self = Self {
        rotation: DMat3::IDENTITY,
        scale: 1.0,
        shift: DVec3::ZERO,
        points_scale: 1.0,
        disorder: false,
    };

    /// Position in the changed capture of a point of the original.
    pub fn place(&self, at: DVec3) -> DVec3 {
        self.scale * (self.rotation * at) + self.shift
    }

    /// Position in the original capture of a point of the changed one.
    pub fn origin(&self, at: DVec3) -> DVec3 {
        self.rotation.transpose() * (at - self.shift) / self.scale
    }

    pub const fn with_disorder(self, disorder: bool) -> Self {
        Self { disorder, ..self }
    }

    /// Whether all numbers stay bit-identical.
    fn is_in_place(&self) -> bool {
        (self.rotation, self.scale, self.shift) == (DMat3::IDENTITY, 1.0, DVec3::ZERO)
    }

    fn pose(&self, pose: &RigidTransform) -> RigidTransform {
        if self.is_in_place() {
            return *pose;
        }
        let rotation = pose.rotation * self.rotation.transpose();
        RigidTransform { rotation, translation: -(rotation * self.place(pose.origin_of_a_in_b())) }
    }
}

/// The sample capture on disk, and its sparse model.
pub struct Sample {
    dir: tempfile::TempDir,
    sparse: SparseModel,
}

/// Words of each line that is not a comment.
fn lines(path: &Path) -> Vec<Vec<String>> {
    let text = std::fs::read_to_string(path).unwrap();
    let words = |line: &str| line.split_whitespace().map(str::to_owned).collect();
    text.lines().filter(|line| !line.starts_with('#')).map(words).collect()
}

fn number<T: std::str::FromStr<Err: std::fmt::Debug>>(word: &str) -> T {
    word.parse().unwrap()
}

impl Sample {
    pub fn new(options: &SampleOptions) -> Self {
        let dir = tempfile::tempdir().unwrap();
        let options = SampleOptions { text: true, truth: false, ..options.clone() };
        write_sample(dir.path(), &options).unwrap();
        let sparse = dir.path().join("sparse/0");
        let floats = |words: &[String]| words.iter().map(|w| number(w)).collect::<Vec<f64>>();
        let images: Vec<Vec<String>> = lines(&sparse.join("images.txt"));
        let camera = floats(&lines(&sparse.join("cameras.txt"))[0][2..]);
        let [w, h, fx_px, fy_px, cx_px, cy_px] = camera[..] else { panic!("{camera:?}") };
        let pinhole = Pinhole { width_px: w as u32, height_px: h as u32, fx_px, fy_px, cx_px, cy_px };
        // Every second line has keypoints.
        let keypoints: Vec<&Vec<String>> = images.iter().skip(1).step_by(2).collect();
        let image = |words: &Vec<String>| {
            let p = floats(&words[1..8]);
            let rotation = DMat3::from_quat(DQuat::from_xyzw(p[1], p[2], p[3], p[0]));
            let translation = DVec3::new(p[4], p[5], p[6]);
            let camera_from_capture = RigidTransform { rotation, translation };
            SparseImage { name: words[9].clone(), camera_from_capture, pinhole: 0 }
        };
        let point = |words: &Vec<String>| SparsePoint {
            position: DVec3::from_slice(&floats(&words[1..4])),
            rgb: [4, 5, 6].map(|i| number(&words[i])),
            error_px: number(&words[7]),
            observations: words[8..]
                .chunks_exact(2)
                .map(|track| {
                    let (image, keypoint): (usize, usize) = (number(&track[0]), number(&track[1]));
                    let at = floats(&keypoints[image - 1][3 * keypoint..3 * keypoint + 2]);
                    (image - 1, glam::DVec2::new(at[0], at[1]))
                })
                .collect(),
        };
        let points = lines(&sparse.join("points3D.txt")).iter().map(point).collect();
        let images = images.iter().step_by(2).map(image).collect();
        Self { sparse: SparseModel { pinholes: vec![pinhole], images, points }, dir }
    }

    /// Writes the changed capture to a new folder.
    pub fn changed(&self, name: &str, change: &Change) -> std::path::PathBuf {
        let folder = self.dir.path().join(name);
        for sub in ["images", "sparse/0"] {
            std::fs::create_dir_all(folder.join(sub)).unwrap();
        }
        let count = self.sparse.images.len();
        // Every eighth image is a test view: these change places only among themselves.
        let new_place = |i: usize| match change.disorder {
            false => i,
            true if i.is_multiple_of(8) => (i + 8) % count.next_multiple_of(8),
            true => (1..count).rev().filter(|i| !i.is_multiple_of(8)).nth(i - 1 - i / 8).unwrap(),
        };
        let mut images = self.sparse.images.clone();
        for (i, image) in self.sparse.images.iter().enumerate() {
            let to = new_place(i);
            let name = if change.disorder { format!("other/{to:03}.png") } else { image.name.clone() };
            let file = folder.join("images").join(&name);
            std::fs::create_dir_all(file.parent().unwrap()).unwrap();
            std::fs::copy(self.dir.path().join("images").join(&image.name), file).unwrap();
            images[to] = SparseImage {
                name,
                camera_from_capture: change.pose(&image.camera_from_capture),
                pinhole: 0,
            };
        }
        let mut points = self.sparse.points.clone();
        for point in &mut points {
            point.position = change.place(change.points_scale * point.position);
            point.observations.iter_mut().for_each(|(image, _)| *image = new_place(*image));
        }
        if change.disorder {
            points.reverse();
            let third = points.len() / 3;
            points.rotate_left(third);
        }
        let sparse = SparseModel { pinholes: self.sparse.pinholes.clone(), images, points };
        sparse.write_binary(&folder.join("sparse/0")).unwrap();
        folder
    }
}
