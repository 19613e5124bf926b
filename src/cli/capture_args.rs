//! Options for reading a capture; shared by `train`, `inspect` and `schedule`.

use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use litetex_gs::capture::{CaptureFormat, ExifTurn, LoadOptions, UndistortFocal};
use litetex_gs::console::values::{parse_bytes, parse_whole, whole};
use litetex_gs::run::MAX_RESOLUTION_MIN;
use std::path::PathBuf;

/// Flags of the capture; what is not given stays as the configuration file or the default says.
#[derive(clap::Args, Clone, Debug, Default)]
#[command(next_help_heading = "Capture")]
pub struct CaptureArgs {
    /// Maximum length of the images' longer side, in pixels; larger images are reduced by area averaging [default: 1600]
    #[arg(long, value_name = "PX", value_parser = whole::<u32>(u64::from(MAX_RESOLUTION_MIN)..=65_536))]
    pub max_resolution: Option<u32>,
    /// Folder of the images, for example images_4 [default: images]
    #[arg(long, value_name = "DIR")]
    pub images: Option<PathBuf>,
    /// Hold out every Nth view in name order; 0 holds out none. A split stated in the capture's files takes precedence [default: 8]
    #[arg(long, value_name = "N", value_parser = parse_whole::<usize>)]
    pub test_every: Option<usize>,
    /// File listing the views to hold out, one name per line; takes precedence over everything else
    #[arg(long, value_name = "FILE")]
    pub test_list: Option<PathBuf>,
}

/// Flags of the capture that `train` has not: there, `--set` reaches them.
#[derive(clap::Args, Clone, Debug, Default)]
#[command(next_help_heading = "Capture")]
pub struct WholeCaptureArgs {
    #[command(flatten)]
    usual: CaptureArgs,
    /// Folder of the masks; white pixels count [default: masks, if it exists]
    #[arg(long, value_name = "DIR")]
    pub masks: Option<PathBuf>,
    /// Invert the masks: black pixels count
    #[arg(long)]
    pub mask_invert: bool,
    /// Keep cameras and points that are more than 20 median distances from the median
    #[arg(long)]
    pub keep_far: bool,
    /// Pose format [default: the first of these that is found]
    #[arg(long, value_name = "FORMAT", value_parser = format_parser())]
    pub format: Option<CaptureFormat>,
    /// Orientation in the photos' EXIF data: auto (turn photos whose sides fit their cameras only then), ignore or apply [default: auto]
    #[arg(long, value_name = "HOW", value_parser = exif_parser())]
    pub exif: Option<ExifTurn>,
    /// Focal length of the pinhole images that photos are undistorted to: lens, or auto (shorter where that keeps more of the photo) [default: lens]
    #[arg(long, value_name = "HOW", value_parser = undistort_focal_parser())]
    pub undistort_focal: Option<UndistortFocal>,
    /// Memory that decoding one photo may take [default: 3GiB]
    #[arg(long, value_name = "SIZE", value_parser = parse_bytes)]
    pub photo_memory: Option<u64>,
    /// Memory for decoded images [default: 4GiB]
    #[arg(long, value_name = "SIZE", value_parser = parse_bytes)]
    pub image_cache: Option<u64>,
}

/// The names of the table, with their help.
fn format_parser() -> impl TypedValueParser<Value = CaptureFormat> {
    let formats = CaptureFormat::all().map(|f| PossibleValue::new(f.name()).help(f.help()));
    PossibleValuesParser::new(formats).try_map(|name| name.parse::<CaptureFormat>())
}

fn exif_parser() -> impl TypedValueParser<Value = ExifTurn> {
    PossibleValuesParser::new(["auto", "ignore", "apply"]).map(|name| match name.as_str() {
        "ignore" => ExifTurn::Ignore,
        "apply" => ExifTurn::Apply,
        _ => ExifTurn::Auto,
    })
}

fn undistort_focal_parser() -> impl TypedValueParser<Value = UndistortFocal> {
    PossibleValuesParser::new(["lens", "auto"]).map(|name| match name.as_str() {
        "auto" => UndistortFocal::Auto,
        _ => UndistortFocal::Lens,
    })
}

impl CaptureArgs {
    /// Writes what was given over `options`.
    pub fn apply(&self, options: &mut LoadOptions) {
        set(&mut options.max_resolution, self.max_resolution);
        set(&mut options.test_every, self.test_every);
        set_some(&mut options.images, &self.images);
        set_some(&mut options.test_list, &self.test_list);
    }
}

impl WholeCaptureArgs {
    /// Writes what was given over `options`.
    pub fn apply(&self, options: &mut LoadOptions) {
        self.usual.apply(options);
        set_some(&mut options.masks, &self.masks);
        set(&mut options.image_cache_bytes, self.image_cache);
        set(&mut options.exif, self.exif);
        set(&mut options.undistort_focal, self.undistort_focal);
        set(&mut options.photo_memory_bytes, self.photo_memory);
        options.mask_invert |= self.mask_invert;
        options.keep_far |= self.keep_far;
        set_some(&mut options.format, &self.format);
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
