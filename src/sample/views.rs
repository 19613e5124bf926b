//! The views of a sample capture: where photos are taken, what their sparse model says, and what is wrong with them.

use super::options::SampleOptions;
use super::poses::{arc, at_distance, behind_centre, cap, from_centre_and_rotation, video};
use super::random::{Stream, normal_vector, stream, uniform};
use super::stress::StressKind as Kind;
use crate::camera::{Pinhole, RigidTransform};
use glam::{DMat3, DQuat, DVec3};

/// Of this many views, one is a test view.
const TEST_EVERY: usize = 8;

/// Of this many training views, the figure walks through one.
const WALKER_EVERY: usize = 5;

/// Sides of cropped photos, relative to the whole, in turn.
const CROPS: [[f64; 2]; 4] = [[1.0, 1.0], [0.68, 1.0], [1.0, 0.66], [0.171, 0.328]];

/// A view.
#[derive(Clone, Debug)]
pub struct View {
    /// File name of the photo.
    pub name: String,
    /// Where the photo is taken.
    pub camera_from_capture: RigidTransform,
    /// Where the sparse model says that it is taken, in the frame of the capture.
    pub written: RigidTransform,
    /// Intrinsics of the photo that is rendered.
    pub pinhole: Pinhole,
    /// Size of the file and the corner of the photo in it, if it is padded and masked.
    pub padded: Option<([u32; 2], [u32; 2])>,
    pub is_test: bool,
    /// Factors of the channels, linear light.
    pub gain: DVec3,
    /// Standard deviation of the noise, of 255.
    pub noise: f64,
    /// Where the figure stands on the floor, if it is in the photo.
    pub walker: Option<DVec3>,
}

impl View {
    /// A plain view.
    pub fn new(name: String, pose: RigidTransform, pinhole: Pinhole, is_test: bool) -> Self {
        Self {
            name,
            camera_from_capture: pose,
            written: pose,
            pinhole,
            padded: None,
            is_test,
            gain: DVec3::ONE,
            noise: 0.0,
            walker: None,
        }
    }

    /// Intrinsics of the file.
    pub fn file_pinhole(&self) -> Pinhole {
        let Some(([width_px, height_px], [left, top])) = self.padded else { return self.pinhole };
        let p = self.pinhole;
        Pinhole {
            width_px,
            height_px,
            cx_px: p.cx_px + f64::from(left),
            cy_px: p.cy_px + f64::from(top),
            ..p
        }
    }
}

/// The views, training views first.
pub fn views(options: &SampleOptions, pinhole: &Pinhole) -> Vec<View> {
    if options.scene.is_some() {
        return on_cap(options.views, pinhole);
    }
    let poses = arc(options, options.views);
    let Some(stress) = options.stress else {
        let name = |view: usize| format!("view_{view:04}.png");
        return poses
            .iter()
            .enumerate()
            .map(|(i, pose)| View::new(name(i), *pose, *pinhole, false))
            .collect();
    };
    let ends = poses.len().div_ceil(TEST_EVERY);
    let (mut train, mut test) = (Vec::new(), Vec::new());
    for (i, pose) in poses.iter().enumerate() {
        let is_test = match stress.kind {
            // At both ends of the arc.
            Kind::Sky => i < ends / 2 || i + ends.div_ceil(2) >= poses.len(),
            _ => i % TEST_EVERY == 0,
        };
        if is_test { test.push(*pose) } else { train.push(*pose) }
    }
    let mut test_pinhole = *pinhole;
    match stress.kind {
        Kind::Views => train = arc(options, stress.level as usize),
        Kind::Cards => test = video(stress.level as usize),
        Kind::Distance => {
            test.iter_mut().for_each(|pose| *pose = at_distance(pose, stress.level));
            if stress.level > 1.0 {
                test_pinhole = around_centre(pinhole, 1.0 / stress.level);
            }
        }
        Kind::Resolution => {
            let side = |px: u32| (f64::from(px) * stress.level).round().max(1.0) as u32;
            test_pinhole = pinhole.resized(side(pinhole.width_px), side(pinhole.height_px));
        }
        _ => {}
    }
    let mut views = numbered("train", train, *pinhole);
    spoil(&mut views, options);
    views.extend(numbered("test", test, test_pinhole));
    views
}

/// The views of a scene other than the still life.
fn on_cap(count: usize, pinhole: &Pinhole) -> Vec<View> {
    let (mut train, mut test) = (Vec::new(), Vec::new());
    for (i, pose) in cap(count).into_iter().enumerate() {
        // Not the first, which looks from the middle.
        if i % TEST_EVERY == TEST_EVERY / 2 { test.push(pose) } else { train.push(pose) }
    }
    let mut views = numbered("train", train, *pinhole);
    views.extend(numbered("test", test, *pinhole));
    views
}

