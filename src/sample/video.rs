//! A video of the still life, as a person takes it with a phone: once around, back to where it began, with motion blur on two
//! of three frames. The poses of all frames stand beside it.

use super::avi::AviWriter;
use super::capture::pinhole_of;
use super::options::SampleOptions;
use super::poses::{closed_path, from_centre_and_rotation};
use super::random::{Stream, normal_vector, stream};
use super::render;
use super::scene::Scene;
use super::views::View;
use crate::camera::RigidTransform;
use crate::{Error, Result, atomic_file};
use glam::{DMat3, DQuat, DVec3};
use serde_json::json;
use std::path::Path;

/// Frames a second.
const RATE_HZ: u32 = 30;

/// Turn of the camera while a blurred frame is exposed, degrees: 1 % of the longer side.
const SHAKE_DEG: f64 = 0.6;

/// Of this many frames, one is sharp.
const SHARP_EVERY: usize = 3;

/// Writes `video.avi` and `truth/poses.json`: for each frame its time, whether it is blurred, and where the camera is in the
/// middle of its exposure. Equal options give equal bytes.
///
/// # Errors
/// [`Error::Usage`] for options out of range, [`Error::Io`].
pub fn write_video(dir: &Path, options: &SampleOptions, frames: usize) -> Result<()> {
    options.check()?;
    if !(3..=10_000).contains(&frames) {
        return Err(usage!("sample: the number of frames must be 3 to 10000"));
    }
    if options.stress.is_some() || options.scene.is_some() {
        return Err(usage!("sample: a video shows the still life only, found a stress or a scene"));
    }
    let pinhole = pinhole_of(options);
    let scene = Scene::new(options, pinhole.fx_px);
    let truth = dir.join("truth");
    std::fs::create_dir_all(&truth).map_err(|e| Error::io(&truth, e))?;
    let mut video =
        AviWriter::create(&dir.join("video.avi"), (options.width_px, options.height_px), RATE_HZ)?;
    let mut rng = stream(options.seed, Stream::Photos, 0);
    let mut poses = Vec::new();
    for (frame, pose) in closed_path(frames).into_iter().enumerate() {
        let is_blurred = frame % SHARP_EVERY != 1;
        let axis = normal_vector(&mut rng).normalize_or(DVec3::X);
        let turn = if is_blurred { SHAKE_DEG.to_radians() } else { 0.0 };
        // A turn about the line of sight moves little.
        let axis = DVec3::new(axis.x, axis.y, 0.0).normalize_or(DVec3::X);
        let at = |share: f64| -> RigidTransform {
            let shaken =
                DMat3::from_quat(DQuat::from_scaled_axis((share - 0.5) * turn * axis)) * pose.rotation;
            from_centre_and_rotation(pose.origin_of_a_in_b(), shaken)
        };
        let view = View::new(String::new(), pose, pinhole, false);
        video.frame(&render::exposed(&scene, &view, options.supersampling, &at))?;
        poses.push(json!({
            "time_secs": frame as f64 / f64::from(RATE_HZ),
            "blurred": is_blurred,
            "camera_from_capture_rows": pose.rotation.transpose().to_cols_array_2d(),
            "translation": pose.translation.to_array(),
        }));
    }
    video.finish()?;
    let text = json!({
        "frame": "x right, y down, z away from the cameras; metres",
        "program_version": env!("CARGO_PKG_VERSION"),
        "pinhole": pinhole,
        "frames_per_sec": RATE_HZ,
        "frames": poses,
    });
    Ok(atomic_file::write(&truth.join("poses.json"), format!("{text:#}\n").as_bytes())?)
}
