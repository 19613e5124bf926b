//! Options that say how a capture is read; shared by `train` and `inspect`.

use super::capture::{CaptureFormat, LoadOptions};
use super::values::parse_bytes;
use std::path::PathBuf;

/// Smallest bound of the images' longer side that makes sense: SSIM's window is 11 pixels wide.
pub const MAX_RESOLUTION_MIN: u32 = 16;

/// Flags of the capture; what is not given stays as the configuration file or the default says.
#[derive(clap::Args, Clone, Debug, Default)]
#[command(next_help_heading = "Capture")]
pub struct CaptureArgs {
    /// Bound of the images' longer side in pixels; larger ones are averaged down by area [default: 1600]
    #[arg(long, value_name = "PX", value_parser = clap::value_parser!(u32).range(i64::from(MAX_RESOLUTION_MIN)..=65_536))]
    pub max_resolution: Option<u32>,
    /// Folder of the images, for example images_4 [default: images]
    #[arg(long, value_name = "DIR")]
    pub images: Option<PathBuf>,
    /// Folder of the masks, white keeps [default: masks, where it exists]
    #[arg(long, value_name = "DIR")]
    pub masks: Option<PathBuf>,
    /// Black keeps instead of white
    #[arg(long)]
    pub mask_invert: bool,
    /// Kind of pose file [default: a sparse model wins over transforms.json, that over CSV]
    #[arg(long, value_name = "FORMAT")]
    pub format: Option<FormatArg>,
    /// Hold out each N-th view in the order of names, 0: none; files that state a split win [default: 8]
    #[arg(long, value_name = "N")]
    pub test_every: Option<usize>,
    /// File with the names of the views to hold out, one a line; wins over everything
    #[arg(long, value_name = "FILE")]
    pub test_list: Option<PathBuf>,
    /// Memory for decoded images [default: 4GiB]
    #[arg(long, value_name = "SIZE", value_parser = parse_bytes)]
    pub image_cache: Option<u64>,
}

/// Kind of pose file, as typed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum FormatArg {
    /// Choose by what is there
    Auto,
    /// COLMAP's sparse model, binary or text
    Colmap,
    /// transforms.json of nerfstudio, instant-ngp and Blender scenes
    Transforms,
    /// CSV export of RealityCapture / RealityScan
    RealityCapture,
}

impl CaptureArgs {
    /// Writes what was given over `options`.
    pub fn apply(&self, options: &mut LoadOptions) {
        set(&mut options.max_resolution, self.max_resolution);
        set(&mut options.test_every, self.test_every);
        set(&mut options.image_cache_bytes, self.image_cache);
        set_some(&mut options.images, &self.images);
        set_some(&mut options.masks, &self.masks);
        set_some(&mut options.test_list, &self.test_list);
        options.mask_invert |= self.mask_invert;
        match self.format {
            Some(FormatArg::Auto) => options.format = None,
            Some(FormatArg::Colmap) => options.format = Some(CaptureFormat::Colmap),
            Some(FormatArg::Transforms) => options.format = Some(CaptureFormat::Transforms),
            Some(FormatArg::RealityCapture) => options.format = Some(CaptureFormat::RealityCapture),
            None => {}
        }
    }
}

/// Overwrites a setting if a value was given.
pub fn set<T>(setting: &mut T, given: Option<T>) {
    if let Some(value) = given {
        *setting = value;
    }
}

/// Overwrites an optional setting if a value was given.
pub fn set_some<T: Clone>(setting: &mut Option<T>, given: &Option<T>) {
    if given.is_some() {
        setting.clone_from(given);
    }
}
