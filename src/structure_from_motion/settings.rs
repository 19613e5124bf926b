//! What the user may choose.

use std::path::PathBuf;

/// How much is spent on the poses.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum PoseQuality {
    /// 1,200 px and 3,000 features. Measured: registers all 50 photos of a phone in a third of the time of `Full`.
    #[default]
    Fast,
    /// COLMAP's own defaults: 3,200 px and 8,192 features.
    Full,
}

impl PoseQuality {
    /// The longer side of the photos in which features are looked for, pixels.
    pub(super) const fn side_max_px(self) -> u32 {
        match self {
            Self::Fast => 1200,
            Self::Full => 3200,
        }
    }

    /// Features of a photo at most.
    pub(super) const fn features_max(self) -> u32 {
        match self {
            Self::Fast => 3000,
            Self::Full => 8192,
        }
    }
}

/// Settings of a capture.
#[derive(Clone, Debug, Default)]
pub struct Settings {
    /// What is spent on the poses.
    pub quality: PoseQuality,
    /// Frames to take of a video; by its duration if `None`.
    pub frames: Option<usize>,
    /// The Python that has pycolmap; looked for if `None`.
    pub python: Option<PathBuf>,
    /// COLMAP, instead of pycolmap.
    pub colmap: Option<PathBuf>,
    /// Threads of the programs; one per core if `None`.
    pub threads: Option<u16>,
}
