//! Verifies that a file renders like the scene it was made from, and finds how coarsely a file may be quantised while it
//! still does: renders scenes and compares their images. Nothing here prints, writes files or chooses a device;
//! callers pass backends, get data and warnings back, and may stop the work through a callback.

mod around;
mod baked_scene;
mod closed_loop;
mod contribution;
mod difference;
mod file_rounder;
mod gradients;
mod identity;
mod limits;
mod rate_distortion;
mod renderer;
mod scaled_steps;
mod sensitivity;
mod sh_bits;
mod verdict;

pub use around::{VIEWS_AROUND, views_around};
pub use baked_scene::{BakedScene, bake_checkpoint};
pub use contribution::Contribution;
pub use difference::{Difference, EXPORT_VIEWS, PSNR_TEST, evenly_spread};
pub use file_rounder::{FileRounder, bytes_for_splats};
pub use identity::{
    CAMERAS_KEY, CaptureIdentity, IDENTITY_KEY, cameras_from_strings, cameras_json, metric_from_strings,
    store_metric, store_up, up_from_strings,
};
pub use limits::QualityLimits;
pub use rate_distortion::{Backends, PASSES_PER_EFFORT, RateGoal, Rounding, find_rounding};
pub use renderer::{GoOn, SceneRenderer, to_display};
pub use sh_bits::{find_sh_bits, sh_bits_views};
pub use verdict::{ExpectedImages, PhotoPsnr, ReadBack, Verdict, verify};
