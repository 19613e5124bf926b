//! Makes captures of videos and of photos without poses: chooses sharp frames, converts photos, and lets other programs
//! (ffmpeg, pycolmap or COLMAP, heif-convert or ImageMagick) do what they do best. Nothing here prints; an [`Observer`]
//! hears how far it is.
//!
//! Each step leaves a marker in a work folder within the capture, so that a run that was killed goes on where it was. The
//! folders `images` and `sparse/0` appear only when they are complete.

mod by_hand;
mod camera;
mod child;
mod engine;
mod estimate;
mod exif;
mod frames;
mod heif;
mod input;
mod install;
mod pairs;
mod photos;
mod run;
mod settings;
mod tools;
mod video;
mod work_folder;

pub use child::Observer;
pub use run::{Made, Plan, VideoFrames};
pub use settings::{PoseQuality, Settings};
