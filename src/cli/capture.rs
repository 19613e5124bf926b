//! The only place of the application layer that touches the loader of captures: opening one and making
//! the model that training starts from.

use litetex_gs::model::{AdamState, Model};
use litetex_gs::train::{TrainConfig, TrainHistory, TrainState};
use litetex_gs::{Report, Result};
use serde::{Deserialize, Serialize};
use std::fmt;
use std::path::{Path, PathBuf};

pub use shim::{Capture, CaptureFormat, LoadOptions, initial_model};

/// Where primitives start.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub enum InitKind {
    /// The capture's points, or random ones where it has none.
    #[default]
    Auto,
    /// The capture's points.
    Sfm,
    /// Points or Gaussians of a PLY file.
    Ply(PathBuf),
    /// That many random points in the view frusta.
    Random(usize),
}

impl fmt::Display for InitKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Auto => f.write_str("auto"),
            Self::Sfm => f.write_str("sfm"),
            Self::Ply(path) => write!(f, "ply:{}", path.display()),
            Self::Random(n) => write!(f, "random:{n}"),
        }
    }
}

impl From<InitKind> for String {
    fn from(init: InitKind) -> Self {
        init.to_string()
    }
}

impl TryFrom<String> for InitKind {
    type Error = String;

    fn try_from(text: String) -> Result<Self, String> {
        super::capture_args::parse_init(&text)
    }
}

/// Opens a capture; nothing is decoded yet.
///
/// # Errors
/// What the loader found.
pub fn open(path: &Path, options: &LoadOptions) -> Result<Capture> {
    Capture::load(path, options)
}

/// The state before the first step.
///
/// # Errors
/// What reading the start found.
pub fn fresh_state(
    capture: &Capture,
    init: &InitKind,
    config: &TrainConfig,
    report: &mut Report,
) -> Result<TrainState> {
    let model: Model = initial_model(capture, init, config, report)?;
    Ok(TrainState {
        step: 0,
        adam: AdamState::zeros(&model),
        model,
        epoch_order: Vec::new(),
        epoch_used: 0,
        epochs: 0,
        history: TrainHistory::default(),
    })
}

/// Stands in for `litetex_gs::dataset` until that is there: the same names and fields, nothing behind.
mod shim {
    use super::InitKind;
    use litetex_gs::backend::TargetImage;
    use litetex_gs::camera::{Camera, Similarity};
    use litetex_gs::model::Model;
    use litetex_gs::train::TrainConfig;
    use litetex_gs::views::{Split, ViewSource};
    use litetex_gs::{Error, Report, Result};
    use serde::{Deserialize, Serialize};
    use std::path::{Path, PathBuf};
    use std::sync::Arc;

    /// Kind of pose file.
    #[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
    #[serde(rename_all = "kebab-case")]
    pub enum CaptureFormat {
        Colmap,
        Transforms,
    }

    impl std::fmt::Display for CaptureFormat {
        fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
            f.write_str(match self {
                Self::Colmap => "colmap",
                Self::Transforms => "transforms",
            })
        }
    }

    /// How a capture is read.
    #[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
    #[serde(deny_unknown_fields, default, rename_all = "kebab-case")]
    pub struct LoadOptions {
        pub format: Option<CaptureFormat>,
        pub images: Option<PathBuf>,
        pub masks: Option<PathBuf>,
        pub mask_invert: bool,
        pub max_resolution: u32,
        pub background: [f32; 3],
        pub test_every: usize,
        pub test_list: Option<PathBuf>,
        pub image_cache_bytes: u64,
    }

    impl Default for LoadOptions {
        fn default() -> Self {
            Self {
                format: None,
                images: None,
                masks: None,
                mask_invert: false,
                max_resolution: 1600,
                background: [0.0; 3],
                test_every: 8,
                test_list: None,
                image_cache_bytes: 4 << 30,
            }
        }
    }

    /// One posed photo.
    pub struct View {
        pub name: String,
        pub split: Split,
        pub camera: Camera,
    }

    /// A capture.
    pub struct Capture {
        pub name: String,
        pub root: PathBuf,
        pub format: CaptureFormat,
        pub views: Vec<View>,
        pub points: Vec<()>,
        pub capture_from_local: Similarity,
        pub near: f32,
        pub health: Option<()>,
        pub report: Report,
    }

    impl Capture {
        pub fn load(path: &Path, _: &LoadOptions) -> Result<Self> {
            if !path.exists() {
                let missing = std::io::Error::from(std::io::ErrorKind::NotFound);
                return Err(Error::io(path, missing));
            }
            Err(Error::unsupported(path, "captures cannot be read yet"))
        }
    }

    impl ViewSource for Capture {
        fn num_views(&self) -> usize {
            self.views.len()
        }

        fn name(&self, view: usize) -> &str {
            &self.views[view].name
        }

        fn split(&self, view: usize) -> Split {
            self.views[view].split
        }

        fn camera(&self, view: usize) -> Camera {
            self.views[view].camera
        }

        fn target(&self, _: usize) -> Result<Arc<TargetImage>> {
            Err(Error::Device("no pictures yet".to_owned()))
        }
    }

    pub fn initial_model(_: &Capture, _: &InitKind, _: &TrainConfig, _: &mut Report) -> Result<Model> {
        Err(Error::Device("no start yet".to_owned()))
    }
}