/// Views called `train_0000.png` or `test_0000.png` and so on.
fn numbered(kind: &str, poses: Vec<RigidTransform>, pinhole: Pinhole) -> Vec<View> {
    let is_test = kind == "test";
    let view = |(i, pose)| View::new(format!("{kind}_{i:04}.png"), pose, pinhole, is_test);
    poses.into_iter().enumerate().map(view).collect()
}

/// The middle of the image, at the same resolution.
fn around_centre(pinhole: &Pinhole, share: f64) -> Pinhole {
    let side = |px: u32| ((f64::from(px) * share).round().max(1.0)) as u32;
    window(pinhole, [side(pinhole.width_px), side(pinhole.height_px)], [0.5, 0.5]).0
}

/// A window of an image, and its corner; `at` places it, 0 to 1 along each axis.
fn window(pinhole: &Pinhole, size: [u32; 2], at: [f64; 2]) -> (Pinhole, [u32; 2]) {
    let free = [pinhole.width_px - size[0], pinhole.height_px - size[1]];
    let corner = [0, 1].map(|axis| (f64::from(free[axis]) * at[axis]).round() as u32);
    let cropped = Pinhole {
        width_px: size[0],
        height_px: size[1],
        cx_px: pinhole.cx_px - f64::from(corner[0]),
        cy_px: pinhole.cy_px - f64::from(corner[1]),
        ..*pinhole
    };
    (cropped, corner)
}

/// Does to the training views what the stress says.
fn spoil(views: &mut [View], options: &SampleOptions) {
    let Some(stress) = options.stress else { return };
    let (level, count) = (stress.level, views.len());
    let mut rng = stream(options.seed, Stream::Photos, 0);
    let mut spread = |amplitude: f64| amplitude * (2.0 * uniform(&mut rng) - 1.0);
    let mut directions = stream(options.seed, Stream::Photos, 1);
    let wrong = (level * count as f64).ceil() as usize;
    for (i, view) in views.iter_mut().enumerate() {
        let whole = view.pinhole;
        let size = [whole.width_px, whole.height_px];
        match stress.kind {
            Kind::Noise => view.noise = level,
            Kind::Exposure => {
                let exposure = spread(level).exp2();
                view.gain = exposure * DVec3::new(1.0 + spread(0.05), 1.0, 1.0 + spread(0.05));
            }
            Kind::PoseNoise => {
                let radians = level.to_radians() / 3_f64.sqrt();
                view.written = turned(&view.written, radians * normal_vector(&mut directions));
            }
            Kind::WrongPoses if (0..wrong).any(|k| (2 * k + 1) * count / (2 * wrong) == i) => {
                let off = turned(&view.written, DVec3::new(0.0, 8_f64.to_radians(), 0.0));
                let centre = off.origin_of_a_in_b() + DVec3::new(0.15, 0.0, 0.0);
                view.written = from_centre_and_rotation(centre, off.rotation);
            }
            Kind::Walker if i % WALKER_EVERY == 2 => {
                let along = i as f64 / (count - 1).max(1) as f64 * 2.0 - 1.0;
                view.walker = Some(behind_centre(&view.camera_from_capture, 0.4 * along));
            }
            Kind::Sizes | Kind::SizesPadded => {
                let share = CROPS[i % CROPS.len()];
                let side = |axis: usize| (f64::from(size[axis]) * share[axis]).round().max(1.0) as u32;
                let (cropped, corner) = window(&whole, [side(0), side(1)], [0.4, 0.6]);
                view.pinhole = cropped;
                view.padded = (stress.kind == Kind::SizesPadded).then_some((size, corner));
            }
            Kind::OffCentre | Kind::OffCentrePadded => {
                // The principal point is in the centre of the canvas; the photo is its right or left part.
                let shift = (2.0 * level * f64::from(size[0])).round();
                let right = i % 2 == 0;
                let cx_px = whole.cx_px - if right { 0.5 } else { -0.5 } * shift;
                view.pinhole = Pinhole { cx_px, ..whole };
                let left = if right { shift as u32 } else { 0 };
                view.padded = (stress.kind == Kind::OffCentrePadded)
                    .then_some(([size[0] + shift as u32, size[1]], [left, 0]));
            }
            Kind::Anisotropic => {
                let width = (f64::from(size[0]) * level).round().max(1.0) as u32;
                view.pinhole = whole.resized(width, size[1]);
            }
            _ => {}
        }
    }
}

/// The pose with the camera rotated about its centre by a rotation vector.
fn turned(pose: &RigidTransform, rotation: DVec3) -> RigidTransform {
    let turn = DMat3::from_quat(DQuat::from_scaled_axis(rotation));
    from_centre_and_rotation(pose.origin_of_a_in_b(), turn * pose.rotation)
}
